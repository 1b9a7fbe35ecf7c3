"""Reading FBX, binary and ASCII, with ufbx (extra "fbx"): the skeleton, and its takes as clips.

ufbx runs in a separate process (``fbx_to_gltf.py``), which returns glTF. So joints, names and clips are found as in
:mod:`motet.formats.gltf`; unit and axes are the file's, and the rest pose of a skin is its bind pose.
"""

import json
import subprocess
import sys
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

from motet.errors import FormatError
from motet.files import File, place_of
from motet.formats import gltf
from motet.formats.text import Clip, chosen, clip_names, read_bytes
from motet.motion.motion import Motion

PROGRAM = Path(__file__).with_name("fbx_to_gltf.py")

FBX_MAX_BYTES, FBX_SECONDS = 2**29, 600
"""The largest file read, and how long reading may take."""


def read(file: File, clip: Clip = None, rest: File | None = None) -> Motion:
    """Read a take, by default the first that moves a bone, or the rest pose as one frame if there is none.

    Lengths are metres. Channels: three angles in "deg" for each joint, the translation of the root and of moving
    joints in "length". FormatError names what the file lacks, and the extra if ufbx is not installed.
    rest: see :func:`motet.formats.gltf.read`; or an FBX file, for its rest pose.
    """
    path, content = place_of(file), BytesIO(read_bytes(file, FBX_MAX_BYTES))
    content.name = str(path)  # used in error messages
    found = as_gltf(content, 0 if clip is None else None)
    names = _takes(found)
    if clip is not None:
        content.seek(0)
        found = as_gltf(content, chosen(path, names, clip))
    elif names:
        chosen(path, names, None)  # logs that there are others
    if rest is not None and place_of(rest).suffix.lower() == ".fbx":
        rest = as_gltf(rest)
    return gltf.read(found, rest=rest)


def clips(file: File) -> tuple[str, ...]:
    """The names of the takes that move a bone, in the file's order; FormatError like :func:`read`."""
    return _takes(as_gltf(file))


def _takes(found: BytesIO) -> tuple[str, ...]:
    return clip_names(json.loads(found.getvalue())["extras"]["takes"])


def as_gltf(file: File, take: int | None = None) -> BytesIO:
    """The skeleton with a take, by its index among those that move a bone; at rest for None or if there is none.

    FormatError with the program's reason for refusing a file, or if ufbx crashes.
    """
    path, content = place_of(file), read_bytes(file, FBX_MAX_BYTES)
    if find_spec("ufbx") is None:
        raise FormatError(path, "FBX files need the package ufbx: install the extra with  pip install 'motet[fbx]'")
    command = [sys.executable, "-P", str(PROGRAM), "-1" if take is None else str(take)]
    try:
        done = subprocess.run(command, input=content, capture_output=True, timeout=FBX_SECONDS, check=False)
    except subprocess.TimeoutExpired as error:
        raise FormatError(path, f"reading it takes over {FBX_SECONDS} s") from error
    except OSError as error:
        raise FormatError(path, f"cannot start a process to read it: {error.strerror}") from error
    if done.returncode:
        reason = done.stderr.decode(errors="replace")[:200] if done.returncode == 1 else "ufbx crashes on it"
        raise FormatError(path, f"broken FBX file: {reason}")
    found = BytesIO(done.stdout)
    found.name = str(path)
    return found
