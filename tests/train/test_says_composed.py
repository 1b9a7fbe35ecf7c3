"""The judge of composed sentences, on motions of known order."""

import numpy as np
import pytest
from says_figures import standing, walking

from motet_train.evaluate.text_adherence import composed
from motet_train.evaluate.text_adherence.prompts import RULE_BY_NAME
from motet_train.evaluate.text_adherence.track import Track


class Told:
    """A model that always walks and then stands, and splits texts at commas."""

    motion = None

    def parts(self, text: str) -> list[str]:
        return text.split(", ")

    def generate(self, text: str, seed: int) -> "list[Told]":
        return [self]


def test_parts_count_only_in_the_order_in_which_they_are_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    forward, still = [{"is": "goes", "way": "forward", "least": 0.5}], [{"is": "still"}]
    rows = [{"text": "walk, stand", "parts": [forward, still]}, {"text": "stand, walk", "parts": [still, forward]}]
    monkeypatch.setattr(composed, "TABLE", {"composed": rows, "whole": ["walk, on", "stand"]})
    walked = walking(seconds=3)
    stood = standing(3) + (walked[-1] - standing(3)[0])[None]
    monkeypatch.setattr(composed, "track_of", lambda _: Track(np.concatenate([walked, stood])))
    report = composed.composed_report(Told(), seeds=[0, 1])  # type: ignore[arg-type]
    assert report["composed_order"] == {"walk, stand": 1, "stand, walk": 0}
    assert report["composed"]["split"] == 1
    assert report["composed"]["whole"] == 0.5
    assert report["composed"]["order"] == 0.5


def test_the_table_names_rules_that_exist() -> None:
    table = composed.TABLE
    assert len(table["composed"]) == 20
    assert all(len(row["parts"]) > 1 for row in table["composed"])
    assert {rule["is"] for row in table["composed"] for part in row["parts"] for rule in part} <= set(RULE_BY_NAME)
