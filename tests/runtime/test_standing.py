"""Figures that stand keep their place and breathe, and do neither while they go."""

from collections.abc import Sequence

import numpy as np
import pytest

from motet import SteerModel, SteerSession, load
from motet.figures.humanoid import HUMANOID
from motet.motion.rotations import Array, conjugate, quat_product
from motet.motion.springs import damping_of
from motet.steering.idle import BREATH_TURNS, IdleSettings
from motet.steering.pose import Pose

IDLE = IdleSettings()
TURNED = [bone for bone, by in BREATH_TURNS.items() if by]
"""Bones that a breath turns: spine, upper chest, neck and shoulders."""

GOES, STANDS, GOES_ON = 45, 240, 120
"""Ticks of :func:`walk_and_stand`."""


@pytest.fixture(scope="module")
def model() -> SteerModel:
    return load("control")


def walk_and_stand(session: SteerSession) -> list[Pose]:
    """The poses of figures that go, stand, and go on."""
    poses = list[Pose]()
    for speed, ticks in ((1.3, GOES), (0.0, STANDS), (1.0, GOES_ON)):
        session.control(speed=speed)
        poses += [session.tick() for _ in range(ticks)]
    return poses


@pytest.fixture(scope="module")
def minute(model: SteerModel) -> list[Pose]:
    """The poses of a minute of two figures that have come to stand."""
    session = model.start(characters=2, places=[[0, 0, 0], [5, 3, 70]])
    session.control(speed=[1.4, 0.8])
    for _ in range(60):
        session.tick()
    session.control(speed=0)
    return [session.tick() for _ in range(30 * 63)][90:]


def ranges(poses: Sequence[Pose], joint: str) -> Array:
    """How far a joint goes (B, 3) in metres."""
    found: Array = np.ptp(np.stack([pose.positions()[:, HUMANOID.index(joint)] for pose in poses]), axis=0)
    return found


def test_figures_that_stand_keep_their_place(minute: list[Pose]) -> None:
    places = np.stack([pose.ground[:, :2] for pose in minute])
    assert np.ptp(places, axis=0).max() < 0.001
    assert max(ranges(minute, f"{side}Toes")[:, [0, 2]].max() for side in ("left", "right")) < 0.005


def test_figures_that_stand_breathe_with_their_chests(minute: list[Pose]) -> None:
    chest, upper, head = (np.linalg.norm(ranges(minute, one), axis=1) for one in ("chest", "upperChest", "head"))
    assert chest.min() > 0.005
    assert chest.max() < 0.01
    assert upper.min() > 0.008
    assert upper.max() < 0.014
    assert head.max() < 0.01
    off = np.stack([np.diff(pose.positions()[:, [0, HUMANOID.index("upperChest")]], axis=1)[:, 0] for pose in minute])
    spectrum = np.abs(np.fft.rfft(off[:1800] - off[:1800].mean(axis=0), axis=0)).sum(axis=2)
    assert (spectrum.argmax(axis=0) == 60 / IDLE.breath).all()


def breaths(model: SteerModel) -> tuple[Array, Array]:
    """Sines of half the angles (T, 5) by which bones are turned beside those of a figure whose feet are not held, which
    plays the same rows; and how far it is from where that one is (T, 2)."""
    held, free = (walk_and_stand(model.start(hold_feet=hold)) for hold in (True, False))
    ours, theirs = (np.stack([pose.rotations[0, TURNED] for pose in poses]) for poses in (held, free))
    apart = np.stack([a.ground[0, :2] - b.ground[0, :2] for a, b in zip(held, free, strict=True)])
    return np.linalg.norm(quat_product(ours, conjugate(theirs))[..., :3], axis=-1), apart


def test_breaths_begin_and_end_without_a_jump_and_are_none_while_figures_go(model: SteerModel) -> None:
    breath, apart = breaths(model)
    assert not breath[:GOES].any()
    assert not apart[:GOES].any()
    assert breath[GOES + 90 : GOES + STANDS, 0].max() == pytest.approx(np.sin(IDLE.depth / 2), rel=0.05)
    assert breath[GOES + 90 : GOES + STANDS, 1].max() == pytest.approx(np.sin(IDLE.depth), rel=0.05)
    steepest = (
        2 * np.pi / IDLE.breath + damping_of(IDLE.settles) / np.e
    )  # of a breath, and of a spring from 1 to 0, a second
    assert np.abs(np.diff(breath, axis=0)).max() < IDLE.depth * steepest / 30
    assert not breath[-GOES_ON // 4 :].any()
    assert np.linalg.norm(np.diff(apart, axis=0), axis=1).max() < 0.005
    assert np.ptp(apart[GOES + STANDS + 1 :], axis=0).max() < 1e-9


def test_a_figure_stands_as_it_does_among_others(model: SteerModel) -> None:
    places = np.array([[0, 0, 0], [1.5, -2, 40], [-3, 4, 170]], dtype=np.float64)
    crowd = model.start(characters=3, places=places)
    crowd.control(speed=[0, 1.0, 0])
    poses = [crowd.tick() for _ in range(60)] + walk_and_stand(crowd)[: GOES + STANDS]
    for number, speed in ((0, 0.0), (1, 1.0), (2, 0.0)):
        alone = model.start(places=places[number])
        alone.control(speed=speed)
        own = [alone.tick() for _ in range(60)] + walk_and_stand(alone)[: GOES + STANDS]
        for one, all_ in zip(own, poses, strict=True):
            np.testing.assert_allclose(one.ground[0], all_.ground[number], rtol=0, atol=1e-12)
            np.testing.assert_allclose(one.rotations[0], all_.rotations[number], rtol=0, atol=1e-6)


def test_neighbours_do_not_breathe_as_one_and_a_snapshot_breathes_on(model: SteerModel) -> None:
    session = model.start(characters=2, places=[[0, 0, 0], [1, 0, 0]])
    for _ in range(60):
        session.tick()
    kept = session.snapshot()
    first = [session.tick().rotations for _ in range(40)]
    assert max(np.abs(one[0, TURNED] - one[1, TURNED]).max() for one in first) > IDLE.depth / 2
    session.restore(kept)
    assert all(np.array_equal(one, session.tick().rotations) for one in first)
