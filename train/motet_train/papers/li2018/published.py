"""Published errors by the protocol: at output frames 1, 3, 7, 9 and 24, on eight windows of each action.

They are those of Li et al. 2018, tables 1 to 4, with their own measurement of RRNN on CMU; for LTD, the averages of
Mao et al. 2019.
"""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy import nan

PUBLISHED_FRAMES = (1, 3, 7, 9, 24)

Rows = Mapping[str, tuple[float, ...]]
"""System -> errors at output frames 1, 3, 7, 9 and 24."""

Actions = Mapping[str, Rows]

ERD = "ERD (Fragkiadaki 2015)"
LSTM_3LR = "LSTM-3LR (Fragkiadaki 2015)"
SRNN = "SRNN (Jain 2016)"
RRNN = "RRNN (Martinez 2017)"
LSTM_AE = "LSTM-AE (Ghosh 2017)"
CONV = "ConvSeq2Seq (Li 2018)"

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

# fmt: off
H36M_ERRORS: Actions = {
    "walking": {
        ERD: (0.93, 1.18, 1.59, 1.78, nan), LSTM_3LR: (0.77, 1.00, 1.29, 1.47, nan),
        SRNN: (0.81, 0.94, 1.16, 1.30, nan), RRNN: (0.33, 0.56, 0.78, 0.85, 1.14),
        LSTM_AE: (1.00, 1.11, 1.39, nan, 1.39), CONV: (0.33, 0.54, 0.68, 0.73, 0.92),
    },
    "eating": {
        ERD: (1.27, 1.45, 1.66, 1.80, nan), LSTM_3LR: (0.89, 1.09, 1.35, 1.46, nan),
        SRNN: (0.97, 1.14, 1.35, 1.46, nan), RRNN: (0.26, 0.43, 0.66, 0.81, 1.34),
        LSTM_AE: (1.31, 1.49, 1.86, nan, 2.01), CONV: (0.22, 0.36, 0.58, 0.71, 1.24),
    },
    "smoking": {
        ERD: (1.66, 1.95, 2.35, 2.42, nan), LSTM_3LR: (1.45, 1.68, 1.94, 2.08, nan),
        SRNN: (1.45, 1.68, 1.94, 2.08, nan), RRNN: (0.35, 0.64, 1.03, 1.15, 1.83),
        LSTM_AE: (0.92, 1.03, 1.15, nan, 1.77), CONV: (0.26, 0.49, 0.96, 0.92, 1.62),
    },
    "discussion": {
        ERD: (2.27, 2.47, 2.68, 2.76, nan), LSTM_3LR: (1.88, 2.12, 2.25, 2.23, nan),
        SRNN: (1.22, 1.49, 1.83, 1.93, nan), RRNN: (0.37, 0.77, 1.06, 1.10, 1.79),
        LSTM_AE: (1.11, 1.20, 1.38, nan, 1.73), CONV: (0.32, 0.67, 0.94, 1.01, 1.86),
    },
    "directions": {RRNN: (0.44, 0.70, 0.86, 0.97, 1.59), CONV: (0.39, 0.60, 0.80, 0.91, 1.45)},
    "greeting": {RRNN: (0.55, 0.90, 1.34, 1.51, 2.03), CONV: (0.51, 0.82, 1.21, 1.38, 1.72)},
    "phoning": {RRNN: (0.62, 1.10, 1.54, 1.70, 1.89), CONV: (0.59, 1.13, 1.51, 1.65, 1.81)},
    "posing": {RRNN: (0.40, 0.76, 1.37, 1.62, 2.56), CONV: (0.29, 0.60, 1.12, 1.37, 2.65)},
    "purchases": {RRNN: (0.59, 0.83, 1.22, 1.30, 2.30), CONV: (0.63, 0.91, 1.19, 1.29, 2.52)},
    "sitting": {RRNN: (0.47, 0.80, 1.30, 1.53, 2.14), CONV: (0.39, 0.61, 1.02, 1.18, 1.67)},
    "sittingdown": {RRNN: (0.50, 0.96, 1.50, 1.72, 2.72), CONV: (0.41, 0.78, 1.16, 1.31, 2.06)},
    "takingphoto": {RRNN: (0.32, 0.63, 0.98, 1.12, 1.51), CONV: (0.23, 0.49, 0.88, 1.06, 1.40)},
    "waiting": {RRNN: (0.35, 0.68, 1.14, 1.34, 2.34), CONV: (0.30, 0.62, 1.09, 1.30, 2.50)},
    "walkingdog": {RRNN: (0.55, 0.91, 1.23, 1.35, 1.86), CONV: (0.59, 1.00, 1.32, 1.44, 1.92)},
    "walkingtogether": {RRNN: (0.29, 0.59, 0.86, 0.92, 1.42), CONV: (0.27, 0.52, 0.71, 0.74, 1.28)},
}
# fmt: on
"""Tables 1 and 2; NaN where they state none."""

BY_ACTION = {"cmu-expmap": CMU_ERRORS, "h36m-expmap": H36M_ERRORS}
"""Name of a layout -> the published rows of each action."""

AVERAGES: Mapping[str, Rows] = {
    "cmu-expmap": {
        RRNN: (0.38, 0.62, 1.02, 1.17, 1.67),
        CONV: (0.31, 0.52, 0.86, 0.99, 1.55),
        "LTD (Mao 2019)": (0.25, 0.39, 0.68, 0.79, 1.33),
    },
    "h36m-expmap": {
        RRNN: (0.43, 0.75, 1.12, 1.27, 1.90),
        CONV: (0.38, 0.68, 1.01, 1.13, 1.77),
        "LTD (Mao 2019)": (0.27, 0.51, 0.83, 0.95, nan),
    },
}
"""Name of a layout -> averages over all its actions: tables 4 and 2, and Mao et al."""

PREDICTOR_GOALS: Mapping[str, Rows] = {
    "cmu-expmap": {"windows_8": (0.26, 0.39, 0.67, 0.78, 1.20), "windows_256": (0.25, 0.39, 0.64, 0.74, 1.10)}
}
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
