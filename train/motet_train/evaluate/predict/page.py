"""The page of results: commands, tables, and what they say, all of it from what was measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill

from motet_train.evaluate.predict.ablation_sentences import ablation_sentences, largest_spread
from motet_train.evaluate.predict.ablations import ablated, ablation_table
from motet_train.evaluate.predict.commands import training_commands
from motet_train.evaluate.predict.costs import cost_table, harness_table
from motet_train.evaluate.predict.curves import FEW, MANY, ROTATION
from motet_train.evaluate.predict.protocol_table import actions_table, means_table, missing
from motet_train.evaluate.predict.results import Results
from motet_train.evaluate.predict.sentences import Figures, beside_floors, beside_goals, beside_papers, smallest
from motet_train.evaluate.predict.training_sentences import training_sentences
from motet_train.evaluate.predict.words import listed
from motet_train.models.predict.systems import TITLES

CORPORA = {"cmu-expmap": "CMU's motions", "h36m-expmap": "Human3.6M"}

INTRODUCTION = """\
Predictors on {corpus}, beside the rows that papers published, and beside floors that nobody has to train. The protocol
is that of [predict.md](predict.md): fifty frames in, 25 out, Euler error. This page was written by the last of these
commands; its tables and the sentences under them are computed from what was measured."""

SYSTEMS = {"trajectory": "motet's own predictor", **TITLES}
"""Model -> what it is."""

READING = """\
A row of several seeds is their mean, in brackets the largest minus the smallest. A lead is within the spread where it
is no larger than the larger spread of the two rows. Sentences count figures as the tables show them, in two decimals.
*Zero velocity* holds the last pose. *Constant velocity* repeats each joint's last turn, exactly, as a rotation.
*Damped velocity* repeats it ever smaller, by a decay for each frame that is best on training files.

Euler errors leap where a joint passes through gimbal lock. Angles of rotation do not, hence the last block of means."""

TRAINING = """\
*Warp*: windows are played up to exp(this) times as fast or slow. *Reverse*, *mirror*: the share of windows that are
played backwards, and mirrored. *Average*: of a running mean of the weights. *Held out*: training files that are for
choosing alone. *Kept*: the step whose weights are kept, the last one, or the best one by the error on what is held
out, or on windows of the training files where nothing is."""

PAPER = """\
What the paper concluded on Human3.6M: the long-term encoder helps in the long run; an LSTM in its place is worse;
longer windows help up to ten frames and little beyond; kernels of 2 x 7 are best; the adversary helps a little."""


@dataclass(frozen=True)
class Surroundings:
    """What stands around the figures. evaluated: the command that writes the page. pictures: title -> path from the
    page."""

    evaluated: str
    pictures: Mapping[str, str]


def page(results: Results, around: Surroundings, ablations: Results | None = None) -> str:
    """The page as Markdown. ablations: runs of the convolutional predictor alone, of which the first is the
    reference."""
    figures = Figures(results)
    trained = [*training_commands(results), *(training_commands(ablations) if ablations else ())]
    commands = [*dict.fromkeys(trained), around.evaluated]
    corpus = CORPORA.get(results.corpus.layout.name, results.corpus.layout.name)
    parts = [
        "# Predictors compared",
        _wrapped(INTRODUCTION.format(corpus=corpus)),
        _wrapped(_rows(figures)),
        _indented(commands),
        READING,
        *_missing(results),
        "## Means of the actions",
        _block(means_table(results.means, results.corpus, results.spreads)),
        _bullets(sentences(figures)),
        *[f"![{title}]({path})" for title, path in around.pictures.items()],
        "## How they were trained",
        _block(harness_table(results.models, results.groups)),
        _block(cost_table(results.models, results.groups)),
        TRAINING,
        _bullets(training_sentences(figures)),
        "## By action",
        _block(actions_table(results.means, results.corpus, results.spreads)),
        *(_ablations(ablations, figures) if ablations else ()),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def sentences(figures: Figures) -> list[str]:
    """What the tables of errors say."""
    found = [line for kind in (FEW, MANY, ROTATION) for line in smallest(figures, kind)]
    return [*found, *beside_papers(figures), *beside_goals(figures), *beside_floors(figures)]


def _ablations(ablations: Results, main: Figures) -> list[str]:
    said = ablated(ablations.models, ablations.groups)
    if not said:
        return []
    figures = Figures(ablations)
    return [
        "## The paper's ablations",
        _block(ablation_table(ablations.means, said, ablations.spreads)),
        _bullets(ablation_sentences(figures, said, largest_spread(main, figures))),
        PAPER,
    ]


def _rows(figures: Figures) -> str:
    """What each row is."""
    models = figures.results.models
    kinds = {row: models[group.runs[0]].manifest.model for row, group in figures.groups.items()}
    rows = {kind: [f"`{figures.name(row)}`" for row in kinds if kinds[row] == kind] for kind in kinds.values()}
    said = [
        f"{listed(names)} {'is' if len(names) == 1 else 'are'} {SYSTEMS[kind]}"
        for kind, names in rows.items()
        if kind in SYSTEMS
    ]
    return f"Rows: {'; '.join(said)}." if said else ""


def _wrapped(text: str, indent: str = "") -> str:
    return fill(text, 120, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def _missing(results: Results) -> list[str]:
    lines = [line for line in missing(results.corpus) if line]
    return [_wrapped(". ".join(line[:1].upper() + line[1:] for line in lines) + ".")] if lines else []


def _block(text: str) -> str:
    return f"```\n{text}\n```"


def _indented(commands: Sequence[str]) -> str:
    return "\n".join(f"    {line}" for command in commands for line in command.split("\n"))


def _bullets(lines: Sequence[str]) -> str:
    return "\n".join(_wrapped(f"* {line}", "  ") for line in lines)
