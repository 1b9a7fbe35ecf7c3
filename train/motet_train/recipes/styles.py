"""The recipe of the styles of steered figures: ``styles.toml`` made into ``motet/steering/styles.json``.

python -m motet_train.recipes.styles
"""

import json
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np

import motet.keyed
import motet.steering
from motet.bundle.fields import Json
from motet.figures.humanoid import BONES, HUMANOID, LEFT_RIGHT
from motet.keyed.keys import Key
from motet.keyed.trunk import turn_of
from motet.models.load import load_as
from motet.motion.kinematics import local_rotations
from motet.motion.motion import Motion
from motet.motion.rotations import Array, inverse, product, rotmat_to_quat
from motet.steering.model import SteerModel
from motet.steering.styles import ARMS, NO_STYLE, STEPS_OF_STYLE, TURNED

STYLE_TABLES = Path(str(files("motet_train.data")))

STYLE_FILE = Path(motet.steering.__file__).with_name("styles.json")

HELD_SECONDS = 1.0
"""How long a pose is held, of which the middle is taken."""


def table() -> Json:
    """``styles.toml``."""
    return tomllib.loads((STYLE_TABLES / "styles.toml").read_text(encoding="utf-8"))


def acts() -> Mapping[str, motet.keyed.KeyedAct]:
    """The acts of which styles are made, by name."""
    return {**motet.keyed.ours(), **motet.keyed.read(STYLE_TABLES / "styles_keyed.toml")}


def made(styles: Json, standing: Motion) -> Json:
    """The document of ``styles.json``. standing: a figure that stands, for at least two seconds."""
    known = acts()
    return {name: _style(style, known[style["act"]], standing) for name, style in styles.items()}


def as_written(act: motet.keyed.KeyedAct) -> motet.keyed.KeyedAct:
    """An act at the speed, of the size and on the side that its keys say."""
    return replace(act, speed=(1.0, 1.0), amplitude=(1.0, 1.0), mirrored=False)


def _style(style: Json, act: motet.keyed.KeyedAct, standing: Motion) -> Json:
    """A style of the key poses of an act, one or two."""
    first, *others = [_pose(act, key, standing) for key in act.keys]
    poses = [first, *(_signed_like(first, other) for other in others)]
    seconds = 0.0
    if act.repeat is not None and others and "steps" not in style:
        seconds = act.repeat.every[0]
    steps = [np.rint(pose * STEPS_OF_STYLE).astype(int).tolist() for pose in poses]
    return {"pace": act.pace, "seconds": seconds, "poses": steps}


def phrases() -> dict[str, list[str]]:
    """What is said for each style, its name first."""
    known = acts()
    of_styles = {name: [name, *known[style["act"]].says] for name, style in table().items()}
    return {NO_STYLE: ["normally", "normal", "plainly", "usual"], **of_styles}


def _pose(act: motet.keyed.KeyedAct, key: Key, standing: Motion) -> Array:
    """A key pose as the numbers (STYLE_WIDTH,) of :mod:`motet.steering.styles`."""
    base = _rotations(standing)
    posed = _rotations(_held(act, key).motion(standing))
    # what the pose turns the trunk by, and arms as they are where their hands have a place
    turns = [rotmat_to_quat(product(posed[bone], inverse(base[bone]))) for bone in TURNED]
    arms = [rotmat_to_quat(posed[bone]) if _hand_of(bone) in key.hands else np.zeros(4) for bone in ARMS]
    # feet and hips as the key says
    foot_turns = [_foot_turn(key, f"{side}_foot") for side in LEFT_RIGHT]
    offsets = [_foot_offset(key, f"{side}_foot") for side in LEFT_RIGHT]
    pose: Array = np.concatenate([*turns, *arms, *foot_turns, *offsets, [_number(key, "hips", "down")]])
    return pose


def _held(act: motet.keyed.KeyedAct, key: Key) -> motet.keyed.KeyedAct:
    """An act that holds a key pose, as it is written."""
    held = replace(key, at=(0.0, 0.0), hold=(HELD_SECONDS, HELD_SECONDS))
    return replace(as_written(act), keys=(held,), repeat=None)


def _hand_of(bone: str) -> str:
    """The hand of a bone of an arm."""
    return "left_hand" if bone.startswith(LEFT_RIGHT[0]) else "right_hand"


def _foot_turn(key: Key, foot: str) -> Array:
    """The quaternion (4,) of a foot that points down; to turn it out is not a thing of styles."""
    (turn,) = turn_of(np.array([_number(key, foot, "point")]), np.zeros(1), np.zeros(1))
    quat: Array = rotmat_to_quat(turn)
    return quat


def _foot_offset(key: Key, foot: str) -> list[float]:
    """How far a foot is moved to the left, up and forward, in metres; no style puts its feet aside."""
    return [0.0, _number(key, foot, "up"), _number(key, foot, "forward")]


def _number(key: Key, part: str, name: str) -> float:
    """The middle of a number of a key, 0 where it has none."""
    low, high = key.numbers.get(part, {}).get(name, (0.0, 0.0))
    return (low + high) / 2


def _rotations(motion: Motion) -> dict[str, Array]:
    """Bone -> its rotation (3, 3) in its parent's frame, in the middle of a pose of a motion of the humanoid."""
    local = local_rotations(motion, [HUMANOID.index(bone) for bone in BONES])
    return dict(zip(BONES, local[round(motion.fps * HELD_SECONDS / 2)], strict=True))


def _signed_like(first: Array, last: Array) -> Array:
    """The numbers of a pose, with its quaternions on the side of another's."""
    quats = 4 * (len(TURNED) + len(ARMS) + len(LEFT_RIGHT))
    both = (first[:quats] * last[:quats]).reshape(-1, 4).sum(axis=1)
    signs = np.where(both < 0, -1.0, 1.0).repeat(4)
    return np.concatenate([signs * last[:quats], last[quats:]])


def main() -> None:
    """Write ``styles.json`` anew."""
    standing = load_as(SteerModel, "control").run("stop 3s")
    document = made(table(), standing)
    STYLE_FILE.write_text(json.dumps(document, separators=(",", ":")) + "\n", encoding="utf-8")
    print(f"{len(document)} styles: {STYLE_FILE.stat().st_size} bytes")


if __name__ == "__main__":
    main()
