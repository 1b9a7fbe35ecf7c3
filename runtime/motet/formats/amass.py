"""AMASS and other files of SMPL bodies (.npz): rotations of 22 joints and the root's path.

Arrays: ``trans`` (T, 3) in metres, and ``poses`` (T, 66 or more) or ``root_orient`` (T, 3) with ``pose_body`` (T, 63):
rotation vectors of the joints in SMPL's order; the fingers, jaw and eyes that follow are left out. z is up. The body
shape would need the body model, which is not read: the skeleton is a plain one with an adult's proportions.
"""

import io
import zipfile
from pathlib import Path

import numpy as np

from motet.errors import FormatError
from motet.files import File, place_of
from motet.formats.lines import frame_rate, read_bytes
from motet.formats.npy import array
from motet.motion.kinematics import motion_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, product, rotvec_to_rotmat
from motet.motion.skeleton import Joint, Skeleton

AMASS_JOINTS = (
    ("pelvis", -1, (0.0, 0.0, 0.0)),
    ("left_hip", 0, (0.07, -0.08, 0.0)),
    ("right_hip", 0, (-0.07, -0.08, 0.0)),
    ("spine1", 0, (0.0, 0.11, -0.02)),
    ("left_knee", 1, (0.03, -0.39, 0.0)),
    ("right_knee", 2, (-0.03, -0.39, 0.0)),
    ("spine2", 3, (0.0, 0.13, 0.01)),
    ("left_ankle", 4, (-0.01, -0.42, -0.03)),
    ("right_ankle", 5, (0.01, -0.42, -0.03)),
    ("spine3", 6, (0.0, 0.06, 0.01)),
    ("left_foot", 7, (0.02, -0.06, 0.13)),
    ("right_foot", 8, (-0.02, -0.06, 0.13)),
    ("neck", 9, (0.0, 0.21, -0.02)),
    ("left_collar", 9, (0.08, 0.11, -0.01)),
    ("right_collar", 9, (-0.08, 0.11, -0.01)),
    ("head", 12, (0.0, 0.09, 0.03)),
    ("left_shoulder", 13, (0.1, 0.03, -0.01)),
    ("right_shoulder", 14, (-0.1, 0.03, -0.01)),
    ("left_elbow", 16, (0.26, 0.0, -0.02)),
    ("right_elbow", 17, (-0.26, 0.0, -0.02)),
    ("left_wrist", 18, (0.25, 0.0, 0.0)),
    ("right_wrist", 19, (-0.25, 0.0, 0.0)),
)
"""SMPL's joints in order, with parents and offsets in metres of a plain body in a T-pose, facing z, y up."""

AMASS_SKELETON = Skeleton(
    tuple(Joint(name, parent, offset) for name, parent, offset in AMASS_JOINTS), metres_per_unit=1.0
)

Z_TO_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Turns z up to y up."""

RATE_NAMES = ("mocap_framerate", "mocap_frame_rate")


def is_amass(content: bytes) -> bool:
    """Whether a file's bytes hold SMPL poses and a path; False for any other or broken file."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = {name.removesuffix(".npy") for name in archive.namelist()}
    # raised on opening: damage, an unknown zip version, names that are not UTF-8
    except (zipfile.BadZipFile, NotImplementedError, ValueError):
        return False
    return "trans" in names and bool(names & {"poses", "pose_body"})


def read(file: File) -> Motion:
    """Read the 22 body joints of a file: the root's translation in "length" (metres), angles in "deg", y up.

    FormatError where arrays are missing, do not fit or hold anything but numbers.
    """
    return parse(place_of(file), read_bytes(file))


def parse(path: Path, content: bytes) -> Motion:
    """:func:`read` of a file's bytes."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            vectors, trans = _vectors(path, archive), _array(archive, "trans")
            fps = _rate(path, archive)
    except FormatError:
        raise
    except KeyError as error:
        raise FormatError(path, f"not an AMASS file: {error.args[0]}") from error
    # a damaged archive makes zipfile, its unpackers and numpy raise errors of a dozen types
    except Exception as error:
        raise FormatError(path, f"not an AMASS file: {str(error)[:200]}") from error
    if trans.shape != (len(vectors), 3) or not (np.isfinite(vectors).all() and np.isfinite(trans).all()):
        raise FormatError(path, f"trans must be ({len(vectors)}, 3) finite numbers, not {trans.shape}")
    turned = rotvec_to_rotmat(vectors)
    turned[:, 0] = Z_TO_Y @ turned[:, 0]
    for i, joint in enumerate(AMASS_SKELETON.joints[1:], start=1):
        turned[:, i] = product(turned[:, joint.parent], turned[:, i])
    return motion_of(AMASS_SKELETON, turned, {0: trans @ Z_TO_Y.T}, fps)


def _array(archive: zipfile.ZipFile, name: str) -> Array:
    return np.asarray(array(archive, name, "fiu"), np.float64)


def _vectors(path: Path, archive: zipfile.ZipFile) -> Array:
    """Rotation vectors (T, 22, 3)."""
    parts = ("poses",) if "poses.npy" in archive.namelist() else ("root_orient", "pose_body")
    poses = np.concatenate([_array(archive, part) for part in parts], axis=-1)
    if poses.ndim != 2 or poses.shape[1] < 3 * len(AMASS_JOINTS):
        raise FormatError(path, f"poses of shape {poses.shape}: expected (frames, {3 * len(AMASS_JOINTS)} or more)")
    return poses[:, : 3 * len(AMASS_JOINTS)].reshape(len(poses), len(AMASS_JOINTS), 3)


def _rate(path: Path, archive: zipfile.ZipFile) -> float:
    names = [name for name in RATE_NAMES if f"{name}.npy" in archive.namelist()]
    if not names:
        raise FormatError(path, f"no frame rate: expected an array {' or '.join(RATE_NAMES)}")
    return frame_rate(float(_array(archive, names[0])), path)
