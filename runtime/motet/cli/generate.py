"""``motet generate``: motions from sentences."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, cast

import click

import motet.keyed
from motet.bundle.graph import SessionOptions
from motet.cli.options import Tries, bar, bundle_option, json_option, naming, noted, seed_option, session_options
from motet.cli.writing import Output, out_option, places, size, write_options
from motet.files import Json
from motet.formats import read_motion
from motet.generate.base import PLAYED, Generated, GenerateModel, Story
from motet.generate.model import CodesModel
from motet.models.load import load_as
from motet.motion.looping import looped
from motet.text.clauses import Passage


@click.command()
@click.argument("texts", nargs=-1, required=True, metavar="TEXT...")
@out_option
@bundle_option("generate")
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
@click.option(
    "--seconds", type=click.FloatRange(0, 600, min_open=True), help="Length for each text. [default: it ends by itself]"
)
@click.option("--max-seconds", type=click.FloatRange(0, 600), help="Maximum length in seconds. [default: the bundle's]")
@seed_option("Seed; later texts use seed + 1, ...")
@click.option("--no-plant", is_flag=True, help="Skip foot planting: the figure moves as drawn.")
@click.option("--all", "every", is_flag=True, help="Write all hypotheses, not only the best.")
@click.option("--story", is_flag=True, help="One motion for all texts, in order.")
@click.option("--after", type=Path, metavar="MOTION", help="Continue from the end of this motion file.")
@click.option("--stand", type=click.Choice(["start", "end", "both"]), help="Start or end in standing.")
@click.option("--loop", is_flag=True, help="Write only a seamless loop.")
@click.option("--whole", is_flag=True, help="Do not split texts that ask for several things in a row.")
@click.option("--numbers/--no-numbers", default=True, help="Turn, go and repeat as much as texts say. [default: yes]")
@click.option("--acts", type=click.Path(path_type=Path), help="Know acts by key poses of this TOML file, too.")
@click.option("--strict", is_flag=True, help="Fail on a text that the model knows only in part.")
@write_options
@session_options
@json_option("Print a list with input and hypotheses of each text.")
def generate(
    texts: tuple[str, ...],
    out: Path,
    bundle: str,
    every: bool,
    output: Output,
    story: bool,
    after: Path | None,
    acts: Path | None,
    no_plant: bool,
    loop: bool,
    as_json: bool,
    session: SessionOptions,
    **settings: Any,
) -> None:
    """Generate a motion for each TEXT, such as "a person walks and turns left", and write it to OUT.

    A text that asks for several things in a row ("walk to the table, then sit down") becomes a story of its parts.
    With several texts, or --all, the files are numbered: out-1.bvh, out-2.bvh, ... A text that cannot be used has none.
    With --story the texts become one motion, each taking over from the one before.
    """
    output.check(out)
    by_codes = story or after is not None or acts is not None or settings["stand"] is not None
    settings = {key: value for key, value in settings.items() if value is not None}
    tries = Tries()
    model = load_as(CodesModel if by_codes else GenerateModel, bundle, session)
    if acts is not None:
        model = cast(CodesModel, model).with_acts(motet.keyed.read(acts))
    requests = _usable(tries, model, texts, settings["numbers"])
    if story or after is not None or "stand" in settings:
        generated = _stories(tries, cast(CodesModel, model), requests, story, after, **settings)
    else:
        generated = _motions(tries, model, requests, **settings)
    count = max((len(results) for *_, results in generated), default=1) if every else 1
    numbers = range(1, 1 + count * (1 if story else len(texts)))
    outs = places(out, list(map(str, numbers)), output=output)
    rows = []
    for index, text, results in generated:
        with tries.of(text):
            placed = zip(results[:count], outs[count * index :], strict=False)
            rows.append(_written(text, placed, not no_plant, loop, output))
    output.finish()
    if rows:
        click.echo(json.dumps(rows) if as_json else "\n".join(_lines(rows)))
    tries.finish()


def _usable(tries: Tries, model: GenerateModel, texts: tuple[str, ...], numbers: bool) -> dict[int, str]:
    """The texts of which words are known, and numbers make sense, by their places."""
    known = tries.usable(dict(enumerate(texts)), model.unknown)
    return tries.usable(known, model.quantities) if numbers else known


Found = tuple[int, str, list[Generated]]
"""The place of an input among all, the input, and its motions, the best first."""


@noted()
def _motions(
    tries: Tries, model: GenerateModel, requests: dict[int, str], seed: int, strict: bool, **settings: Any
) -> list[Found]:
    """The motions of each text by itself, of all of them in one batch."""
    if strict:  # one text that is refused leaves the others
        requests = tries.usable(requests, partial(model.check, whole=settings["whole"], numbers=settings["numbers"]))
    with bar("generating") as progress:
        seeds = [seed + index for index in requests]
        generated = model.generate(list(requests.values()), seed=seeds, strict=strict, progress=progress, **settings)
    return [(index, text, results) for (index, text), results in zip(requests.items(), generated, strict=True)]


@noted()
def _stories(
    tries: Tries,
    model: CodesModel,
    requests: dict[int, str],
    story: bool,
    after: Path | None,
    seed: int,
    **settings: Any,
) -> list[Found]:
    """One motion for all texts, or one for each."""
    if settings.pop("hypotheses", 1) != 1:
        raise click.UsageError("--story, --after and --stand give one motion: leave --hypotheses out")
    if after is not None:
        settings["after"] = read_motion(after)
    groups = [requests] if story else [{index: text} for index, text in requests.items()]
    stories: list[Found] = []
    for number, group in enumerate(filter(None, groups)):
        label = " / ".join(group.values())
        with tries.of(label), naming(after):
            stories.append((number, label, [model.story(list(group.values()), seed=seed + min(group), **settings)]))
    return stories


def _written(text: str, results: Iterable[tuple[Generated, Path]], plant: bool, loop: bool, output: Output) -> Json:
    """Write the motions of an input; what is said of them."""
    hypotheses = []
    for result, place in results:
        motion = result.playable(output.fps or PLAYED, plant)
        captions = captions_of(result.passages) if isinstance(result, Story) else None
        motion = output.write(place, looped(motion) if loop else motion, text, captions)
        facts = {"frames": len(motion), "fps": motion.fps, "seconds": motion.duration}
        passages = {"passages": list(map(asdict, result.passages))} if isinstance(result, Story) else {}
        shown = {"action": result.action or None, "lacking": result.lacking, "confidence": result.confidence}
        details = {**shown, "requested": dict(result.requested), "measured": dict(result.measured)}
        scored = {"output": str(place), "log_likelihood": result.log_likelihood}
        hypotheses.append({**scored, **facts, **details, **passages})
    return {"input": text, "hypotheses": hypotheses}


def captions_of(passages: Iterable[Passage]) -> list[tuple[float, str]]:
    """What a page says when: the sentences of a story."""
    return [(passage.start, passage.text) for passage in passages]


def _lines(rows: list[Json]) -> Iterator[str]:
    for row in rows:
        for hypothesis in row["hypotheses"]:
            likelihood = hypothesis["log_likelihood"]
            score = "" if likelihood is None else f", log-likelihood {likelihood:.1f}"
            yield f"{hypothesis['output']}: {size(hypothesis['frames'], hypothesis['fps'])}{score}: {row['input']}"
            if hypothesis["action"]:
                yield f"  as: {hypothesis['action']}{confidence_of(hypothesis)}"
            if hypothesis["action"] and (numbers := _numbers(hypothesis)):
                yield f"  {numbers}"
            for passage in hypothesis.get("passages", ()):
                numbers = "" if hypothesis["action"] else _numbers(passage)
                numbers = numbers and f"; {numbers}"
                shown = "" if hypothesis["action"] else f" (as: {passage['action']}{confidence_of(passage)}{numbers})"
                yield f"  {passage['start']:.1f}-{passage['stop']:.1f} s {passage['text']}{shown}"


def confidence_of(shown: Json) -> str:
    """How sure the model is of what it shows, and the words that are left out."""
    without = ", ".join(f"'{word}'" for word in shown["lacking"])
    sure = "" if shown["confidence"] is None else f", confidence {shown['confidence']:.2f}"
    return sure + (without and f", without {without}")


def _numbers(hypothesis: Json) -> str:
    """What was requested in numbers beside what was measured: "requested: 3 steps: 3 shown"."""
    shown = {kind: f": {value:.3g} shown" for kind, value in hypothesis["measured"].items()}
    numbers = ", ".join(f"{value:.3g} {kind}{shown.get(kind, '')}" for kind, value in hypothesis["requested"].items())
    return numbers and f"requested: {numbers}"
