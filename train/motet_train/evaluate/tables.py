"""The one writer of figures: reports, groups of figures with stable keys, as JSON and as text; tables of cells."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

Report = dict[str, dict[str, float]]
"""Group -> key -> figure. A measure is a function of a model and data that gives one, or gives it part by part."""

Goals = Mapping[str, tuple[float | None, float | None]]
"""Name of a figure, "GROUP.KEY" -> (least, most) that is to be reached."""

GAP = "   "


def gathered(parts: Iterable[Report], name: str) -> Report:
    """The parts of a report in one, with a bar while they are measured."""
    report: Report = {}
    for part in tqdm(parts, desc=name, unit=" parts", disable=None, leave=False):
        report |= part
    return report


def json_ready(figures: Any) -> Any:
    """Figures, nested in any way, rounded to six digits; null for numbers that JSON lacks."""
    if isinstance(figures, Mapping):
        return {key: json_ready(value) for key, value in figures.items()}
    if isinstance(figures, list | tuple):
        return [json_ready(value) for value in figures]
    if isinstance(figures, float):
        return float(f"{figures:.6g}") if np.isfinite(figures) else None
    return figures


def aligned(rows: Sequence[Sequence[str]], left: Sequence[int] = (0,)) -> str:
    """Rows of cells as text, each column as wide as its widest cell; a row of one cell is a heading of any width.

    left: the columns that stand to the left; the others stand to the right.
    """
    several = [row for row in rows if len(row) > 1]
    widths = [max(len(row[i]) for row in several if i < len(row)) for i in range(max(map(len, several), default=0))]

    def line(row: Sequence[str]) -> str:
        cells = zip(row, widths, strict=False)
        padded = [cell.ljust(width) if i in left else cell.rjust(width) for i, (cell, width) in enumerate(cells)]
        return GAP.join(padded).rstrip() if len(row) > 1 else "".join(row)

    return "\n".join(map(line, rows))


def report_table(reports: Mapping[str, Report], goals: Goals, beside: Mapping[str, Report] | None = None) -> str:
    """One line per figure that any report has, one column per report, and the goal beside those that have one.

    beside: further columns, which need not reach goals.
    """
    columns = [*reports.values(), *(beside or {}).values()]
    groups: dict[str, dict[str, None]] = {}
    for report in reports.values():
        for group, figures in report.items():
            groups.setdefault(group, {}).update(dict.fromkeys(figures))
    rows = [["", *short_names(list(reports)), *(beside or {}), ""]]
    for group, key in ((group, key) for group, keys in groups.items() for key in keys):
        values = [report.get(group, {}).get(key) for report in columns]
        shown = ["" if value is None else f"{value:.4g}" for value in values]
        own = [value for value in values[: len(reports)] if value is not None]
        rows.append([f"{group}.{key}", *shown, _goal(goals, f"{group}.{key}", own)])
    return aligned(rows, left=(0, len(columns) + 1))


def short_names(names: Sequence[str]) -> list[str]:
    """Names of runs and bundles without their folders, where they stay different."""
    short = [Path(name).name or name for name in names]
    return short if len(set(short)) == len(names) else list(names)


def reached(goals: Goals, name: str, value: float) -> bool:
    """Whether a figure is within its goal; a figure that is not a number is not."""
    least, most = goals[name]
    return (least is None or value >= least) and (most is None or value <= most)


def _goal(goals: Goals, name: str, values: Sequence[float]) -> str:
    if name not in goals:
        return ""
    least, most = goals[name]
    text = (
        f"{least:g} to {most:g}" if None not in (least, most) else f">= {least:g}" if most is None else f"<= {most:g}"
    )
    return f"{text:<12}" + ("" if all(reached(goals, name, value) for value in values) else "  NOT REACHED")
