"""The three CMU trials in the repository: clips that a control model is trained on, and motions for docs and tests."""

from pathlib import Path

CMU_FOLDER = Path(__file__).parent / "cmu"
CMU_CLIPS = {"walk": "39_14.amc", "run": "09_07.amc", "bend": "02_06.amc"}
"""The default clips (thesis 5.1): CMU trials 39_14 and 09_07, and the first bend of 02_06."""

CMU_LICENCE = (
    "CMU Graphics Lab Motion Capture Database (mocap.cs.cmu.edu), created with funding from NSF EIA-0196217: "
    "free for all uses, may be included in products, may not be resold as such"
)
