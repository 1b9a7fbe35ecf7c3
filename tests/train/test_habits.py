"""Heads and collar bones of recordings, mended person by person."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from codes_data import small_store
from stores import prepare

from motet import to_humanoid
from motet.figures.humanoid.bones import HUMANOID
from motet.formats import read_motion
from motet.motion.kinematics import global_transforms, local_rotations, posed
from motet.motion.motion import Motion
from motet.motion.rotations import Array, axis_to_rotmat
from motet.representation.contract import named
from motet.steering.recorded import COLLAR_SLOPE
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.corpus import Record
from motet_train.data.habits import HEAD_PITCH, without_habits
from motet_train.data.preparation import Preparation
from motet_train.data.store import Store

AS_RECORDED = Preparation("root_sixd", humanoid=True, trim=False, cut=False, fps=30.0)

LOOKS_DOWN = {"A": 12.0, "B": 25.0, "never walks": 0.0}
"""Degrees that each person's head is pitched forward by, besides how the recorded walker holds it."""

DROOPS = {"A": 0.0, "B": 30.0, "never walks": 20.0}
"""Degrees that each person's collar bones are turned down by."""

NOD = 15.0
"""Degrees that the first person's head goes down in the second half of the walk."""


def held(motion: Motion, person: str) -> Motion:
    """A motion with the habits of a person."""
    pitch = np.full(len(motion), LOOKS_DOWN[person])
    pitch[len(motion) // 2 :] += NOD if person == "A" else 0.0
    turned = {"head": local_rotations(motion, [HUMANOID.index("head")])[:, 0] @ axis_to_rotmat("x", np.radians(pitch))}
    for side, sign in (("left", -1), ("right", 1)):
        collar = HUMANOID.index(f"{side}Shoulder")
        down = axis_to_rotmat("z", np.radians(sign * DROOPS[person]))
        turned[f"{side}Shoulder"] = down @ local_rotations(motion, [collar])[:, 0]
    return posed(motion, turned, {})


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    walk = to_humanoid(read_motion(CMU_FOLDER / "39_14.amc")).motion.resample(30.0)
    stands = posed(walk, {}, {})
    values = stands.values.copy()
    values[:, [stands.channels.index(f"hips.{axis}") for axis in ("tx", "tz")]] = 0.0
    standing = Motion(values, stands.channels, stands.units, stands.fps, stands.skeleton)

    def records() -> Iterator[Record]:
        for person in LOOKS_DOWN:
            motion = standing if person == "never walks" else walk
            yield Record(person, person, held(motion, person), ("a person walks",))

    return prepare(records(), tmp_path_factory.mktemp("habits") / "store", AS_RECORDED)


def places(store: Store, record: int) -> Array:
    """Joints (T, J, 3) of a recording."""
    return global_transforms(named("root_sixd").motion(store.motion(record)))[1]


def pitches(store: Store, record: int) -> Array:
    """How far down the head looks, in degrees (T,), by where its top is."""
    turns = global_transforms(named("root_sixd").motion(store.motion(record)))[0]
    return np.degrees(np.arcsin(-turns[:, HUMANOID.index("head"), 1, 2]))


def test_people_who_walk_look_ahead_and_a_nod_stays_a_nod(store: Store) -> None:
    mended = without_habits(store)
    for record in (0, 1):
        assert np.median(pitches(mended, record)) == pytest.approx(HEAD_PITCH, abs=0.01)
    nod = pitches(mended, 0) - pitches(store, 0)
    assert nod.std() < 2.0  # the same all the time, but for how the head is tilted aside
    # who never walks is taken for the median of the others
    raised = [np.median(pitches(store, record) - pitches(mended, record)) for record in range(3)]
    assert raised[2] == pytest.approx((raised[0] + raised[1]) / 2, abs=1.0)


def test_collar_bones_slope_alike_and_arms_keep_their_directions(store: Store) -> None:
    mended = without_habits(store)
    for record in range(3):
        for side in ("left", "right"):
            chain = [HUMANOID.index(f"{side}{part}") for part in ("Shoulder", "UpperArm", "LowerArm", "Hand")]
            before = np.diff(places(store, record)[:, chain], axis=1)
            after = np.diff(places(mended, record)[:, chain], axis=1)
            np.testing.assert_allclose(after[:, 1:], before[:, 1:], atol=1e-5)
            slopes = np.degrees(np.arctan2(-after[:, 0, 1], np.hypot(after[:, 0, 0], after[:, 0, 2])))
            assert slopes.mean() == pytest.approx(COLLAR_SLOPE, abs=2.0)


def test_everything_else_stays_and_other_figures_are_left_alone(store: Store, tmp_path: Path) -> None:
    mended = without_habits(store)
    changed = ("head.", "leftShoulder.", "leftUpperArm.", "rightShoulder.", "rightUpperArm.")
    same = [not name.startswith(changed) for name in store.channels]
    np.testing.assert_array_equal(mended.frames[:, same], store.frames[:, same])
    others = small_store(tmp_path, 4)
    assert without_habits(others) is others
