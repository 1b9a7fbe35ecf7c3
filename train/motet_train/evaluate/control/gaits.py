"""The thesis' experiments (chapter 5) as numbers, over a control model run by ONNX Runtime or by torch.

Every experiment runs without noise (variety 0) unless it says so. Letters in shapes: T frames, B characters,
D channels, L labels.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.motion.rotations import Array
from motet_train.data.period import period
from motet_train.evaluate.control.lab import Codes, Lab
from motet_train.evaluate.control.measures import Reference, arrival, upsample

Figures = dict[str, float]


def limit_cycle(lab: Lab, role: str = "walk", seconds: float = 60.0) -> Figures:
    """A free run against the training motion: period, drift, leg energy (thesis 5.2).

    drift: relative change from seconds 5 to 25 to the last 20 of the period; amplitude_drift: of the standard
    deviation of the leg angles.
    """
    frames = lab.hold(lab.training_history(role), role, seconds).frames[:, 0]
    first, last = (
        lab.reference.leg_angles(part) for part in (frames[lab.frames(5) : lab.frames(25)], frames[-lab.frames(20) :])
    )
    training = lab.reference.period(getattr(lab, role))
    amplitudes = [float(np.sqrt(part.var(axis=0).mean())) for part in (first, last)]
    return {
        "period_s": period(last) / lab.fps,
        "training_period_s": training / lab.fps,
        "period_error": abs(period(last) / training - 1),
        "drift": _change(period(first), period(last)),
        "amplitude_drift": _change(*amplitudes),
        "energy": lab.reference.energy_ratio(frames[-lab.frames(20) :], getattr(lab, role)),
    }


def _change(first: float, last: float) -> float:
    """Relative change; NaN from nothing, as of a figure that stands still."""
    return abs(last / first - 1) if first > 0 else np.nan


def convergence(lab: Lab, starts: int = 100, sigma: float = 1.0) -> Figures:
    """Walking from past codes with Gaussian noise: how many are on the loop within 3 s and stay (figure 5.2)."""
    rng = np.random.default_rng(0)
    clip = lab.reference.motions[lab.walk][0]
    at = rng.integers(0, len(clip) - lab.model.taps, starts)
    clean = np.concatenate([lab.training_history("walk", int(frame)) for frame in at])
    noisy = clean + sigma * rng.standard_normal(clean.shape)
    times = lab.reaches(lab.hold(noisy, "walk", 6.0).frames, "walk")
    return {"converged": float((times <= 3).sum()), "median_s": float(np.median(times)), "max_s": float(times.max())}


def synchronisation(lab: Lab, starts: int = 10) -> Figures:
    """Replay the left leg's codes half a cycle late: does the right leg follow (figures 5.3, 5.4)?

    In step: the right leg's phase on the recorded loop is within 5 % of a cycle of the left leg's, and stays so.
    """
    if lab.legs is None:
        return {}
    _, apart = late_left_leg(lab, starts)
    seconds = arrival(apart < 0.05, lab.fps)
    return {"share": float((seconds <= 1).mean()), "max_s": float(seconds.max())}


def late_left_leg(lab: Lab, starts: int) -> tuple[Array, Array]:
    """Frames (T, B, D) with the left leg half a cycle late, and how far apart in cycles the legs are (T-2, B)."""
    assert lab.legs is not None
    left, right = lab.legs
    recorded = lab.hold(lab.loop("walk").histories([lab.model.taps], lab.model.taps), "walk", 10.0)
    cycle = lab.cycle("walk")
    times = [int(lab.model.taps + cycle + round(start * cycle / starts)) for start in range(starts)]
    half = round(cycle / 2)

    def force(time: int, codes: Codes) -> None:
        for row, start in enumerate(times):
            codes[row, left.codes] = recorded.codes[start + time + 1 - half, 0, left.codes]

    walk = np.repeat(lab.control(walk=1.0)[None], lab.frames(4.0), axis=0)
    run = lab.play(lab.start(recorded.histories(times, lab.model.taps)), walk, force)
    phase = leg_phase(lab.reference, run.frames, recorded.frames[:, 0], right.channels, cycle)
    wanted = (np.array(times) - half + 1 + np.arange(len(phase))[:, None]) / cycle
    return run.frames, np.abs((phase - wanted + 0.5) % 1 - 0.5)


def leg_phase(reference: Reference, frames: Array, loop: Array, leg: NDArray[np.intp], cycle: float) -> Array:
    """Phase in cycles (T-2, B) of one leg: the best match of three frames of its angles on a loop (N, D)."""
    std = reference.std[leg]
    fine = upsample(loop[:, leg] / std)
    points = round(cycle * 4)
    windows = fine[np.arange(points)[:, None] + 4 * np.arange(3)].reshape(points, -1)
    seen = frames[..., leg] / std
    seen = np.concatenate([seen[:-2], seen[1:-1], seen[2:]], axis=-1)
    square = ((seen[..., None, :] - windows) ** 2).sum(axis=-1)
    phase: Array = square.argmin(axis=-1) / (cycle * 4)
    return phase


def switch(lab: Lab, start: str, end: str, count: int) -> tuple[Array, Array]:
    """Switch from one gait to another at equal phases: seconds to the other's loop (B,), largest jump (B,)."""
    history, before = lab.phases(start, count)
    frames = lab.hold(history, end, 4.0).frames
    return lab.reaches(frames, end), lab.reference.jumps(np.concatenate([before[None], frames])).max(axis=0)


def gait_transitions(lab: Lab, count: int = 20) -> Figures:
    """Walk to run and back from each phase (thesis 5.3, figure 5.5); jump_ratio: over the training motions' largest."""
    (to_run, jump_up), (to_walk, jump_down) = switch(lab, "walk", "run", count), switch(lab, "run", "walk", count)
    times, jump = np.concatenate([to_run, to_walk]), float(max(jump_up.max(), jump_down.max()))
    return {
        "share": float(np.isfinite(times).mean()),
        "median_s": float(np.median(times)),
        "max_s": float(times.max()),
        "under_half": float((times < 0.5).mean()),
        "jump": jump,
        "jump_ratio": jump / lab.reference.largest_jump,
    }


def gait_control(lab: Lab, gait: ArrayLike) -> Array:
    """Controls (..., L) of a gait parameter (...): walk 1 - g, run g."""
    g = np.asarray(gait, dtype=np.float64)
    return lab.control(walk=1 - g, run=g)


def ramp(lab: Lab, seconds: float = 5.0) -> Array:
    """The gait parameter (T,) up in ``seconds``, held for 3 s, down as slowly, held for 3 s (figure 5.6)."""
    up, hold = np.linspace(0, 1, lab.frames(seconds)), lab.frames(3.0)
    return np.concatenate([up, np.ones(hold), up[::-1], np.zeros(hold)])


def ramp_hysteresis(lab: Lab, seconds: float = 5.0, starts: int = 4) -> Figures:
    """Where on ramps up and down does the nearer loop change? The mean and the least width over starts."""
    gait = ramp(lab, seconds)
    frames = lab.play(lab.start(lab.phases("walk", starts)[0]), gait_control(lab, gait)).frames
    running = nearer_to_run(lab, frames)
    half = len(gait) // 2
    switched = [arrival(running[:half], lab.fps), arrival(~running[half:], lab.fps)]
    at = [
        part[np.minimum(np.nan_to_num(t * lab.fps, posinf=0) - 1, half - 1).astype(int)]
        for part, t in zip((gait[:half], gait[half:]), switched, strict=True)
    ]
    width = np.where(np.isfinite(switched).all(axis=0), at[0] - at[1], np.nan)
    return {
        "ramp_width": float(width.mean()),
        "ramp_width_least": float(width.min()),
        "ramp_up": float(at[0].mean()),
        "ramp_down": float(at[1].mean()),
    }


def nearer_to_run(lab: Lab, frames: Array) -> NDArray[np.bool_]:
    """Which of frames (..., D) are nearer to the running loop than to the walking one."""
    walk, run = (lab.reference.distance(frames, lab.loop_points(role)) for role in ("walk", "run"))
    return run < walk


def constant_hysteresis(lab: Lab, points: int = 41, starts: int = 4) -> Figures:
    """From each loop at a constant g for 15 s: up to which g is walking kept, down to which running (all starts)?"""
    grid = np.linspace(0, 1, points)
    kept = {}
    for role in ("walk", "run"):
        history = np.tile(lab.phases(role, starts)[0], (points, 1, 1))
        control = gait_control(lab, np.repeat(grid, starts))
        session = lab.start(history)
        lab.settle(session, control, 13.0)
        frames = lab.play(session, np.repeat(control[None], lab.frames(2.0), axis=0)).frames
        running = nearer_to_run(lab, frames).mean(axis=0) > 0.5
        kept[role] = (running == (role == "run")).reshape(points, starts).all(axis=1)
    walk, run = int(np.cumprod(kept["walk"]).sum()) - 1, points - int(np.cumprod(kept["run"][::-1]).sum())
    if walk < 0 or run == points:
        return {"constant_width": float("nan")}
    return {"constant_width": float(grid[walk] - grid[run]), "walk_to": float(grid[walk]), "run_to": float(grid[run])}
