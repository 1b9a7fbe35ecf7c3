"""Three CMU trials, in the repository only: default clips of a control model, and motions for docs and tests."""

from pathlib import Path

from motet_train.data.errors import DataError

CMU_FOLDER = Path(__file__).parent / "cmu"
"""Folder of the trials; not in the wheel."""

CMU_CLIPS = {"walk": "39_14", "run": "09_07", "bend": "02_06"}
"""The default clips (thesis 5.1): CMU trials 39_14 and 09_07, and the first bend of 02_06."""

CMU_LICENCE = (
    "CMU Graphics Lab Motion Capture Database (mocap.cs.cmu.edu), created with funding from NSF EIA-0196217: "
    "free for all uses, may be included in products, may not be resold as such"
)


def cmu_trial(name: str) -> Path:
    """The file of one of the trials, such as "39_14"; DataError where only the wheel is installed."""
    path = CMU_FOLDER / f"{name}.amc"
    if not path.is_file():
        raise DataError(
            f"CMU's trial {name} is not installed: run this in a checkout of motet's repository, or give --data"
        )
    return path
