"""Pictures of a describe or generate model: the paper's figures 5 to 10 (Plappert et al. 2017)."""

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure
from sklearn.manifold import TSNE

from motet.bundle.graph import Floats
from motet.generate.base import GenerateModel
from motet.models.describe import DescribeModel
from motet.representation.root_block import from_root_block
from motet_train.data.errors import DataError
from motet_train.evaluate.figures import Drawings, panels, strips
from motet_train.evaluate.language.attributes import ACTIONS, DIRECTION_PATTERNS, Patterns, common, mentioned
from motet_train.evaluate.language.generate import ASKED, known_sentences, knows
from motet_train.evaluate.language.motions import moves
from motet_train.evaluate.language.split_store import SplitStore, unknown_words_allowed
from motet_train.trainer import LOG


def describe_drawings(model: DescribeModel, corpus: SplitStore, run: Path | None) -> Drawings:
    """Figures 5, 6, 9a and 10. run: the folder with the training log, if there is one."""
    records = corpus.described(range(len(corpus.store.records)))
    sentences = corpus.references(records)
    draw = contexts(model.embed(corpus.motions(records)))
    figures: dict[str, Callable[[], Figure]] = {
        "figure-9a-contexts-of-motions": partial(draw, ACTIONS, sentences, "Contexts of motions"),
        "figure-10-walking": partial(draw, DIRECTION_PATTERNS, sentences, "Contexts of walking", "walk"),
    }
    if run is not None:
        figures["figure-5-loss"] = partial(losses, run)
    if moves(corpus.motion(records[0])):
        figures["figure-6-descriptions"] = partial(descriptions, model, corpus)
    return figures


def generate_drawings(model: GenerateModel, corpus: SplitStore, run: Path | None) -> Drawings:
    """Figures 7, 8 and 9b. run: as in :func:`describe_drawings`."""
    known = known_sentences(model, corpus, corpus.described(range(len(corpus.store.records))))
    with unknown_words_allowed():
        draw = contexts(model.embed([sentence for _, sentence in known]))
    sentences = [(sentence,) for _, sentence in known]
    figures: dict[str, Callable[[], Figure]] = {
        "figure-9b-contexts-of-sentences": partial(draw, ACTIONS, sentences, "Contexts of sentences")
    }
    if run is not None:
        figures["figure-7-loss"] = partial(losses, run)
    texts = [sentence for sentence, *_ in ASKED.values() if knows(model, sentence, every_word=True)]
    if texts and moves(corpus.motion(known[0][0])):
        figures["figure-8-generated"] = partial(generated, model, texts)
    return figures


def losses(run: Path) -> Figure:
    """Figures 5 and 7: the loss over training epochs; DataError if the run has no log."""
    try:
        lines = [json.loads(line) for line in (run / LOG).read_text().splitlines()]
    except (OSError, ValueError) as error:
        raise DataError(f"{run} has no readable training log: {error}") from error
    picture, (axes,) = panels(1, 1, (7, 4), f"Loss of {run.name}")
    for key, name in (("loss", "training"), ("validation", "validation")):
        axes.plot([line["epoch"] for line in lines], [line[key] for line in lines], label=name)
    axes.set(xlabel="epoch", ylabel="loss of a step")
    axes.legend()
    return picture


def contexts(vectors: Floats) -> Callable[..., Figure]:
    """Context vectors (N, C) laid out in a plane by t-SNE, once for all pictures of them."""
    perplexity = min(30.0, (len(vectors) - 1) / 3)
    places = TSNE(2, perplexity=perplexity, init="pca", random_state=0).fit_transform(vectors)

    def draw(colours: Patterns, sentences: Sequence[Sequence[str]], title: str, only: str | None = None) -> Figure:
        """Each vector in the colour of the attribute that half of its sentences name; only: show those of an action."""
        kinds = [_kind(row, colours, only) for row in sentences]
        picture, (axes,) = panels(1, 1, (7, 6), title)
        for number, kind in enumerate([*colours, "other"]):
            chosen = places[[other == kind for other in kinds]]
            colour = "lightgrey" if kind == "other" else f"C{number}"
            if len(chosen):
                axes.scatter(chosen[:, 0], chosen[:, 1], s=12, color=colour, label=f"{kind} ({len(chosen)})")
        axes.set(xticks=[], yticks=[])
        axes.legend(fontsize=7)
        return picture

    return draw


def _kind(sentences: Sequence[str], colours: Patterns, only: str | None) -> str | None:
    """The only common attribute of some sentences, or "other"; None if they lack the action ``only``."""
    actions = common([mentioned(ACTIONS, sentence) for sentence in sentences])
    if only is not None and only not in actions:
        return None
    attributes = common([mentioned(colours, sentence) for sentence in sentences])
    return next(iter(attributes)) if len(attributes) == 1 else "other"


def descriptions(model: DescribeModel, corpus: SplitStore) -> Figure:
    """Figure 6: test motions with the three best descriptions and their log-probabilities."""
    test = corpus.described(corpus.parts.test, 6)
    motions = corpus.motions(test)
    rows = []
    for candidates in model.describe(motions):
        best = [f"{candidate.text}   {candidate.log_probability:.2f}" for candidate in candidates[:3]]
        rows.append("\n".join(best))
    return strips([from_root_block(motion) for motion in motions], rows, "Test motions, their descriptions and log P")


def generated(model: GenerateModel, texts: Sequence[str]) -> Figure:
    """Figure 8: the most likely motion for each of a few sentences."""
    rows = model.generate(texts)
    scores = ["" if row[0].log_likelihood is None else f"   {row[0].log_likelihood:.1f}" for row in rows]
    titles = [text + score for text, score in zip(texts, scores, strict=True)]
    return strips([row[0].motion for row in rows], titles, "Generated motions and their log-likelihood")
