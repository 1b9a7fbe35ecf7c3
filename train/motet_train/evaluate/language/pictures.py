"""Pictures of a describe or generate model: the paper's figures 5 to 10 (Plappert et al. 2017)."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure as Picture
from numpy.typing import NDArray
from sklearn.manifold import TSNE

from motet.draw.body import COLOURS
from motet.draw.figure import Figure, figure_of
from motet.errors import OutputError
from motet.models.describe import DescribeModel
from motet.models.generate import GenerateModel
from motet.motion.motion import Motion
from motet.representation.root_block import from_root_block
from motet_train.data.errors import DataError
from motet_train.evaluate.language.attributes import ACTIONS, DIRECTIONS, Table, common, said
from motet_train.evaluate.language.chain import prompts
from motet_train.evaluate.language.corpus import Corpus, unknown_words_allowed
from motet_train.evaluate.language.motions import moves
from motet_train.evaluate.language.prompts import ASKED

mpl.use("Agg")

FIGURES, STRIPS = 9, 6
"""Stick figures of a strip, and strips of a picture of test motions."""

SPACING = 0.62
"""Body heights from one stick figure to the next."""

ELSE = "other"

Drawings = dict[str, Callable[[], Picture]]


def draw_describe(model: DescribeModel, corpus: Corpus, run: Path | None, folder: Path) -> list[Path]:
    """Figures 5, 6, 9a and 10 into a folder; the files. run: the folder with the log of the training, if any."""
    records = corpus.described(range(len(corpus.store.records)))
    sentences = corpus.references(records)
    contexts = Contexts(model.embed(corpus.motions(records)))
    drawings: Drawings = {
        "figure-9a-contexts-of-motions": lambda: contexts.draw(ACTIONS, sentences, "Contexts of motions"),
        "figure-10-walking": lambda: contexts.draw(DIRECTIONS, sentences, "Contexts of walking", "walk"),
    }
    if run is not None:
        drawings["figure-5-loss"] = lambda: losses(run)
    if moves(corpus.motion(records[0])):
        drawings["figure-6-descriptions"] = lambda: descriptions(model, corpus)
    return _save(drawings, folder)


def draw_generate(model: GenerateModel, corpus: Corpus, run: Path | None, folder: Path) -> list[Path]:
    """Figures 7, 8 and 9b into a folder; the files. run: as of :func:`draw_describe`."""
    asked = prompts(model, corpus, corpus.described(range(len(corpus.store.records))))
    with unknown_words_allowed():
        contexts = Contexts(model.embed([sentence for _, sentence in asked]))
    sentences = [(sentence,) for _, sentence in asked]
    drawings: Drawings = {
        "figure-9b-contexts-of-sentences": lambda: contexts.draw(ACTIONS, sentences, "Contexts of sentences")
    }
    if run is not None:
        drawings["figure-7-loss"] = lambda: losses(run)
    if moves(corpus.motion(asked[0][0])):
        drawings["figure-8-generated"] = lambda: generated(model)
    return _save(drawings, folder)


def losses(run: Path) -> Picture:
    """Figures 5 and 7: the loss over training epochs; DataError where the run has no log."""
    try:
        lines = [json.loads(line) for line in (run / "log.jsonl").read_text().splitlines()]
    except (OSError, ValueError) as error:
        raise DataError(f"{run} has no log of its training that can be read: {error}") from error
    picture, (axes,) = _axes(1, (7, 4), f"Loss of {run.name}")
    for key, name in (("loss", "training"), ("validation", "validation")):
        axes.plot([line["epoch"] for line in lines], [line[key] for line in lines], label=name)
    axes.set(xlabel="epoch", ylabel="loss of a step")
    axes.legend()
    return picture


class Contexts:
    """Context vectors (N, C) laid out in a plane by t-SNE, once for all pictures of them."""

    def __init__(self, vectors: NDArray[np.float32]) -> None:
        perplexity = min(30.0, (len(vectors) - 1) / 3)
        self.places = TSNE(2, perplexity=perplexity, init="pca", random_state=0).fit_transform(vectors)

    def draw(self, colours: Table, sentences: Sequence[Sequence[str]], title: str, only: str | None = None) -> Picture:
        """Each vector in the colour of what its sentences say; only: an action that they have to say."""
        actions = [common([said(ACTIONS, sentence) for sentence in row]) for row in sentences]
        shown = [only is None or only in found for found in actions]
        kinds = [_kind(colours, row) if show else None for row, show in zip(sentences, shown, strict=True)]
        picture, (axes,) = _axes(1, (7, 6), title)
        for number, kind in enumerate([*colours, ELSE]):
            chosen = self.places[[found == kind for found in kinds]]
            colour = "lightgrey" if kind == ELSE else f"C{number}"
            if len(chosen):
                axes.scatter(chosen[:, 0], chosen[:, 1], s=12, color=colour, label=f"{kind} ({len(chosen)})")
        axes.set(xticks=[], yticks=[])
        axes.legend(fontsize=7)
        return picture


def descriptions(model: DescribeModel, corpus: Corpus) -> Picture:
    """Figure 6: test motions with the three best descriptions and their log-probabilities."""
    test = corpus.described(corpus.parts.test, STRIPS)
    motions = corpus.motions(test)
    rows = [
        "\n".join(f"{found.text}   {found.log_probability:.2f}" for found in row[:3]) for row in model.describe(motions)
    ]
    return _strips(motions, rows, "Test motions, their descriptions and log P")


def generated(model: GenerateModel) -> Picture:
    """Figure 8: the likeliest motion for each of a few sentences."""
    texts = [sentence for sentence, _ in ASKED.values()]
    rows = model.generate(texts)
    titles = [f"{text}   {row[0].log_likelihood:.1f}" for text, row in zip(texts, rows, strict=True)]
    return _strips([row[0].motion for row in rows], titles, "Generated motions and their log-likelihood")


def _kind(table: Table, sentences: Sequence[str]) -> str:
    """The one attribute that half of the sentences agree on."""
    found = common([said(table, sentence) for sentence in sentences])
    return next(iter(found)) if len(found) == 1 else ELSE


def _strips(motions: Sequence[Motion], titles: Sequence[str], title: str) -> Picture:
    picture, panels = _axes(len(motions), (9, 2.0 * len(motions)), title)
    for axes, motion, text in zip(panels, motions, titles, strict=True):
        _strip(axes, figure_of(from_root_block(motion)))
        axes.set_title(text, fontsize=8, loc="left")
    return picture


def _strip(axes: Axes, figure: Figure) -> None:
    """Stick figures at even times from left to right, seen from a little in front of the side they first turn to."""
    view = figure.heading + np.radians(60)
    frames = np.linspace(0, len(figure.points) - 1, FIGURES).round().astype(int)
    colours = [np.array(COLOURS[bone.side]) / 255 for bone in figure.bones]
    for number, points in enumerate(figure.points[frames]):
        across = (points - points[0])[:, [0, 2]] @ [np.sin(view), np.cos(view)]
        flat = np.column_stack([across + SPACING * number, points[:, 1]])
        lines = [flat[[bone.start, bone.end]] for bone in figure.bones]
        axes.add_collection(LineCollection(lines, colors=colours, linewidths=1.2))
    axes.set(xlim=(-SPACING, SPACING * FIGURES), ylim=(-0.05, 1.25), aspect="equal")
    axes.axis("off")


def _axes(rows: int, size: tuple[float, float], title: str) -> tuple[Picture, list[Axes]]:
    picture = Picture(figsize=size, layout="constrained")
    picture.suptitle(title)
    return picture, list(picture.subplots(rows, 1, squeeze=False).flat)


def _save(drawings: Mapping[str, Callable[[], Picture]], folder: Path) -> list[Path]:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write plots to {folder}: {error.strerror}") from error
    paths = [folder / f"{name}.png" for name in drawings]
    for path, draw in zip(paths, drawings.values(), strict=True):
        draw().savefig(path, dpi=110)
    return paths
