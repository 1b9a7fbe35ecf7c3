"""``motet describe`` and ``motet generate``: from motion files to sentences, and from sentences to motion files."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, cast

import click

from motet.bundle.graph import SessionOptions
from motet.cli.options import Tries, bar, bundle_option, in_place, naming, noted, session_options
from motet.cli.reading import Read, Source, read_options
from motet.cli.writing import Output, out_option, places, size, write_options
from motet.formats import READS, read_motion
from motet.models.describe import DescribeModel, Description
from motet.models.generate import PLAYED, Generated, GenerateModel
from motet.models.generate_codes import CodesModel, Story
from motet.models.known import NOTHING
from motet.models.load import load_as
from motet.motion.looping import looped


@click.command(
    help=f"""Describe motion files: sentences, the best first, each with its log-probability or, from a bundle of known
    motions, the probability that it is right; with --draws, with how well it agrees with all sentences drawn (0 to 1).
    A sentence after "?" is one that the model is not sure of; a bundle of known motions says "{NOTHING}" of a motion
    like none of them.

    All files are described in one batch, motions over 30 s in windows; with --timeline, motions of any length are cut
    where what is done changes. Any human figure will do. Of a file of several clips all are described, or the one of
    --clip or MOTION.glb#CLIP. Reads {READS}.
    """
)
@click.argument("motions", nargs=-1, required=True, type=Path, metavar="MOTION...")
@bundle_option("describe")
@click.option("--beams", type=click.IntRange(1, 100), help="Sentences to print. [default: the bundle's]")
@click.option(
    "--draws",
    type=click.IntRange(0, 1000),
    help="Samples for consensus (MBR) decoding; 0: beam search. [default: the bundle's; of describe: beam search]",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the samples.")
@click.option("--timeline", is_flag=True, help="One sentence for each part of a motion, with its times.")
@session_options
@read_options
@click.option("--json", "as_json", is_flag=True, help="Print a list: each window or part with its input and seconds.")
def describe(
    motions: tuple[Path, ...],
    bundle: str,
    beams: int | None,
    draws: int | None,
    seed: int,
    timeline: bool,
    session: SessionOptions,
    read: Read,
    as_json: bool,
) -> None:
    """Describe motion files."""
    if timeline and (beams, draws) != (None, None):
        raise click.UsageError("--timeline gives one sentence for each part: it goes with neither --beams nor --draws")
    model, tries = load_as(DescribeModel, bundle, session), Tries()
    sources = read.sources(motions, every=True)
    if timeline:
        rows, lines = _timelines(model, sources, read, tries)
    else:
        settings = {"beams": beams, "draws": draws or None, "decoding": "beam" if draws == 0 else None, "seed": seed}
        rows, lines = _hypotheses(model, sources, read, tries, settings)
    read.say_resampled(model.fps)
    for line in [json.dumps(rows)] if as_json else lines:
        click.echo(line)
    tries.finish()


def _hypotheses(
    model: DescribeModel, sources: Sequence[Source], read: Read, tries: Tries, settings: Mapping[str, Any]
) -> tuple[list[dict[str, Any]], list[str]]:
    """For each window of the motions its sentences, ready for JSON and as lines."""
    windows = []
    for source in sources:
        with tries.of(source) as caught:
            cut = model.windows(read(source))
            said: dict[str, Any] = {"input": str(source), "in_place": in_place(caught)}
            windows += [(said, start, start + part.duration, model.prepared(part)) for start, part in cut]
    with bar("describing") as progress:
        found = model.describe([part for *_, part in windows], progress=progress, **settings)
    inputs, rows, lines = [said["input"] for said, *_ in windows], [], []
    for (said, start, stop, _), descriptions in zip(windows, found, strict=True):
        hypotheses, name = [description.to_json() for description in descriptions], said["input"]
        rows.append({**said, "start": start, "stop": stop, "hypotheses": hypotheses})
        lines += [name] if len(sources) > 1 and start == 0 else []
        lines += [f"{start:.1f} to {stop:.1f} s"] if inputs.count(name) > 1 else []
        lines += [f"{description.score:8.2f}  {_told(description)}" for description in descriptions]
    return rows, lines


def _timelines(
    model: DescribeModel, sources: Sequence[Source], read: Read, tries: Tries
) -> tuple[list[dict[str, Any]], list[str]]:
    """For each part of the motions its sentence, ready for JSON and as lines."""
    rows, lines = [], []
    for source in sources:
        with tries.of(source) as caught, bar(source.name) as progress:
            parts = model.timeline(read(source), progress=progress)
            rows += [{"input": str(source), "in_place": in_place(caught), **part.to_json()} for part in parts]
            lines += [str(source)] if len(sources) > 1 else []
            lines += [f"{part.start:.1f}-{part.stop:.1f} s  {_told(part)}" for part in parts]
    return rows, lines


def _told(description: Description) -> str:
    sure = description.confident or description.text == NOTHING
    return description.text if sure else f"? {description.text}"


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
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed; later texts use seed + 1, ..."
)
@click.option("--no-plant", is_flag=True, help="Skip foot planting: the figure moves as drawn.")
@click.option("--all", "every", is_flag=True, help="Write all hypotheses, not only the best.")
@click.option("--story", is_flag=True, help="One motion for all texts, in order.")
@click.option("--after", type=Path, metavar="MOTION", help="Continue from the end of this motion file.")
@click.option("--stand", type=click.Choice(["start", "end", "both"]), help="Start or end in standing.")
@click.option("--loop", is_flag=True, help="Write only a seamless loop.")
@click.option("--whole", is_flag=True, help="Do not split texts that ask for several things in a row.")
@click.option("--strict", is_flag=True, help="Fail on a text that the model knows only in part.")
@write_options
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print a list with input and hypotheses of each text.")
def generate(
    texts: tuple[str, ...],
    out: Path,
    bundle: str,
    every: bool,
    output: Output,
    story: bool,
    after: Path | None,
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
    told = story or after is not None or settings["stand"] is not None
    settings = {key: value for key, value in settings.items() if value is not None}
    tries, model = Tries(), load_as(CodesModel if told else GenerateModel, bundle, session)
    asked = tries.usable(dict(enumerate(texts)), model.unknown)
    if told:
        found = _stories(tries, cast(CodesModel, model), asked, story, after, **settings)
    else:
        found = _motions(tries, model, asked, **settings)
    count = max((len(results) for *_, results in found), default=1) if every else 1
    numbers = range(1, 1 + count * (1 if story else len(texts)))
    outs, rows = places(out, list(map(str, numbers)), output=output), []
    for index, text, results in found:
        with tries.of(text):
            own = zip(results[:count], outs[count * index :], strict=False)
            rows.append(_written(text, own, not no_plant, loop, output))
    output.finish()
    if rows:
        click.echo(json.dumps(rows) if as_json else "\n".join(_lines(rows)))
    tries.finish()


Found = tuple[int, str, list[Generated]]
"""The place of an input among all, the input, and its motions, the best first."""


@noted()
def _motions(
    tries: Tries, model: GenerateModel, asked: dict[int, str], seed: int, strict: bool, whole: bool, **settings: Any
) -> list[Found]:
    """The motions of each text by itself, of all of them in one batch."""
    if strict:  # one text that is refused leaves the others
        asked = tries.usable(asked, partial(model.check, whole=whole))
    with bar("generating") as progress:
        seeds = [seed + index for index in asked]
        found = model.generate(
            list(asked.values()), seed=seeds, strict=strict, whole=whole, progress=progress, **settings
        )
    return [(index, text, results) for (index, text), results in zip(asked.items(), found, strict=True)]


@noted()
def _stories(
    tries: Tries, model: CodesModel, asked: dict[int, str], story: bool, after: Path | None, seed: int, **settings: Any
) -> list[Found]:
    """One motion for all texts, or one for each."""
    if settings.pop("hypotheses", 1) != 1:
        raise click.UsageError("--story, --after and --stand give one motion: leave --hypotheses out")
    if after is not None:
        settings["after"] = read_motion(after)
    groups = [asked] if story else [{index: text} for index, text in asked.items()]
    found: list[Found] = []
    for number, group in enumerate(filter(None, groups)):
        told = " / ".join(group.values())
        with tries.of(told), naming(after):
            found.append((number, told, [model.story(list(group.values()), seed=seed + min(group), **settings)]))
    return found


def _written(
    text: str, results: Iterable[tuple[Generated, Path]], plant: bool, loop: bool, output: Output
) -> dict[str, Any]:
    """Write the motions of an input; what is said of them."""
    found = []
    for result, place in results:
        motion = result.playable(output.fps or PLAYED, plant)
        motion = output.write(place, looped(motion) if loop else motion, text)
        facts = {"frames": len(motion), "fps": motion.fps, "seconds": motion.duration}
        passages = {"passages": list(map(asdict, result.passages))} if isinstance(result, Story) else {}
        told = {"action": result.action or None, "lacking": list(result.lacking)}
        found.append({"output": str(place), "log_likelihood": result.log_likelihood, **facts, **told, **passages})
    return {"input": text, "hypotheses": found}


def _lines(rows: list[dict[str, Any]]) -> Iterator[str]:
    for row in rows:
        for found in row["hypotheses"]:
            likelihood = found["log_likelihood"]
            score = "" if likelihood is None else f", log-likelihood {likelihood:.1f}"
            yield f"{found['output']}: {size(found['frames'], found['fps'])}{score}: {row['input']}"
            if found["action"]:
                yield f"  as: {found['action']}"
            for passage in found.get("passages", ()):
                shown = "" if found["action"] else f" (as: {passage['action']})"
                yield f"  {passage['start']:.1f}-{passage['stop']:.1f} s {passage['text']}{shown}"
