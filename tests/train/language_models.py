"""A corpus of five kinds of motions whose measures are known, and models whose answers to it are known."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from language_data import SKELETON

from motet.errors import TextError
from motet.models.describe import Description, Part
from motet.motion.motion import Motion
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS
from motet.search.model import IndexSettings
from motet_train.data.store import Entry, Store
from motet_train.evaluate.language.split_store import plain

FPS, FRAMES = 10.0, 21
HEIGHT = 0.85  # of the hips above the feet of SKELETON
CHANNELS = (*ROOT_BLOCK, "left_leg.rx", "right_leg.rx")
UNITS = (*ROOT_BLOCK_UNITS, "deg", "deg")

KINDS: Mapping[str, tuple[float, float, float]] = {
    "walks": (1.0, 0.0, 0.0),
    "runs": (3.0, 0.0, 0.0),
    "walks and turns left": (1.0, 90.0, 0.0),
    "walks and turns right": (1.0, -90.0, 0.0),
    "jumps": (0.2, 0.0, 0.5),
}
"""What is said -> speed in m/s, degrees turned in all, rise in m."""


def moving(speed: float, turn: float, rise: float, swing: float = 10.0) -> Motion:
    """Two seconds of a figure with legs that swing against each other."""
    time = np.arange(FRAMES) / FPS
    values = np.zeros((FRAMES, len(CHANNELS)))
    values[:, 0], values[:, 2] = speed, turn / 2
    values[:, 3] = HEIGHT + rise * (time == 1.0)
    values[:, 6] = swing * np.sin(5 * time)
    values[:, 7] = -values[:, 6]
    return Motion(values, CHANNELS, UNITS, FPS, SKELETON)


def small_store(each: int = 6) -> Store:
    """The kinds in turn, each record with a swing of its own and three sentences, the last with a word of its own."""
    motions, entries = [], []
    for i in range(each * len(KINDS)):
        kind = list(KINDS)[i % len(KINDS)]
        motions.append(moving(*KINDS[kind], swing=10.0 + 0.1 * i).values)
        sentences = (f"A person {kind}.", f"Somebody quickly {kind} here", f"the {kind} of {'x' * (i + 1)} are seen")
        entries.append(Entry(f"{i:02}", f"{i // 10}", sentences, ((i * FRAMES, (i + 1) * FRAMES),), 0))
    frames = np.concatenate(motions).astype(np.float32)
    return Store(frames, "root_angles", CHANNELS, UNITS, FPS, (SKELETON,), tuple(entries), ())


STORE = small_store()


def manifest(store: Store, verb: str, by: str = "trial") -> dict[str, Any]:
    """What a run says that left the last ten records, two of each kind, for validation and test."""
    names = [entry.name for entry in store.records]
    split = {"by": by, "train": len(names) - 10, "validation": names[-10:-5], "test": names[-5:]}
    training = {"split": split, "seconds": 1.5, "epochs": 3}
    return {"name": f"fake-{verb}", "verb": verb, "training": training}


def told(store: Store, verb: str) -> Any:
    """The same as a model has it."""
    return SimpleNamespace(**manifest(store, verb))


class FakeDescribe:
    """Says of each motion of the store what people said of it, in their order; of others that somebody dances."""

    fps = FPS

    def __init__(self, store: Store) -> None:
        self.manifest = told(store, "describe")
        self.said = {store.sequence(i).tobytes(): entry.sentences for i, entry in enumerate(store.records)}

    def describe(self, motions: Sequence[Motion], beams: int = 5) -> list[list[Description]]:
        rows = [self.said.get(motion.values.astype(np.float32).tobytes(), ("somebody dances",)) for motion in motions]
        return [[Description(plain(text), -i, -i, True) for i, text in enumerate(row[:beams])] for row in rows]

    def timeline(self, motion: Motion) -> list[Part]:
        """A part for each motion of the store."""
        starts = range(0, len(motion), FRAMES)
        said = [self.describe([motion[start : start + FRAMES]], 1)[0][0] for start in starts]
        return [
            Part(**asdict(one), start=s / FPS, stop=(s + FRAMES) / FPS) for one, s in zip(said, starts, strict=True)
        ]

    def score(self, motion: Motion, sentence: str) -> float:
        return -2.0 * (len(sentence.split()) + 1)


@dataclass(frozen=True, eq=False)
class Answer:
    """What is measured of a generated motion."""

    features: Motion
    log_likelihood: float


class FakeGenerate:
    """Gives the very motion that a sentence was said about first; knows all sentences with a known kind in them."""

    fps = FPS

    def __init__(self, store: Store) -> None:
        self.manifest = told(store, "generate")
        self.motions = {
            plain(sentence): Motion(store.sequence(i), store.channels, store.units, FPS, store.skeleton)
            for i, entry in reversed(list(enumerate(store.records)))
            for sentence in entry.sentences
        }

    def unknown(self, sentence: str) -> list[str]:
        if sentence not in self.motions:
            raise TextError(f"no word of {sentence} is known")
        return []

    def generate(self, sentences: Sequence[str], hypotheses: int = 2, seed: Iterable[int] = ()) -> list[list[Answer]]:
        return [[Answer(self.motions[plain(text)], -1.0)] * hypotheses for text in sentences]

    def score(self, sentence: str, motion: Motion) -> float:
        return -3.0 * (len(motion) + 1)


class WholeMotions:
    """Makes a search model see each motion as one window."""

    def settings(self, kind: type[IndexSettings]) -> IndexSettings:
        return kind()

    def windows(self, motion: Motion, longest: float) -> list[tuple[float, Motion]]:
        return [(0.0, motion)]
