"""What papers report by the protocol: errors at output frames 1, 3, 7, 9 and 24, on eight windows of each action.

Li et al. 2018, tables 1 to 4, who measured RRNN themselves on CMU; of LTD the averages of Mao et al. 2019.
"""

from collections.abc import Iterable

import numpy as np

from motet_train.papers.li2018.published_h36m import CONV, H36M_ERRORS, RRNN, Actions, Rows

FRAMES = (1, 3, 7, 9, 24)

CMU_ERRORS: Actions = {
    "basketball": {RRNN: (0.50, 0.80, 1.27, 1.45, 1.78), CONV: (0.37, 0.62, 1.07, 1.18, 1.95)},
    "basketball_signal": {RRNN: (0.41, 0.76, 1.32, 1.54, 2.15), CONV: (0.32, 0.59, 1.04, 1.24, 1.96)},
    "directing_traffic": {RRNN: (0.33, 0.59, 0.93, 1.10, 2.05), CONV: (0.25, 0.56, 0.89, 1.00, 2.04)},
    "jumping": {RRNN: (0.56, 0.88, 1.77, 2.02, 2.40), CONV: (0.39, 0.60, 1.36, 1.56, 2.01)},
    "running": {RRNN: (0.33, 0.50, 0.66, 0.75, 1.00), CONV: (0.28, 0.41, 0.52, 0.57, 0.67)},
    "soccer": {RRNN: (0.29, 0.51, 0.88, 0.99, 1.72), CONV: (0.26, 0.44, 0.75, 0.87, 1.56)},
    "walking": {RRNN: (0.35, 0.47, 0.60, 0.65, 0.88), CONV: (0.35, 0.44, 0.45, 0.50, 0.78)},
    "washwindow": {RRNN: (0.30, 0.46, 0.72, 0.91, 1.36), CONV: (0.30, 0.47, 0.80, 1.01, 1.39)},
}
"""Table 3."""

CMU_AVERAGE: Rows = {
    RRNN: (0.38, 0.62, 1.02, 1.17, 1.67),
    CONV: (0.31, 0.52, 0.86, 0.99, 1.55),
    "LTD (Mao 2019)": (0.25, 0.39, 0.68, 0.79, 1.33),
}
"""Over all eight actions: table 4, and Mao et al."""

H36M_AVERAGE: Rows = {
    RRNN: (0.43, 0.75, 1.12, 1.27, 1.90),
    CONV: (0.38, 0.68, 1.01, 1.13, 1.77),
    "LTD (Mao 2019)": (0.27, 0.51, 0.83, 0.95, np.nan),
}
"""Over all fifteen actions: table 2, and Mao et al."""

GOALS = {"windows_8": (0.26, 0.39, 0.67, 0.78, 1.20), "windows_256": (0.25, 0.39, 0.64, 0.74, 1.10)}
"""What the small predictor is to reach on CMU's five complete actions, by the windows measured."""


def by_action(layout: str) -> Actions:
    """The published rows of a layout's corpus."""
    return H36M_ERRORS if layout.startswith("h36m") else CMU_ERRORS


def averages(layout: str) -> Rows:
    """The published averages over all actions of a layout's corpus."""
    return H36M_AVERAGE if layout.startswith("h36m") else CMU_AVERAGE


def mean_over(table: Actions, actions: Iterable[str]) -> Rows:
    """The mean over these actions of each system that has a row for all of them; NaN where one of them has none."""
    rows = [table.get(action, {}) for action in actions]
    names = [name for name in rows[0] if all(name in row for row in rows)] if rows else []
    return {name: tuple(float(n) for n in np.mean([row[name] for row in rows], axis=0)) for name in names}
