"""Files of motion: one record per format, chosen by the extension.

A format's module has ``read(file, **options) -> Motion``, ``write(file, motion)`` or both, where a file is a path or a
binary file object; both raise motet's errors and leave nothing half-written. If its files hold several motions, it also
has ``clips(file)``, which returns their names, and ``read`` takes "clip". To add a format, write its module and add its
record to :data:`FORMATS`, which help texts, the table of docs/formats.md and the lists of corpora are built from.
"""

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from motet.errors import FormatError, MotionError, OutputError
from motet.files import File, check_place, place_of
from motet.formats.character import Character, put_onto
from motet.formats.lines import Clip, split_clip
from motet.motion.humanoid import rig
from motet.motion.motion import Motion
from motet.motion.skeleton import Skeleton, metres

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Format:
    """One format of motion files.

    keeps: which parts of a motion a file holds, for the docs.
    reader, writer: the modules in this package with its ``read`` and ``write``, imported on first use; empty if it is
        not read or not written.
    options: the keyword arguments of its ``read``.
    mocap: whether a file holds motion and skeleton, as the files of a corpus must.
    loose: whether its unit of length is a convention that some files ignore.
    needs: the package required for writing, from the extra "plot".
    """

    extension: str
    name: str
    keeps: str
    reader: str = ""
    writer: str = ""
    options: tuple[str, ...] = ()
    mocap: bool = False
    loose: bool = False
    needs: str = ""

    def read(self) -> Callable[..., Motion]:
        """The module's ``read``."""
        found: Callable[..., Motion] = import_module(f"motet.formats.{self.reader}").read
        return found

    def clips(self) -> Callable[[File], tuple[str, ...]]:
        """The module's ``clips``."""
        found: Callable[[File], tuple[str, ...]] = import_module(f"motet.formats.{self.reader}").clips
        return found

    def write(self) -> Callable[[File, Motion], None]:
        """The module's ``write``."""
        found: Callable[[File, Motion], None] = import_module(f"motet.formats.{self.writer}").write
        return found


_AMC = "everything; AMC has no frame rate: 120 unless `fps=` or a comment written by motet gives another"
_GIF = "an animated picture; needs Pillow: `pip install 'motet[plot]'`"
_NPZ = "everything, bit for bit; from AMASS, the body joints"
_GLB = "a skeleton and its animations, each a clip; written with a body, for viewers and engines"
_CHARACTER = "a skeleton and its animations, each a clip, or its rest pose"
_AVATAR = f"{_CHARACTER}; written by `--onto`, the avatar itself ([humanoid.md](humanoid.md#characters))"
_FBX = "a skeleton and its takes, each a clip; needs ufbx: `pip install 'motet[fbx]'`"
_VRMA = "the humanoid: motions of other human figures are retargeted ([humanoid.md](humanoid.md))"

FORMATS = (
    Format(".amc", "Acclaim, with its .asf", _AMC, "amc", "amc", options=("asf", "fps", "partial"), mocap=True),
    Format(".bvh", "Biovision", "everything but the unit of length", "bvh", "bvh", options=("partial",), mocap=True),
    Format(".npz", "motet's own; AMASS", _NPZ, "npz", "npz", mocap=True),
    Format(".csv", "table", "values, units and frame rate, no skeleton", "csv", "csv"),
    Format(".xml", "MMM of KIT", "angles and root; the skeleton is not in the file", "mmm"),
    Format(".glb", "glTF 2.0", _GLB, "gltf", "glb", options=("clip", "rest"), mocap=True, loose=True),
    Format(".gltf", "glTF 2.0, as text", _CHARACTER, "gltf", options=("clip", "rest"), loose=True),
    Format(".vrm", "VRM avatar", _AVATAR, "gltf", options=("clip", "rest"), loose=True),
    Format(".vrma", "VRM Animation", _VRMA, "gltf", "vrma", options=("clip", "rest"), mocap=True, loose=True),
    Format(".fbx", "FBX", _FBX, "fbx", options=("clip", "rest"), mocap=True, loose=True),
    Format(".html", "web page", "a page with a player: orbit, play, scrub, no network", writer="html"),
    Format(".gif", "picture", _GIF, writer="gif", needs="PIL"),
)

CHARACTER_READERS = {"gltf": "gltf_character", "fbx": "fbx"}
"""Reader -> the module whose ``read_character`` reads a skeleton with the axes of its nodes."""

NO_MOTIONS = {
    ".c3d": ", which hold markers without a skeleton: first solve for one in the program that recorded them",
}
"""Extensions of other motion files -> what to add when refusing them."""

READABLE = tuple(kind.extension for kind in FORMATS if kind.reader)
WRITABLE = tuple(kind.extension for kind in FORMATS if kind.writer)
MOCAP = tuple(kind.extension for kind in FORMATS if kind.mocap)
CLIPPED = tuple(kind.extension for kind in FORMATS if "clip" in kind.options)
READS = ", ".join(f"{kind.extension} ({kind.name})" for kind in FORMATS if kind.reader)
WRITES = ", ".join(f"{kind.extension} ({kind.name})" for kind in FORMATS if kind.writer)
"""The formats as help texts list them."""

ONTO = (".glb", ".vrm")
"""Extensions for a character written with its mesh and new animations."""


HUMAN_HEIGHT = (0.5, 3.0)
"""Plausible sizes of a human figure in metres, sole to crown or hand to hand."""


def read_motion(  # noqa: PLR0913  options, each of which has a default
    file: File,
    *,
    fps: float | None = None,
    asf: str | Path | None = None,
    unit: str | float | None = None,
    partial: bool = False,
    clip: Clip = None,
    rest: File | None = None,
    format: str | None = None,
) -> Motion:
    """Read a motion file or a binary file object; "file.glb#Walk" is the clip Walk of file.glb.

    fps: the frame rate, for AMC, which states none.
    asf: the skeleton of an AMC file; by default it is looked for beside it.
    unit: the length unit if the file states none: "m", "cm", "mm", "inch" or a number of metres. For glTF, whose metre
        is only a convention, it applies unless the figure is human-sized in metres and not in that unit.
    partial: read the complete frames of a truncated AMC or BVH file instead of refusing it.
    clip: a motion of a file with several: a name from :func:`clips` or a number from 1; default: the first.
    rest: a glTF file with the same joints in a T-pose, for glTF and FBX files whose rest pose is their first frame;
        "file.glb#TPose" means the first frame of that clip. For FBX, an FBX file works too.
    format: the extension, such as "bvh", if it differs from the path's; required for a file object.

    FormatError for an unknown extension, a missing file, one that is not a motion, and an option that the format does
    not take or the file contradicts.
    """
    file, named = split_clip(file, READABLE)
    kind, path = _format(file, format, READABLE, "read"), place_of(file)
    clip = named if clip is None else clip
    given = {"fps": fps, "asf": asf, "partial": partial or None, "clip": clip, "rest": rest}
    options = _taken(path, kind, given)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # Motion refuses infinite values
            motion = kind.read()(file, **options)
        log.debug("read %s: %r", path, motion)
        return motion if unit is None else _in_unit(path, motion, metres(unit), kind.loose)
    except FormatError:
        raise
    except MotionError as error:
        raise FormatError(path, str(error)) from error


def _taken(path: Path, kind: Format, given: Mapping[str, Any]) -> dict[str, Any]:
    """The options that were given; FormatError if the format does not take one of them."""
    options = {name: value for name, value in given.items() if value is not None}
    for name in options.keys() - set(kind.options):
        takers = " ".join(known.extension for known in FORMATS if name in known.options)
        raise FormatError(path, f"{name!r} is an option for {takers} files only")
    return options


def clips(file: File, *, format: str | None = None) -> tuple[str, ...]:
    """The names of the motions in a file, for ``clip`` of :func:`read_motion`.

    They are unique; empty if the format holds one motion per file, or the file holds none. format: see
    :func:`read_motion`. FormatError for an unknown extension, or for a damaged file of a format with clips.
    """
    kind = _format(file, format, READABLE, "read")
    return kind.clips()(file) if "clip" in kind.options else ()


def names_motion(text: str) -> bool:
    """Whether a text names a motion file, judging by its extension; with or without a clip."""
    return place_of(split_clip(text, READABLE)[0]).suffix.lower() in READABLE


def read_character(file: File) -> Character:
    """Read a skeleton to put motions onto: from the nodes of glTF, VRM and FBX, otherwise the motion's skeleton.

    The name of a rig in :data:`motet.motion.humanoid.RIGS`, such as "mixamo", gives that rig unless a file of that
    name exists. FormatError like :func:`read_motion`.
    """
    if isinstance(file, str | Path) and not Path(file).suffix and not Path(file).exists():
        return _character(_rig(Path(file)))
    reader = _format(file, None, READABLE, "read").reader
    if reader not in CHARACTER_READERS:
        return Character(read_motion(file))
    with np.errstate(over="ignore", invalid="ignore"):  # Skeleton refuses infinite values
        found: Character = import_module(f"motet.formats.{CHARACTER_READERS[reader]}").read_character(file)
    return found


def write_motion(
    file: File,
    motion: Motion | Mapping[str, Motion],
    *,
    format: str | None = None,
    like: File | Character | Motion | Skeleton | None = None,
    onto: File | Character | None = None,
) -> None:
    """Write a motion in the format of the path's extension, or in ``format``, which a file object requires.

    like: the character whose skeleton takes the motion: its file (.bvh, .glb, .vrm, ...), a motion of it, its
        skeleton, or the name of a rig ("mixamo", "rigify", "unity", "unreal").
    onto: a character's .glb or .vrm; it is written with its mesh and materials and the motion, or several motions by
        clip name, as animations.

    FormatError, MotionError or OutputError if that is impossible; then nothing is written.
    """
    if onto is not None:
        write_onto(file, motion if isinstance(motion, Mapping) else {"motion": motion}, onto, format=format)
    elif isinstance(motion, Mapping):
        raise MotionError("writing several motions into one file requires onto= and a character's .glb or .vrm")
    else:
        check_writable(file, format)
        character = None if like is None else _character(like)
        write_on(file, motion if character is None else put_onto(motion, character), character, format=format)


def write_on(file: File, motion: Motion, character: Character | None, *, format: str | None = None) -> None:
    """Write a motion like :func:`write_motion`; if a character is given, the motion is already on its skeleton."""
    check_writable(file, format)
    kind = _format(file, format, WRITABLE, "write")
    with np.errstate(over="ignore", invalid="ignore"):  # writers refuse values that are too large
        if character and character.nodes and kind.writer == "glb":
            from motet.formats import gltf_onto

            gltf_onto.write_clip(file, _metres(motion), character.nodes)
        else:
            kind.write()(file, motion)


def write_onto(file: File, motions: Mapping[str, Motion], onto: File | Character, *, format: str | None = None) -> None:
    """Write a character with named motions, like :func:`write_motion`."""
    check_writable(file, format, ONTO)
    if not isinstance(onto, Character):
        _format(onto, None, ONTO, "write onto")
    character = onto if isinstance(onto, Character) else read_character(onto)
    write_all_on(file, {name: put_onto(motion, character) for name, motion in motions.items()}, character)


def write_all_on(file: File, motions: Mapping[str, Motion], character: Character) -> None:
    """Write a character with motions that are on its skeleton already."""
    if character.nodes is None:
        raise MotionError(f"the character has no mesh to write: expected a file of it, one of {' '.join(ONTO)}")
    from motet.formats import gltf_onto

    with np.errstate(over="ignore", invalid="ignore"):
        gltf_onto.write_onto(file, {name: _metres(motion) for name, motion in motions.items()}, character.nodes)


def _metres(motion: Motion) -> Motion:
    return motion if motion.skeleton is None or motion.skeleton.metres_per_unit == 1 else motion.scaled(1.0)


def check_writable(file: File, format: str | None = None, allowed: tuple[str, ...] = WRITABLE) -> None:
    """Refuse an unwritable path or a disallowed extension before long work starts."""
    kind = _format(file, format, allowed, "write")
    if kind.needs and find_spec(kind.needs) is None:
        reason = (
            f"{kind.extension} files need the package {kind.needs}: install the extra with  pip install 'motet[plot]'"
        )
        raise OutputError(f"cannot write {place_of(file)}: {reason}")
    if isinstance(file, str | Path):
        check_place(file)


def _format(file: File, format: str | None, allowed: tuple[str, ...], verb: str) -> Format:
    extension = place_of(file).suffix.lower() if format is None else f".{format.lower().removeprefix('.')}"
    if extension in allowed:
        return next(kind for kind in FORMATS if kind.extension == extension)
    what = f"files of type {extension!r}" if extension else "a file without an extension"
    why = NO_MOTIONS.get(extension, "")
    raise FormatError(place_of(file), f"cannot {verb} {what}{why}; expected one of {' '.join(allowed)}")


def _character(like: File | Character | Motion | Skeleton) -> Character:
    if isinstance(like, Skeleton):
        return Character(Motion(np.zeros((1, 0)), (), (), 1.0, like))
    if isinstance(like, Motion):
        return Character(like)
    return like if isinstance(like, Character) else read_character(like)


def _rig(name: Path) -> Skeleton:
    try:
        return rig(str(name))
    except MotionError as error:
        raise FormatError(name, f"no such file, and {error}") from error


def _in_unit(path: Path, motion: Motion, unit: float, loose: bool) -> Motion:
    """The motion with the length unit that its file leaves out or, if ``loose``, states only by convention."""
    if motion.skeleton is None:
        raise FormatError(path, "a file without a skeleton has no length unit")
    said, height = motion.skeleton.metres_per_unit, motion.skeleton.height
    if said is None or (loose and (_human(height * unit) or not _human(height * said))):
        return motion.with_unit(unit)
    if not math.isclose(said, unit, rel_tol=1e-6):
        log.info("%s: the file states a length unit of %.6g m, so the given %.6g m is ignored", path, said, unit)
    return motion


def _human(height: float) -> bool:
    return HUMAN_HEIGHT[0] <= height <= HUMAN_HEIGHT[1]
