"""``motet live``: a steered figure, as a page, by a server, or as messages for an avatar."""

from pathlib import Path
from typing import Any

import click

from motet.bundle.graph import SessionOptions
from motet.cli import missing
from motet.cli.options import bundle_option, clips_option, session_options, steered
from motet.files import check_place
from motet.generate.base import GenerateModel
from motet.live.page import write_live_page
from motet.models.load import load_as
from motet.steering.model import SteerModel


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Write a page that steers a figure in a browser.")
@click.option("--port", type=click.IntRange(0, 65535), help="Serve poses on this port (WebSocket, JSON); 0: any.")
@click.option("--osc", metavar="HOST:PORT", help="Send poses there (VMC protocol, OSC over UDP).")
@click.option("--script", help="Script for --osc without a server, repeated, such as 'walk 3s, run 4s'.")
@click.option(
    "--host", default="127.0.0.1", show_default=True, help="Address to serve on; 0.0.0.0 serves other machines."
)
@click.option(
    "--origin", "origins", multiple=True, help="Origin of a web page that may connect; may be given several times."
)
@click.option("--characters", type=click.IntRange(1), default=1, show_default=True, help="Initial number of figures.")
@bundle_option("control")
@clips_option
@session_options
def live(
    out: Path | None,
    port: int | None,
    osc: str | None,
    script: str | None,
    host: str,
    origins: tuple[str, ...],
    characters: int,
    bundle: str,
    clips: Path | None,
    session: SessionOptions,
) -> None:
    """Steer figures live: in a page (-o), by a server (--port), or onto an avatar (--osc).

    \b
    motet live -o live.html
    motet live --port 8765
    motet live --osc 127.0.0.1:39539 --script "walk 3s, run 4s"
    motet live --osc 127.0.0.1:39539 --port 8765
    """
    _check(out, port, osc, script)
    if out is not None:
        check_place(out)
        write_live_page(out, steered(SteerModel, bundle, clips, session), characters)
        click.echo(f"{out}: {out.stat().st_size / 1e6:.1f} MB")
        return
    if lacking := missing("live"):
        raise click.UsageError(f"this needs {', '.join(lacking)}: install the extra with  pip install 'motet[live]'")
    target = None if osc is None else _address(osc)
    model = steered(SteerModel, bundle, clips, session)
    if port is not None:
        words = load_as(GenerateModel, "generate", session).ready()
        _serve(model, target, host, port=port, characters=characters, origins=origins, words=words)
    elif target is not None and script is not None:
        _follow(model, target, script)


def _check(out: Path | None, port: int | None, osc: str | None, script: str | None) -> None:
    if out is None and port is None and osc is None:
        raise click.UsageError("say what to do: -o live.html, --port 8765 or --osc 127.0.0.1:39539")
    if out is not None and not (port is None and osc is None and script is None):
        raise click.UsageError("-o writes a page and does nothing else")
    if script is not None and (osc is None or port is not None):
        raise click.UsageError("--script is for --osc without --port")
    if osc is not None and port is None and script is None:
        raise click.UsageError("--osc needs --script, or --port for clients that steer")


def _address(place: str) -> tuple[str, int]:
    host, _, port = place.rpartition(":")
    if not host or not port.isdecimal() or not 1 <= int(port) <= 65535:
        raise click.BadParameter("expected an address and a port, such as 127.0.0.1:39539", param_hint="'--osc'")
    return host.strip("[]"), int(port)


def _follow(model: SteerModel, target: tuple[str, int], script: str) -> None:
    from motet.live.vmc import Sender, run_script

    sender = Sender(*target)
    click.echo(f"sending to {sender.place}; stop with Ctrl-C", err=True)
    try:
        run_script(model, script, sender.send)
    except KeyboardInterrupt:
        click.echo("stopped", err=True)


def _serve(model: SteerModel, target: tuple[str, int] | None, host: str, **settings: Any) -> None:
    from motet.live.server import LiveServer, run_server
    from motet.live.vmc import Sender

    watch = None if target is None else Sender(*target).send
    server = LiveServer(model, host, watch=watch, **settings)
    run_server(server, lambda: click.echo(f"listening on ws://{host}:{server.port}; stop with Ctrl-C", err=True))
    click.echo("stopped", err=True)
