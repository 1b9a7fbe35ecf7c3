"""``motet key``: clips of acts by key poses."""

from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path

import click

from motet.bundle.graph import SessionOptions
from motet.cli.options import seed_option, session_options
from motet.cli.reading import Read, read_options
from motet.cli.writing import Output, out_option, places, say_written, write_options
from motet.keyed import KeyedAct, ours
from motet.keyed import read as read_acts
from motet.models.load import load_as
from motet.motion.motion import Motion
from motet.steering.model import SteerModel

WALK_SPEED = 1.3
"""Metres a second of a person who walks below an act."""


@click.command()
@click.argument("acts", required=False, type=Path)
@out_option
@click.option("--act", "names", multiple=True, help="Only this act; may be given several times.  [default: all]")
@click.option(
    "--over",
    type=Path,
    metavar="MOTION",
    help="Motion below the acts.  [default: a person who stands or walks]",
)
@seed_option("Seed of times, sizes and counts.")
@write_options
@session_options
@read_options
def key(
    acts: Path | None,
    out: Path,
    names: tuple[str, ...],
    over: Path | None,
    seed: int,
    output: Output,
    session: SessionOptions,
    read: Read,
) -> None:
    """Make a clip of each act in the file ACTS (.toml), or of each act that ships.

    With {name} in OUT, such as "clips/{name}.bvh", each clip has the name of its act; else several are numbered.
    """
    chosen = _chosen(ours() if acts is None else read_acts(acts), names)
    outs = places(out, list(chosen), output=output)
    bases = _bases(chosen, seed, session) if over is None else dict.fromkeys(chosen, read(over))
    for (name, act), place in zip(chosen.items(), outs, strict=True):
        motion = output.write(place, act.motion(bases[name], seed), name)
        say_written(place, motion, f": {name}")
    output.finish()


def _chosen(acts: Mapping[str, KeyedAct], names: tuple[str, ...]) -> Mapping[str, KeyedAct]:
    if unknown := [name for name in names if name not in acts]:
        near = get_close_matches(unknown[0], acts, 3, cutoff=0.0)
        raise click.UsageError(f"there is no act {unknown[0]!r}; the nearest of {len(acts)} are {', '.join(near)}")
    return {name: acts[name] for name in names or acts}


def _bases(acts: Mapping[str, KeyedAct], seed: int, session: SessionOptions) -> dict[str, Motion]:
    """For each act a person who stands and breathes, or walks, a little longer than it."""
    model = load_as(SteerModel, "control", session)
    bases = {}
    for name, act in acts.items():
        order = f"walk speed {WALK_SPEED * act.pace:.2f}" if act.over == "walk" else "stop"
        bases[name] = model.run(f"{order} {act.seconds(seed) + 1:.1f}s")
    return bases
