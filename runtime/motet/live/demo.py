"""A folder of pages that show what the shipped models do, for browsers without a network: ``motet demo``."""

from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import NamedTuple

from motet.draw.page import source, write, write_many
from motet.draw.svg import strip
from motet.files import new_folder, write_whole
from motet.generate.model import CodesModel
from motet.live.page import write_live_page
from motet.models.describe import DescribeModel
from motet.models.load import load_as
from motet.motion.motion import Motion
from motet.predict.fill import JOIN_SECONDS, FillModel
from motet.predict.model import PredictModel
from motet.steering.model import SteerModel

PROMPTS = ("a person waves", "a person kicks", "someone bows", "a man walks in a circle")


MOST_JOINED_FRAMES = 120
"""At most how many frames of motions are joined."""


class Card(NamedTuple):
    """What the index says of a page: its file, a title, a sentence, and the motion of its picture."""

    file: str
    title: str
    text: str
    motion: Motion


def write_demo(folder: str | Path) -> None:
    """Write a new folder with a page each for live figures, generate, predict, join and describe, and ``index.html``,
    which leads to them.

    OutputError if there is something at ``folder`` or it cannot be written, in which case nothing is left of it.
    """
    with new_folder(folder) as place:
        write_whole(place / "index.html", _index(list(_pages(place))))


def _pages(place: Path) -> Iterator[Card]:
    """Write the pages; what the index says of each."""
    steer = load_as(SteerModel, "control")
    writer = load_as(CodesModel, "generate")
    walk = steer.run("walk 4s, run 4s")
    write_live_page(place / "live.html", steer, 3, "motet live")
    yield Card("live.html", "Live", "Steer it by keys, touch, pad or words; or drop a motion or an avatar on it.", walk)

    made = [drawn.motion for (drawn,) in writer.generate(PROMPTS)]
    write_many(place / "generate.html", made, PROMPTS, "motet generate")
    yield Card("generate.html", "Generate", "Motions from sentences, such as “a person kicks”.", made[1])
    yield _predicted(place, walk, writer)
    yield _joined(place, made[0][:MOST_JOINED_FRAMES], made[2][:MOST_JOINED_FRAMES])
    yield _described(place, [walk[:90], walk[-60:], *made[1:3]])


def _predicted(place: Path, walk: Motion, writer: CodesModel) -> Card:
    start_of_walk = walk[: round(1.0 * walk.fps) + 1]
    # a second of the walk is given, five are predicted
    future = load_as(PredictModel, "predict").predict(start_of_walk, seconds=5.0, append=True, beyond=writer)
    write(place / "predict.html", future, [(0.0, "given"), (start_of_walk.duration, "predicted")], "motet predict")
    return Card("predict.html", "Predict", "A second of a walk is given; the rest goes on from it.", future)


def _joined(place: Path, first: Motion, other: Motion) -> Card:
    """first, other: the beginnings of the motions of the first and the third prompt."""
    joined = load_as(FillModel, "fill").join(first, other)
    start = first.duration
    captions = [(0.0, PROMPTS[0]), (start, "filled"), (start + JOIN_SECONDS, PROMPTS[2])]
    write(place / "join.html", joined, captions, "motet join")
    return Card("join.html", "Fill and join", "Two motions, with a transition between them.", joined)


def _described(place: Path, motions: list[Motion]) -> Card:
    descriptions = load_as(DescribeModel, "describe").describe(motions)
    write_many(place / "describe.html", motions, [best.text for best, *_ in descriptions], "motet describe")
    return Card("describe.html", "Describe", "Sentences for motions, each above its own.", motions[1])


def _index(cards: list[Card]) -> str:
    item = '<li><a href="{}">{}<h2>{}</h2><p>{}</p></a></li>'
    items = "\n".join(
        item.format(card.file, strip(card.motion), escape(card.title), escape(card.text)) for card in cards
    )
    page = source("motet.draw", "index.html").replace("{{STYLE}}", source("motet.draw", "page.css"))
    return page.replace("{{CARDS}}", items)
