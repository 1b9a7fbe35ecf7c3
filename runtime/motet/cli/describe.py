"""``motet describe``: sentences for motion files."""

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import click

from motet.bundle.graph import SessionOptions
from motet.cli.many import Many, many_options, print_list
from motet.cli.options import bundle_option, json_option, seed_option, session_options
from motet.cli.reading import read_options
from motet.corpus.answers import Answer, Describe, Timeline, to_json
from motet.files import Json
from motet.formats import READS
from motet.models.nearest_neighbour import NOTHING


@click.command(
    help=f"""Describe motion files: sentences, the best first, each with its log-probability or, from a bundle of known
    motions, the probability that it is right; with --draws, with how well it agrees with all sentences drawn (0 to 1).
    A sentence after "?" is one that the model is not sure of; a bundle of known motions says "{NOTHING}" of a motion
    like none of them.

    Motions over 30 s are described in windows; with --timeline, motions of any length are cut
    where what is done changes. Any human figure will do. Of a file of several clips all are described, or the one of
    --clip or MOTION.glb#CLIP. Reads {READS}.
    """
)
@click.argument("motions", nargs=-1, required=True, type=Path, metavar="MOTION|FOLDER|ZIP...")
@bundle_option("describe")
@click.option("--beams", type=click.IntRange(1, 100), help="Sentences to print. [default: the bundle's]")
@click.option(
    "--draws",
    type=click.IntRange(0, 1000),
    help="Samples for consensus (MBR) decoding; 0: beam search. [default: the bundle's; of describe: beam search]",
)
@seed_option("Seed of the samples.")
@click.option("--timeline", is_flag=True, help="One sentence for each part of a motion, with its times.")
@session_options
@read_options
@many_options
@json_option("Print a list: each window or part with its input and seconds.")
def describe(
    motions: tuple[Path, ...],
    bundle: str,
    beams: int | None,
    draws: int | None,
    seed: int,
    timeline: bool,
    session: SessionOptions,
    many: Many,
    as_json: bool,
) -> None:
    """Describe motion files."""
    if timeline and (beams, draws) != (None, None):
        raise click.UsageError("--timeline gives one sentence for each part: it goes with neither --beams nor --draws")
    settings = {"beams": beams, "draws": draws or None, "decoding": "beam" if draws == 0 else None, "seed": seed}
    options = many.read.options, bundle, session
    verb = Timeline(*options) if timeline else Describe(*options, settings)
    sources = many.sources(motions)
    if many.parts:
        many.write_part(verb, sources, motions, "describing")
    answers = many.answers(verb, sources, "describing")
    if as_json:
        rows = chain.from_iterable(answer.rows for answer in answers)
        print_list(map(to_json, rows))
    else:
        for answer in answers:
            for line in _told_of(answer, len(sources) > 1):
                click.echo(line)
    many.read.say_resampled(lambda: verb.model.fps)
    many.tries.finish()


def _told_of(answer: Answer, several: bool) -> Iterator[str]:
    """The sentences of a motion, after its name if there are several."""
    if several and answer.rows:
        yield str(answer.source)
    for row in answer.rows:
        if "hypotheses" not in row:
            yield f"{row['start']:.1f}-{row['stop']:.1f} s  {_told(row)}"
            continue
        if len(answer.rows) > 1:
            yield f"{row['start']:.1f} to {row['stop']:.1f} s"
        for hypothesis in row["hypotheses"]:
            yield f"{hypothesis['score']:8.2f}  {_told(hypothesis)}"


def _told(hypothesis: Json) -> str:
    sure = hypothesis["confident"] or hypothesis["text"] == NOTHING
    return str(hypothesis["text"]) if sure else f"? {hypothesis['text']}"
