"""``motet compose``: motions from prompts, places and poses at given times."""

import json
from dataclasses import asdict
from pathlib import Path

import click

from motet.bundle.graph import SessionOptions
from motet.cli.generate import captions_of, confidence_of
from motet.cli.options import bundle_option, json_option, noted, seed_option, session_options
from motet.cli.writing import Output, out_option, say_written, write_options
from motet.composition.compose import compose as composition_of
from motet.composition.plans import parse_plan, read_plan
from motet.generate.model import CodesModel
from motet.models.load import load_as


@click.command()
@click.argument("plan", metavar="PLAN")
@out_option
@bundle_option("generate")
@seed_option("Seed of what is drawn.")
@click.option("--strict", is_flag=True, help="Fail on a prompt that the model knows only in part.")
@write_options
@session_options
@json_option("Print an object with the passages and what was met.")
def compose(
    plan: str,
    out: Path,
    bundle: str,
    seed: int,
    strict: bool,
    output: Output,
    as_json: bool,
    session: SessionOptions,
) -> None:
    """Write a motion for PLAN: prompts at their times, and where to be, which way to face and which pose to have when.

    PLAN is a JSON file, a list of moments such as {"at": 3, "place": [0, 3], "facing": 90, "text": "a person waves"},
    or a script: "0s a person walks; 3s at 0 3 facing 90 a person waves; 4.5s pose kick.bvh@1.2; 6s". Places are x and
    z in metres; the first moment is the start, the last one the end.
    """
    output.check(out)
    moments = read_plan(plan) if Path(plan).suffix.lower() == ".json" else parse_plan(plan)
    model = load_as(CodesModel, bundle, session)
    with noted():
        composed = composition_of(model, moments, seed=seed, strict=strict)
    label = " / ".join(passage.text for passage in composed.passages)
    motion = output.write(out, composed.motion, label, captions_of(composed.passages))
    output.finish()
    facts = {"output": str(out), "frames": len(motion), "fps": motion.fps, "seconds": motion.duration}
    passages = [asdict(passage) for passage in composed.passages]
    met = [outcome._asdict() for outcome in composed.met]
    if as_json:
        click.echo(json.dumps({**facts, "passages": passages, "met": met}))
        return
    say_written(out, motion)
    for passage in composed.passages:
        action = f"{passage.action}{confidence_of(vars(passage))}"
        click.echo(f"  {passage.start:.1f}-{passage.stop:.1f} s {passage.text} (as: {action})")
    for each in composed.met:
        click.echo(f"  {each}")
