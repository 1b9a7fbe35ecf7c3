"""Sentences that ask for several things in a row: whether they are split as meant, and each part is shown in turn."""

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from motet.generate.model import CodesModel, Story
from motet_train.evaluate.tables import Report
from motet_train.evaluate.text_adherence.prompts import holds
from motet_train.evaluate.text_adherence.track import track_of


@cache
def table() -> Mapping[str, Any]:
    """composed.toml: "composed", texts with the rules of each of their parts; "whole", texts that have no parts."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def composed_report(model: CodesModel, seeds: Sequence[int]) -> Report:
    """Shares from 0 to 1. split: of composed texts in as many parts as meant; whole: of the others left whole; order:
    of motions of composed texts in which every part is shown, in this order; parts: of all these parts."""
    rows, whole = table()["composed"], table()["whole"]
    split = {row["text"]: len(model.parts(row["text"])) == len(row["parts"]) for row in rows}
    shown = {row["text"]: [_shown(model, row, seed) for seed in seeds] for row in rows}
    each = [motion for motions in shown.values() for motion in motions]
    return {
        "composed": {
            "split": float(np.mean(list(split.values()))),
            "whole": float(np.mean([len(model.parts(text)) == 1 for text in whole])),
            "order": float(np.mean([all(parts) for parts in each])),
            "parts": float(np.mean([part for parts in each for part in parts])),
        },
        "composed_order": {text: float(np.mean(list(map(all, motions)))) for text, motions in shown.items()},
    }


def _shown(model: CodesModel, row: Mapping[str, Any], seed: int) -> list[bool]:
    """Whether each part of a composed text is shown in its passage; in a motion of other passages, in its part of the
    cut into parts that shows most, at tenths of the motion."""
    (made,) = model.generate(row["text"], seed=seed)
    track, count = track_of(made.motion), len(row["parts"])
    if isinstance(made, Story) and len(made.passages) == count:
        cuts = [[one.stop / made.passages[-1].stop for one in made.passages[:-1]]]
    else:
        cuts = [[cut / 10 for cut in chosen] for chosen in combinations(range(1, 10), count - 1)]
    parts = ([track.part(*edges) for edges in pairwise((0.0, *cut, 1.0))] for cut in cuts)
    found = ([holds(part, rules) for part, rules in zip(own, row["parts"], strict=True)] for own in parts)
    return max(found, key=sum)
