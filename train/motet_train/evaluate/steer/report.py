"""All figures of a model that is steered, beside recordings and beside the same model that seldom searches.

Some figures are told anything at random, for minutes: whether their poses stay whole, and whether they go. What joints
do from tick to tick is held against what they do in the recordings that are played (:class:`Limits`).
"""

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.errors import ControlWarning
from motet.figures.humanoid import BONES, HUMANOID
from motet.motion.rotations import Array
from motet.motion.skeleton import partners_of
from motet.steering.model import SteerModel
from motet.steering.settings import SteeringSettings
from motet_train.data.errors import DataError
from motet_train.data.matching_rows import rows_of
from motet_train.data.recorded import Recording, gaits_of, recordings
from motet_train.data.store import Store
from motet_train.evaluate.positions import Flags, length
from motet_train.evaluate.steer.following import (
    MEASURED_SPEEDS,
    WAYS_PACES,
    Track,
    aside_errors,
    creep_errors,
    gait_figures,
    speed_errors,
    standing,
    stretches,
    tracks_of,
    turn_errors,
    way_off,
    ways_errors,
)
from motet_train.evaluate.steer.players import SEED, reversal_figures, stick_figures
from motet_train.evaluate.steer.told import act_figures, going_figures, said_acts
from motet_train.evaluate.tables import Goals, Report, gathered, report_table

GOING_GOALS = {"never": 0, "off_worst_cm": 8}

STEER_GOALS: Goals = {
    "walk.slide_cm": (None, 2.5),
    "walk.toe_speed": (None, 0.15),
    "walk.acceleration": (None, 6),
    "run.slide_cm": (None, 6),
    "speed.mean": (None, 0.1),
    "turn_walk.s_90": (None, 1.2),
    "turn_walk.direction_90": (None, 5),
    "turn_walk.facing_90": (None, 5),
    "ways_walk.direction": (None, 2),
    "ways_walk.direction_worst": (None, 6),
    "ways_run.direction": (None, 3),
    "ways_run.direction_worst": (None, 8),
    "creep.speed_worst": (None, 0.05),
    "creep.slide_cm": (None, 2),
    "stick.slide_p95_cm": (None, 5),
    "reversals.slide_p95_cm": (None, 6),
    "act_standing.begun_worst": (None, 0.4),
    "act_walk.begun_worst": (None, 0.4),
    **{f"act_{who}.leaps": (None, 0) for who in ("standing", "walk", "run")},
    **{f"going_{gait}.{name}": (None, most) for gait in MEASURED_SPEEDS for name, most in GOING_GOALS.items()},
    "random.broken": (None, 0),
    "random.frozen": (None, 0),
    "random.leaps": (None, 0),
    "random.under_ground": (None, 0),
}
"""Figure -> (least, most) that the model that comes with motet is to reach."""

BESIDE_COLUMNS = {"recorded": "as recorded", "held": "feet held", "seldom": "seldom searched"}
"""What stands beside a model's figures, GROUP_NAME in a report, and the heads of their columns: recordings as they are
and with their feet held, as they are played; and the rival."""


@dataclass(frozen=True, eq=False)
class Limits:
    """The most of recordings, and of their mirror images. turn: (J,) degrees that bones turn by in a frame, the hips
    seen from the facing. leap: (J',) metres that joints move in a frame, seen from the figure. low, high: of the hips.
    """

    turn: Array
    leap: Array
    low: float
    high: float

    @staticmethod
    def of(tracks: list[Track]) -> "Limits":
        """Those of recordings."""

        def most(of: Callable[[Track], Array], names: tuple[str, ...]) -> Array:
            values = np.max([of(track).max(axis=(0, 1)) for track in tracks], axis=0)
            found: Array = np.maximum(values, values[list(partners_of(names))])
            return found

        heights = np.concatenate([track.height[:, 0] for track in tracks])
        return Limits(most(turns, BONES), most(leaps, HUMANOID.names), float(heights.min()), float(heights.max()))


def turns(track: Track) -> Array:
    """Degrees (T - 1, B, J) by which bones turn from frame to frame, seen from their parents."""
    a, b = track.rotations[:-1].astype(np.float64), track.rotations[1:]
    signs = np.where((a * b).sum(axis=-1, keepdims=True) < 0, -1, 1)
    found: Array = np.degrees(4 * np.arcsin(np.minimum(length(a - signs * b) / 2, 1)))
    return found


def leaps(track: Track) -> Array:
    """Metres (T - 1, B, J') by which joints move from frame to frame, as the figures see it."""
    return length(np.diff(track.seen().places, axis=0))


@dataclass(frozen=True, eq=False)
class Watch:
    """What T ticks of B figures were: each array is (T, B) but ``ground`` (T, B, 3).

    asked: m/s. way: degrees, where to. since: ticks since the last change, 0 at the tick that follows it. finite:
    whether all is. turn: degrees that the bone turned which turned most. leap: how far the joint moved that went the
    farthest beside its limit, as a share of that. height: of the hips. lowest: of the soles.
    """

    ground: Array
    asked: Floats
    way: Floats
    since: NDArray[np.int32]
    finite: Flags
    turn: Floats
    leap: Floats
    height: Floats
    lowest: Array


class _Teller:
    """Tells B figures something else after 0.2 to 3 s each: to stand in 15 of 100 changes, and to face where they go in
    half of them."""

    def __init__(self, model: SteerModel, characters: int, seed: int) -> None:
        self.rng, self.fps, self.names = np.random.default_rng(seed), model.fps, np.array(model.gaits)
        self.ranges = np.array([model.speeds[name] for name in model.gaits])
        self.session = model.start(characters=characters)
        self.left, self.since, self.gait = (np.zeros(characters, dtype=np.int64) for _ in range(3))
        self.speed, self.direction, self.facing = (np.zeros(characters) for _ in range(3))

    def tell(self) -> None:
        """Before each tick."""
        self.left -= 1
        self.since += 1
        who = np.flatnonzero(self.left < 0)
        if not len(who):
            return
        rng, count = self.rng, len(who)
        self.left[who], self.since[who] = np.round(rng.uniform(0.2, 3.0, count) * self.fps) - 1, 0
        self.gait[who] = rng.integers(len(self.names), size=count)
        low, high = self.ranges[self.gait[who]].T
        self.speed[who] = np.where(rng.random(count) < 0.15, 0.0, rng.uniform(low, high))
        self.direction[who] = rng.uniform(-180, 180, count)
        facing = rng.uniform(-180, 180, count)
        self.facing[who] = np.where(rng.random(count) < 0.5, self.direction[who], facing)
        gaits = self.names[self.gait].tolist()
        self.session.control(gait=gaits, speed=self.speed, direction=self.direction, facing=self.facing)
        self.speed = np.hypot(*self.session.target[:, :2].T)  # within what gaits can do that way


def watched(
    model: SteerModel, limits: Limits, seconds: float, characters: int, seed: int = SEED, chunk: int = 30
) -> Watch:
    """What figures do that are told anything at random, with the foot lock. chunk: ticks looked at together."""
    teller, ticks = _Teller(model, characters, seed), round(seconds * model.fps)
    last, parts = [teller.session.tick()], []
    for start in range(0, ticks, chunk):
        poses, asked, ways, since = [], [], [], []
        for _ in range(min(chunk, ticks - start)):
            teller.tell()
            poses.append(teller.session.tick())
            asked.append(teller.speed.astype(np.float32))
            ways.append(teller.direction.astype(np.float32))
            since.append(teller.since.astype(np.int32))
        track = Track.of([*last, *poses], model.fps)
        now, last = track[1:], poses[-1:]
        part = Watch(
            ground=now.ground,
            asked=np.stack(asked),
            way=np.stack(ways),
            since=np.stack(since),
            finite=np.asarray(np.isfinite(now.places).all(axis=(2, 3)) & np.isfinite(now.ground).all(axis=2)),
            turn=turns(track).max(axis=2).astype(np.float32),
            leap=(leaps(track) / np.maximum(limits.leap, 1e-3)).max(axis=2).astype(np.float32),
            height=now.height,
            lowest=now.soles[..., 1].min(axis=2),
        )
        parts.append(part)
    return Watch(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Watch)))


def broken(watch: Watch, limits: Limits) -> Flags:
    """Poses (T, B) that are not finite, or where a bone turned more in a tick than any does in a recording, or whose
    hips are lower or higher than in any by 5 cm."""
    inside = (watch.height >= limits.low - 0.05) & (watch.height <= limits.high + 0.05)
    found: Flags = ~(watch.finite & (watch.turn <= limits.turn.max()) & inside)
    return found


def frozen(watch: Watch, fps: float) -> Flags:
    """Ticks (T, B) at which a figure turns out to be frozen.

    It was told the same for 2 s until then, to go at more than 0.4 m/s, and went less than a third as far along its
    path; or for the first time none of its joints has turned by 0.01 degrees a tick for half a second.
    """
    ticks, stiff_for = round(2.0 * fps), round(0.5 * fps)
    steps = np.linalg.norm(np.diff(watch.ground[..., :2], axis=0, prepend=watch.ground[:1, :, :2]), axis=2)
    path, stiff = np.cumsum(steps, axis=0, dtype=np.float64), np.cumsum(watch.turn < 0.01, axis=0)
    went, still = np.zeros_like(path), np.zeros(path.shape, dtype=bool)
    went[ticks:] = path[ticks:] - path[:-ticks]
    still[stiff_for:] = stiff[stiff_for:] - stiff[:-stiff_for] == stiff_for
    still[1:] &= ~still[:-1]
    found: Flags = still | ((watch.since == ticks) & (watch.asked > 0.4) & (went / 2.0 < watch.asked / 3))
    return found


def astray(watch: Watch, fps: float) -> Array:
    """Degrees (N,) between where figures went for half a second and where they were told to go, of all that had been
    told the same for 2 s by then, to go at more than 0.4 m/s."""
    ticks, last = round(2.0 * fps), round(0.5 * fps)
    told = (watch.since == ticks) & (watch.asked > 0.4)
    gone = np.zeros_like(watch.ground[..., :2])
    gone[last:] = watch.ground[last:, :, :2] - watch.ground[:-last, :, :2]
    found: Array = np.abs(way_off(gone[told], watch.way[told]))
    return found


def wandering(model: SteerModel, limits: Limits, seconds: float, characters: int) -> dict[str, float]:
    """Counts, all ticks of all figures: broken poses, freezes, leaps (a joint goes a tenth farther in a tick, seen from
    the figure, than in any recording), soles 3 cm or more under the ground; and the most of each. direction: degrees
    off (:func:`astray`), their mean and 95th percentile; NaN of none."""
    watch = watched(model, limits, seconds, characters)
    off = astray(watch, model.fps)
    mean, most = (off.mean(), np.percentile(off, 95)) if len(off) else (np.nan, np.nan)
    return {
        "broken": float(broken(watch, limits).sum()),
        "frozen": float(frozen(watch, model.fps).sum()),
        "leaps": float((watch.leap > 1.1).sum()),
        "under_ground": float((watch.lowest < -0.03).sum()),
        "largest_turn": float(watch.turn.max()),
        "largest_leap": float(watch.leap.max()),
        "direction": float(mean),
        "direction_p95": float(most),
        "deepest_cm": 100 * float(max(0.0, -watch.lowest.min())),
    }


@dataclass(frozen=True, eq=False)
class Recorded:
    """Recordings of gaits, and what they show. held: with their feet held, as a model plays them; plain: without."""

    held: list[tuple[Recording, Track]]
    plain: list[tuple[Recording, Track]]

    @staticmethod
    def of(store: Store) -> "Recorded":
        """Those of a store; DataError where it is not in ``root_sixd``, or a gait has none."""
        if store.representation != "root_sixd":
            what = f"in root_sixd (motet prepare --for codes), not {store.representation}"
            raise DataError(f"figures that are steered are measured beside a store {what}")
        gaits, shown = gaits_of(store), []
        for held in (True, False):
            found = recordings(store, gaits, held)
            rows = rows_of(found, tuple(gait.name for gait in gaits), SteeringSettings())
            shown.append(list(zip(found, tracks_of(found, rows), strict=True)))
        return Recorded(*shown)

    def standing(self, gait: str, held: bool) -> dict[str, float]:
        """The figures of :func:`standing`, of stretches of a gait's recordings."""
        own = [track for one, track in (self.held if held else self.plain) if gait in one.gaits]
        return standing([part for track in own for part in stretches(track, MEASURED_SPEEDS[gait])])


def steer_report(model: SteerModel, recorded: Recorded, minutes: float = 10.0, characters: int = 100) -> Report:
    """The figures of a model, of recordings and of the rival.

    model: or a net that stands for one (:class:`motet_train.papers.tdbn.steered.Driven`), which has no rival.
    minutes, characters: how long how many figures are told anything at random.
    DataError for a model without a walk and a run.
    """
    if missing := [gait for gait in MEASURED_SPEEDS if gait not in model.gaits]:
        raise DataError(f"a model that is steered is measured at a walk and a run; this one has no {missing[0]!r}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ControlWarning)  # speeds that a gait does not have show in the figures
        return gathered(_parts(model, recorded, minutes, characters), "steered figures")


def _parts(model: SteerModel, recorded: Recorded, minutes: float, characters: int) -> Iterator[Report]:
    limits = Limits.of([track for _, track in recorded.held])
    measures: dict[str, Callable[[SteerModel], dict[str, float]]] = {
        **{gait: partial(gait_figures, gait=gait) for gait in MEASURED_SPEEDS},
        "speed": speed_errors,
        **{f"turn_{gait}": partial(turn_errors, gait=gait, pace=pace) for gait, pace in MEASURED_SPEEDS.items()},
        "aside": aside_errors,
        "creep": creep_errors,
        **{f"ways_{gait}": partial(ways_errors, gait=gait) for gait in WAYS_PACES},
        "reversals": reversal_figures,
        "stick": stick_figures,
        "random": partial(wandering, limits=limits, seconds=60 * minutes, characters=characters),
    }
    if hasattr(model, "matcher"):
        acts = said_acts(model)
        gaits = {"act_standing": None, **{f"act_{gait}": gait for gait in MEASURED_SPEEDS}}
        measures |= {name: partial(act_figures, acts=acts, leap=limits.leap, gait=of) for name, of in gaits.items()}
        measures |= {f"going_{gait}": partial(going_figures, gait=gait) for gait in MEASURED_SPEEDS}
    rivals = {"_seldom": seldom(model)} if hasattr(model, "matcher") else {}  # what stands for one does not search
    for ending, one in {"": model, **rivals}.items():
        yield from ({f"{name}{ending}": measure(one)} for name, measure in measures.items())
    for gait in MEASURED_SPEEDS:
        yield {f"{gait}_recorded": recorded.standing(gait, False), f"{gait}_held": recorded.standing(gait, True)}
    yield {"random_held": {"largest_turn": float(limits.turn.max()), "largest_leap": 1.0}}


def seldom(model: SteerModel, every: int = 30) -> SteerModel:
    """The simplest rival: the same model, which searches only every so many ticks, a second, and when something else is
    told; until then, or until its end, the recording that fits best is played."""
    own = {**asdict(model.settings(SteeringSettings)), "search_every": every}
    manifest = replace(model.manifest, settings={**model.manifest.settings, SteeringSettings.FEATURE: own})
    return SteerModel(manifest, {}, model.tables)


def steer_text(reports: Mapping[str, Report]) -> str:
    """A table of the figures of each model, with recordings and the rival of the first one beside them, and goals."""
    own = {name: _of(report, "") for name, report in reports.items()}
    first = next(iter(reports.values()))
    return report_table(own, STEER_GOALS, {head: _of(first, f"_{kind}") for kind, head in BESIDE_COLUMNS.items()})


def _of(report: Report, ending: str) -> Report:
    """The groups of a kind, without the ending that says which."""
    endings = tuple(f"_{kind}" for kind in BESIDE_COLUMNS)
    return {
        group.removesuffix(ending): found
        for group, found in report.items()
        if (group.endswith(ending) if ending else not group.endswith(endings))
    }
