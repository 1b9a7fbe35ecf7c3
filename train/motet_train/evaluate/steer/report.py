"""All figures of a steered model, next to those of recordings and of the same model with rare searches.

For minutes, figures get random commands: whether their poses stay plausible, and whether they go. The movement of
joints in each tick is compared with that in the recordings that are played (:class:`Limits`).
"""

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.errors import ControlWarning
from motet.figures.humanoid import BONES, HUMANOID
from motet.motion.rotations import Array
from motet.motion.skeleton import partners_of
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.recorded import Recording
from motet.steering.rows import rows_of
from motet.steering.settings import SteeringSettings
from motet_train.data.errors import DataError
from motet_train.data.recorded import gaits_of, recordings
from motet_train.data.store import Store
from motet_train.evaluate.positions import Flags, mean_and_tail
from motet_train.evaluate.steer.commands import act_figures, going_figures, said_acts
from motet_train.evaluate.steer.crowds import CROWDS, crowd_figures
from motet_train.evaluate.steer.edges import (
    minute_figures,
    slow_side_figures,
    spot_turn_figures,
    stop_figures,
    wild_stick_figures,
)
from motet_train.evaluate.steer.following import (
    MEASURED_SPEEDS,
    WAYS_PACES,
    Track,
    aside_errors,
    creep_errors,
    gait_figures,
    joint_steps,
    speed_errors,
    standing,
    stretches,
    tracks_of,
    turn_errors,
    turns,
    way_off,
    ways_errors,
)
from motet_train.evaluate.steer.ground import GROUNDS, ground_figures
from motet_train.evaluate.steer.limbs import cut_figures, reach_figures
from motet_train.evaluate.steer.paths import chase_figures, path_figures, slow_point_figures
from motet_train.evaluate.steer.players import COMMANDS_SEED, reversal_figures, stick_figures
from motet_train.evaluate.tables import Report, gathered, read_goals, report_table

STEER_GOALS = read_goals("steer")

BESIDE_COLUMNS = {"recorded": "as recorded", "held": "feet held", "seldom": "seldom searched"}
"""Suffix of a group in a report -> the head of its column: recordings as they are; with their feet held, as they are
played; and the rival."""


@dataclass(frozen=True, eq=False)
class Limits:
    """The extremes of recordings and of their mirror images. turn: (J,) degrees that bones turn by in a frame, the hips
    relative to the facing. leap: (J',) metres that joints move in a frame, in the figure's own space. low, high: of the
    hips.
    """

    turn: Array
    leap: Array
    low: float
    high: float

    @staticmethod
    def of(tracks: list[Track]) -> "Limits":
        """The limits of recordings."""
        # the extremes of all frames of all recordings
        turn = np.max([turns(track).max(axis=(0, 1)) for track in tracks], axis=0)
        leap = np.max([joint_steps(track).max(axis=(0, 1)) for track in tracks], axis=0)
        heights = np.concatenate([track.height[:, 0] for track in tracks])

        # a model also plays mirror images, so both sides have the larger limit
        return Limits(
            turn=np.maximum(turn, turn[list(partners_of(BONES))]),
            leap=np.maximum(leap, leap[list(partners_of(HUMANOID.names))]),
            low=float(heights.min()),
            high=float(heights.max()),
        )


@dataclass(frozen=True, eq=False)
class Watch:
    """T ticks of B figures: each array is (T, B) except ``ground`` (T, B, 3).

    speed: commanded, m/s. direction: commanded, degrees. since: ticks since the command changed, 0 at the first tick.
    finite: whether the pose is. turn: degrees that the bone turned by which turned most. leap: the largest step of a
    joint, relative to its limit. height: of the hips. lowest: height of the lowest point of the soles.
    """

    ground: Array
    speed: Floats
    direction: Floats
    since: NDArray[np.int32]
    finite: Flags
    turn: Floats
    leap: Floats
    height: Floats
    lowest: Array

    @staticmethod
    def joined(parts: list["Watch"]) -> "Watch":
        """Consecutive parts as one."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return Watch(*map(np.concatenate, columns))


class _RandomPlayer:
    """Gives B figures random commands that last 0.2 to 3 s: 15 % of them to stand, half to face the way they go."""

    def __init__(self, model: SteerModel, characters: int) -> None:
        self.rng = np.random.default_rng(COMMANDS_SEED)
        self.fps = model.fps
        self.names = np.array(model.gaits)
        self.ranges = np.array([model.speeds[name] for name in model.gaits])
        # the figures and their commands
        self.session = model.start(characters=characters)
        self.ticks_left = np.zeros(characters, dtype=np.int64)
        self.since = np.zeros(characters, dtype=np.int64)
        self.gait = np.zeros(characters, dtype=np.int64)
        self.speed = np.zeros(characters)
        self.direction = np.zeros(characters)
        self.facing = np.zeros(characters)

    def control(self) -> None:
        """Change commands before a tick."""
        self.ticks_left -= 1
        self.since += 1
        changing = np.flatnonzero(self.ticks_left < 0)
        if len(changing):
            self._draw(changing)
            gaits = self.names[self.gait].tolist()
            self.session.control(gait=gaits, speed=self.speed, direction=self.direction, facing=self.facing)
            self.speed = np.hypot(*self.session.target[:, :2].T)  # limited to what the gaits can do in that direction

    def _draw(self, changing: NDArray[np.intp]) -> None:
        """Draw new commands for some figures."""
        rng = self.rng
        count = len(changing)
        # how long the command lasts, and the gait
        self.ticks_left[changing] = np.round(rng.uniform(0.2, 3.0, count) * self.fps) - 1
        self.since[changing] = 0
        self.gait[changing] = rng.integers(len(self.names), size=count)

        # a speed that the gait has, or standing; a direction, and as often as not a facing of its own
        slowest, fastest = self.ranges[self.gait[changing]].T
        self.speed[changing] = np.where(rng.random(count) < 0.15, 0.0, rng.uniform(slowest, fastest))
        self.direction[changing] = rng.uniform(-180, 180, count)
        facing = rng.uniform(-180, 180, count)
        self.facing[changing] = np.where(rng.random(count) < 0.5, self.direction[changing], facing)

    def play(self, ticks: int) -> tuple[list[Pose], Array]:
        """The poses of some ticks, and (T, 3, B) the speed, the direction and the age of each command in ticks."""
        poses = []
        commands = []
        for _ in range(ticks):
            self.control()
            poses.append(self.session.tick())
            commands.append(np.stack([self.speed, self.direction, self.since]))
        return poses, np.stack(commands)


def watched(model: SteerModel, limits: Limits, seconds: float, characters: int, chunk: int = 30) -> Watch:
    """Watch figures that get random commands, with the foot lock. chunk: ticks that are measured together."""
    player = _RandomPlayer(model, characters)
    ticks = round(seconds * model.fps)
    last = player.session.tick()
    parts = []
    for start in range(0, ticks, chunk):
        poses, commands = player.play(min(chunk, ticks - start))
        track = Track.of([last, *poses], model.fps)
        parts.append(_watch_of(track, commands, limits))
        last = poses[-1]
    return Watch.joined(parts)


def _watch_of(track: Track, commands: Array, limits: Limits) -> Watch:
    """What commands (T, 3, B) make of figures, by a track of T + 1 frames."""
    # steps need the frame before; all else is of the frame itself
    now = track[1:]
    relative_steps = joint_steps(track) / np.maximum(limits.leap, 1e-3)
    return Watch(
        ground=now.ground,
        speed=commands[:, 0].astype(np.float32),
        direction=commands[:, 1].astype(np.float32),
        since=commands[:, 2].astype(np.int32),
        finite=np.asarray(np.isfinite(now.places).all(axis=(2, 3)) & np.isfinite(now.ground).all(axis=2)),
        turn=turns(track).max(axis=2).astype(np.float32),
        leap=relative_steps.max(axis=2).astype(np.float32),
        height=now.height,
        lowest=now.soles[..., 1].min(axis=2),
    )


def broken(watch: Watch, limits: Limits) -> Flags:
    """Poses (T, B) that are not finite, in which a bone turns more in a tick than in any recording, or whose hips are 5
    cm lower or higher than in any."""
    above = watch.height >= limits.low - 0.05
    below = watch.height <= limits.high + 0.05
    whole = watch.finite & (watch.turn <= limits.turn.max()) & above & below
    flags: Flags = ~whole
    return flags


def frozen(watch: Watch, fps: float) -> Flags:
    """Ticks (T, B) at which a figure turns out to be frozen.

    For 2 s its command was to go at more than 0.4 m/s, and its path was shorter than a third of that; or for the first
    time none of its joints has turned by 0.01 degrees a tick for half a second.
    """
    # metres gone in the last two seconds
    ticks = round(2.0 * fps)
    ground = watch.ground[..., :2]
    steps = np.linalg.norm(np.diff(ground, axis=0, prepend=ground[:1]), axis=2)
    path = np.cumsum(steps, axis=0, dtype=np.float64)
    gone = np.zeros_like(path)
    gone[ticks:] = path[ticks:] - path[:-ticks]

    # ticks at which a figure has just been stiff for half a second
    stiff_ticks = round(0.5 * fps)
    stiff = np.cumsum(watch.turn < 0.01, axis=0)
    still = np.zeros(path.shape, dtype=bool)
    still[stiff_ticks:] = stiff[stiff_ticks:] - stiff[:-stiff_ticks] == stiff_ticks
    still[1:] &= ~still[:-1]

    # a third of the way that was commanded
    too_slow = gone / 2.0 < watch.speed / 3
    flags: Flags = still | (_long_commanded(watch, ticks) & too_slow)
    return flags


def _long_commanded(watch: Watch, ticks: int) -> Flags:
    """Ticks (T, B) at which a figure has had one command for ``ticks`` ticks, to go at more than 0.4 m/s."""
    flags: Flags = (watch.since == ticks) & (watch.speed > 0.4)
    return flags


def astray(watch: Watch, fps: float) -> Array:
    """Degrees (N,) between the actual and the commanded direction over half a second, for all figures that have had one
    command for 2 s, to go at more than 0.4 m/s."""
    selected = _long_commanded(watch, round(2.0 * fps))
    half_second = round(0.5 * fps)
    ground = watch.ground[..., :2]
    gone = np.zeros_like(ground)
    gone[half_second:] = ground[half_second:] - ground[:-half_second]
    errors: Array = np.abs(way_off(gone[selected], watch.direction[selected]))
    return errors


def wandering(model: SteerModel, limits: Limits, seconds: float, characters: int) -> dict[str, float]:
    """Counts over all ticks and figures: broken poses, freezes, leaps (a joint moves a tenth farther in a tick, in the
    figure's own space, than in any recording), and soles 3 cm or more under the ground; and the largest of each.
    direction: errors in degrees (:func:`astray`), their mean and 95th percentile; NaN without any."""
    # watch figures, and count
    watch = watched(model, limits, seconds, characters)
    direction, direction_p95 = mean_and_tail(astray(watch, model.fps))
    return {
        "broken": float(broken(watch, limits).sum()),
        "frozen": float(frozen(watch, model.fps).sum()),
        "leaps": float((watch.leap > 1.1).sum()),
        "under_ground": float((watch.lowest < -0.03).sum()),
        "largest_turn": float(watch.turn.max()),
        "largest_leap": float(watch.leap.max()),
        "direction": direction,
        "direction_p95": direction_p95,
        "deepest_cm": 100 * float(max(0.0, -watch.lowest.min())),
    }


@dataclass(frozen=True, eq=False)
class Recorded:
    """Recordings of gaits, and their tracks. held: with their feet held, as a model plays them; plain: without."""

    held: list[tuple[Recording, Track]]
    plain: list[tuple[Recording, Track]]

    @staticmethod
    def of(store: Store) -> "Recorded":
        """The recordings of a store; DataError if it is not in ``root_sixd``, or a gait has none."""
        store.needs_sixd("figures that are steered are measured beside a store in")
        return Recorded(held=_with_tracks(store, held=True), plain=_with_tracks(store, held=False))

    def standing(self, gait: str, held: bool) -> dict[str, float]:
        """The figures of :func:`standing` for stretches of a gait's recordings."""
        parts = []
        for recording, track in self.held if held else self.plain:
            if gait in recording.gaits:
                parts += stretches(track, MEASURED_SPEEDS[gait])
        return standing(parts)


def _with_tracks(store: Store, held: bool) -> list[tuple[Recording, Track]]:
    gaits = gaits_of(store)
    recorded = recordings(store, gaits, held)
    rows = rows_of(recorded, tuple(gait.name for gait in gaits), SteeringSettings())
    return list(zip(recorded, tracks_of(recorded, rows), strict=True))


def steer_report(model: SteerModel, recorded: Recorded, minutes: float = 10.0, characters: int = 100) -> Report:
    """The figures of a model, of recordings and of the rival.

    model: may be a net behind the same interface (:class:`motet_train.papers.tdbn.steered.Driven`), without a rival.
    minutes, characters: duration and number of figures of the random commands.
    DataError for a model without a walk and a run.
    """
    if missing := [gait for gait in MEASURED_SPEEDS if gait not in model.gaits]:
        raise DataError(f"a model that is steered is measured at a walk and a run; this one has no {missing[0]!r}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ControlWarning)  # speeds that a gait lacks show in the figures
        return gathered(_parts(model, recorded, minutes, characters), "steered figures")


Measure = Callable[[SteerModel], dict[str, float]]


def _parts(model: SteerModel, recorded: Recorded, minutes: float, characters: int) -> Iterator[Report]:
    limits = Limits.of([track for _, track in recorded.held])
    systems = {"": model}
    measures = _measures(limits, minutes, characters)
    if hasattr(model, "matcher"):  # a net behind the interface neither acts nor searches
        measures |= _command_measures(model, limits)
        systems["_seldom"] = seldom(model)
    for suffix, system in systems.items():
        for name, measure in measures.items():
            yield {f"{name}{suffix}": measure(system)}
    for gait in MEASURED_SPEEDS:
        yield {
            f"{gait}_recorded": recorded.standing(gait, held=False),
            f"{gait}_held": recorded.standing(gait, held=True),
        }
    yield {"random_held": {"largest_turn": float(limits.turn.max()), "largest_leap": 1.0}}


STEP_MEASURES: Mapping[str, Measure] = {
    "slow_side": slow_side_figures,
    "spot_turn": spot_turn_figures,
    "wild_stick": wild_stick_figures,
    "stops": stop_figures,
    "standing": minute_figures,
}
"""Of models that plan steps."""


def _measures(limits: Limits, minutes: float, characters: int) -> dict[str, Measure]:
    """Group -> its measure, for all steered models."""
    measures: dict[str, Measure] = {gait: partial(gait_figures, gait=gait) for gait in MEASURED_SPEEDS}
    measures["speed"] = speed_errors
    for gait, pace in MEASURED_SPEEDS.items():
        measures[f"turn_{gait}"] = partial(turn_errors, gait=gait, pace=pace)
    measures["aside"] = aside_errors
    measures["creep"] = creep_errors
    for gait in WAYS_PACES:
        measures[f"ways_{gait}"] = partial(ways_errors, gait=gait)
    measures["reversals"] = reversal_figures
    measures["stick"] = stick_figures
    # for the minutes that a user waits longest
    measures["random"] = partial(wandering, limits=limits, seconds=60 * minutes, characters=characters)
    return measures


def _command_measures(model: SteerModel, limits: Limits) -> dict[str, Measure]:
    """Group -> its measure, for models that plan steps, act, reach, and go to points."""
    acts = said_acts(model)
    measures = dict(STEP_MEASURES)
    # acts, begun from all gaits, and cut
    measures["act_standing"] = partial(act_figures, acts=acts, leap=limits.leap, gait=None)
    for gait in MEASURED_SPEEDS:
        measures[f"act_{gait}"] = partial(act_figures, acts=acts, leap=limits.leap, gait=gait)
    measures["cut_standing"] = partial(cut_figures, acts=acts, gait=None)
    for gait in MEASURED_SPEEDS:
        measures[f"cut_{gait}"] = partial(cut_figures, acts=acts, gait=gait)
    # hands, ways and ground
    measures["reach"] = reach_figures
    for gait in MEASURED_SPEEDS:
        measures[f"going_{gait}"] = partial(going_figures, gait=gait)
        measures[f"paths_{gait}"] = partial(path_figures, gait=gait)
        for ground in GROUNDS:
            measures[f"ground_{ground}_{gait}"] = partial(ground_figures, ground=ground, gait=gait)
    # near and moving points, and crowds
    measures["slow_points"] = slow_point_figures
    measures["chase"] = chase_figures
    return measures | {f"crowd_{crowd}": partial(crowd_figures, crowd=crowd) for crowd in CROWDS}


def seldom(model: SteerModel) -> SteerModel:
    """The simplest rival: the same model, which searches only every 30 ticks, a second, and when a command changes; in
    between, the best recording is played on, or to its end."""
    settings = {**asdict(model.settings(SteeringSettings)), "search_every": 30}
    manifest = replace(model.manifest, settings={**model.manifest.settings, SteeringSettings.FEATURE: settings})
    return SteerModel(manifest, {}, model.tables)


def steer_text(reports: Mapping[str, Report]) -> str:
    """A table of the figures of each model with the goals, and those of recordings and of the first model's rival."""
    first = next(iter(reports.values()))
    beside = {head: _groups(first, f"_{suffix}") for suffix, head in BESIDE_COLUMNS.items()}
    return report_table({name: _model_groups(report) for name, report in reports.items()}, STEER_GOALS, beside)


def _groups(report: Report, suffix: str) -> Report:
    """The groups with a suffix, named without it."""
    return {group.removesuffix(suffix): figures for group, figures in report.items() if group.endswith(suffix)}


def _model_groups(report: Report) -> Report:
    """The groups of the model itself."""
    suffixes = tuple(f"_{suffix}" for suffix in BESIDE_COLUMNS)
    return {group: figures for group, figures in report.items() if not group.endswith(suffixes)}
