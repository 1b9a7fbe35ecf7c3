"""Sentences that ask for several things, and with numbers: what of them is shown."""

import numpy as np
import pytest
from says_figures import led, part, standing, walking

from motet.figures.humanoid import HUMANOID
from motet_train.evaluate.text_adherence import composed, numbers
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
    monkeypatch.setattr(composed, "COMPOSED_TEXTS", {"composed": rows, "whole": ["walk, on", "stand"]})
    walked = walking(seconds=3)
    stood = standing(3) + (walked[-1] - standing(3)[0])[None]
    monkeypatch.setattr(composed, "track_of", lambda _: Track(np.concatenate([walked, stood])))
    report = composed.composed_report(Told(), seeds=[0, 1])  # type: ignore[arg-type]
    assert report["composed_order"] == {"walk, stand": 1, "stand, walk": 0}
    assert report["composed"]["split"] == 1
    assert report["composed"]["whole"] == 0.5
    assert report["composed"]["order"] == 0.5


def test_the_table_names_rules_that_exist() -> None:
    table = composed.COMPOSED_TEXTS
    assert len(table["composed"]) == 20
    assert all(len(row["parts"]) > 1 for row in table["composed"])
    assert {rule["is"] for row in table["composed"] for part in row["parts"] for rule in part} <= set(RULE_BY_NAME)


def test_degrees_metres_and_seconds_of_a_walk() -> None:
    track = Track(walking(seconds=4))
    metres = numbers.measured(track, "metres")
    assert numbers.met(track, {"text": "", "metres": metres * 1.09})
    assert not numbers.met(track, {"text": "", "metres": metres * 1.2})
    assert numbers.met(track, {"text": "", "seconds": 4.1})
    assert not numbers.met(track, {"text": "", "seconds": 4.2})
    assert not numbers.met(track, {"text": "", "degrees": 30})


@pytest.mark.parametrize("degrees", [30, -135, 450])
def test_degrees_are_those_of_the_hips_from_the_first_to_the_last_frame(degrees: float) -> None:
    still, turned = standing(4), led(standing(4), 0, degrees)
    hips = still.copy()
    for name in ("UpperLeg", "LowerLeg", "Foot", "Toes"):
        hips[:, part(name)] = turned[:, part(name)]
    shoulders = turned.copy()
    shoulders[:, part("UpperLeg")] = still[:, part("UpperLeg")]
    assert numbers.measured(Track(hips), "degrees") == pytest.approx(degrees)
    assert numbers.measured(Track(turned), "degrees") == pytest.approx(degrees)
    assert numbers.measured(Track(shoulders), "degrees") == pytest.approx(0)
    assert numbers.met(Track(hips), {"text": "", "degrees": degrees})
    assert not numbers.met(Track(shoulders), {"text": "", "degrees": degrees})


def test_jumps_and_dips_are_counted() -> None:
    time = np.arange(120) / 30
    hops, dips = standing(4)[:120], standing(4)[:120]
    hops[..., 1] += np.maximum(0, 0.2 * np.sin(2 * np.pi * time))[:, None]
    dips[:, HUMANOID.index("hips"), 1] -= 0.3 * np.sin(np.pi * time / 2) ** 2
    assert numbers.met(Track(hops), {"text": "", "times": 4, "act": "jumps"})
    assert not numbers.met(Track(hops), {"text": "", "times": 3, "act": "jumps"})
    assert numbers.COUNTS_BY_NAME["dips"](Track(dips)) == 2


def test_the_table_has_eight_of_each_kind() -> None:
    for kind in numbers.BARS:
        rows = [row for row in numbers.NUMBERS if kind in row]
        assert len(rows) == 8
        assert {row.get("act") for row in rows} <= ({*numbers.COUNTS_BY_NAME} if kind == "times" else {None})
    with pytest.raises(StopIteration):
        numbers.met(Track(standing(1)), {"text": "nothing"})
