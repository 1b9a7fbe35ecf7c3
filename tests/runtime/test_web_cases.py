"""The golden cases that runtime/web ships are what Python gives; and files that runtime/web writes are read."""

import base64
import json
from io import BytesIO
from typing import Any

import numpy as np
from web_cases import CASES, WEB, cases

from motet.figures.humanoid import to_humanoid
from motet.formats import read_motion
from motet.motion.kinematics import positions, skeleton_of

SHIPPED: dict[str, Any] = json.loads(CASES.read_text("utf-8"))


def assert_alike(found: Any, wanted: Any, place: str = "cases") -> None:
    if isinstance(wanted, dict):
        assert found.keys() == wanted.keys(), place
        for key, value in wanted.items():
            assert_alike(found[key], value, f"{place}.{key}")
    elif isinstance(wanted, list) and not isinstance(wanted[0], str):
        np.testing.assert_allclose(found, wanted, atol=2e-5, rtol=0, err_msg=place)
    else:
        assert found == wanted, place


def test_golden_cases_are_what_python_gives() -> None:
    texts = {name: case["text"] for name, case in SHIPPED["figures"].items() if "text" in case}
    files = {name: base64.b64decode(case["base64"]) for name, case in SHIPPED["scenes"].items()}
    assert_alike(cases(texts, files, np.array(SHIPPED["feet"]["frames"])), SHIPPED)


def test_files_written_in_javascript_are_read_with_the_same_positions() -> None:
    walk = read_motion(BytesIO(SHIPPED["figures"]["walk"]["text"].encode()), format="bvh")
    wanted = to_humanoid(walk).motion
    names = skeleton_of(wanted).names
    for name in ("walk.bvh", "walk.vrma"):
        found = read_motion(WEB / "written" / name)
        skeleton, places = skeleton_of(found), positions(found)
        assert found.fps == wanted.fps
        bones = [i for i, bone in enumerate(names) if bone in skeleton.names]
        assert len(bones) >= 22
        at = [skeleton.index(names[i]) for i in bones]
        np.testing.assert_allclose(places[:, at], positions(wanted)[:, bones], atol=1e-4)
