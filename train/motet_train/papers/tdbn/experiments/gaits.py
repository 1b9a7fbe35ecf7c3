"""The thesis' experiments (chapter 5) as numbers, over a control model run by ONNX Runtime or by torch.

Every experiment runs without noise (variety 0) unless it says so. Letters in shapes: T frames, B characters,
D channels, L labels.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.motion.rotations import Array
from motet_train.evaluate.positions import arrival
from motet_train.papers.tdbn.experiments.measures import Reference, upsample
from motet_train.papers.tdbn.experiments.study import Codes, ControlStudy
from motet_train.papers.tdbn.period import period

Figures = dict[str, float]


def limit_cycle(study: ControlStudy, role: str = "walk", seconds: float = 60.0) -> Figures:
    """A free run against the training motion: period, drift, leg energy (thesis 5.2).

    drift: relative change from seconds 5 to 25 to the last 20 of the period; amplitude_drift: of the standard
    deviation of the leg angles.
    """
    frames = study.hold(study.training_history(role), role, seconds).frames[:, 0]
    first, last = (
        study.reference.leg_angles(part)
        for part in (frames[study.frames(5) : study.frames(25)], frames[-study.frames(20) :])
    )
    training = study.reference.period(getattr(study, role))
    amplitudes = [float(np.sqrt(part.var(axis=0).mean())) for part in (first, last)]
    return {
        "period_s": period(last) / study.fps,
        "training_period_s": training / study.fps,
        "period_error": abs(period(last) / training - 1),
        "drift": _change(period(first), period(last)),
        "amplitude_drift": _change(*amplitudes),
        "energy": study.reference.energy_ratio(frames[-study.frames(20) :], getattr(study, role)),
    }


def _change(first: float, last: float) -> float:
    """Relative change; NaN from nothing, as of a figure that stands still."""
    return abs(last / first - 1) if first > 0 else np.nan


def convergence(study: ControlStudy, starts: int = 100, sigma: float = 1.0) -> Figures:
    """Walking from past codes with Gaussian noise: how many are on the loop within 3 s and stay (figure 5.2)."""
    rng = np.random.default_rng(0)
    clip = study.reference.motions[study.walk][0]
    at = rng.integers(0, len(clip) - study.model.taps, starts)
    clean = np.concatenate([study.training_history("walk", int(frame)) for frame in at])
    noisy = clean + sigma * rng.standard_normal(clean.shape)
    times = study.reaches(study.hold(noisy, "walk", 6.0).frames, "walk")
    return {"converged": float((times <= 3).sum()), "median_s": float(np.median(times)), "max_s": float(times.max())}


def synchronisation(study: ControlStudy, starts: int = 10) -> Figures:
    """Replay the left leg's codes half a cycle late: does the right leg follow (figures 5.3, 5.4)?

    In step: the right leg's phase on the recorded loop is within 5 % of a cycle of the left leg's, and stays so.
    """
    if study.legs is None:
        return {}
    _, apart = late_left_leg(study, starts)
    seconds = arrival(apart < 0.05, study.fps)
    return {"share": float((seconds <= 1).mean()), "max_s": float(seconds.max())}


def late_left_leg(study: ControlStudy, starts: int) -> tuple[Array, Array]:
    """Frames (T, B, D) with the left leg half a cycle late, and how far apart in cycles the legs are (T-2, B)."""
    assert study.legs is not None
    left, right = study.legs
    recorded = study.hold(study.loop("walk").histories([study.model.taps], study.model.taps), "walk", 10.0)
    cycle = study.cycle("walk")
    times = [int(study.model.taps + cycle + round(start * cycle / starts)) for start in range(starts)]
    half = round(cycle / 2)

    def force(time: int, codes: Codes) -> None:
        for row, start in enumerate(times):
            codes[row, left.codes] = recorded.codes[start + time + 1 - half, 0, left.codes]

    walk = np.repeat(study.control(walk=1.0)[None], study.frames(4.0), axis=0)
    run = study.play(study.start(recorded.histories(times, study.model.taps)), walk, force)
    phase = leg_phase(study.reference, run.frames, recorded.frames[:, 0], right.channels, cycle)
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


def switch(study: ControlStudy, start: str, end: str, count: int) -> tuple[Array, Array]:
    """Switch from one gait to another at equal phases: seconds to the other's loop (B,), largest jump (B,)."""
    history, before = study.phases(start, count)
    frames = study.hold(history, end, 4.0).frames
    return study.reaches(frames, end), study.reference.jumps(np.concatenate([before[None], frames])).max(axis=0)


def gait_transitions(study: ControlStudy, count: int = 20) -> Figures:
    """Walk to run and back from each phase (thesis 5.3, figure 5.5); jump_ratio: over the training motions' largest."""
    (to_run, jump_up), (to_walk, jump_down) = switch(study, "walk", "run", count), switch(study, "run", "walk", count)
    times, jump = np.concatenate([to_run, to_walk]), float(max(jump_up.max(), jump_down.max()))
    return {
        "share": float(np.isfinite(times).mean()),
        "median_s": float(np.median(times)),
        "max_s": float(times.max()),
        "under_half": float((times < 0.5).mean()),
        "jump": jump,
        "jump_ratio": jump / study.reference.largest_jump,
    }


def gait_control(study: ControlStudy, gait: ArrayLike) -> Array:
    """Controls (..., L) of a gait parameter (...): walk 1 - g, run g."""
    g = np.asarray(gait, dtype=np.float64)
    return study.control(walk=1 - g, run=g)


def ramp(study: ControlStudy, seconds: float = 5.0) -> Array:
    """The gait parameter (T,) up in ``seconds``, held for 3 s, down as slowly, held for 3 s (figure 5.6)."""
    up, hold = np.linspace(0, 1, study.frames(seconds)), study.frames(3.0)
    return np.concatenate([up, np.ones(hold), up[::-1], np.zeros(hold)])


def ramp_hysteresis(study: ControlStudy, seconds: float = 5.0, starts: int = 4) -> Figures:
    """Where on ramps up and down does the nearer loop change? The mean and the least width over starts."""
    gait = ramp(study, seconds)
    frames = study.play(study.start(study.phases("walk", starts)[0]), gait_control(study, gait)).frames
    running = nearer_to_run(study, frames)
    half = len(gait) // 2
    switched = [arrival(running[:half], study.fps), arrival(~running[half:], study.fps)]
    at = [
        part[np.minimum(np.nan_to_num(t * study.fps, posinf=0) - 1, half - 1).astype(int)]
        for part, t in zip((gait[:half], gait[half:]), switched, strict=True)
    ]
    width = np.where(np.isfinite(switched).all(axis=0), at[0] - at[1], np.nan)
    return {
        "ramp_width": float(width.mean()),
        "ramp_width_least": float(width.min()),
        "ramp_up": float(at[0].mean()),
        "ramp_down": float(at[1].mean()),
    }


def nearer_to_run(study: ControlStudy, frames: Array) -> NDArray[np.bool_]:
    """Which of frames (..., D) are nearer to the running loop than to the walking one."""
    walk, run = (study.reference.distance(frames, study.loop_points(role)) for role in ("walk", "run"))
    return run < walk


def constant_hysteresis(study: ControlStudy, points: int = 41, starts: int = 4) -> Figures:
    """From each loop at a constant g for 15 s: up to which g is walking kept, down to which running (all starts)?"""
    grid = np.linspace(0, 1, points)
    kept = {}
    for role in ("walk", "run"):
        history = np.tile(study.phases(role, starts)[0], (points, 1, 1))
        control = gait_control(study, np.repeat(grid, starts))
        session = study.start(history)
        study.settle(session, control, 13.0)
        frames = study.play(session, np.repeat(control[None], study.frames(2.0), axis=0)).frames
        running = nearer_to_run(study, frames).mean(axis=0) > 0.5
        kept[role] = (running == (role == "run")).reshape(points, starts).all(axis=1)
    walk, run = int(np.cumprod(kept["walk"]).sum()) - 1, points - int(np.cumprod(kept["run"][::-1]).sum())
    if walk < 0 or run == points:
        return {"constant_width": float("nan")}
    return {"constant_width": float(grid[walk] - grid[run]), "walk_to": float(grid[walk]), "run_to": float(grid[run])}


def sampled_runs(study: ControlStudy, variety: float = 1.0, runs: int = 4) -> Figures:
    """Four sampled runs of one transition, and four sampled minutes of walking (thesis 5.3, figure 5.7c).

    differ: the least RMS z between two transitions in their first second. arrive: the share that runs in the last
    half second of two. kept: the share of walking frames nearer to the walking loop. energy: of the walk's legs.
    """
    history = study.phases("walk", 1)[0].repeat(runs, axis=0)
    frames = study.hold(history, "run", 2.0, variety=variety).frames
    z = study.reference.z(frames[: study.frames(1.0)])
    pairs = [np.sqrt(((z[:, i] - z[:, j]) ** 2).mean()) for i in range(runs) for j in range(i)]
    walk = study.hold(history, "walk", 60.0, variety=variety).frames
    last = walk[-study.frames(20.0) :]
    return {
        "variety": variety,
        "differ": float(min(pairs)),
        "arrive": float(nearer_to_run(study, frames[-study.frames(0.5) :]).all(axis=0).mean()),
        "kept": float(1 - nearer_to_run(study, walk).mean()),
        "period_s": float(np.median([period(study.reference.leg_angles(last[:, row])) for row in range(runs)]))
        / study.fps,
        "energy": float(np.mean([study.reference.energy_ratio(last[:, row], study.walk) for row in range(runs)])),
    }
