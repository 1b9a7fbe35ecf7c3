"""The thesis' experiments (chapter 5) as numbers, over a control model run by ONNX Runtime or by torch.

Every experiment runs without noise (variety 0) unless it says so. Letters in shapes: T frames, B characters,
D channels, L labels.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.errors import MotionError
from motet.figures.feet.contacts import lay_root_path
from motet.figures.humanoid import map_of
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet_train.evaluate.positions import acceleration, arrival, leap, slide, speed, stances
from motet_train.papers.tdbn.clips import period
from motet_train.papers.tdbn.study import Codes, ControlStudy, Recording, Reference, upsample

Figures = dict[str, float]


def limit_cycle(study: ControlStudy, role: str = "walk", seconds: float = 60.0) -> Figures:
    """A free run against the training motion: period, drift, leg energy (thesis 5.2).

    drift: relative change from seconds 5 to 25 to the last 20 of the period; amplitude_drift: of the standard
    deviation of the leg angles; NaN from nothing, as of a figure that stands still.
    """
    reference, label = study.reference, getattr(study, role)
    frames = study.hold(study.training_history(role), role, seconds).frames[:, 0]
    end = frames[-study.frames(20) :]
    first, last = map(reference.leg_angles, (frames[study.frames(5) : study.frames(25)], end))
    training = reference.period(label)
    pairs = [[measure(part) for part in (first, last)] for measure in (period, lambda p: np.sqrt(p.var(axis=0).mean()))]
    drift, amplitude_drift = (abs(after / before - 1) if before > 0 else np.nan for before, after in pairs)
    return {
        "period_s": period(last) / study.fps,
        "training_period_s": training / study.fps,
        "period_error": abs(period(last) / training - 1),
        "drift": float(drift),
        "amplitude_drift": float(amplitude_drift),
        "energy": reference.energy_ratio(end, label),
    }


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
    seconds = arrival(late_left_leg(study, starts)[1] < 0.05, study.fps)
    return {"share": float((seconds <= 1).mean()), "max_s": float(seconds.max())}


def late_left_leg(study: ControlStudy, starts: int) -> tuple[Array, Array]:
    """Frames (T, B, D) with the left leg half a cycle late, and how far apart in cycles the legs are (T-2, B)."""
    assert study.legs is not None
    (left, right), taps = study.legs, study.model.taps
    recorded = study.hold(study.loop("walk").histories([taps], taps), "walk", 10.0)
    cycle = study.cycle("walk")
    times = [int(taps + cycle + round(start * cycle / starts)) for start in range(starts)]
    half = round(cycle / 2)

    def force(time: int, codes: Codes) -> None:
        for row, start in enumerate(times):
            codes[row, left.codes] = recorded.codes[start + time + 1 - half, 0, left.codes]

    walk = np.repeat(study.control(walk=1.0)[None], study.frames(4.0), axis=0)
    run = study.play(study.start(recorded.histories(times, taps)), walk, force)
    phase = _leg_phase(study.reference, run.frames, recorded.frames[:, 0], right.channels, cycle)
    wanted = (np.array(times) - half + 1 + np.arange(len(phase))[:, None]) / cycle
    return run.frames, np.abs((phase - wanted + 0.5) % 1 - 0.5)


def _leg_phase(reference: Reference, frames: Array, loop: Array, leg: NDArray[np.intp], cycle: float) -> Array:
    """Phase in cycles (T-2, B) of one leg: the best match of three frames of its angles on a loop (N, D)."""
    fine, seen = upsample(loop[:, leg] / reference.std[leg]), frames[..., leg] / reference.std[leg]
    points = round(cycle * 4)
    windows = fine[np.arange(points)[:, None] + 4 * np.arange(3)].reshape(points, -1)
    seen = np.concatenate([seen[:-2], seen[1:-1], seen[2:]], axis=-1)
    square = ((seen[..., None, :] - windows) ** 2).sum(axis=-1)
    return np.asarray(square.argmin(axis=-1) / (cycle * 4))


def switch(study: ControlStudy, start: str, end: str, count: int) -> tuple[Array, Array]:
    """Switch from one gait to another at equal phases: seconds to the other's loop (B,), largest jump (B,)."""
    history, before = study.phases(start, count)
    frames = study.hold(history, end, 4.0).frames
    return study.reaches(frames, end), study.reference.jumps(np.concatenate([before[None], frames])).max(axis=0)


def gait_transitions(study: ControlStudy, count: int = 20) -> Figures:
    """Walk to run and back from each phase (thesis 5.3, figure 5.5); jump_ratio: over the training motions' largest."""
    ways = (("walk", "run"), ("run", "walk"))
    times, jumps = (np.concatenate(both) for both in zip(*(switch(study, *way, count) for way in ways), strict=True))
    return {
        "share": float(np.isfinite(times).mean()),
        "median_s": float(np.median(times)),
        "max_s": float(times.max()),
        "under_half": float((times < 0.5).mean()),
        "jump": float(jumps.max()),
        "jump_ratio": float(jumps.max()) / study.reference.largest_jump,
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
    running, half, at = study.nearer_to_run(frames), len(gait) // 2, []
    for part, changed in ((gait[:half], running[:half]), (gait[half:], ~running[half:])):
        time = arrival(changed, study.fps)
        frame = np.minimum(np.nan_to_num(time * study.fps, posinf=0) - 1, half - 1).astype(int)
        at.append((part[frame], np.isfinite(time)))
    (up, there), (down, back) = at
    width = np.where(there & back, up - down, np.nan)
    figures = {"ramp_width": width.mean(), "ramp_width_least": width.min(), "ramp_up": up.mean()}
    return {name: float(value) for name, value in {**figures, "ramp_down": down.mean()}.items()}


def constant_hysteresis(study: ControlStudy, points: int = 41, starts: int = 4) -> Figures:
    """From each loop at a constant g for 15 s: up to which g is walking kept, down to which running (all starts)?"""
    grid = np.linspace(0, 1, points)
    kept = {}
    for role in ("walk", "run"):
        session = study.start(np.tile(study.phases(role, starts)[0], (points, 1, 1)))
        control = gait_control(study, np.repeat(grid, starts))
        session.set_control(control)
        for _ in range(study.frames(13.0)):
            session.step()
        frames = study.play(session, np.repeat(control[None], study.frames(2.0), axis=0)).frames
        running = study.nearer_to_run(frames).mean(axis=0) > 0.5
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
    reference, history = study.reference, study.phases("walk", 1)[0].repeat(runs, axis=0)
    frames = study.hold(history, "run", 2.0, variety=variety).frames
    z = reference.z(frames[: study.frames(1.0)])
    pairs = [np.sqrt(((z[:, i] - z[:, j]) ** 2).mean()) for i in range(runs) for j in range(i)]
    walk = study.hold(history, "walk", 60.0, variety=variety).frames
    last = np.moveaxis(walk[-study.frames(20.0) :], 1, 0)
    return {
        "variety": variety,
        "differ": float(min(pairs)),
        "arrive": float(study.nearer_to_run(frames[-study.frames(0.5) :]).all(axis=0).mean()),
        "kept": float(1 - study.nearer_to_run(walk).mean()),
        "period_s": float(np.median([period(reference.leg_angles(one)) for one in last])) / study.fps,
        "energy": float(np.mean([reference.energy_ratio(one, study.walk) for one in last])),
    }


def depth(study: ControlStudy, frames: Array) -> tuple[Array, Array]:
    """How far down frames (..., D) are, in z along a line: 0 the bend's first training pose, 1 its deepest.

    And its deepest training poses (N, D).
    """
    assert study.bend is not None
    clip = study.reference.motions[study.bend][0]
    z = study.reference.z(clip)
    bottom = int(((z - z[0]) ** 2).sum(axis=1).argmax())
    line = z[bottom] - z[0]
    along: Array = (study.reference.z(frames) - z[0]) @ line / (line @ line)
    return along, upsample(clip[bottom - 4 : bottom + 5])


def bends(study: ControlStudy, count: int = 40, seconds: float = 6.0) -> Figures:
    """Bend from equal phases of walking and of running: the share executed within ``seconds``, the least depth.

    Executed: down to the training motion's deepest poses, and then up again (thesis 5.4, figure 5.9).
    """
    figures = {}
    for role, ending in (("walk", ""), ("run", "_from_run")):
        frames = study.hold(study.phases(role, count)[0], "bend", seconds).frames
        along, deepest = depth(study, frames)
        down = (study.reference.distance(frames, deepest) < 0.5) & (along > 0.8)
        first = np.where(down.any(axis=0), down.argmax(axis=0), len(frames))
        risen = np.any((np.arange(len(frames))[:, None] > first) & (along < 0.3), axis=0)
        figures[f"share{ending}"] = float(risen.mean())
        figures[f"depth{ending}"] = float(along.max(axis=0).min())
    return figures


def interruptions(study: ControlStudy, count: int = 10) -> Figures:
    """Walk, bend, and run in the middle of it: the longest time until running, for each moment and over all."""
    runs = interrupted(study, count)
    seconds = {f"{name}_s": float(study.reaches(run.frames, "run").max()) for name, run in runs.items()}
    return {"interrupt_s": max(seconds.values()), **seconds}


def interrupted(study: ControlStudy, count: int) -> dict[str, Recording]:
    """The runs after a bend is interrupted, by the moment: at which share of its largest depth (figure 5.10)."""
    bend = study.hold(study.phases("walk", count)[0], "bend", 6.0)
    taps, down, runs = study.model.taps, depth(study, bend.frames)[0], {}
    for name, share in {"early": 0.3, "middle": 0.6, "late": 0.95}.items():
        at = (down[taps:] > share * down.max(axis=0)).argmax(axis=0) + taps
        history = np.concatenate([bend.histories([time], taps, row) for row, time in enumerate(at)])
        runs[name] = study.hold(history, "run", 4.0)
    return runs


def standing_feet(study: ControlStudy) -> Figures:
    """How far feet slide and how fast they are while they stand, how much joints tremble, and the pace, in both gaits.

    As a user sees them, in smooth sessions whose path is laid, and "plain", without smoothing; beside the training
    motions, of which there are joint angles alone: their path is laid, too, and their feet are left as they then are.
    None for a figure that is no human's: which joints are in the balls of its feet is not known.
    """
    model, figures = study.model, dict[str, float]()
    try:
        joints = map_of(model.contract.features(study.reference.motions[study.walk][0])).joints
    except MotionError:
        return {}
    balls = [joints.get(f"{side}Toes", joints[f"{side}Foot"]) for side in ("left", "right")]  # or ankles
    for role, label in (("walk", study.walk), ("run", study.run)):
        if label is None:
            continue
        clips = [lay_root_path(model.contract.features(clip)) for clip in study.reference.motions[label]]
        of = {f"_{role}": [model.run(f"{label} 20s")], f"_{role}_plain": [model.run(f"{label} 20s", smooth=False)]}
        for ending, motions in {**of, f"_{role}_recorded": clips}.items():
            measured = [_measured(motion, balls) for motion in motions]
            figures |= {key + ending: float(np.mean([one[key] for one in measured])) for key in measured[0]}
    return figures


def _measured(motion: Motion, balls: list[int]) -> Figures:
    places = positions(motion) * (skeleton_of(motion).metres_per_unit or 1.0)
    points, root = places[:, balls], places[:, 0]
    return {
        "slide": slide(stances(points, root, motion.fps)),
        "speed": speed(points, root, motion.fps),
        "acceleration": acceleration(places, root, motion.fps),
        "pace": float(np.linalg.norm((root[-1] - root[0])[[0, 2]])) / motion.duration,
    }


def leaps(study: ControlStudy) -> Figures:
    """The largest turn of a joint in a frame, degrees, under controls that change at random.

    For a minute each after a quarter, a half and a second, to uniform numbers between 0 and 1 for every label.
    """
    found, model = {"leap": 0.0, "leap_plain": 0.0}, study.model
    rng = np.random.default_rng(0)
    for seconds in (0.25, 0.5, 1.0):
        controls = rng.uniform(size=(round(60 / seconds), len(model.labels)))
        track = controls.repeat(study.frames(seconds), axis=0)
        for key, smooth in (("leap", True), ("leap_plain", False)):
            frames = model.start(smooth=smooth).frames(track)[0]
            found[key] = max(found[key], leap(model.contract.features(frames)))
    recorded = [leap(model.contract.features(clip)) for clips in study.reference.motions.values() for clip in clips]
    return {**found, "leap_recorded": max(recorded)}
