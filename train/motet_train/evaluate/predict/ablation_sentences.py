"""What a table of ablations says, in sentences computed from its figures as they are shown."""

from collections.abc import Mapping

from motet_train.evaluate.predict.ablations import MODEL
from motet_train.evaluate.predict.curves import MANY
from motet_train.evaluate.predict.published import FRAMES
from motet_train.evaluate.predict.sentences import Figures
from motet_train.evaluate.predict.words import amount, at, listed


def ablation_sentences(figures: Figures, said: Mapping[str, str], noise: float) -> list[str]:
    """How each row differs from the first, on many windows. said: title -> words. noise: a difference that says
    nothing."""
    if not said:
        return []
    first, *others = said
    lines = [f"Differences of {amount(noise)} or less, the largest spread of this model's seeds, say nothing."]
    if noise <= 0:
        lines = ["Each row is one seed, and no spread was measured: small differences say nothing."]
    return lines + [f"{said[row]}: {_beside(figures, row, first, noise)}." for row in others]


def _beside(figures: Figures, row: str, first: str, noise: float) -> str:
    off = {frame: round(figures.error(row, frame, MANY) - figures.error(first, frame, MANY), 2) for frame in FRAMES}
    worse, better = ([frame for frame in FRAMES if sign * off[frame] > noise] for sign in (1, -1))
    parts = [
        f"{word} {at(frames, FRAMES)}, by {listed([amount(abs(off[frame])) for frame in frames])}"
        for word, frames in (("worse", worse), ("better", better))
        if frames
    ]
    return "; ".join(parts) or "no difference"


def largest_spread(*tables: Figures) -> float:
    """The largest spread of the model's seeds at the frames that papers report, on many windows; 0 where no row has
    several."""
    spreads = (
        figures.spread(row, frame, MANY) for figures in tables for row in figures.models(MODEL) for frame in FRAMES
    )
    return max((spread for spread in spreads if spread is not None), default=0.0)
