"""``motet demo``: pages that show what the models do."""

from pathlib import Path

import click

from motet.live.demo import write_demo


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path), required=True, help="New folder to write.")
def demo(out: Path) -> None:
    """Write a folder of pages that show what the models do, for any browser, offline: open its index.html.

    \b
    motet demo -o demo
    """
    write_demo(out)
    size = sum(page.stat().st_size for page in out.iterdir())
    click.echo(f"{out / 'index.html'}: {size / 1e6:.1f} MB in all")
