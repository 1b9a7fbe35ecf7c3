"""Twelve prompts as pictures, each with whether the motion does what it says."""

from matplotlib.figure import Figure

from motet_train.evaluate.figures import Drawings
from motet_train.evaluate.says.prompts import Prompt, prompts
from motet_train.evaluate.says.table import Generator
from motet_train.evaluate.says.track import track_of
from motet_train.evaluate.strips import strips

EVERY = 8
"""Of the prompts, in the order of their file, so many apart are drawn: nobody has picked them."""


def drawn() -> list[Prompt]:
    """Those that are drawn: twelve."""
    return list(prompts()[::EVERY])


def says_drawings(generator: Generator) -> Drawings:
    """The motion of each of them with seed 0."""

    def draw() -> Figure:
        motions = [generator.generate(prompt.text, 0) for prompt in drawn()]
        does = [prompt.passes(track_of(motion)) for prompt, motion in zip(drawn(), motions, strict=True)]
        titles = [prompt.text + ("" if yes else "   (does not)") for prompt, yes in zip(drawn(), does, strict=True)]
        return strips(motions, titles, f"{sum(does)} of {len(does)} do what they say")

    return {"says": draw}
