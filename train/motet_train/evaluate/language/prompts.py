"""Whether generated motions do what was asked: walk, run, turn left or right, jump, measured on the root block.

The thresholds are those of the training motions, by what was said about them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from motet.errors import TextError
from motet.models.generate import GenerateModel
from motet.motion.motion import Motion
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS
from motet_train.evaluate.language.attributes import common_side, common_verbs, turns
from motet_train.evaluate.language.corpus import Corpus

SEEDS = 10


class Travel(NamedTuple):
    """How a motion moves over the ground.

    speed: the median forward, m/s, which a stop does not change. turn: the sum to the left, degrees. rise: the highest
    above the median height of the root, m.
    """

    speed: float
    turn: float
    rise: float


@dataclass(frozen=True)
class Thresholds:
    """What counts as what.

    slow: m/s, half of the speed that nine of ten training walks exceed. run: m/s, between the median speeds of walks
    and of runs. turn: degrees, between the median turns of straight and of turning ones. rise: m, between the median
    rises of walks and of jumps.
    """

    slow: float
    run: float
    turn: float
    rise: float


ASKED: Mapping[str, tuple[str, Callable[[Travel, Thresholds], bool]]] = {
    "walks": ("a person walks", lambda travel, limits: limits.slow <= travel.speed < limits.run),
    "runs": ("a person runs", lambda travel, limits: travel.speed >= limits.run),
    "left": ("a person walks and turns left", lambda travel, limits: travel.turn >= limits.turn),
    "right": ("a person walks and turns right", lambda travel, limits: travel.turn <= -limits.turn),
    "jumps": ("a person jumps", lambda travel, limits: travel.rise >= limits.rise),
}
"""Key -> the sentence, and whether a motion is what it says."""


def travel(motion: Motion) -> Travel:
    """How a motion with the root block moves; what its first frame says of velocities repeats the second."""
    block = motion.select(ROOT_BLOCK, ROOT_BLOCK_UNITS).values
    steps, height = block[1:], block[:, 3]
    forward = float(np.median(steps[:, 0])) if len(steps) else 0.0
    return Travel(forward, float(steps[:, 2].sum() / motion.fps), float(height.max() - np.median(height)))


def kinds(corpus: Corpus) -> dict[str, list[Travel]]:
    """How the training motions move that people say walk, run, jump, go straight, turn left, turn right.

    Empty without a root block. A motion that does two of walking, running and jumping is none of them.
    """
    found: dict[str, list[Travel]] = {key: [] for key in (*ASKED, "straight")}
    if set(ROOT_BLOCK) <= set(corpus.store.channels):
        for record in corpus.described(corpus.parts.train):
            for kind in _kinds(corpus.sentences(record)):
                found[kind].append(travel(corpus.motion(record)))
    return found


def thresholds(found: Mapping[str, Sequence[Travel]]) -> Thresholds | None:
    """The thresholds between :func:`kinds`; None where there are no motions of some kind."""
    if not all(found.values()):
        return None
    speeds, rises = ({key: [getattr(t, name) for t in found[key]] for key in found} for name in ("speed", "rise"))
    turning = [abs(t.turn) for key in ("left", "right") for t in found[key]]
    return Thresholds(
        slow=float(np.percentile(speeds["walks"], 10)) / 2,
        run=_between(speeds["walks"], speeds["runs"]),
        turn=_between([abs(t.turn) for t in found["straight"]], turning),
        rise=_between(rises["walks"], rises["jumps"]),
    )


def recognised(found: Mapping[str, Sequence[Travel]], limits: Thresholds) -> dict[str, float]:
    """For each of ASKED the share of the training motions of that kind that count as such: what a model can reach."""
    return {key: float(np.mean([is_so(t, limits) for t in found[key]])) for key, (_, is_so) in ASKED.items()}


def _kinds(sentences: Sequence[str]) -> list[str]:
    verbs, turning, side = common_verbs(sentences), turns(sentences), common_side(sentences)
    found = [f"{verb}s" for verb in verbs if len(verbs) == 1]
    if turning is False:
        found.append("straight")
    elif turning and side:
        found.append(side)
    return found


def _between(*samples: Sequence[float]) -> float:
    return float(np.mean([np.median(sample) for sample in samples]))


def prompted(model: GenerateModel, limits: Thresholds, seeds: int = SEEDS) -> dict[str, float]:
    """For each of ASKED the share of seeds whose likeliest motion is what the sentence says.

    A sentence of which the model knows no word counts as failed.
    """
    shares = {}
    for key, (sentence, is_so) in ASKED.items():
        try:
            rows = model.generate([sentence] * seeds, seed=range(seeds))
        except TextError:
            rows = []
        shares[key] = sum(is_so(travel(row[0].features), limits) for row in rows) / seeds
    return shares
