"""``motet generate``: sentences in, motion files out."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import click

from motet.bundle.graph import SessionOptions
from motet.cli.notes import noted
from motet.cli.options import session_options
from motet.cli.reading import Tries, bar, naming, out_option, places
from motet.cli.writing import Output, size, write_options
from motet.formats import read_motion
from motet.models.generate import PLAYED, Generated, GenerateModel
from motet.models.generate_codes import CodesModel, Story
from motet.models.load import load_as
from motet.motion.looping import looped


@click.command()
@click.argument("texts", nargs=-1, required=True, metavar="TEXT...")
@out_option
@click.option("--bundle", default="generate", show_default=True, help="Name or path of a bundle.")
@click.option(
    "--hypotheses", type=click.IntRange(1, 100), help="Hypotheses kept while decoding. [default: the bundle's]"
)
@click.option(
    "--candidates",
    type=click.IntRange(1, 100),
    help="Draws per hypothesis; 1: independent samples. [default: the bundle's]",
)
@click.option("--temperature", type=click.FloatRange(0.01, 100), help="Sampling temperature. [default: the bundle's]")
@click.option(
    "--top-p", type=click.FloatRange(0.01, 1), help="Nucleus sampling: draw from the likeliest codes up to this mass."
)
@click.option("--seconds", type=click.FloatRange(0, 600), help="Length for each text; 0: it ends by itself.")
@click.option("--max-seconds", type=click.FloatRange(0, 600), help="Maximum length in seconds. [default: the bundle's]")
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed; later texts use seed + 1, ..."
)
@click.option("--no-plant", is_flag=True, help="Skip foot planting: the figure moves as drawn.")
@click.option("--all", "every", is_flag=True, help="Write all hypotheses, not only the best.")
@click.option("--story", is_flag=True, help="One motion for all texts, in order.")
@click.option("--after", type=Path, metavar="MOTION", help="Continue from the end of this motion file.")
@click.option("--stand", type=click.Choice(["start", "end", "both"]), help="Start or end in standing.")
@click.option("--loop", is_flag=True, help="Write only a seamless loop.")
@click.option("--strict", is_flag=True, help="Fail on a text that the model knows only in part.")
@write_options
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print a list with input and hypotheses of each text.")
def generate(
    texts: tuple[str, ...],
    out: Path,
    bundle: str,
    no_plant: bool,
    every: bool,
    seed: int,
    output: Output,
    story: bool,
    after: Path | None,
    stand: str | None,
    loop: bool,
    strict: bool,
    as_json: bool,
    session: SessionOptions,
    **settings: Any,
) -> None:
    """Generate a motion for each TEXT, such as "a person walks and turns left", and write it to OUT.

    With several texts, or --all, the files are numbered: out-1.bvh, out-2.bvh, ... A text that cannot be used has none.
    With --story the texts become one motion, each taking over from the one before.
    """
    output.check(out)
    teller = load_as(CodesModel, bundle, session) if story or after is not None or stand is not None else None
    model = teller or load_as(GenerateModel, bundle, session)
    tries = Tries()
    asked = tries.usable(model, texts)
    given = {"strict": strict, **settings, "seconds": settings["seconds"] or None}
    shown = partial(_written, plant=not no_plant, loop=loop, output=output)
    with noted():
        if teller is None:
            found = _motions(tries, model, texts, asked, seed, given)
        else:
            given |= {"after": after, "stand": stand, "seed": seed}
            found = list(_stories(tries, teller, texts, [asked] if story else [[one] for one in asked], given))
    rows = _rows(tries, found, partial(places, out, output=output), 1 if story else len(texts), every, shown)
    output.finish()
    if rows:
        click.echo(json.dumps(rows) if as_json else "\n".join(_lines(rows)))
    tries.finish()


Found = tuple[int, str, list[Generated]]
"""The place of an input among all, the input, and its motions, the best first."""


def _motions(
    tries: Tries, model: GenerateModel, texts: Sequence[str], asked: list[int], seed: int, given: Mapping[str, Any]
) -> list[Found]:
    """The motions of each text by itself, of all of them in one batch."""
    if given["strict"]:  # one text that is refused leaves the others
        asked = [index for index in asked if tries.done(texts[index], partial(model.check, texts[index]))]
    with bar("generating") as progress:
        seeds = [seed + index for index in asked]
        found = model.generate([texts[index] for index in asked], seed=seeds, progress=progress, **given)
    return [(index, texts[index], results) for index, results in zip(asked, found, strict=True)]


def _stories(
    tries: Tries, model: CodesModel, texts: Sequence[str], groups: list[list[int]], given: dict[str, Any]
) -> Iterator[Found]:
    """One motion for the texts of each group."""
    options = {key: value for key, value in given.items() if value is not None}
    if options.pop("hypotheses", 1) != 1:
        raise click.UsageError("--story, --after and --stand give one motion: leave --hypotheses out")
    source = options.get("after")
    if source is not None:
        options["after"] = read_motion(source)
    for number, group in enumerate(filter(None, groups)):
        asked = [texts[index] for index in group]
        with tries.of(" / ".join(asked)), naming(source):
            yield number, " / ".join(asked), [model.story(asked, **{**options, "seed": given["seed"] + group[0]})]


def _rows(
    tries: Tries,
    found: list[Found],
    placed: Callable[[list[str]], list[Path]],
    inputs: int,
    every: bool,
    shown: Callable[[Generated, Path, str], dict[str, Any]],
) -> list[dict[str, Any]]:
    """Write the motions of each input; what is said of those that could be written."""
    count = max((len(results) for *_, results in found), default=1) if every else 1
    outs = placed([str(number + 1) for number in range(count * inputs)])
    rows = []
    for index, text, results in found:
        pairs = zip(results[:count], outs[count * index :], strict=False)
        with tries.of(text):
            rows.append({"input": text, "hypotheses": [shown(result, place, text) for result, place in pairs]})
    return rows


def _written(result: Generated, place: Path, text: str, plant: bool, loop: bool, output: Output) -> dict[str, Any]:
    motion = result.playable(output.fps or PLAYED, plant)
    motion = output.write(place, looped(motion) if loop else motion, text)
    facts = {"frames": len(motion), "fps": motion.fps, "seconds": motion.duration}
    passages = {"passages": list(map(asdict, result.passages))} if isinstance(result, Story) else {}
    return {"output": str(place), "log_likelihood": result.log_likelihood, **facts, **passages}


def _lines(rows: list[dict[str, Any]]) -> Iterator[str]:
    for row in rows:
        for found in row["hypotheses"]:
            likelihood = found["log_likelihood"]
            score = "" if likelihood is None else f", log-likelihood {likelihood:.1f}"
            yield f"{found['output']}: {size(found['frames'], found['fps'])}{score}: {row['input']}"
            for passage in found.get("passages", ()):
                yield f"  {passage['start']:.1f}-{passage['stop']:.1f} s {passage['text']}"
