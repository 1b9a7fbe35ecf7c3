"""Whether knees and elbows flip: acts that cut each other at any tick, and hands that reach for points at random."""

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array
from motet.steering.acts import Act
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.session import SteerSession
from motet_train.evaluate.positions import length
from motet_train.evaluate.steer.following import MEASURED_SPEEDS, Track, settled, turns

CUTS_SEED = 4
"""Of the ticks at which acts are cut, and of the points that hands reach for; it chose no setting."""

SHOWN = 1.5
"""Seconds that are measured after an act was cut."""

REACHED_POINTS = 300
"""Points that hands reach for."""

LOWEST_POINT = (-0.3, 0.3, -0.2)
HIGHEST_POINT = (0.8, 1.9, 0.8)
"""Where they are, from the left of the figure, the ground and its back: from within the body to beyond the arm."""

PASSED_AT = 1.2
"""m/s of a walk past points that stay where they are."""

STARTING_DISTANCE = 3.0
"""How far these are ahead at first, metres."""


def cut_figures(model: SteerModel, acts: Sequence[Act], gait: str | None) -> dict[str, float]:
    """Every act cut by every act, at a tick drawn at random, of figures that stand or go straight on in a gait.

    turn: degrees of the largest turn of a bone in a tick, relative to its parent. acts: that of the acts themselves.
    velocity: the largest change of a joint's velocity in a tick, in the figure's own space, m/s.
    """
    # each figure has its pair, and the tick at which the second act cuts the first
    rng = np.random.default_rng(CUTS_SEED)
    pairs = list(product(acts, acts))
    cuts = np.array([rng.integers(1, len(first)) for first, _ in pairs])
    session = model.start(gait, characters=len(pairs))
    if gait is not None:
        session.control(speed=MEASURED_SPEEDS[gait], direction=0.0)
    before = settled(session, model.fps, 0)

    # until some time after the last cut
    poses = [before, *_cut(session, pairs, cuts, round(SHOWN * model.fps))]
    acts_own_turn = max(float(_own_turns(act).max()) for act in acts)
    return _largest(poses, model.fps) | {"acts": acts_own_turn}


def _cut(
    session: SteerSession, pairs: Sequence[tuple[Act, Act]], cuts: NDArray[np.int64], after: int
) -> Iterator[Pose]:
    """The poses of figures that play the first act of each pair, and the second from their tick of ``cuts`` (N,) on,
    until some ticks after the last."""
    session.act([first for first, _ in pairs])
    for tick in range(int(cuts.max()) + after):
        (cut,) = np.nonzero(cuts == tick)
        if len(cut):
            session.act([pairs[figure][1] for figure in cut.tolist()], ids=cut.tolist())
        yield session.tick()


def reach_figures(model: SteerModel) -> dict[str, float]:
    """Left hands that reach for :data:`REACHED_POINTS` points, of figures that walk.

    turn, velocity: as of :func:`cut_figures`, where points go along with the figures, and where figures pass them.
    """
    points = np.random.default_rng(CUTS_SEED).uniform(LOWEST_POINT, HIGHEST_POINT, (REACHED_POINTS, 3))
    first = _reach_figures(model, points, along=True)
    second = _reach_figures(model, points, along=False)
    return {name: max(first[name], second[name]) for name in first}


def _reach_figures(model: SteerModel, points: Array, along: bool) -> dict[str, float]:
    """The figures for points (N, 3), from figures that walk. along: whether they go along."""
    session = model.start("walk", characters=len(points))
    session.control(speed=PASSED_AT, direction=0.0)
    before = settled(session, model.fps, 0)
    ahead = before.place + np.array([0.0, 0.0, STARTING_DISTANCE])
    poses = [before]
    for _ in range(round(2 * STARTING_DISTANCE / PASSED_AT * model.fps)):
        session.reach("left", points + (poses[-1].place if along else ahead))
        poses.append(session.tick())
    return _largest(poses, model.fps)


def _largest(poses: Sequence[Pose], fps: float) -> dict[str, float]:
    """The largest turn of a bone, and the largest change of a joint's velocity."""
    track = Track.of(poses, fps)
    velocities = np.diff(track.in_place().places, axis=0) * fps
    return {
        "turn": float(turns(track).max()),
        "velocity": float(length(np.diff(velocities, axis=0)).max()),
    }


def _own_turns(act: Act) -> Array:
    """Degrees (T - 1, 1, J) that bones turn by between the frames of an act."""
    return turns(
        Track(
            act.ground[:, None], act.rotations[:, None].astype(np.float32), act.height[:, None].astype(np.float32), 1.0
        )
    )
