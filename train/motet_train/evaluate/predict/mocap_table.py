"""The tables of predictions of recorded motions: distances of all, and by kinds of motions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from motet_train.data.store import Entry
from motet_train.evaluate.predict.error_rows import BRACKETS, REPORTED, ErrorRows
from motet_train.evaluate.predict.floors import CONSTANT, DAMPED, FLOORS, ZERO, key
from motet_train.evaluate.predict.kinds import by_kind
from motet_train.evaluate.predict.mocap import PLACE, POSE, Distances, Measured, to_json
from motet_train.evaluate.predict.seed_groups import SeedGroup, pooled, spread

TITLES = {PLACE: "joints in the world, cm", POSE: "joints relative to the root, cm"}

COMPARED = {ZERO: "standing still", CONSTANT: CONSTANT, DAMPED: DAMPED}
"""Floors that a model is to be better than, and how sentences call them."""


ONE = {"people": "person", "recordings": "recording", "windows": "window"}


@dataclass(frozen=True)
class Part:
    """The distances of some recordings. means, and spreads of groups of several seeds: system -> measure -> (N,)."""

    recordings: tuple[str, ...]
    people: int
    windows: int
    means: Distances
    spreads: Distances


def part_of(found: Measured, entries: Sequence[Entry], groups: Sequence[SeedGroup]) -> Part:
    """What was measured in some recordings, by groups of runs; DataError where they have no window."""
    names = tuple(entry.name for entry in entries)
    means, several = found.mean(names), [group for group in groups if len(group.runs) > 1]
    apart = pooled(means, several, spread)
    spreads = {group.title: apart[group.title] for group in several}
    people = len({entry.subject for entry in entries})
    return Part(names, people, len(found.windows(names)), pooled(means, groups), spreads)


def parts_of(found: Measured, entries: Sequence[Entry], groups: Sequence[SeedGroup]) -> dict[str, Part]:
    """The parts of what was measured by the kinds of the recordings; a kind without a window is left out."""
    kinds = by_kind([entry for entry in entries if len(found.windows([entry.name]))])
    return {kind: part_of(found, members, groups) for kind, members in kinds.items()}


def distance_table(part: Part, fps: float) -> str:
    """The distances as text, one block for each measure."""
    rows = _headed(fps, bool(part.spreads))
    rows.title(_counts(part))
    for measure in (PLACE, POSE):
        rows.title(TITLES[measure])
        _block(rows, part, measure)
    return rows.text()


def kinds_table(parts: Mapping[str, Part], fps: float) -> str:
    """The distances in the world by kinds of motions, and under each kind where a model is worse than a floor."""
    rows = _headed(fps, any(part.spreads for part in parts.values()))
    for kind, part in parts.items():
        rows.title()
        rows.title(f"{kind}: {_counts(part)}, {TITLES[PLACE]}")
        _block(rows, part, PLACE)
        for line in worse(part.means):
            rows.title(f"  {line}")
    return rows.text()


def worse(means: Distances, measure: str = PLACE) -> list[str]:
    """For each model where it is worse than a floor, in a line; distances count as they are shown."""
    lines = []
    for name in (name for name in means if name not in FLOORS):
        said = []
        for floor, words in COMPARED.items():
            frames = [
                str(frame)
                for frame in REPORTED
                if round(float(means[name][measure][frame]), 1) > round(float(means[floor][measure][frame]), 1)
            ]
            said += [f"worse than {words} at {', '.join(frames)}"] if frames else []
        lines.append(f"{name}: {'; '.join(said) or 'nowhere worse than ' + ', '.join(COMPARED.values())}")
    return lines


def _headed(fps: float, spreads: bool) -> ErrorRows:
    rows = ErrorRows(spreads, digits=1)
    rows.head("milliseconds", (f"{(frame + 1) / fps * 1000:.0f}" for frame in REPORTED))
    if spreads:
        rows.title(BRACKETS)
    return rows


def _counts(part: Part) -> str:
    counts = {"people": part.people, "recordings": len(part.recordings), "windows": part.windows}
    return ", ".join(f"{count} {ONE[words] if count == 1 else words}" for words, count in counts.items())


def _block(rows: ErrorRows, part: Part, measure: str) -> None:
    for name, values in part.means.items():
        rows.add(name, values[measure], part.spreads[name][measure] if name in part.spreads else None)


def part_json(found: Measured, part: Part, name: str) -> dict[str, Any]:
    """The distances of a run, and of the floors, in the windows of a part."""
    means = found.mean(part.recordings)
    floors = {key(floor): to_json(means, floor) for floor in FLOORS}
    return {"recordings": len(part.recordings), "windows": part.windows, **to_json(means, name), **floors}
