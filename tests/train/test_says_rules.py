"""The rules of "does what it says", on figures whose doings are known and on the recorded trials that motet carries."""

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from says_figures import HIPS, leaping, led, shifted, standing, stepping, times, tipped, walking, whole_tipped

from motet.figures.humanoid.bones import HUMANOID
from motet.figures.humanoid.retarget import to_humanoid
from motet.formats import read_motion
from motet.motion.mirroring import mirror
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.errors import DataError
from motet_train.evaluate.text_adherence.prompts import EVERYDAY_PROMPTS, RULE_BY_NAME, actions, holds
from motet_train.evaluate.text_adherence.track import RATE, Track, calm, longest, spells, swings, track_of

WAVE = np.sin(2 * np.pi * times(2.0))


def arms(points: np.ndarray, left: tuple[float, float, float], right: tuple[float, float, float]) -> np.ndarray:
    """Points with the hands at places seen from the shoulders (side, up, front), the elbows half way."""
    found = points.copy()
    for side, sign, place in (("left", 1, left), ("right", -1, right)):
        shoulder = found[:, HUMANOID.index(f"{side}UpperArm")]
        for part, share in (("LowerArm", 0.5), ("Hand", 1.0), ("Hand_end", 1.2)):
            found[:, HUMANOID.index(f"{side}{part}")] = shoulder + share * np.array(place) * [sign, 1, 1]
    return found


def hand(y: object = 0, z: object = 0, x: object = 0, side: str = "right", seconds: float = 2.0) -> np.ndarray:
    """Points of a figure that moves one hand."""
    return shifted(standing(seconds), f"{side}Hand", x=x, y=y, z=z)


def crouched(depth: object, seconds: float = 2.0) -> np.ndarray:
    """Points of a figure on bent knees: all but the feet lower by so many metres, the knees forward."""
    points = standing(seconds)
    down = np.broadcast_to(depth, len(points))
    low = shifted(shifted(points, "", y=-down), "Foot", y=down)
    low = shifted(low, "Toes", y=down)
    return shifted(low, "LowerLeg", y=down / 2, z=1.2 * down)


def lifted(side: str, height: object, z: object = 0, seconds: float = 2.0) -> np.ndarray:
    """Points of a figure with one foot that much higher, and in front."""
    points = standing(seconds)
    for name in (f"{side}Foot", f"{side}Toes"):
        points = shifted(points, name, y=height, z=z)
    return points


def seated() -> np.ndarray:
    """Points of a figure on a chair of half a metre."""
    points = shifted(standing(), "", y=-0.4)
    for name in ("LowerLeg", "Foot", "Toes"):
        points = shifted(points, name, y=0.35 if name == "LowerLeg" else 0.4, z=0.4)
    return points


def twisting() -> np.ndarray:
    """Points of a figure whose shoulders turn to and fro by 50 degrees to each side."""
    points, angle = standing(), np.radians(50) * WAVE
    for i, name in enumerate(HUMANOID.names):
        if "Arm" in name or "Hand" in name or "Shoulder" in name:
            x = points[:, i, 0].copy()
            points[:, i, 0], points[:, i, 2] = x * np.cos(angle), -x * np.sin(angle)
    return points


GUARD = arms(standing(), (-0.05, -0.05, 0.3), (-0.05, -0.05, 0.3))
HALF = np.arange(61) >= 30
JACK = arms(shifted(shifted(standing(), "leftFoot", x=0.3), "rightFoot", x=-0.3), (0.2, 0.5, 0), (0.2, 0.5, 0))
JACKS = np.where((np.arange(61) % 20 < 10)[:, None, None], JACK, standing())
FALLEN = np.concatenate([standing(1), whole_tipped(90, 0.2, 1)])
FLIPPED = np.concatenate([standing(1), whole_tipped(180, 1.4, 1)])
DOWN = np.clip(times(2.0) - 0.5, 0, 1)

CASES: list[tuple[str, dict[str, Any], np.ndarray, np.ndarray]] = [
    ("goes", {"way": "forward", "least": 1.1, "most": 1.3, "metres": 4}, walking(1.2), walking(0.8)),
    ("goes", {"way": "backward", "least": 0.5}, walking(1.2, way=180), walking(1.2)),
    ("goes", {"way": "left", "least": 0.5}, walking(1.2, way=90), walking(1.2, way=-90)),
    ("goes", {"way": "right", "least": 0.5}, walking(1.2, way=-90, turn=170), walking(1.2, way=90)),
    ("sidesteps", {"side": "left", "metres": 0.35}, walking(0.3, way=80), walking(0.3, way=40)),
    ("travels", {"metres": 2}, walking(1.0), walking(1.0, turn=360)),
    ("wanders", {}, walking(1.0, turn=360), walking(1.0)),
    ("turns", {"least": 85, "most": 95}, walking(turn=95), walking(turn=-95)),
    ("turns", {"least": -135, "most": -120}, walking(turn=-135), walking(turn=-90)),
    ("turned_about", {"least": 300}, led(standing(), 0, 360), led(standing(), 0, 180)),
    ("straight", {}, walking(turn=20), walking(turn=60)),
    ("starts", {"most": 0.3}, led(standing(), HALF), led(standing(), ~HALF)),
    ("ends", {"least": 0.5}, led(standing(), HALF), led(standing(), ~HALF)),
    ("reaches", {"least": 2, "most": 3}, led(standing(), 2.5 * HALF), led(standing(), 1)),
    ("stays", {"most": 1}, led(standing(), 0.4), led(standing(), 0.6)),
    ("strides", {"least": 6}, stepping(4.0), stepping(4.0, stride=0.05)),
    ("bobs", {"metres": 0.1}, shifted(standing(), "hips", y=0.1 * WAVE), shifted(standing(), "hips", y=0.03 * WAVE)),
    ("rises_and_falls", {"metres": 0.3, "count": 4}, shifted(standing(), "hips", y=0.4 * WAVE), standing()),
    ("hips", {"least": 0.9, "most": 1.0}, standing(), crouched(0.2)),
    ("jumps", {"rise": 0.35, "most_metres": 0.1}, leaping(0.4), leaping(0.3)),
    ("jumps", {"rise": 0.2, "metres": 0.8, "count": 2}, leaping(0.4, 1.0, 2), leaping(0.4, 0.5, 2)),
    ("jumps", {"rise": 0.2, "most_metres": 0.4}, leaping(0.4, 0.3), leaping(0.4, 0.5)),
    ("hops", {}, shifted(lifted("left", 0.3), "hips", y=0.1 * WAVE), shifted(standing(), "hips", y=0.1 * WAVE)),
    ("kicks", {"side": "left", "height": 0.8}, lifted("left", 0.9 * HALF), lifted("right", 0.9 * HALF)),
    ("kicks", {"side": "either", "height": 0.8}, lifted("right", 0.9 * HALF), lifted("right", 0.5 * HALF)),
    ("on_one_leg", {"seconds": 1.5}, lifted("right", 0.3), lifted("right", 0.3 * HALF)),
    ("jumping_jacks", {"count": 3}, JACKS, standing()),
    ("lifts_feet", {"height": 0.08}, stepping(2.0), lifted("left", 0.3)),
    ("steps_a_second", {"least": 1.5}, stepping(4.0), stepping(4.0, rate=0.5)),
    ("raises", {"side": "left", "above": 0.2}, hand(1.1, side="left"), hand(1.1)),
    ("raises", {"side": "both", "above": 0.2}, shifted(standing(), "Hand", y=1.1), hand(1.1)),
    ("raises", {"side": "either", "above": 0.2}, hand(1.1), hand(0.8)),
    ("waves", {"count": 4}, hand(0.7, x=0.2 * WAVE), hand(0.1, x=0.2 * WAVE)),
    ("punches", {"side": "right", "speed": 2}, hand(0.4, z=0.5 * HALF), hand(0.4, z=0.5 * HALF, side="left")),
    ("punches", {"side": "both", "speed": 2}, shifted(standing(), "Hand", z=0.5 * HALF), hand(z=0.5 * HALF)),
    ("reaches_down", {"side": "both", "most": 0.5}, shifted(standing(), "Hand", y=-0.5), hand(-0.5)),
    ("reaches_down", {"most": 0.5}, hand(-0.5), standing()),
    ("wipes", {"count": 4}, hand(0.5, z=0.4, x=0.3 * WAVE), hand(0.5, x=0.3 * WAVE)),
    ("to_mouth", {}, hand(0.7, x=0.1, z=0.15), hand(0.1)),
    ("on_guard", {"share": 0.9}, GUARD, standing()),
    ("hands_together", {"most": 0.3}, GUARD, standing()),
    ("arms_out", {}, arms(standing(), (0.5, 0, 0), (0.5, 0, 0)), GUARD),
    ("arms_ahead", {}, arms(standing(), (0, 0, 0.5), (0, 0, 0.5)), GUARD),
    ("swings_arms", {"count": 4, "metres": 0.3}, shifted(standing(), "Hand", z=0.4 * WAVE), hand(z=0.4 * WAVE)),
    ("hands_still", {"most": 0.1}, standing(), hand(z=0.2 * WAVE)),
    ("hands_move", {"least": 0.3, "most": 1}, shifted(standing(), "Hand", z=0.2 * WAVE), standing()),
    ("hands_fast", {"least": 1}, hand(z=0.2 * WAVE), hand(z=0.1 * WAVE)),
    ("lies", {"when": "start"}, whole_tipped(90, 0.2), standing()),
    ("lies", {"when": "end"}, whole_tipped(90, 0.2), FALLEN[::-1]),
    ("prone", {"share": 0.5}, whole_tipped(85, 0.3), standing()),
    ("comes_up", {"metres": 0.3}, crouched(0.4 - 0.4 * DOWN), crouched(0.4 * DOWN)),
    ("comes_up", {"metres": -0.3}, crouched(0.4 * DOWN), crouched(0.4 - 0.4 * DOWN)),
    ("crouches", {"when": "end"}, crouched(0.45 * DOWN), crouched(0.45 - 0.45 * DOWN)),
    ("crouches", {"hips": 0.4}, crouched(0.6), crouched(0.5)),
    ("upright", {"when": "start"}, crouched(0.45 * DOWN), crouched(0.45 - 0.45 * DOWN)),
    ("sits", {}, seated(), crouched(0.45)),
    ("bends", {"degrees": 40, "seconds": 1}, tipped(45), tipped(45 * HALF[::-1] * HALF)),
    ("bows", {}, tipped(40 * np.sin(np.pi * times(2.0) / 2)), tipped(40 * DOWN)),
    ("upside_down", {}, FLIPPED, FALLEN),
    ("rolls", {}, whole_tipped(170, 0.5), FLIPPED),
    ("ducks", {}, crouched(0.3 * np.sin(np.pi * times(2.0) / 2)), crouched(0.3 * DOWN)),
    ("still", {}, standing(), hand(z=2 * WAVE)),
    ("sways", {"count": 4}, shifted(standing(), "upperChest", x=0.2 * WAVE), standing()),
    ("twists", {"count": 4}, twisting(), standing()),
    ("climbs", {"metres": 0.3}, shifted(standing(4), "", y=0.5 * (times(4) > 1)), shifted(standing(4), "", y=0.5)),
    ("feet_stay", {}, tipped(40), led(standing(), 0.5)),
    ("lasts", {"seconds": 1.5}, standing(2.0), standing(1.0)),
]
"""Rule, parameters, what it is true of, and what it is false of."""


@pytest.mark.parametrize(("rule", "given", "yes", "no"), CASES, ids=[f"{i}-{case[0]}" for i, case in enumerate(CASES)])
def test_rules_tell_figures_apart(rule: str, given: dict[str, Any], yes: np.ndarray, no: np.ndarray) -> None:
    assert RULE_BY_NAME[rule](Track(yes), **given) is True
    assert RULE_BY_NAME[rule](Track(no), **given) is False


def test_every_rule_is_told_apart_and_asked_for() -> None:
    assert {case[0] for case in CASES} == set(RULE_BY_NAME)
    asked = [rule for prompt in EVERYDAY_PROMPTS for rule in prompt.rules]
    assert {rule["is"] for rule in asked} == set(RULE_BY_NAME)
    for rule in asked:
        inspect.signature(RULE_BY_NAME[rule["is"]]).bind(
            None, **{key: value for key, value in rule.items() if key != "is"}
        )


@pytest.mark.parametrize("rule", RULE_BY_NAME)
def test_a_single_frame_is_judged(rule: str) -> None:
    """Every prompt can be put to a motion of one frame; nothing is done in so short a time."""
    (given,) = [case[1] for case in CASES if case[0] == rule][:1]
    assert RULE_BY_NAME[rule](Track(standing()[:1]), **given) in (True, False)
    assert not holds(Track(standing()[:1]), [{"is": rule, **given}])


def test_turn_and_velocity_of_a_walk_that_turns() -> None:
    found = Track(walking(1.5, turn=90))
    assert found.turn == pytest.approx(90 * (1 - 0.3 / 4), abs=1)  # between the middles of the first and last 0.3 s
    np.testing.assert_allclose(found.velocity, [[1.5, 0]] * len(found), atol=0.05)
    assert found.seconds == pytest.approx(4, abs=0.05)


def test_where_a_joint_is_does_not_depend_on_place_and_heading() -> None:
    here = Track(hand(z=0.4))
    there = Track(led(hand(z=0.4), 1.0, turn=200))
    np.testing.assert_allclose(there.body("rightHand"), here.body("rightHand"), atol=1e-9)
    np.testing.assert_allclose(here.body("leftFoot")[0], [0.09, 0.08, 0.0], atol=1e-9)
    np.testing.assert_allclose(here.body("hips")[0], [0, HIPS, 0], atol=1e-9)


def test_a_part_keeps_the_ground() -> None:
    found = Track(leaping(0.5, jumps=3))
    flight = found.part(0.17, 0.27)
    assert flight.ground == found.ground == pytest.approx(0, abs=0.01)
    assert flight.height("hips").min() > HIPS + 0.1
    assert len(found.part(1.0, 1.0)) == 1


def test_swings_count_turning_points() -> None:
    time = np.linspace(0, 3, 300)
    assert swings(np.sin(2 * np.pi * time), 0.5) == 7  # up, then down and up three times
    assert swings(np.sin(2 * np.pi * time), 2.1) == 0
    assert swings(np.linspace(0, 5, 100), 1.0) == 1
    noise = 0.05 * np.random.default_rng(0).standard_normal(300)
    assert swings(np.sin(2 * np.pi * time) + noise, 0.5) == 7
    assert swings(-np.sin(2 * np.pi * time), 0.5) == 7


def test_calm_is_a_mean_over_the_window_that_there_is() -> None:
    values = np.random.default_rng(1).standard_normal((40, 2))
    half = 4  # 0.3 s at 30 frames a second
    naive = [values[max(0, i - half) : i + half + 1].mean(axis=0) for i in range(len(values))]
    np.testing.assert_allclose(calm(values, 0.3), naive)
    np.testing.assert_allclose(calm(values, 0.0), values)


def test_spells() -> None:
    flags = np.array([1, 1, 0, 0, 1, 0, 1, 1, 1], dtype=bool)
    assert spells(flags) == [(0, 2), (4, 5), (6, 9)]
    assert longest(flags) == pytest.approx(3 / RATE)
    assert spells(~flags | flags) == [(0, 9)]
    assert longest(flags & ~flags) == 0


def test_a_track_is_of_the_humanoid() -> None:
    for shape in ((5, 7, 3), (0, len(HUMANOID.names), 3)):
        with pytest.raises(DataError, match="positions of the humanoid's joints"):
            Track(np.zeros(shape))


@pytest.fixture(scope="module")
def recorded() -> dict[str, Track]:
    names = ("39_14", "09_07", "02_06")
    motions = {name: to_humanoid(read_motion(CMU_FOLDER / f"{name}.amc")).motion for name in names}
    found = {name: track_of(motion) for name, motion in motions.items()}
    return found | {f"{name} mirrored": track_of(mirror(motion)) for name, motion in motions.items()}


def passed(track: Track) -> set[str]:
    return {prompt.text for prompt in EVERYDAY_PROMPTS if prompt.passes(track)}


def test_recorded_trials_do_what_they_show(recorded: dict[str, Track]) -> None:
    walk, run, bend = (passed(recorded[name]) for name in ("39_14", "09_07", "02_06"))
    assert "a person walks straight forward" in walk
    assert not any("run" in text or "jump" in text or "kick" in text or "turns" in text for text in walk)
    assert {"a person runs straight forward", "someone is jogging"} <= run
    assert not any("walk" in text or "turn" in text or "jump" in text for text in run)
    assert not any("walk" in text or "run" in text or "kick" in text for text in bend)


def test_mirrored_trials_do_the_same_on_the_other_side(recorded: dict[str, Track]) -> None:
    for name in ("39_14", "09_07", "02_06"):
        here, there = recorded[name], recorded[f"{name} mirrored"]
        assert there.turn == pytest.approx(-here.turn, abs=1.0)
        swapped = {text.replace("left", "*").replace("right", "left").replace("*", "right") for text in passed(there)}
        assert swapped - {"a person twists the upper body right and left"} == passed(here)


def test_a_motion_is_seen_the_same_at_any_frame_rate() -> None:
    motion = read_motion(CMU_FOLDER / "39_14.amc")
    whole, slower = track_of(motion), track_of(motion.resample(30))
    assert motion.fps == 120
    assert len(whole) == len(slower)
    assert whole.turn == pytest.approx(slower.turn, abs=0.5)
    np.testing.assert_allclose(whole.pace, slower.pace, atol=0.05)


def test_the_table_of_prompts() -> None:
    found = EVERYDAY_PROMPTS
    assert len(found) >= 60
    assert len({prompt.text for prompt in found}) == len(found)
    assert {prompt.group for prompt in found} == {"locomotion", "rest"}
    assert min(sum(prompt.group == group for prompt in found) for group in ("locomotion", "rest")) >= 30
    known = set(actions().values())
    for prompt in found:
        assert any(prompt.shows(action) for action in known), f"no action shows {prompt.text!r}"
        assert any(prompt.shows(action) is False for action in known)


def test_the_table_of_trials_has_each_trial_once() -> None:
    folder = Path(__file__).parents[2] / "train/motet_train/evaluate/text_adherence/trials.tsv"
    names = [name for line in folder.read_text().splitlines()[1:] for name in line.split("\t")[1].split()]
    assert len(names) == len(set(names)) == len(actions())
    assert actions()["16_01"] == "jump"


def test_the_table_of_results_has_every_prompt_with_its_rules() -> None:
    table = (Path(__file__).parents[2] / "docs/results/says.tsv").read_text(encoding="utf-8")
    rules = {}
    for line in table.splitlines()[1:]:
        cells = line.split("\t")
        rules[cells[1]] = cells[2]
    for prompt in EVERYDAY_PROMPTS:
        assert [rule.split()[0] for rule in rules[prompt.text].split(";")] == [rule["is"] for rule in prompt.rules]
