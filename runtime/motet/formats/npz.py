"""NPZ: a complete motion, lossless, as numpy arrays. Nothing in it is pickled.

Arrays: ``values`` (T, D) float64, ``channels`` (D,) and ``units`` (D,) text, ``fps`` float64, and ``skeleton``, the
JSON of :meth:`motet.motion.skeleton.Skeleton.to_json`, empty for a motion without skeleton.
"""

import io
import json
import zipfile
from pathlib import Path

import numpy as np

from motet.errors import FormatError
from motet.files import File, place_of, write_whole
from motet.formats import amass
from motet.formats.lines import frame_rate, read_bytes
from motet.formats.npy import NPY_MAX_BYTES, array
from motet.motion.motion import Motion
from motet.motion.skeleton import Skeleton

OTHER_NPZ = {
    "posed_joints": "Kimodo's npz, which has no skeleton: convert it to BVH with its own kimodo_convert",
    "body_pos_w": "a robot's motion for training controllers, not a human's",
    "dof_pos": "the motor angles of a robot, not a human's motion",
    "joint_pos": "the motor angles of a robot, not a human's motion",
}
"""An array -> the kind of file it reveals."""

NPZ_ARRAYS = {"values": "fiu", "channels": "U", "units": "U", "fps": "fiu", "skeleton": "U"}
"""Array -> its allowed kinds of dtype."""


def read(file: File) -> Motion:
    """Read a motion written by :func:`write` or a file of AMASS (:mod:`motet.formats.amass`); else FormatError."""
    path, content = place_of(file), read_bytes(file)
    if amass.is_amass(content):
        return amass.parse(path, content)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            _refuse_others(path, {name.removesuffix(".npy") for name in archive.namelist()})
            values, channels, units, fps, skeleton = (array(archive, name, kinds) for name, kinds in NPZ_ARRAYS.items())
        names, kinds, text = map(str, channels.tolist()), map(str, units.tolist()), str(skeleton)
        bones = Skeleton.from_json(json.loads(text)) if text else None
        return Motion(values, tuple(names), tuple(kinds), frame_rate(float(fps), path), bones)
    except FormatError:
        raise
    # a damaged archive makes zipfile, its unpackers, numpy and json raise errors of a dozen types
    except Exception as error:
        raise FormatError(path, f"not an .npz motion written by motet: {str(error)[:200]}") from error


def _refuse_others(path: Path, arrays: set[str]) -> None:
    """FormatError that names the kind of file if the arrays are another program's."""
    for name, kind in OTHER_NPZ.items():
        if name in arrays and not arrays >= NPZ_ARRAYS.keys():
            raise FormatError(path, f"this is {kind}; expected a motion from motet or AMASS")


def write(file: File, motion: Motion) -> None:
    """Write a motion; FormatError if it is too long to read back, OutputError if it cannot be written."""
    if motion.values.nbytes >= NPY_MAX_BYTES:
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
