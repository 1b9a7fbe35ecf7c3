"""Whether generated motions do what was asked: walk, run, turn left or right, jump, measured on the root block.

The thresholds are those of the training motions, by what was said about them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from motet.models.generate import GenerateModel
from motet.motion.motion import Motion
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS
from motet_train.evaluate.language.attributes import common_side, common_verbs, turns
from motet_train.evaluate.language.chain import knows
from motet_train.evaluate.language.split_store import SplitStore, unknown_words_allowed


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
    rises of walks and of jumps. NaN where there are no training motions of a kind.
    """

    slow: float
    run: float
    turn: float
    rise: float


class Asked(NamedTuple):
    """A sentence, whether a motion is what it says, and the thresholds that this takes."""

    sentence: str
    is_so: Callable[[Travel, Thresholds], bool]
    needs: tuple[str, ...]


ASKED: Mapping[str, Asked] = {
    "walks": Asked("a person walks", lambda travel, than: than.slow <= travel.speed < than.run, ("slow", "run")),
    "runs": Asked("a person runs", lambda travel, than: travel.speed >= than.run, ("run",)),
    "left": Asked("a person walks and turns left", lambda travel, than: travel.turn >= than.turn, ("turn",)),
    "right": Asked("a person walks and turns right", lambda travel, than: travel.turn <= -than.turn, ("turn",)),
    "jumps": Asked("a person jumps", lambda travel, than: travel.rise >= than.rise, ("rise",)),
}


def travel(motion: Motion) -> Travel:
    """How a motion with the root block moves; what its first frame says of velocities repeats the second."""
    block = motion.select(ROOT_BLOCK, ROOT_BLOCK_UNITS).values
    steps, height = block[1:], block[:, 3]
    forward = float(np.median(steps[:, 0])) if len(steps) else 0.0
    return Travel(forward, float(steps[:, 2].sum() / motion.fps), float(height.max() - np.median(height)))


def kinds(corpus: SplitStore) -> dict[str, list[Travel]]:
    """How the training motions move that people say walk, run, jump, go straight, turn left, turn right.

    Empty without a root block. A motion that does two of walking, running and jumping is none of them.
    """
    found: dict[str, list[Travel]] = {key: [] for key in (*ASKED, "straight")}
    if set(ROOT_BLOCK) <= set(corpus.store.channels):
        for record in corpus.described(corpus.parts.train):
            for kind in _kinds(corpus.sentences(record)):
                found[kind].append(travel(corpus.motion(record)))
    return found


def thresholds(found: Mapping[str, Sequence[Travel]]) -> Thresholds:
    """The thresholds between :func:`kinds`."""
    speeds, rises = ({key: [getattr(t, name) for t in found[key]] for key in found} for name in ("speed", "rise"))
    turning = [abs(t.turn) for key in ("left", "right") for t in found[key]]
    return Thresholds(
        slow=float(np.percentile(speeds["walks"], 10)) / 2 if speeds["walks"] else np.nan,
        run=_between(speeds["walks"], speeds["runs"]),
        turn=_between([abs(t.turn) for t in found["straight"]], turning),
        rise=_between(rises["walks"], rises["jumps"]),
    )


def measurable(limits: Thresholds) -> dict[str, Asked]:
    """Those of ASKED whose thresholds exist."""
    return {
        key: asked for key, asked in ASKED.items() if all(np.isfinite(getattr(limits, name)) for name in asked.needs)
    }


def recognised(found: Mapping[str, Sequence[Travel]], limits: Thresholds) -> dict[str, float]:
    """What a model can reach: for each measurable one of ASKED the share of the training motions of that kind that
    count as such; NaN where there are none."""
    return {
        key: float(np.mean([asked.is_so(t, limits) for t in found[key]])) if found[key] else np.nan
        for key, asked in measurable(limits).items()
    }


def _kinds(sentences: Sequence[str]) -> list[str]:
    verbs, turning, side = common_verbs(sentences), turns(sentences), common_side(sentences)
    found = [f"{verb}s" for verb in verbs if len(verbs) == 1]
    if turning is False:
        found.append("straight")
    elif turning and side:
        found.append(side)
    return found


def _between(*samples: Sequence[float]) -> float:
    return float(np.mean([np.median(sample) for sample in samples])) if all(samples) else np.nan


def prompted(model: GenerateModel, limits: Thresholds, seeds: int = 10) -> dict[str, float]:
    """For each measurable one of ASKED the share of seeds whose likeliest motion is what the sentence says.

    A sentence of which the model knows no word counts as failed.
    """
    shares = {}
    for key, asked in measurable(limits).items():
        known = knows(model, asked.sentence)
        with unknown_words_allowed():
            rows = model.generate([asked.sentence] * seeds, seed=range(seeds)) if known else []
        shares[key] = sum(asked.is_so(travel(row[0].features), limits) for row in rows) / seeds
    return shares
