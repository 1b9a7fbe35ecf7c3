"""Whether a model says what it does not know: sentences outside of its recordings, and known ones in new wordings."""

from collections.abc import Iterable

from motet.errors import TextError
from motet.models.codes import CodesModel
from motet_train.evaluate.language.split_store import unknown_words_allowed

OUTSIDE = (
    "a person plays the violin",
    "someone paints a wall with a brush",
    "a man types on a keyboard",
    "a woman brushes her teeth",
    "a person rides a bicycle",
    "somebody swims the butterfly stroke",
    "a man shaves his beard",
    "a person reads a newspaper",
    "a girl skips with a rope",
    "a man digs a hole with a shovel",
    "a person plays table tennis",
    "someone puts on a jacket",
    "a man plays the drums",
    "a woman rocks a baby",
    "a person casts a fishing rod",
    "someone shoots an arrow with a bow",
    "a man lifts a barbell",
    "a person bakes a cake",
    "someone drives a car",
    "a man rows a boat",
    "a person irons a shirt",
    "someone cuts bread with a knife",
    "a man plays golf on a phone",
    "a woman combs her hair",
    "a person takes a photo",
    "someone skis down a hill",
    "a man saws a plank",
    "a person conducts an orchestra",
    "someone waters the flowers",
    "a man hammers a nail",
    "a person opens an umbrella",
    "a woman plays the piano",
    "someone throws a frisbee",
    "a man plays basketball and dunks",
    "a person yawns and stretches",
    "someone blows out candles",
    "a person surfs on a wave",
    "a man does push ups",
    "a woman does yoga in the lotus position",
    "someone pours coffee into a cup",
)
"""Everyday actions that none of the recorded trials shows."""


def said_to_be_outside(model: CodesModel, sentences: Iterable[str]) -> float:
    """The share of sentences that are refused, or said to be outside of what a model knows."""
    with unknown_words_allowed():
        found = [_outside(model, sentence) for sentence in sentences]
    return sum(found) / len(found)


def _outside(model: CodesModel, sentence: str) -> bool:
    try:
        return not model.understood(sentence).confident
    except TextError:
        return True
