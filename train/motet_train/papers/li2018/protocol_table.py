"""The table of the protocol: what was measured, and under it what papers report."""

from collections.abc import Mapping, Sequence

import numpy as np

from motet.motion.rotations import Array
from motet_train.evaluate.predict.error_rows import BRACKETS, ErrorRows
from motet_train.papers.li2018.curves import FEW, MANY, MEAN, ROTATION, Curves, complete
from motet_train.papers.li2018.expmap_files import ExpmapCorpus
from motet_train.papers.li2018.protocol import LABELS, true_times
from motet_train.papers.li2018.published import FRAMES, GOALS, averages, by_action, mean_over
from motet_train.papers.li2018.published_h36m import Rows

PUBLISHED = "published: "
"""What lines begin with that were not measured here."""

TITLES = {
    FEW: "8 windows of each action",
    MANY: "256 windows of each action",
    ROTATION: "256 windows, mean angle between predicted and true rotations of the joints that move, degrees",
}


def protocol_table(found: Curves, corpus: ExpmapCorpus, spreads: Curves | None = None) -> str:
    """As text: what is missing, frames and true times, then each action's rows, and under the means what papers say.

    Published figures are of eight windows and stand there only. spreads: of the systems that are means of several
    seeds, see :func:`motet_train.papers.li2018.curves.spreads_of`.
    """
    rows = _headed(corpus, spreads or {})
    for kind, systems in found.items():
        rows.title()
        rows.title(TITLES[kind])
        for action in next(iter(systems.values())):
            _block(rows, found, corpus, spreads or {}, (kind, action))
    _averages(rows, corpus)
    return "\n".join([*missing(corpus), rows.text()])


def missing(corpus: ExpmapCorpus) -> list[str]:
    """Lines that say which files the corpus lacks, and what follows; none where it lacks none."""
    if not corpus.missing:
        return []
    layout, gone = corpus.layout, set(corpus.missing)
    parts = (("training", layout.train), ("test", layout.test))
    all_files = sum(len(names) for _, groups in parts for names in groups.values())
    lacking: dict[str, list[str]] = {}
    for part, groups in parts:
        for group, names in groups.items():
            if count := len(gone & set(names)):
                lacking.setdefault(group, []).append(f"{count} of {len(names)} {part}")
    said = ", ".join(f"{group} ({' and '.join(counts)})" for group, counts in lacking.items())
    lines = [f"{len(gone)} of {all_files} files are missing: {said}"]
    if lacking.keys() & layout.test.keys() and lacking.keys().isdisjoint(complete(corpus)):
        lines.append("means are those of the actions with all their files")
    return [*lines, ""]


def _headed(corpus: ExpmapCorpus, spreads: Curves) -> ErrorRows:
    rows = ErrorRows(any(spreads.values()))
    rows.head("milliseconds, true", (f"{time:.0f}" for time in true_times(corpus.layout.fps)))
    rows.head("milliseconds, as papers label them", map(str, LABELS))
    if any(spreads.values()):
        rows.title(BRACKETS)
    return rows


def _block(rows: ErrorRows, found: Curves, corpus: ExpmapCorpus, spreads: Curves, part: tuple[str, str]) -> None:
    """The rows of an action, or of the mean."""
    (kind, action), whole = part, complete(corpus)
    rows.title(f"mean of {', '.join(whole)}" if action == MEAN else action)
    beside: Mapping[str, Mapping[str, Array]] = spreads.get(kind, {})
    for name, errors in found[kind].items():
        rows.add(name, errors[action], beside[name][action] if name in beside else None)
    if kind == FEW:
        known = by_action(corpus.layout.name)
        _published(rows, mean_over(known, whole) if action == MEAN else known.get(action, {}))
    if action == MEAN and kind in GOALS and corpus.layout.name.startswith("cmu"):
        rows.add("goal", at_frames(GOALS[kind]))


def _averages(rows: ErrorRows, corpus: ExpmapCorpus) -> None:
    rows.title()
    rows.title(f"average of all {len(corpus.layout.test)} actions, 8 windows")
    _published(rows, averages(corpus.layout.name))


def _published(rows: ErrorRows, known: Rows) -> None:
    for name, values in known.items():
        rows.add(PUBLISHED + name, at_frames(values))


def at_frames(values: Sequence[float]) -> Array:
    """Published values as an error (N,), NaN at frames that papers do not report."""
    error = np.full(max(FRAMES) + 1, np.nan)
    error[list(FRAMES)] = values
    return error
