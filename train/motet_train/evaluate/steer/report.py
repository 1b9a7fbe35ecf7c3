"""All figures of a model that is steered, beside recordings and beside the same model that seldom searches."""

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial

from motet.decode.matching import SteeringSettings
from motet.errors import ControlWarning
from motet.models.steer import SteerModel
from motet_train.data.errors import DataError
from motet_train.data.matching_rows import Recording, gaits_of, recordings, rows_of
from motet_train.data.store import Store
from motet_train.evaluate.steer.following import (
    MEASURED_SPEEDS,
    aside_errors,
    gait_figures,
    speed_errors,
    turn_errors,
)
from motet_train.evaluate.steer.track import Track, standing, stretches, tracks_of
from motet_train.evaluate.steer.wandering import Limits, wandering
from motet_train.evaluate.tables import Goals, Report, gathered, report_table

STEER_GOALS: Goals = {
    "walk.slide_cm": (None, 2.5),
    "walk.toe_speed": (None, 0.15),
    "walk.acceleration": (None, 6),
    "run.slide_cm": (None, 6),
    "speed.mean": (None, 0.1),
    "turn_walk.s_90": (None, 1.2),
    "turn_walk.direction_90": (None, 5),
    "turn_walk.facing_90": (None, 5),
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
        "random": partial(wandering, limits=limits, seconds=60 * minutes, characters=characters),
    }
    rivals = {"_seldom": seldom(model)} if isinstance(model, SteerModel) else {}
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
