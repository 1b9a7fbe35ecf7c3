"""Reading FBX, binary and ASCII: the skeleton, and its takes as clips; by ufbx, of the extra "fbx".

ufbx runs in a process of its own (``fbx_to_gltf.py``), which gives what it finds as glTF. So joints, names and clips
are found as in :mod:`motet.formats.gltf`; unit and axes are those of the file, and skins rest as they are bound.
"""

import json
import subprocess
import sys
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

from motet.errors import FormatError
from motet.files import File, place_of
from motet.formats import gltf, gltf_character
from motet.formats.character import Character
from motet.formats.clips import Clip, chosen, clip_names
from motet.formats.lines import read_bytes
from motet.motion.motion import Motion

PROGRAM = Path(__file__).with_name("fbx_to_gltf.py")

FBX_MAX_BYTES = 2**29
"""The largest file that is read."""

FBX_SECONDS = 600
"""How long one may take."""


def read(file: File, clip: Clip = None, rest: File | None = None) -> Motion:
    """Read a take, the first that moves a bone by default, or the rest pose as one frame where there is none.

    Lengths are metres. Channels: three angles in "deg" for each joint, the translation of the root and of joints that
    move in "length". FormatError names what the file lacks, and the extra where ufbx is not installed.
    rest: as of :func:`motet.formats.gltf.read`, or an FBX file, whose own rest pose it then is.
    """
    path, content = place_of(file), read_bytes(file, FBX_MAX_BYTES)
    found = _gltf(path, content, 0 if clip is None else None)
    names = _takes(found)
    if clip is not None:
        found = _gltf(path, content, chosen(path, names, clip))
    elif names:
        chosen(path, names, None)  # which says that there are others
    if rest is not None and place_of(rest).suffix.lower() == ".fbx":
        rest = _gltf(place_of(rest), read_bytes(rest, FBX_MAX_BYTES), None)
    return gltf.read(found, rest=rest)


def clips(file: File) -> tuple[str, ...]:
    """The names of the takes that move a bone, in the file's order; FormatError as :func:`read`."""
    return _takes(_gltf(place_of(file), read_bytes(file, FBX_MAX_BYTES), None))


def read_character(file: File) -> Character:
    """Read a character's skeleton to put motions onto; FormatError as :func:`read`."""
    return gltf_character.read_character(_gltf(place_of(file), read_bytes(file, FBX_MAX_BYTES), None))


def _takes(found: BytesIO) -> tuple[str, ...]:
    return clip_names(json.loads(found.getvalue())["extras"]["takes"])


def _gltf(path: Path, content: bytes, take: int | None) -> BytesIO:
    """The skeleton with a take, of those that move a bone, by its index; None: at rest, as where there is none."""
    found = BytesIO(_run(path, content, "-1" if take is None else str(take)))
    found.name = str(path)  # by which errors call it
    return found


def _run(path: Path, content: bytes, number: str) -> bytes:
    """What the program makes of a file; FormatError with its reason for refusing it, or where ufbx breaks down."""
    if find_spec("ufbx") is None:
        raise FormatError(path, "FBX files need the package ufbx: install the extra with  pip install 'motet[fbx]'")
    command = [sys.executable, "-P", str(PROGRAM), number]
    try:
        done = subprocess.run(command, input=content, capture_output=True, timeout=FBX_SECONDS, check=False)
    except subprocess.TimeoutExpired as error:
        raise FormatError(path, f"it takes more than {FBX_SECONDS} s to read") from error
    except OSError as error:
        raise FormatError(path, f"no process to read it can be started: {error.strerror}") from error
    if done.returncode:
        reason = done.stderr.decode(errors="replace")[:200] if done.returncode == 1 else "ufbx breaks down on it"
        raise FormatError(path, f"broken FBX file: {reason}")
    return done.stdout
