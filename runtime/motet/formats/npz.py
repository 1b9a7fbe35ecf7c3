"""NPZ: a complete motion, lossless, as numpy arrays; and AMASS and other files of SMPL bodies. Nothing is unpickled.

motet's arrays: ``values`` (T, D) float64, ``channels`` (D,) and ``units`` (D,) text, ``fps`` float64, and ``skeleton``,
the JSON of :meth:`motet.motion.skeleton.Skeleton.to_json`, empty for a motion without skeleton.

SMPL's arrays: ``trans`` (T, 3) in metres, and ``poses`` (T, 66 or more) or ``root_orient`` (T, 3) with ``pose_body``
(T, 63): rotation vectors of the joints in SMPL's order; the fingers, jaw and eyes that follow are left out. z is up.
The body shape would need the body model, which is not read: the skeleton is a plain one with an adult's proportions.
"""

import io
import json
import math
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from motet.errors import FormatError
from motet.files import File, place_of, write_whole
from motet.formats.text import frame_rate, most_poses, read_bytes
from motet.motion.kinematics import motion_of
from motet.motion.motion import Motion
from motet.motion.rotations import product, rotvec_to_rotmat
from motet.motion.skeleton import Joint, Skeleton

NPZ_MAX_BYTES = 2**29
"""Bytes of an unpacked array: over an hour of a hundred channels at 120 fps."""

AMASS_JOINTS = (
    Joint("pelvis", -1, (0.0, 0.0, 0.0)),
    Joint("left_hip", 0, (0.07, -0.08, 0.0)),
    Joint("right_hip", 0, (-0.07, -0.08, 0.0)),
    Joint("spine1", 0, (0.0, 0.11, -0.02)),
    Joint("left_knee", 1, (0.03, -0.39, 0.0)),
    Joint("right_knee", 2, (-0.03, -0.39, 0.0)),
    Joint("spine2", 3, (0.0, 0.13, 0.01)),
    Joint("left_ankle", 4, (-0.01, -0.42, -0.03)),
    Joint("right_ankle", 5, (0.01, -0.42, -0.03)),
    Joint("spine3", 6, (0.0, 0.06, 0.01)),
    Joint("left_foot", 7, (0.02, -0.06, 0.13)),
    Joint("right_foot", 8, (-0.02, -0.06, 0.13)),
    Joint("neck", 9, (0.0, 0.21, -0.02)),
    Joint("left_collar", 9, (0.08, 0.11, -0.01)),
    Joint("right_collar", 9, (-0.08, 0.11, -0.01)),
    Joint("head", 12, (0.0, 0.09, 0.03)),
    Joint("left_shoulder", 13, (0.1, 0.03, -0.01)),
    Joint("right_shoulder", 14, (-0.1, 0.03, -0.01)),
    Joint("left_elbow", 16, (0.26, 0.0, -0.02)),
    Joint("right_elbow", 17, (-0.26, 0.0, -0.02)),
    Joint("left_wrist", 18, (0.25, 0.0, 0.0)),
    Joint("right_wrist", 19, (-0.25, 0.0, 0.0)),
)
"""SMPL's joints in order, with offsets in metres of a plain body in a T-pose, facing z, y up."""


def read(file: File) -> Motion:
    """Read a motion written by :func:`write`, or the 22 body joints of a file of AMASS.

    AMASS has the root's translation in "length" (metres), angles in "deg", y up. FormatError where arrays are missing,
    do not fit or are of another kind.
    """
    path, content = place_of(file), read_bytes(file)
    kind = "an .npz motion written by motet"
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = {name.removesuffix(".npy") for name in archive.namelist()}
            if "trans" in names and names & {"poses", "pose_body"}:
                kind = "an AMASS file"
                return _amass(path, archive, names, len(content))
            return _motet(path, archive, names)
    except FormatError:
        raise
    # a damaged archive makes zipfile, its unpackers, numpy and json raise errors of a dozen types
    except Exception as error:
        reason = error.args[0] if isinstance(error, KeyError) else error
        raise FormatError(path, f"not {kind}: {str(reason)[:200]}") from error


def array(archive: zipfile.ZipFile, name: str, kinds: str) -> NDArray[Any]:
    """One array of the given kinds of dtype; its declared size is checked against the archive before allocation.

    KeyError if there is none of that name, ValueError if it is too large, of another type or does not fit its size;
    a damaged archive makes zipfile and its unpackers raise errors of a dozen types.
    """
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > NPZ_MAX_BYTES:
        raise ValueError(f"array {name!r} has {info.file_size} bytes: expected at most {NPZ_MAX_BYTES}")
    with archive.open(info) as stream:
        shape, by_columns, dtype = _header(stream)
        size = info.file_size - stream.tell()
        if dtype.kind not in kinds or math.prod(shape) * dtype.itemsize != size:
            raise ValueError(f"array {name!r} of {dtype} {shape} does not fit {size} bytes, or is of the wrong type")
        content = stream.read()
    if dtype.kind == "U":  # numpy makes strings of numbers that are no code points, but they cannot be printed
        points = np.frombuffer(content, f"{dtype.byteorder}u4")
        if not ((points < 0xD800) | ((points > 0xDFFF) & (points <= 0x10FFFF))).all():
            raise ValueError(f"array {name!r} holds invalid characters")
    return np.frombuffer(content, dtype).reshape(shape, order="F" if by_columns else "C")


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether columns come first, and dtype of an array, from the beginning of its file."""
    headers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    header: tuple[tuple[int, ...], bool, np.dtype[Any]] = headers[npy.read_magic(stream)](stream)
    return header


def _motet(path: Path, archive: zipfile.ZipFile, names: set[str]) -> Motion:
    arrays = {"values": "fiu", "channels": "U", "units": "U", "fps": "fiu", "skeleton": "U"}
    others = {
        "posed_joints": "Kimodo's npz, which has no skeleton: convert it to BVH with its own kimodo_convert",
        "body_pos_w": "a robot's motion for training controllers, not a human's",
        "dof_pos": "the motor angles of a robot, not a human's motion",
        "joint_pos": "the motor angles of a robot, not a human's motion",
    }
    for name, kind in others.items():
        if name in names and not names >= arrays.keys():
            raise FormatError(path, f"this is {kind}; expected a motion from motet or AMASS")
    values, channels, units, fps, skeleton = (array(archive, name, kinds) for name, kinds in arrays.items())
    bones = Skeleton.from_json(json.loads(str(skeleton))) if str(skeleton) else None
    names_of_channels, units_of_channels = (tuple(map(str, words.tolist())) for words in (channels, units))
    return Motion(values, names_of_channels, units_of_channels, frame_rate(float(fps), path), bones)


def _amass(path: Path, archive: zipfile.ZipFile, names: set[str], size: int) -> Motion:
    rates = ("mocap_framerate", "mocap_frame_rate")
    rate = next((name for name in rates if name in names), None)
    parts = ("poses",) if "poses" in names else ("root_orient", "pose_body")
    with archive.open(f"{parts[0]}.npy") as stream:
        shape = _header(stream)[0]
    if shape[0] * len(AMASS_JOINTS) >= most_poses(size):
        raise FormatError(path, f"{shape[0]} frames are too many for a file of {size} bytes")
    poses = np.concatenate([array(archive, part, "fiu") for part in parts], axis=-1).astype(np.float64)
    width = 3 * len(AMASS_JOINTS)
    if poses.ndim != 2 or poses.shape[1] < width:
        raise FormatError(path, f"poses of shape {poses.shape}: expected (frames, {width} or more)")
    trans = array(archive, "trans", "fiu").astype(np.float64)
    if rate is None:
        raise FormatError(path, f"no frame rate: expected an array {' or '.join(rates)}")
    fps = frame_rate(float(array(archive, rate, "fiu")), path)
    vectors = poses[:, :width].reshape(len(poses), len(AMASS_JOINTS), 3)
    if trans.shape != (len(vectors), 3) or not (np.isfinite(vectors).all() and np.isfinite(trans).all()):
        raise FormatError(path, f"trans must be ({len(vectors)}, 3) finite numbers, not {trans.shape}")
    turned = rotvec_to_rotmat(vectors)
    z_to_y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    turned[:, 0] = z_to_y @ turned[:, 0]
    for i, joint in enumerate(AMASS_JOINTS[1:], start=1):
        turned[:, i] = product(turned[:, joint.parent], turned[:, i])
    return motion_of(Skeleton(AMASS_JOINTS, metres_per_unit=1.0), turned, {0: trans @ z_to_y.T}, fps)


def write(file: File, motion: Motion) -> None:
    """Write a motion; FormatError if it is too long to read back, OutputError if it cannot be written."""
    if motion.values.nbytes >= NPZ_MAX_BYTES:
        raise FormatError(place_of(file), f"{motion.values.nbytes} bytes of values are too many for one file: split it")
    content = io.BytesIO()
    skeleton = "" if motion.skeleton is None else json.dumps(motion.skeleton.to_json())
    np.savez_compressed(
        content,
        values=motion.values,
        channels=np.array(motion.channels, dtype=np.str_),
        units=np.array(motion.units, dtype=np.str_),
        fps=np.float64(motion.fps),
        skeleton=np.str_(skeleton),
    )
    write_whole(file, content.getvalue())
