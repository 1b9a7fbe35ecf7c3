"""Write a steered figure as one HTML page that runs it: no network, no other file, any browser.

The page is ``page.html`` with ``loop.js``, which does in JavaScript what :mod:`motet.decode.matching` and
:mod:`motet.motion.feet.lock` do, and with the numbers of the bundle: its table with codes as 16-bit floats and features
as int8, gzipped; the linear map from codes to poses, which its graph "pose" gives; and the constants of both modules.
"""

import gzip
from base64 import b64encode
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.decode.matching import AHEAD, BEFORE, BEHIND, EVERY, HASTE, LAG, LASTING, STANDS
from motet.draw.body import Body
from motet.draw.page import bone_data, filled, source
from motet.errors import BundleError, ControlError
from motet.files import File, place_of, write_whole
from motet.models import steer_session
from motet.models.steer import SteerModel
from motet.motion import two_bone
from motet.motion.feet import lock as foot_lock
from motet.motion.humanoid import BONES, HUMANOID

FINE = 16
"""Steps of a feature in 8 bits: features are multiples of 1 / FINE."""

MOST = 8
"""Characters of a page at most."""

Packed = tuple[str, str, NDArray[Any]]
"""Name, kind (such as "f2") and values (N, W) of an array of the table."""


def write_live_page(file: File, model: SteerModel, characters: int = 1, title: str | None = None) -> None:
    """Write the page of :func:`live_page`; the title is the file's name where none is given.

    Errors as there, and OutputError if the file cannot be written.
    """
    title = place_of(file).stem if title is None else title
    write_whole(file, live_page(model, characters, title))


def live_page(model: SteerModel, characters: int = 1, title: str = "motet") -> str:
    """The HTML of a page in which a figure is steered with keys, a gamepad or a finger, and others go with it.

    characters: how many figures there are at first, 1 to :data:`MOST`. ControlError for another number, BundleError for
    another model, a bundle without a graph "pose" or with features that are no multiples of 1 / :data:`FINE`.
    """
    if not isinstance(model, SteerModel):
        raise BundleError(f"{model} is not steered: a page needs a model such as motet.load('control')")
    if not 1 <= characters <= MOST:
        raise ControlError(f"a page has 1 to {MOST} characters, not {characters}")
    data = {"net": net_data(model), "body": body_data(), "characters": characters, "most": MOST}
    scripts = {"LOOP": source("motet.live", "loop.js"), "OTHERS": source("motet.live", "others.js")}
    return filled(source("motet.live", "page.html"), title, data, **scripts)


def net_data(model: SteerModel) -> dict[str, Any]:
    """All that ``loop.js`` steers a figure with, ready for JSON; errors as :func:`live_page`."""
    matcher, table = model.matcher, model.matcher.table
    arrays = _arrays(model)
    middle, basis = _linear(model)
    return {
        "fps": model.fps,
        "gaits": list(model.gaits),
        "speeds": dict(zip(model.gaits, model.manifest.config["speeds"], strict=True)),
        "sectors": steer_session.SECTORS.tolist(),
        "forward": steer_session.FORWARD,
        "steering": model.manifest.config["steering"],
        **{
            "every": matcher.every,
            "reserve": matcher.reserve,
            "lasting": LASTING,
            "everyRow": EVERY,
            "stands": STANDS,
            "lag": float(LAG),
        },
        **{"behind": BEHIND, "before": BEFORE, "ahead": list(AHEAD), "haste": HASTE, "fine": FINE},
        "mean": table.mean.tolist(),
        "scale": table.scale.tolist(),
        "columns": matcher.columns.tolist(),
        "signs": matcher.signs.tolist(),
        "codeSigns": matcher.code_signs.tolist(),
        "still": int(model.start().snapshot().playing.row[0]),
        "middle": middle.tolist(),
        "basis": np.round(basis.astype(np.float64), 7).ravel().tolist(),
        "parents": HUMANOID.parents.tolist(),
        "offsets": HUMANOID.offsets.tolist(),
        "bones": [HUMANOID.index(bone) for bone in BONES],
        "lock": _lock(),
        "leg": {"shortest": two_bone.SHORTEST, "share": two_bone.SHARE, "gives": list(two_bone.GIVES)},
        "rows": len(table.left),
        "arrays": [{"name": name, "kind": kind, "width": values.shape[1]} for name, kind, values in arrays],
        "table": b64encode(gzip.compress(b"".join(map(_shuffled, arrays)), mtime=0)).decode(),
    }


def body_data() -> dict[str, Any]:
    """The body that is drawn on the humanoid. height: in metres. skull: jaw and crown (2, 3) in metres, in the frame of
    the joint ``carrier``. bones: as ``stage.js`` has them, between the humanoid's joints, jaw and crown."""
    body = Body(HUMANOID)
    carrier = HUMANOID.joints[body.head].parent
    points = body.points(HUMANOID.rest_positions / body.height) * body.height
    skull = points[len(HUMANOID.joints) :] - points[carrier]
    bones = [bone_data(bone) for bone in body.bones]
    return {"height": body.height, "carrier": carrier, "skull": skull.tolist(), "bones": bones}


def _arrays(model: SteerModel) -> list[Packed]:
    table, codes = model.matcher.table, len(model.matcher.code_signs)
    features = table.features * FINE
    if np.abs(features).max() > 127 or not np.array_equal(features, np.round(features)):
        raise BundleError(f"bundle {model.manifest.name!r}: its features are no multiples of 1/{FINE} in 8 bits")
    shown = (table.gaits > 0) @ (1 << np.arange(table.gaits.shape[1]))
    left = np.minimum(table.left, 65535)
    return [
        ("codes", "f2", table.frames[:, :codes]),
        ("moves", "f4", table.frames[:, codes:]),
        ("features", "i1", features),
        ("left", "u2", left[:, None]),
        ("shown", "u1", shown[:, None]),
    ]


def _shuffled(array: Packed) -> bytes:
    """The bytes of an array, column by column, of each column first all first bytes: so they are pressed best."""
    _, kind, values = array
    columns = np.ascontiguousarray(values.T.astype(f"<{kind}"))
    split = columns.view(np.uint8).reshape(*columns.shape, -1)
    return np.ascontiguousarray(np.swapaxes(split, 1, 2)).tobytes()


def _linear(model: SteerModel) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The numbers (P,) of a pose whose codes are 0, and what each code adds (K, P)."""
    if "pose" not in model.graphs:
        raise BundleError(
            f"bundle {model.manifest.name!r}: a page needs its graph 'pose', and it has none: export it again"
        )
    count = len(model.matcher.code_signs)
    codes = np.concatenate([np.zeros((1, count)), np.eye(count)]).astype(np.float32)
    values = model.graphs["pose"]({"codes": codes})["values"]
    return values[0], values[1:] - values[0]


def _lock() -> dict[str, Any]:
    points = zip(foot_lock.CARRIERS, foot_lock.POINTS.tolist(), strict=True)
    bones = foot_lock.COLUMNS.tolist()
    joints = [[HUMANOID.index(BONES[bone]) for bone in leg] for leg in bones]
    legs = zip(joints, bones, strict=True)
    return {
        **asdict(foot_lock.LockSettings()),
        "soles": [[part, point] for part, point in points],
        "legs": [{"joints": joints, "bones": bones} for joints, bones in legs],
    }
