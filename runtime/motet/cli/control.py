"""``motet control``: a script run by a steered figure."""

from inspect import signature
from pathlib import Path
from typing import Any

import click

from motet.bundle.graph import SessionOptions
from motet.cli.options import bundle_option, clips_option, naming, noted, session_options, steered
from motet.cli.reading import Read, read_options
from motet.cli.writing import Output, out_option, say_written, write_options
from motet.errors import ControlError
from motet.formats import names_motion
from motet.generate.base import GenerateModel
from motet.models.control import ControlModel
from motet.models.load import load_as
from motet.steering.model import SteerModel
from motet.steering.scripts import parse_orders


@click.command()
@click.argument("script")
@out_option
@bundle_option("control")
@clips_option
@click.option("--start", help="Where to start: a gait or label, or a motion file to continue.")
@click.option("--seed", type=click.IntRange(0), help="Seed, for models with noise.  [default: 0]")
@click.option(
    "--variety",
    type=click.FloatRange(0, 1),
    help="For models that sample: 0 is always the same, 1 fully sampled.  [default: 0]",
)
@click.option(
    "--temperature",
    type=click.FloatRange(0.01, 100),
    help="Sampling temperature of models that sample; lower is more deterministic.  [default: the bundle's]",
)
@click.option("--loose-feet", "hold_feet", flag_value=False, default=None, help="Do not hold standing feet.")
@click.option(
    "--no-smooth", "smooth", flag_value=False, default=None, help="Show a trembling net's frames as they are."
)
@write_options
@session_options
@read_options
def control(
    script: str,
    out: Path,
    bundle: str,
    clips: Path | None,
    start: str | None,
    output: Output,
    session: SessionOptions,
    read: Read,
    **settings: Any,
) -> None:
    """Run SCRIPT, such as "walk 3s speed 1.4, turn left 90, run 4s, stop", and write the motion.

    Orders are separated by commas: a gait, "turn" or "stop", and in any order seconds ("3s"), a speed in m/s ("speed
    1.4"), a way ("backwards", "left", "right"), a turn in degrees ("turn left 90") and a style ("style limping").
    "act jump" does something once, "act 'wave'" as the bundle generate shows it.
    With --bundle tdbn: a label and seconds; a ramp "walk>run 5s"; a mix "walk*.3+run*.7 2s".
    """
    output.check(out)
    with noted():
        model = steered(ControlModel, bundle, clips, session)
    chosen = {name: value for name, value in settings.items() if value is not None}
    if unknown := chosen.keys() - signature(model.run).parameters.keys():
        raise ControlError(f"{model!r} has no setting {', '.join(map(repr, sorted(unknown)))}")
    captions = model.captions(script)
    with naming(start), noted():
        first = read(Path(start)) if start and (Path(start).suffix or names_motion(start)) else start
        if isinstance(model, SteerModel) and any(
            order.act and order.act not in model.takes for order in parse_orders(script, model.gaits)
        ):
            chosen["words"] = load_as(GenerateModel, "generate", session)
        motion = model.run(script, first, **chosen)
    motion = output.shaped(motion)
    output.save(out, motion, script, captions)
    output.finish()
    say_written(out, motion)
