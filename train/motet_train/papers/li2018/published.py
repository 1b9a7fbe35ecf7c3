"""Published errors by the protocol: at output frames 1, 3, 7, 9 and 24, on eight windows of each action.

They are those of Li et al. 2018, tables 1 to 4, with their own measurement of RRNN on CMU; for LTD, the averages of
Mao et al. 2019.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from motet_train.data.table import read_toml

PUBLISHED_FRAMES = (1, 3, 7, 9, 24)

Rows = Mapping[str, tuple[float, ...]]
"""System -> errors at output frames 1, 3, 7, 9 and 24."""

Actions = Mapping[str, Rows]

PUBLISHED_TABLES = read_toml(__file__, "published.toml")

BY_ACTION: Mapping[str, Actions] = PUBLISHED_TABLES["actions"]
"""Name of a layout -> the published rows of each action: tables 3, 1 and 2; NaN where they state none."""

AVERAGES: Mapping[str, Rows] = PUBLISHED_TABLES["averages"]
"""Name of a layout -> averages over all its actions: tables 4 and 2, and Mao et al."""

PREDICTOR_GOALS: Mapping[str, Rows] = PUBLISHED_TABLES["goals"]
"""Goals of the small predictor on the complete actions, by the number of windows."""


def mean_over(table: Actions, actions: Iterable[str]) -> Rows:
    """The mean over actions of each system that has a row for all of them; NaN where one of them has none."""
    rows = [table.get(action, {}) for action in actions]
    means = {}
    for name in rows[0] if rows else ():
        if all(name in row for row in rows):
            mean = np.mean([row[name] for row in rows], axis=0)
            means[name] = tuple(mean.tolist())
    return means
