"""Sentences that ask for several actions in a row: whether they are split correctly, and each part is shown in turn."""

from collections.abc import Sequence
from itertools import combinations, pairwise
from typing import Any

import numpy as np

from motet.bundle.fields import Json
from motet.generate.base import Story
from motet.generate.model import CodesModel
from motet_train.data.table import read_toml
from motet_train.evaluate.tables import Report
from motet_train.evaluate.text_adherence.prompts import holds
from motet_train.evaluate.text_adherence.track import Track, track_of

COMPOSED_TEXTS = read_toml(__file__, "composed.toml")
"""Texts with the rules of each of their parts, "composed", and texts that have no parts, "whole"."""


def composed_report(model: CodesModel, seeds: Sequence[int]) -> Report:
    """Shares from 0 to 1. split: of composed texts with the right number of parts; whole: of the others that are left
    whole; order: of motions of composed texts that show every part, in order; parts: of all these parts."""
    split = []
    all_parts: list[list[bool]] = []
    orders = {}
    for row in COMPOSED_TEXTS["composed"]:
        split.append(len(model.parts(row["text"])) == len(row["parts"]))
        motions = [_shown(model, row, seed) for seed in seeds]
        orders[row["text"]] = float(np.mean([all(parts) for parts in motions]))
        all_parts += motions
    # texts that must not be split
    whole = [len(model.parts(text)) == 1 for text in COMPOSED_TEXTS["whole"]]
    return {
        "composed": {
            "split": float(np.mean(split)),
            "whole": float(np.mean(whole)),
            "order": float(np.mean([all(parts) for parts in all_parts])),
            "parts": float(np.mean(np.concatenate(all_parts))),
        },
        "composed_order": orders,
    }


def _shown(model: CodesModel, row: Json, seed: int) -> list[bool]:
    """Whether each part of a composed text is shown in its passage. A motion with another number of passages is cut at
    tenths of its duration where most parts are shown."""
    (generated,) = model.generate(row["text"], seed=seed)
    track = track_of(generated.motion)
    count = len(row["parts"])
    # the passages if they are the parts, else all ways to cut
    if isinstance(generated, Story) and len(generated.passages) == count:
        end = generated.passages[-1].stop
        cuts = [[passage.stop / end for passage in generated.passages[:-1]]]
    else:
        cuts = (np.array(list(combinations(range(1, 10), count - 1))) / 10).tolist()
    return max((_shown_between(track, row["parts"], cut) for cut in cuts), key=sum)


def _shown_between(track: Track, parts: Sequence[Any], cuts: Sequence[float]) -> list[bool]:
    """Whether each part is shown between its cuts, shares of the duration."""
    flags = []
    for (start, stop), rules in zip(pairwise((0.0, *cuts, 1.0)), parts, strict=True):
        flags.append(holds(track.part(start, stop), rules))
    return flags
