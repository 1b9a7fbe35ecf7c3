"""Reports: groups of figures with stable keys, as JSON and as a table beside the goals."""

from collections.abc import Iterator, Mapping

import numpy as np

Report = dict[str, dict[str, float]]

Goals = Mapping[str, tuple[float | None, float | None]]
"""Name of a figure, "GROUP.KEY" -> (least, most) that is to be reached."""


def json_ready(report: Report) -> dict[str, dict[str, float | None]]:
    """The report with numbers that JSON lacks as null, rounded to six digits."""
    return {
        name: {key: float(f"{value:.6g}") if np.isfinite(value) else None for key, value in figures.items()}
        for name, figures in report.items()
    }


def table(reports: Mapping[str, Report], goals: Goals) -> str:
    """One line per figure that any report has, one column per report, and the goal behind those that have one."""
    lines = [" " * 28 + "".join(f"{name[-14:]:>15}" for name in reports)]
    for group, key in _names(reports):
        values = [report.get(group, {}).get(key) for report in reports.values()]
        name = f"{group}.{key}"
        cells = "".join(" " * 15 if value is None else f"{value:>15.4g}" for value in values)
        lines.append(f"{name:<28}{cells}{_goal(goals, name, [value for value in values if value is not None])}")
    return "\n".join(lines)


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
    return f"   {text:<12}" + ("" if all(reached(goals, name, value) for value in values) else "  NOT REACHED")
