"""All figures of a model that is steered, beside recordings and beside the same model that seldom searches."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from motet.errors import ControlWarning
from motet.models.steer import SteerModel
from motet_train.data.errors import DataError
from motet_train.data.locomotion import Recording, gaits_of, recordings
from motet_train.data.matching_rows import rows_of
from motet_train.data.store import Store
from motet_train.evaluate.steer.following import aside_errors, speed_errors, turn_errors
from motet_train.evaluate.steer.standing import SPEEDS, held_on, standing, stretches
from motet_train.evaluate.steer.track import Track, tracks_of
from motet_train.evaluate.steer.wandering import Limits, wandering
from motet_train.evaluate.tables import Goals, Report, report_table

GOALS: Goals = {
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

SELDOM = 30
"""Ticks between two searches of the simple rival: the recording that fits best is played for a second, or until
something else is told. (Two seconds make it weaker: few recorded runs go on for so long.)"""

MINUTES, CHARACTERS = 10.0, 100
"""How long how many figures are told anything at random."""

BESIDE = {"recorded": "as recorded", "held": "feet held", "seldom": "seldom searched"}
"""What stands beside a model's figures, GROUP_NAME in a report, and the heads of their columns: recordings as they are
and with their feet held, as they are played; and the rival."""

Told = Callable[[str], object]


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
        return Recorded(_shown(store, True), _shown(store, False))

    def limits(self) -> Limits:
        """The most that they do."""
        return Limits.of([track for _, track in self.held])

    def standing(self, gait: str, held: bool) -> dict[str, float]:
        """The figures of :func:`standing`, of stretches of a gait's recordings."""
        own = [track for one, track in (self.held if held else self.plain) if gait in one.gaits]
        return standing([part for track in own for part in stretches(track, SPEEDS[gait])])


def _shown(store: Store, held: bool) -> list[tuple[Recording, Track]]:
    gaits = gaits_of(store)
    found = recordings(store, gaits, held)
    return list(zip(found, tracks_of(found, rows_of(found, tuple(gait.name for gait in gaits))), strict=True))


def steer_report(
    model: SteerModel,
    recorded: Recorded,
    told: Told = lambda part: None,
    minutes: float = MINUTES,
    characters: int = CHARACTERS,
) -> Report:
    """The figures of a model, of recordings and of the rival; ``told`` is told what is measured next.

    model: or a net that stands for one (:class:`motet_train.papers.tdbn.driven.Driven`), which has no rival.
    DataError for a model without a walk and a run.
    """
    if missing := [gait for gait in SPEEDS if gait not in model.gaits]:
        raise DataError(f"a model that is steered is measured at a walk and a run; this one has no {missing[0]!r}")
    limits = recorded.limits()
    report: Report = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ControlWarning)  # speeds that a gait does not have show in the figures
        rivals = {"_seldom": seldom(model)} if isinstance(model, SteerModel) else {}  # a net does not search
        for name, one in {"": model, **rivals}.items():
            own = _figures(one, limits, lambda part, name=name: told(part + name), minutes, characters)  # type: ignore[misc]
            report |= {f"{group}{name}": figures for group, figures in own.items()}
    for gait in SPEEDS:
        told(f"{gait}_recorded")
        report |= {f"{gait}_recorded": recorded.standing(gait, False), f"{gait}_held": recorded.standing(gait, True)}
    report["random_held"] = {"largest_turn": float(limits.turn.max()), "largest_leap": 1.0}
    return report


def seldom(model: SteerModel) -> SteerModel:
    """The same model, which searches only every :data:`SELDOM` ticks, and when something else is told."""
    config = {**model.manifest.config, "every": SELDOM}
    return SteerModel(replace(model.manifest, config=config), model.graphs)


def _figures(model: SteerModel, limits: Limits, told: Told, minutes: float, characters: int) -> Report:
    parts: dict[str, Callable[[], dict[str, float]]] = {
        **{gait: lambda gait=gait: _standing(model, gait) for gait in SPEEDS},  # type: ignore[misc]
        "speed": lambda: speed_errors(model),
        **{
            f"turn_{gait}": lambda gait=gait, pace=pace: turn_errors(model, gait, pace)  # type: ignore[misc]
            for gait, pace in SPEEDS.items()
        },
        "aside": lambda: aside_errors(model),
        "random": lambda: wandering(model, limits, 60 * minutes, characters),
    }
    report: Report = {}
    for name, part in parts.items():
        told(name)
        report[name] = part()
    return report


def _standing(model: SteerModel, gait: str) -> dict[str, float]:
    """With the foot lock, and without ("free")."""
    free = standing([held_on(model, gait, False)])
    return standing([held_on(model, gait, True)]) | {f"free_{name}": value for name, value in free.items()}


def steer_text(reports: Mapping[str, Report]) -> str:
    """A table of the figures of each model, with recordings and the rival of the first one beside them, and goals."""
    own = {name: _of(report, "") for name, report in reports.items()}
    first = next(iter(reports.values()))
    return report_table(own, GOALS, {head: _of(first, f"_{kind}") for kind, head in BESIDE.items()})


def _of(report: Report, ending: str) -> Report:
    """The groups of a kind, without the ending that says which."""
    endings = tuple(f"_{kind}" for kind in BESIDE)
    groups: dict[str, Any] = {
        group.removesuffix(ending): found
        for group, found in report.items()
        if (group.endswith(ending) if ending else not group.endswith(endings))
    }
    return groups
