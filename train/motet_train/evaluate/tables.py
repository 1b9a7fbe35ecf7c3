"""The writer of all reports: groups of figures with stable keys, as JSON and as text, and tables of cells."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from motet_train.data.table import read_toml

Figures = dict[str, float]
"""Key -> figure."""

Report = dict[str, Figures]
"""Group -> key -> figure. A measure is a function of a model and data that returns a report, or yields its parts."""

Reports = Mapping[str, Report]
"""Name of a model -> its report."""

Goals = Mapping[str, tuple[float | None, float | None]]
"""Name of a figure, "GROUP.KEY" -> the lowest and highest value that meet the goal, None for no bound."""


def read_goals(kind: str) -> Goals:
    """The goals of a kind of models in goals.toml."""
    goals = {}
    for name, bounds in read_toml(__file__, "goals.toml")[kind].items():
        goals[name] = (bounds.get("least"), bounds.get("most"))
    return goals


def gathered(parts: Iterable[Report], name: str) -> Report:
    """Merge the parts of a report, with a progress bar while they are measured."""
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
    if isinstance(figures, float | np.number):
        return float(f"{figures:.6g}") if np.isfinite(figures) else None
    return figures


def aligned(rows: Sequence[Sequence[str]], left: Sequence[int] = (0,)) -> str:
    """Rows of cells as text, each column as wide as its widest cell; a row of one cell is a heading of any width.

    left: the left-aligned columns; all others are right-aligned.
    """
    table_rows = [row for row in rows if len(row) > 1]
    # the width of each column
    columns = zip_longest(*table_rows, fillvalue="")
    widths = [max(map(len, cells)) for cells in columns]

    # cells padded to it
    lines = []
    for row in rows:
        if len(row) > 1:
            cells = []
            for column, cell in enumerate(row):
                width = widths[column]
                cells.append(cell.ljust(width) if column in left else cell.rjust(width))
            lines.append("   ".join(cells).rstrip())
        else:
            lines.append("".join(row))
    return "\n".join(lines)


def report_table(reports: Reports, goals: Goals, beside: Reports | None = None) -> str:
    """One line per figure that any report has, one column per report, and the goal of those that have one.

    beside: further columns, to which goals do not apply.
    """
    # the names of reports are shortened, those beside them are heads already
    others = beside or {}
    columns = [*reports.values(), *others.values()]
    rows = [["", *short_names(list(reports)), *others, ""]]
    for group, figures in _merged(reports.values()).items():
        for key in figures:
            values = [report.get(group, {}).get(key) for report in columns]
            cells = ["" if value is None else f"{value:.4g}" for value in values]
            judged = [value for value in values[: len(reports)] if value is not None]
            name = f"{group}.{key}"
            rows.append([name, *cells, _goal(goals, name, judged)])
    return aligned(rows, left=(0, len(columns) + 1))


def _merged(reports: Iterable[Report]) -> Report:
    """Each figure that any report has, group by group, in the order of the reports."""
    merged: Report = {}
    for report in reports:
        for group, figures in report.items():
            merged[group] = merged.get(group, {}) | figures
    return merged


def short_names(names: Sequence[str]) -> list[str]:
    """Names of runs and bundles without their folders, unless that makes two of them equal."""
    short = [Path(name).name or name for name in names]
    return short if len(set(short)) == len(names) else list(names)


def reached(goals: Goals, name: str, value: float) -> bool:
    """Whether a figure meets its goal; NaN does not."""
    least, most = goals[name]
    return (least is None or value >= least) and (most is None or value <= most)


def _goal(goals: Goals, name: str, values: Sequence[float]) -> str:
    if name not in goals:
        return ""
    least, most = goals[name]
    if most is None:
        bounds = f">= {least:g}"
    elif least is None:
        bounds = f"<= {most:g}"
    else:
        bounds = f"{least:g} to {most:g}"
    missed = not all(reached(goals, name, value) for value in values)
    return f"{bounds:<12}" + ("  NOT REACHED" if missed else "")
