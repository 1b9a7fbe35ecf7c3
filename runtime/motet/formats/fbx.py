"""Reading FBX, binary and ASCII, with ufbx (extra "fbx"): the skeleton, and its takes as clips.

ufbx runs in a separate process (``fbx_to_gltf.py``), which returns glTF. So joints, names and clips are found as in
:mod:`motet.formats.gltf`; unit and axes are the file's, and the rest pose of a skin is its bind pose.
"""

import json
import logging
import subprocess
import sys
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

from motet.files import File, place_of
from motet.formats import gltf
from motet.formats.text import (
    Clip,
    ContentError,
    Contents,
    Figure,
    choice,
    chosen,
    is_name_of,
    names_file,
    part_names,
    read_bytes,
)
from motet.motion.motion import Motion

log = logging.getLogger(__name__)

Takes = dict[str, set[int]]
"""The takes by name, and the nodes that each moves."""

FBX_PROGRAM = Path(__file__).with_name("fbx_to_gltf.py")

FBX_MAX_BYTES = 2**29
FBX_SECONDS = 600
"""The largest file read, and how long reading may take."""


@names_file
def read(file: File, clip: Clip = None, rest: File | None = None, figure: Figure = None) -> Motion:
    """Read a take, by default the first that moves a bone, or the rest pose as one frame if there is none.

    Lengths are metres. Channels: three angles in "deg" for each joint, the translation of the root and of moving
    joints in "length". FormatError names what the file lacks, and the extra if ufbx is not installed.
    rest, figure: see :func:`motet.formats.gltf.read`; rest may be an FBX file, for its rest pose.
    """
    # the file is read once, though ufbx may run twice
    content = BytesIO(read_bytes(file, FBX_MAX_BYTES))
    content.name = str(place_of(file))  # used in error messages
    # the first take's document lists all takes, and mostly is the one that is read
    document = as_gltf(content, 0 if clip is None else None)
    take, figure = _choice(content, _takes(document), clip, figure)
    # another take needs another run
    if take or clip is not None:
        content.seek(0)
        document = as_gltf(content, take)
    if note := json.loads(document.getvalue())["extras"]["note"]:
        log.warning("%s: %s", place_of(file), note)
    if rest is not None and place_of(rest).suffix.lower() == ".fbx":
        rest = as_gltf(rest)
    return gltf.read(document, None if take is None else 1, rest, figure)


def _choice(content: BytesIO, takes: Takes, clip: Clip, figure: Figure) -> tuple[int | None, Figure]:
    """The index of a take, None for none, and a figure. The file is read for its figures only if that needs them."""
    path = place_of(content)
    names = tuple(takes)
    is_number = isinstance(clip, int) or (clip is not None and clip.isdecimal())
    if figure is None and (clip is None or is_number or is_name_of(clip, names)):
        return (chosen(path, names, clip) if names or clip is not None else None), None
    content.seek(0)
    parts = contents(content)
    take, place = choice(path, parts, clip, figure)
    return take, None if place is None else tuple(parts.figures)[place]


@names_file
def contents(file: File) -> Contents:
    """The takes that move a bone, and the figures as the first take shows them; FormatError like :func:`read`."""
    document = as_gltf(file, 0)
    return gltf.contents_of_takes(document, _takes(document))


def _takes(document: BytesIO) -> Takes:
    """The takes of a document."""
    takes = json.loads(document.getvalue())["extras"]["takes"]
    names = part_names(take["name"] for take in takes)
    return {name: set(take["moved"]) for name, take in zip(names, takes, strict=True)}


@names_file
def as_gltf(file: File, take: int | None = None) -> BytesIO:
    """The skeleton with a take, by its index among those that move a bone; at rest for None or if there is none.

    FormatError with the program's reason for refusing a file, or if ufbx crashes.
    """
    content = read_bytes(file, FBX_MAX_BYTES)
    if find_spec("ufbx") is None:
        raise ContentError("FBX files need the package ufbx: install the extra with  pip install 'motet[fbx]'")
    # a process of its own, since untrusted files may crash ufbx
    command = [sys.executable, "-P", str(FBX_PROGRAM), "-1" if take is None else str(take)]
    try:
        done = subprocess.run(command, input=content, capture_output=True, timeout=FBX_SECONDS, check=False)
    except subprocess.TimeoutExpired as error:
        raise ContentError(f"reading it takes over {FBX_SECONDS} s") from error
    except OSError as error:
        raise ContentError(f"cannot start a process to read it: {error.strerror}") from error
    if done.returncode:
        reason = done.stderr.decode(errors="replace")[:200] if done.returncode == 1 else "ufbx crashes on it"
        raise ContentError(f"broken FBX file: {reason}")
    document = BytesIO(done.stdout)
    document.name = str(place_of(file))
    return document
