"""What papers report by the protocol: errors at output frames 1, 3, 7, 9 and 24, averages over actions."""

from collections.abc import Mapping

FRAMES = (1, 3, 7, 9, 24)

Rows = Mapping[str, tuple[float, ...]]

CMU_ALL: Rows = {
    "RRNN (Martinez 2017), 8 actions": (0.38, 0.62, 1.02, 1.17, 1.67),
    "ConvSeq2Seq (Li 2018), 8 actions": (0.31, 0.52, 0.86, 0.99, 1.55),
    "LTD (Mao 2019), 8 actions": (0.25, 0.39, 0.68, 0.79, 1.33),
}
CMU_FIVE: Rows = {"ConvSeq2Seq (Li 2018)": (0.33, 0.50, 0.83, 0.94, 1.39)}
"""On basketball, jumping, running, soccer and walking."""

H36M: Rows = {
    "RRNN (Martinez 2017)": (0.43, 0.75, 1.12, 1.27, 1.90),
    "ConvSeq2Seq (Li 2018)": (0.38, 0.68, 1.01, 1.13, 1.77),
    "LTD (Mao 2019)": (0.27, 0.51, 0.83, 0.95, float("nan")),
}

GOAL = (0.26, 0.40, 0.68, 0.78, 1.25)
"""What the small predictor is to reach on the five actions."""


def rows(layout: str) -> Rows:
    """The published rows of a layout's corpus."""
    return H36M if layout.startswith("h36m") else {**CMU_FIVE, **CMU_ALL}
