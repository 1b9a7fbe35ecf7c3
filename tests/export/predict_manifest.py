"""The manifest of a run of a predictor, before its configuration."""

from typing import Any


def predict_manifest(model: str, joints: int, horizon: int) -> dict[str, Any]:
    channels = [f"joint{n}.e{axis}" for n in range(joints) for axis in "xyz"]
    motion = {
        "representation": "angles",
        "channels": channels,
        "units": ["rad"] * len(channels),
        "fps": 60.0,
        "mean": [0.1] * len(channels),
        "std": [0.5] * len(channels),
        "skeleton": None,
    }
    named = {"name": "x", "verb": "predict", "model": model, "loop": "free_run"}
    return {**named, "motion": motion, "defaults": {"horizon": horizon}, "licence": {}}
