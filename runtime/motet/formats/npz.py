"""NPZ: a complete motion, lossless, as numpy arrays; and AMASS and other files of SMPL bodies. Nothing is unpickled.

motet's arrays: ``values`` (T, D) float64, ``channels`` (D,) and ``units`` (D,) text, ``fps`` float64, and ``skeleton``,
the JSON of :meth:`motet.motion.skeleton.Skeleton.to_json`, empty for a motion without skeleton.

SMPL's arrays: ``trans`` or ``transl`` (T, 3) in metres, and the rotations of the joints in SMPL's order: ``poses``,
``root_orient`` with ``pose_body`` (AMASS), or ``global_orient`` with ``body_pose`` (mocap from video: ROMP, 4D-Humans,
WHAM, GVHMR). Each is of rotation vectors, (T, 3 J) or (T, J, 3), or of matrices (T, J, 3, 3); fingers, jaw and eyes
that follow the 22 joints of the body are left out. AMASS has z up, mocap from video y.
The body shape would need the body model, which is not read: the skeleton is a plain one with an adult's proportions.
"""

import io
import json
import math
import zipfile
from collections.abc import Iterator
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from motet.errors import FormatError
from motet.files import File, place_of, write_whole
from motet.formats.text import ContentError, check_rate, frame_rate, most_poses, names_file, read_bytes
from motet.motion.kinematics import motion_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, product, rotvec_to_rotmat
from motet.motion.skeleton import Joint, Names, Skeleton

NPZ_MAX_BYTES = 2**29
"""Bytes of an unpacked array: over an hour of a hundred channels at 120 fps."""

JOINT_TABLE = """\
pelvis         -1   0.0    0.0    0.0
left_hip        0  0.07  -0.08    0.0
right_hip       0 -0.07  -0.08    0.0
spine1          0   0.0   0.11  -0.02
left_knee       1  0.03  -0.39    0.0
right_knee      2 -0.03  -0.39    0.0
spine2          3   0.0   0.13   0.01
left_ankle      4 -0.01  -0.42  -0.03
right_ankle     5  0.01  -0.42  -0.03
spine3          6   0.0   0.06   0.01
left_foot       7  0.02  -0.06   0.13
right_foot      8 -0.02  -0.06   0.13
neck            9   0.0   0.21  -0.02
left_collar     9  0.08   0.11  -0.01
right_collar    9 -0.08   0.11  -0.01
head           12   0.0   0.09   0.03
left_shoulder  13   0.1   0.03  -0.01
right_shoulder 14  -0.1   0.03  -0.01
left_elbow     16  0.26    0.0  -0.02
right_elbow    17 -0.26    0.0  -0.02
left_wrist     18  0.25    0.0    0.0
right_wrist    19 -0.25    0.0    0.0
"""
"""Of each of SMPL's joints the name, the parent's number, and the offset in metres, in their order."""


def _joints_of_table() -> Iterator[Joint]:
    for line in JOINT_TABLE.splitlines():
        name, parent, x, y, z = line.split()
        yield Joint(name, int(parent), (float(x), float(y), float(z)))


AMASS_JOINTS = tuple(_joints_of_table())
"""SMPL's joints: a plain body in a T-pose, facing z, y up."""


ROTATIONS = (("poses",), ("root_orient", "pose_body"), ("global_orient", "body_pose"))
"""Arrays that hold the rotations of SMPL's joints, one kind or another."""

RATE_ARRAYS = ("mocap_framerate", "mocap_frame_rate", "fps")
"""Arrays that hold the frame rate of SMPL's, one or another."""


@names_file
def read(file: File, fps: float | None = None) -> Motion:
    """Read a motion written by :func:`write`, or the 22 body joints of a file of SMPL bodies, such as AMASS.

    SMPL's has the root's translation in "length" (metres), angles in "deg", y up. fps: of one that states no frame
    rate. FormatError where arrays are missing, do not fit or are of another kind, or where the file states another
    rate.
    """
    content = read_bytes(file)
    kind = "an .npz motion written by motet"
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = {name.removesuffix(".npy") for name in archive.namelist()}
            if parts := next(filter(names.issuperset, ROTATIONS), None):
                kind = "a file of SMPL bodies"
                return _smpl(archive, names, parts, len(content), fps)
            motion = _motet(archive, names)
            check_rate(motion.fps, fps)
            return motion
    except ContentError:
        raise
    # a damaged archive makes zipfile, its unpackers, numpy and json raise errors of a dozen types
    except Exception as error:
        reason = error.args[0] if isinstance(error, KeyError) else error
        raise ContentError(f"not {kind}: {str(reason)[:200]}") from error


def array(archive: zipfile.ZipFile, name: str, kinds: str) -> NDArray[Any]:
    """One array of the given kinds of dtype; its declared size is checked against the archive before allocation.

    KeyError if there is none of that name, ValueError if it is too large, of another type or does not fit its size;
    a damaged archive makes zipfile and its unpackers raise errors of a dozen types.
    """
    # the size that the archive declares, before anything is unpacked
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > NPZ_MAX_BYTES:
        raise ValueError(f"array {name!r} has {info.file_size} bytes: expected at most {NPZ_MAX_BYTES}")
    with archive.open(info) as stream:
        # the array's own header must fit it
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
    return headers[npy.read_magic(stream)](stream)


ARRAYS = {"values": "fiu", "channels": "U", "units": "U", "fps": "fiu", "skeleton": "U"}
"""motet's arrays, and of each the kinds of dtypes that it may have."""

UNSUPPORTED_ARRAYS = {
    "posed_joints": "Kimodo's npz, which has no skeleton: convert it to BVH with its own kimodo_convert",
    "body_pos_w": "a robot's motion for training controllers, not a human's",
    "dof_pos": "the motor angles of a robot, not a human's motion",
    "joint_pos": "the motor angles of a robot, not a human's motion",
    "joints": "places of joints, as of HumanML3D, without rotations",
    "betas": "a body's shape without its poses",
}
"""An array of files that are not read -> what these are."""


def _motet(archive: zipfile.ZipFile, names: set[str]) -> Motion:
    for name, kind in UNSUPPORTED_ARRAYS.items():
        if name in names and not names >= ARRAYS.keys():
            raise ContentError(f"this is {kind}; expected a motion from motet, AMASS or other SMPL bodies")
    values, channels, units, fps, skeleton = (array(archive, name, kinds) for name, kinds in ARRAYS.items())
    bones = Skeleton.from_json(json.loads(str(skeleton))) if str(skeleton) else None
    rate = frame_rate(float(fps))
    return Motion(values, tuple(map(str, channels.tolist())), tuple(map(str, units.tolist())), rate, bones)


def _smpl(archive: zipfile.ZipFile, names: set[str], parts: Names, size: int, fps: float | None) -> Motion:
    # rotations in their parents' frames
    turned = _joints(archive, parts, size)
    # where the root is, in metres
    trans = _path_of_root(archive, names, len(turned))
    rate = _rate(archive, names, fps)

    # rotations in the world, y up
    if parts[-1] != "body_pose":
        z_to_y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        turned[:, 0] = z_to_y @ turned[:, 0]
        trans = trans @ z_to_y.T
    for i, joint in enumerate(AMASS_JOINTS[1:], start=1):
        turned[:, i] = product(turned[:, joint.parent], turned[:, i])
    return motion_of(Skeleton(AMASS_JOINTS, metres_per_unit=1.0), turned, {0: trans}, rate)


def _joints(archive: zipfile.ZipFile, parts: Names, size: int) -> Array:
    """Rotations (T, 22, 3, 3) of the body's joints, each in its parent's frame."""
    with archive.open(f"{parts[0]}.npy") as stream:
        shape = _header(stream)[0]
    if not shape:
        raise ContentError(f"{parts[0]} is a single number: expected its frames")
    # a small file must not become a large motion
    if shape[0] * len(AMASS_JOINTS) >= most_poses(size):
        raise ContentError(f"{shape[0]} frames are too many for a file of {size} bytes")
    each = [_rotations(part, array(archive, part, "fiu").astype(np.float64)) for part in parts]
    turned = np.concatenate(each, axis=1)
    if turned.shape[1] < len(AMASS_JOINTS):
        expected = f"expected {len(AMASS_JOINTS)} or more"
        raise ContentError(f"{' and '.join(parts)}: {turned.shape[1]} joints, {expected}")
    return np.array(turned[:, : len(AMASS_JOINTS)])


def _path_of_root(archive: zipfile.ZipFile, names: set[str], frames: int) -> Array:
    """The translation (T, 3) of the root in metres."""
    place = next(filter(names.__contains__, ("trans", "transl")), None)
    if place is None:
        raise ContentError("no translation of the root: expected an array trans or transl")
    trans = array(archive, place, "fiu").astype(np.float64)
    # the root has a place in each frame
    if trans.shape != (frames, 3) or not np.isfinite(trans).all():
        raise ContentError(f"{place} must be ({frames}, 3) finite numbers, not {trans.shape}")
    return trans


def _rate(archive: zipfile.ZipFile, names: set[str], fps: float | None) -> float:
    """The frame rate that a file states, or else the one that was given."""
    name = next(filter(names.__contains__, RATE_ARRAYS), None)
    if name is not None:
        stated = frame_rate(float(array(archive, name, "fiu")))
        check_rate(stated, fps)
        return stated
    if fps is None:
        raise ContentError(
            f"no frame rate, as an array {' or '.join(RATE_ARRAYS)}: give it by --fps-in, in Python fps="
        )
    return frame_rate(fps)


def _rotations(name: str, values: Array) -> Array:
    """Rotations (T, J, 3, 3) of joints, from vectors (T, 3 J) or (T, J, 3), or matrices (T, J, 3, 3) or (T, 3, 3)."""
    if not np.isfinite(values).all():
        raise ContentError(f"{name} holds numbers that are not finite")
    # the root's may come without an axis of joints
    if values.ndim == 3 and values.shape[1:] == (3, 3) and name in ("global_orient", "root_orient"):
        values = values[:, None]
    if values.ndim == 4 and values.shape[2:] == (3, 3):
        _check_matrices(name, values)
        return np.array(values)
    if values.ndim not in (2, 3) or math.prod(values.shape[1:]) % 3:
        shapes = "(frames, 3 times joints), (frames, joints, 3) or (frames, joints, 3, 3)"
        raise ContentError(f"{name} of shape {values.shape}: expected {shapes}")
    return rotvec_to_rotmat(values.reshape(len(values), -1, 3))


def _check_matrices(name: str, matrices: Array) -> None:
    """FormatError where some of the matrices (T, J, 3, 3) are no rotations."""
    differences = matrices @ np.swapaxes(matrices, -1, -2) - np.eye(3)
    if np.abs(differences).max(initial=0.0) > 0.01 or np.linalg.det(matrices).min(initial=1.0) < 0:
        raise ContentError(f"{name} holds matrices that are no rotations")


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
