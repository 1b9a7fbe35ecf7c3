"""The one writer of figures: reports, groups of figures with stable keys, as JSON and as text; tables of cells."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

Report = dict[str, dict[str, float]]
"""Group -> key -> figure. A measure is a function of a model and data that gives one, or gives it part by part."""

Goals = Mapping[str, tuple[float | None, float | None]]
"""Name of a figure, "GROUP.KEY" -> (least, most) that is to be reached."""


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
    columns = zip_longest(*(row for row in rows if len(row) > 1), fillvalue="")
    pads = [(str.ljust if i in left else str.rjust, max(map(len, cells))) for i, cells in enumerate(columns)]

    def line(row: Sequence[str]) -> str:
        padded = [pad(cell, width) for cell, (pad, width) in zip(row, pads, strict=False)]
        return "   ".join(padded).rstrip() if len(row) > 1 else "".join(row)

    return "\n".join(map(line, rows))


def report_table(reports: Mapping[str, Report], goals: Goals, beside: Mapping[str, Report] | None = None) -> str:
    """One line per figure that any report has, one column per report, and the goal beside those that have one.

    beside: further columns, which need not reach goals.
    """
    columns = [*reports.values(), *(beside or {}).values()]
    rows = [["", *short_names(list(reports)), *(beside or {}), ""]]
    groups = dict.fromkeys(group for report in reports.values() for group in report)
    for group in groups:
        for key in dict.fromkeys(key for report in reports.values() for key in report.get(group, {})):
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
    text = f">= {least:g}" if most is None else f"<= {most:g}" if least is None else f"{least:g} to {most:g}"
    return f"{text:<12}" + ("" if all(reached(goals, name, value) for value in values) else "  NOT REACHED")
