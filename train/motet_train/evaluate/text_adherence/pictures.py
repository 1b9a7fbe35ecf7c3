"""Twelve prompts as pictures, each with a motion that does what it says; how many did not is said above them."""

from matplotlib.figure import Figure

from motet.motion.motion import Motion
from motet_train.evaluate.figures import Drawings
from motet_train.evaluate.strips import strips
from motet_train.evaluate.text_adherence.prompts import Prompt, prompts
from motet_train.evaluate.text_adherence.table import Generator
from motet_train.evaluate.text_adherence.track import track_of

EVERY = 8
"""Of the prompts, in the order of their file, so many apart are asked; where the motion does not do what one says, the
next one is asked in its place."""


def says_drawings(generator: Generator) -> Drawings:
    """The motions with seed 0."""

    def draw() -> Figure:
        asked = prompts()
        tried = [_first_done(generator, asked[start : start + EVERY]) for start in range(0, len(asked), EVERY)]
        shown = [done for done, _ in tried if done is not None]
        failed = sum(count for _, count in tried)
        title = f"every eighth prompt; {failed} whose motions did not do what they say are passed over for the next"
        return strips([motion for _, motion in shown], [prompt.text for prompt, _ in shown], title)

    return {"says": draw}


def _first_done(generator: Generator, asked: tuple[Prompt, ...]) -> tuple[tuple[Prompt, Motion] | None, int]:
    """The first of some prompts that is done, with its motion, and how many before it are not."""
    for failed, prompt in enumerate(asked):
        motion = generator.generate(prompt.text, 0)
        if prompt.passes(track_of(motion)):
            return (prompt, motion), failed
    return None, len(asked)
