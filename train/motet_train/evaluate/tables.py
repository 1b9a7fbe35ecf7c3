"""Reports, groups of figures with stable keys, as JSON and as text; and tables in general."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

Report = dict[str, dict[str, float]]

Goals = Mapping[str, tuple[float | None, float | None]]
"""Name of a figure, "GROUP.KEY" -> (least, most) that is to be reached."""

GAP = "   "


def json_ready(report: Report) -> dict[str, dict[str, float | None]]:
    """The report with numbers that JSON lacks as null, rounded to six digits."""
    return {
        name: {key: float(f"{value:.6g}") if np.isfinite(value) else None for key, value in figures.items()}
        for name, figures in report.items()
    }


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
    others = beside or {}
    rows = [["", *short_names(list(reports)), *others, ""]]
    for group, key in _names(reports):
        name, values = f"{group}.{key}", [report.get(group, {}).get(key) for report in reports.values()]
        cells = [*values, *(report.get(group, {}).get(key) for report in others.values())]
        shown = ["" if value is None else f"{value:.4g}" for value in cells]
        rows.append([name, *shown, _goal(goals, name, [value for value in values if value is not None])])
    return aligned(rows, left=(0, len(reports) + len(others) + 1))


def short_names(names: Sequence[str]) -> list[str]:
    """Names of runs and bundles without their folders, where they stay different."""
    short = [Path(name).name or name for name in names]
    return short if len(set(short)) == len(names) else list(names)


def reached(goals: Goals, name: str, value: float) -> bool:
    """Whether a figure is within its goal; a figure that is not a number is not."""
    least, most = goals[name]
    return (least is None or value >= least) and (most is None or value <= most)


def _names(reports: Mapping[str, Report]) -> Iterator[tuple[str, str]]:
    groups: dict[str, dict[str, None]] = {}
    for report in reports.values():
        for group, figures in report.items():
            groups.setdefault(group, {}).update(dict.fromkeys(figures))
    return ((group, key) for group, keys in groups.items() for key in keys)


def _goal(goals: Goals, name: str, values: list[float]) -> str:
    if name not in goals:
        return ""
    least, most = goals[name]
    text = (
        f"{least:g} to {most:g}" if None not in (least, most) else f">= {least:g}" if most is None else f"<= {most:g}"
    )
    return f"{text:<12}" + ("" if all(reached(goals, name, value) for value in values) else "  NOT REACHED")
