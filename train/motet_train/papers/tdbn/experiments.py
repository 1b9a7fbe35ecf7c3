"""The thesis' experiments (chapter 5) as numbers, over a control model run by ONNX Runtime or by torch.

Every experiment runs without noise (variety 0) unless it says so. Letters in shapes: T frames, B characters,
D channels, L labels.
"""

import numpy as np

from motet.errors import MotionError
from motet.figures.feet.contacts import lay_root_path
from motet.figures.humanoid import map_of
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, Indices, Mask
from motet_train.evaluate.positions import acceleration, arrival, leap, slide, speed, stances
from motet_train.evaluate.tables import Figures
from motet_train.papers.tdbn.clips import period
from motet_train.papers.tdbn.study import Codes, ControlStudy, Recording, Reference, upsample


def limit_cycle(study: ControlStudy, role: str = "walk", seconds: float = 60.0) -> Figures:
    """A free run compared with the training motion: period, drift, leg energy (thesis 5.2).

    drift: relative change of the period from seconds 5 to 25 to the last 20. amplitude_drift: the same of the standard
    deviation of the leg angles. NaN for a figure that stands still.
    """
    reference = study.reference
    label = getattr(study, role)
    frames = study.hold(study.training_history(role), role, seconds).frames[:, 0]
    end = frames[-study.frames(20) :]
    first = reference.leg_angles(frames[study.frames(5) : study.frames(25)])
    last = reference.leg_angles(end)
    training = reference.period(label)
    return {
        "period_s": period(last) / study.fps,
        "training_period_s": training / study.fps,
        "period_error": abs(period(last) / training - 1),
        "drift": _change(period(first), period(last)),
        "amplitude_drift": _change(_amplitude(first), _amplitude(last)),
        "energy": reference.energy_ratio(end, label),
    }


def _amplitude(angles: Array) -> float:
    return float(np.sqrt(angles.var(axis=0).mean()))


def _change(before: float, after: float) -> float:
    """The relative change of a number, NaN if it was not positive."""
    return abs(after / before - 1) if before > 0 else float("nan")


def convergence(study: ControlStudy) -> Figures:
    """Walking from past codes with Gaussian noise: the number on the loop within 3 s that stay on it (figure 5.2)."""
    rng = np.random.default_rng(0)
    clip = study.reference.motions[study.walk][0]
    first_frames = rng.integers(0, len(clip) - study.model.taps, 100)
    clean = np.concatenate([study.training_history("walk", int(frame)) for frame in first_frames])
    noisy = clean + rng.standard_normal(clean.shape)
    times = study.reaches(study.hold(noisy, "walk", 6.0).frames, "walk")
    return {"converged": (times <= 3).sum(), "median_s": np.median(times), "max_s": times.max()}


def synchronisation(study: ControlStudy) -> Figures:
    """Replay the left leg's codes half a cycle late: does the right leg follow (figures 5.3, 5.4)?

    It follows if its phase on the recorded loop comes within 5 % of a cycle of the left leg's, and stays there.
    """
    if not study.legs:
        return {}
    seconds = arrival(late_left_leg(study, 10)[1] < 0.05, study.fps)
    return {"share": (seconds <= 1).mean(), "max_s": seconds.max()}


def late_left_leg(study: ControlStudy, starts: int) -> tuple[Array, Array]:
    """Frames (T, B, D) with the left leg half a cycle late, and the legs' difference in phase in cycles (T-2, B)."""
    left, right = study.legs
    taps = study.model.taps
    # record the loop, and start at equal phases of its second cycle
    recorded = study.hold(study.loop("walk").histories([taps], taps), "walk", 10.0)
    cycle = study.cycle("walk")
    half = round(cycle / 2)
    times = [int(taps + cycle + round(start * cycle / starts)) for start in range(starts)]
    run = _forced(study, recorded, times, half, left.codes)
    # the right leg's phase, and the phase at which it would be in step
    phase = _leg_phase(study.reference, run.frames, recorded.frames[:, 0], right.channels, cycle)
    in_step = (np.array(times) - half + 1 + np.arange(len(phase))[:, None]) / cycle
    return run.frames, np.abs((phase - in_step + 0.5) % 1 - 0.5)


def _forced(study: ControlStudy, recorded: Recording, times: list[int], delay: int, leg_codes: Indices) -> Recording:
    """Walk on from times of a recorded walk, a leg's codes replaced by the recorded ones ``delay`` frames earlier."""

    def force(time: int, codes: Codes) -> None:
        for row, start in enumerate(times):
            codes[row, leg_codes] = recorded.codes[start + time + 1 - delay, 0, leg_codes]

    walk = np.repeat(study.control(walk=1.0)[None], study.frames(4.0), axis=0)
    return study.play(study.start(recorded.histories(times, study.model.taps)), walk, force)


def _leg_phase(reference: Reference, frames: Array, loop: Array, leg: Indices, cycle: float) -> Array:
    """Phase in cycles (T-2, B) of one leg: the best match of three frames of its angles on a loop (N, D)."""
    # windows of three frames at each point of one cycle of the upsampled loop
    points = round(cycle * 4)
    fine = upsample(loop[:, leg] / reference.std[leg])
    windows = fine[np.arange(points)[:, None] + 4 * np.arange(3)].reshape(points, -1)
    # windows of three frames of the run
    angles = frames[..., leg] / reference.std[leg]
    angles = np.concatenate([angles[:-2], angles[1:-1], angles[2:]], axis=-1)
    squares = ((angles[..., None, :] - windows) ** 2).sum(axis=-1)
    return np.asarray(squares.argmin(axis=-1) / (cycle * 4))


def switch(study: ControlStudy, start: str, end: str, count: int) -> tuple[Array, Array]:
    """Switch from a gait to another at equal phases: seconds to the other loop (B,), and largest jumps (B,)."""
    history, before = study.phases(start, count)
    frames = study.hold(history, end, 4.0).frames
    return study.reaches(frames, end), study.reference.jumps(np.concatenate([before[None], frames])).max(axis=0)


def gait_transitions(study: ControlStudy, count: int = 20) -> Figures:
    """Walk to run and back from each phase (thesis 5.3, figure 5.5).

    jump_ratio: the largest jump relative to the training motions' largest.
    """
    times_to_run, jumps_to_run = switch(study, "walk", "run", count)
    times_to_walk, jumps_to_walk = switch(study, "run", "walk", count)
    times = np.concatenate([times_to_run, times_to_walk])
    jumps = np.concatenate([jumps_to_run, jumps_to_walk])
    return {
        "share": np.isfinite(times).mean(),
        "median_s": np.median(times),
        "max_s": times.max(),
        "under_half": (times < 0.5).mean(),
        "jump": jumps.max(),
        "jump_ratio": jumps.max() / study.reference.largest_jump,
    }


def gait_control(study: ControlStudy, gait: Array) -> Array:
    """Controls (..., L) of a gait parameter (...): walk 1 - g, run g."""
    return study.control(walk=1 - gait, run=gait)


def ramp(study: ControlStudy) -> Array:
    """The gait parameter (T,) up in 5 s, held for 3 s, down as slowly, held for 3 s (figure 5.6)."""
    up = np.linspace(0, 1, study.frames(5.0))
    hold = study.frames(3.0)
    return np.concatenate([up, np.ones(hold), up[::-1], np.zeros(hold)])


def gait_run(study: ControlStudy, gait: Array, starts: int = 1) -> Recording:
    """Runs from equal phases of walking under a gait parameter (T,)."""
    return study.play(study.start(study.phases("walk", starts)[0]), gait_control(study, gait))


def ramp_hysteresis(study: ControlStudy) -> Figures:
    """The gait parameter at which the nearer loop changes on ramps up and down (thesis 5.3): means over four starts.

    ramp_width: the difference of both; ramp_width_least: its least. NaN if a run never changes its loop.
    """
    gait = ramp(study)
    running = study.nearer_to_run(gait_run(study, gait, 4).frames)
    half = len(gait) // 2
    up, runs = _crossing(study, gait[:half], running[:half])
    down, walks = _crossing(study, gait[half:], ~running[half:])
    width = np.where(runs & walks, up - down, np.nan)
    return {
        "ramp_width": width.mean(),
        "ramp_width_least": width.min(),
        "ramp_up": up.mean(),
        "ramp_down": down.mean(),
    }


def _crossing(study: ControlStudy, gait: Array, changed: Mask) -> tuple[Array, Mask]:
    """The gait parameter (B,) when frames (T, B) have changed for good, and whether they do."""
    time = arrival(changed, study.fps)
    frame = np.minimum(np.nan_to_num(time * study.fps, posinf=0) - 1, len(gait) - 1).astype(int)
    return gait[frame], np.isfinite(time)


def constant_hysteresis(study: ControlStudy) -> Figures:
    """From each loop at constant gait parameters: up to which one walking persists, and down to which running.

    A gait persists at a parameter if it does for 15 s from four starts.
    """
    grid = np.linspace(0, 1, 41)
    walks = _persists(study, "walk", grid)
    runs = _persists(study, "run", grid)
    # the unbroken ranges from either end of the grid
    last_walk = int(np.cumprod(walks).sum()) - 1
    first_run = len(grid) - int(np.cumprod(runs[::-1]).sum())
    if last_walk < 0 or first_run == len(grid):
        return {"constant_width": float("nan")}
    walk_to = grid[last_walk]
    run_to = grid[first_run]
    return {"constant_width": walk_to - run_to, "walk_to": walk_to, "run_to": run_to}


def _persists(study: ControlStudy, role: str, grid: Array) -> Mask:
    """Whether a gait persists at each gait parameter of a grid (N,)."""
    session = study.start(np.tile(study.phases(role, 4)[0], (len(grid), 1, 1)))
    control = gait_control(study, np.repeat(grid, 4))
    session.set_control(control)
    for _ in range(study.frames(13.0)):
        session.step()
    # judge the last two seconds
    frames = study.play(session, np.repeat(control[None], study.frames(2.0), axis=0)).frames
    running = study.nearer_to_run(frames).mean(axis=0) > 0.5
    persists: Mask = (running == (role == "run")).reshape(len(grid), 4).all(axis=1)
    return persists


def sampled_runs(study: ControlStudy) -> Figures:
    """Four sampled runs of one transition, and four sampled minutes of walking (thesis 5.3, figure 5.7c).

    differ: the least RMS z between two transitions in their first second. arrive: the share that runs in the last
    half second of two. kept: the share of walking frames nearer to the walking loop. energy: of the walk's legs.
    """
    reference = study.reference
    history = study.phases("walk", 1)[0].repeat(4, axis=0)
    # from four phases of walking: to a run, and on walking for a minute
    frames = study.hold(history, "run", 2.0, variety=1.0).frames
    walk = study.hold(history, "walk", 60.0, variety=1.0).frames
    # the last 20 seconds of that minute
    ends = np.moveaxis(walk[-study.frames(20.0) :], 1, 0)
    periods = [period(reference.leg_angles(end)) for end in ends]
    energies = [reference.energy_ratio(end, study.walk) for end in ends]
    return {
        "variety": 1.0,
        "differ": _least_difference(reference.z(frames[: study.frames(1.0)])),
        "arrive": study.nearer_to_run(frames[-study.frames(0.5) :]).all(axis=0).mean(),
        "kept": 1 - study.nearer_to_run(walk).mean(),
        "period_s": np.median(periods) / study.fps,
        "energy": float(np.mean(energies)),
    }


def _least_difference(z: Array) -> float:
    """The least RMS difference between two of runs (T, B, D)."""
    from scipy.spatial.distance import pdist  # imported here, so that training does not load it

    runs = np.moveaxis(z, 1, 0).reshape(z.shape[1], -1)
    return float(pdist(runs).min() / np.sqrt(runs.shape[1]))


def depth(study: ControlStudy, frames: Array) -> tuple[Array, Array]:
    """The depth (...) of frames (..., D): 0 at the bend's first training pose, 1 at its deepest, linear in z.

    Also returns the deepest training poses (N, D).
    """
    clip = study.reference.motions[study.bend][0]
    z = study.reference.z(clip)
    bottom = int(((z - z[0]) ** 2).sum(axis=1).argmax())
    line = z[bottom] - z[0]
    along: Array = (study.reference.z(frames) - z[0]) @ line / (line @ line)
    return along, upsample(clip[bottom - 4 : bottom + 5])


def bends(study: ControlStudy) -> Figures:
    """Bend from 40 phases of walking and of running: the share executed within 6 s, and the least depth.

    A bend is executed if it reaches the training motion's deepest poses and rises again (thesis 5.4, figure 5.9).
    """
    figures = {}
    for role, ending in (("walk", ""), ("run", "_from_run")):
        frames = study.hold(study.phases(role, 40)[0], "bend", 6.0).frames
        along, deepest = depth(study, frames)
        down = (study.reference.distance(frames, deepest) < 0.5) & (along > 0.8)
        first = np.where(down.any(axis=0), down.argmax(axis=0), len(frames))
        risen = np.any((np.arange(len(frames))[:, None] > first) & (along < 0.3), axis=0)
        figures[f"share{ending}"] = risen.mean()
        figures[f"depth{ending}"] = along.max(axis=0).min()
    return figures


def interruptions(study: ControlStudy) -> Figures:
    """Walk, bend, and run in the middle of the bend: the longest time until running, for each moment and overall."""
    runs = interrupted(study, 10)
    seconds = {f"{name}_s": study.reaches(run.frames, "run").max() for name, run in runs.items()}
    return {"interrupt_s": max(seconds.values()), **seconds}


def interrupted(study: ControlStudy, count: int) -> dict[str, Recording]:
    """The runs after a bend is interrupted, by the moment: a share of its largest depth (figure 5.10)."""
    bend = study.hold(study.phases("walk", count)[0], "bend", 6.0)
    taps = study.model.taps
    down, _ = depth(study, bend.frames)
    runs = {}
    for name, share in {"early": 0.3, "middle": 0.6, "late": 0.95}.items():
        times = (down[taps:] > share * down.max(axis=0)).argmax(axis=0) + taps
        history = np.concatenate([bend.histories([time], taps, row) for row, time in enumerate(times)])
        runs[name] = study.hold(history, "run", 4.0)
    return runs


def standing_feet(study: ControlStudy) -> Figures:
    """Sliding and speed of standing feet, trembling of joints, and pace, in both gaits.

    Of smooth sessions with a root path, as users see them, and "plain", without smoothing. Training motions are joint
    angles alone: their root path is computed, too, and their feet stay as they then are. Empty for a figure that is not
    human, as the joints at the balls of its feet are unknown.
    """
    model = study.model
    try:
        joints = map_of(model.contract.features(study.reference.motions[study.walk][0])).joints
    except MotionError:
        return {}
    balls = [joints.get(f"{side}Toes", joints[f"{side}Foot"]) for side in ("left", "right")]  # or ankles
    figures: Figures = {}
    for role, label in (("walk", study.walk), ("run", study.run)):
        if not label:
            continue
        recorded = [lay_root_path(model.contract.features(clip)) for clip in study.reference.motions[label]]
        figures |= _feet([model.run(f"{label} 20s")], balls, f"_{role}")
        figures |= _feet([model.run(f"{label} 20s", smooth=False)], balls, f"_{role}_plain")
        figures |= _feet(recorded, balls, f"_{role}_recorded")
    return figures


def _feet(motions: list[Motion], balls: list[int], ending: str) -> Figures:
    """Mean figures of some motions; ``ending`` is that of their names."""
    measured = [_measured(motion, balls) for motion in motions]
    figures = {}
    for key in measured[0]:
        figures[key + ending] = float(np.mean([of_motion[key] for of_motion in measured]))
    return figures


def _measured(motion: Motion, balls: list[int]) -> Figures:
    places = positions(motion) * (skeleton_of(motion).metres_per_unit or 1.0)
    points = places[:, balls]
    root = places[:, 0]
    return {
        "slide": slide(stances(points, root, motion.fps)),
        "speed": speed(points, root, motion.fps),
        "acceleration": acceleration(places, root, motion.fps),
        "pace": float(np.linalg.norm((root[-1] - root[0])[[0, 2]])) / motion.duration,
    }


def leaps(study: ControlStudy) -> Figures:
    """The largest rotation of a joint between frames, in degrees, under random controls.

    Controls change to uniform numbers for every label, for a minute each after a quarter, a half and a whole second.
    """
    model = study.model
    figures = {"leap": 0.0, "leap_plain": 0.0}
    rng = np.random.default_rng(0)
    for seconds in (0.25, 0.5, 1.0):
        controls = rng.uniform(size=(round(60 / seconds), len(model.labels)))
        track = controls.repeat(study.frames(seconds), axis=0)
        for key, smooth in (("leap", True), ("leap_plain", False)):
            frames = model.start(smooth=smooth).frames(track)[0]
            figures[key] = max(figures[key], leap(model.contract.features(frames)))
    recorded = [leap(model.contract.features(clip)) for clip in study.reference.clips]
    return {**figures, "leap_recorded": max(recorded)}
