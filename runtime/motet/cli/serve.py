"""``motet serve``: models over HTTP."""

import click

from motet.bundle.graph import SessionOptions
from motet.cli import missing
from motet.cli.options import session_options


@click.command()
@click.option("--port", type=click.IntRange(0, 65535), default=8000, show_default=True, help="Port; 0: any free one.")
@click.option(
    "--host", default="127.0.0.1", show_default=True, help="Address to serve on; 0.0.0.0 serves other machines."
)
@click.option(
    "--origin", "origins", multiple=True, help="Origin of a web page that may call (CORS); may be given several times."
)
@click.option(
    "--bundle", "bundles", multiple=True, help="Name or path of a bundle for its verb; may be given several times."
)
@click.option("--max-megabytes", type=click.IntRange(1, 4096), default=32, show_default=True, help="Of a request.")
@click.option(
    "--max-seconds", type=click.FloatRange(1, 3600), default=300, show_default=True, help="Of a motion, given or asked."
)
@click.option(
    "--timeout", type=click.FloatRange(0.1, 3600), default=60, show_default=True, help="Seconds until an answer."
)
@click.option(
    "--requests", type=click.IntRange(1, 10_000), default=256, show_default=True, help="Answered or waiting at once."
)
@click.option("--mmcp", is_flag=True, help="Speak the Motion Model Context Protocol, too, at /mmcp: for Blender.")
@session_options
def serve(
    port: int,
    host: str,
    origins: tuple[str, ...],
    bundles: tuple[str, ...],
    max_megabytes: int,
    max_seconds: float,
    timeout: float,
    requests: int,
    mmcp: bool,
    session: SessionOptions,
) -> None:
    """Serve models over HTTP: sentences to motions, motion files to sentences and to their continuations.

    \b
    motet serve
    curl "localhost:8000/generate.bvh?text=a+person+walks" -o walk.bvh
    curl -F file=@walk.bvh localhost:8000/describe
    """
    from motet.serve.application import app, run
    from motet.serve.limits import LOCAL_HOSTS, Limits

    if mmcp and (lacking := missing("mmcp")):
        raise click.UsageError(f"--mmcp needs {', '.join(lacking)}: install the extra with  pip install 'motet[mmcp]'")
    limits = Limits(body_bytes=max_megabytes << 20, motion_seconds=max_seconds, seconds=timeout, requests=requests)
    hosts = LOCAL_HOSTS if host in LOCAL_HOSTS else None
    application = app(bundles, origins=origins, hosts=hosts, limits=limits, session=session, mmcp=mmcp)
    shown = f"[{host}]" if ":" in host else host
    run(
        application,
        host,
        port,
        ready=lambda bound_port: click.echo(f"serving on http://{shown}:{bound_port}; stop with Ctrl-C", err=True),
    )
    click.echo("stopped", err=True)
