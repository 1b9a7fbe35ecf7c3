"""Files of motion: one record per format, chosen by the extension.

A format's module has ``read(file, **options) -> Motion``, ``write(file, motion)`` or both, where a file is a path or a
binary file object; both raise motet's errors and leave nothing half-written. What parses the content of a file raises
:class:`~motet.formats.text.ContentError`, to which ``read``, marked as ``names_file``, adds the file's name. If its
files hold several motions or skeletons, it also has ``contents(file)``, which returns their names, and ``read`` takes
"clip", "figure" or both. To add a format, write its module and add its record to :data:`FORMATS`, which help texts, the
table of docs/reference/formats.md and the lists of corpora are built from.
"""

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

import numpy as np

from motet.errors import FormatError, MotionError, OutputError
from motet.figures.humanoid import JointMap, from_humanoid, grounded, on_humanoid, rig
from motet.figures.root_motion import in_place, travel_on_root
from motet.files import File, check_place, place_of
from motet.formats.text import Clip, Contents, Figure, naming, split_clip
from motet.motion.motion import Motion, motions_of, rest_motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Names, Skeleton, metres

if TYPE_CHECKING:
    from motet.formats.gltf_character import Nodes

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Format:
    """One format of motion files.

    keeps: which parts of a motion a file holds, for the docs.
    reader: the module of motet with its ``read``, imported on first use; empty if it is not read.
    writer: the function of motet that writes it, imported on first use; empty if it is not written.
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
    options: Names = ()
    mocap: bool = False
    loose: bool = False
    needs: str = ""

    def module(self) -> Any:
        """The module that reads it."""
        return import_module(f"motet.{self.reader}")

    def write(self) -> Callable[[File, Motion], None]:
        """The function that writes it."""
        function: Callable[[File, Motion], None] = resolve_name(f"motet.{self.writer}")
        return function


_NODES = ("clip", "figure", "rest")

FORMATS = (
    Format(
        ".amc",
        "Acclaim, with its .asf",
        "everything; AMC need not state its frame rate: 120 unless the file or `fps=` gives another",
        "formats.amc",
        "formats.amc.write",
        ("asf", "fps", "partial"),
        mocap=True,
    ),
    Format(
        ".bvh",
        "Biovision",
        "everything but the unit of length",
        "formats.bvh",
        "formats.bvh.write",
        ("figure", "partial"),
        mocap=True,
    ),
    Format(
        ".npz",
        "motet's own; SMPL",
        "everything, bit for bit; from AMASS and mocap of videos (SMPL), the body joints",
        "formats.npz",
        "formats.npz.write",
        ("fps",),
        mocap=True,
    ),
    Format(".csv", "table", "values, units and frame rate, no skeleton", "formats.csv", "formats.csv.write"),
    Format(".xml", "MMM of KIT", "angles and root; the skeleton is not in the file", "formats.mmm"),
    Format(
        ".glb",
        "glTF 2.0",
        "a skeleton and its animations, each a clip; written with a body, for viewers and engines",
        "formats.gltf",
        "formats.glb.write",
        _NODES,
        mocap=True,
        loose=True,
    ),
    Format(
        ".gltf",
        "glTF 2.0, as text",
        "a skeleton and its animations, each a clip, or its rest pose",
        "formats.gltf",
        options=_NODES,
        loose=True,
    ),
    Format(
        ".vrm",
        "VRM avatar",
        "a skeleton and its animations, each a clip, or its rest pose; written by `--onto`, the "
        "avatar itself ([humanoid.md](../humanoid.md#characters))",
        "formats.gltf",
        options=_NODES,
        loose=True,
    ),
    Format(
        ".vrma",
        "VRM Animation",
        "the humanoid: motions of other human figures are retargeted ([humanoid.md](../humanoid.md))",
        "formats.gltf",
        "formats.glb.write_vrma",
        _NODES,
        mocap=True,
        loose=True,
    ),
    Format(
        ".fbx",
        "FBX",
        "a skeleton and its takes, each a clip; needs ufbx: `pip install 'motet[fbx]'`",
        "formats.fbx",
        options=_NODES,
        mocap=True,
        loose=True,
    ),
    Format(".html", "web page", "a page with a player: orbit, play, scrub, no network", writer="draw.page.write"),
    Format(
        ".gif",
        "picture",
        "an animated picture; needs Pillow: `pip install 'motet[plot]'`",
        writer="draw.gif.write",
        needs="PIL",
    ),
)

READABLE = tuple(kind.extension for kind in FORMATS if kind.reader)
WRITABLE = tuple(kind.extension for kind in FORMATS if kind.writer)
MOCAP = tuple(kind.extension for kind in FORMATS if kind.mocap)
CLIPPED = tuple(kind.extension for kind in FORMATS if "clip" in kind.options)
OF_FOLDERS = tuple(dict.fromkeys((*MOCAP, *CLIPPED)))
"""The extensions of what is taken of a folder or zip."""
FIGURED = tuple(kind.extension for kind in FORMATS if "figure" in kind.options)
READS = ", ".join(f"{kind.extension} ({kind.name})" for kind in FORMATS if kind.reader)
WRITES = ", ".join(f"{kind.extension} ({kind.name})" for kind in FORMATS if kind.writer)
"""The formats as help texts list them."""

ONTO = (".glb", ".vrm")
"""Extensions for a character written with its mesh and new animations."""

BODIES = (".glb", ".gltf", ".vrm")
"""Extensions of the files that such a character can come from."""


@dataclass(frozen=True)
class Character:
    """A character's skeleton from its file, to put motions onto.

    rest: a motion of it; for a glTF file one frame, the rest pose of its nodes, in metres, with every angle 0.
    joint_map: its bones if the file names them, as VRM does, else None.
    nodes: for a glTF file, the nodes of the joints, used to write a motion for exactly these nodes.
    skin: joint -> points (P, 3) of the mesh attached to it, relative to the joint, at rest; empty without a mesh.
    """

    rest: Motion
    joint_map: JointMap | None = None
    nodes: "Nodes | None" = None
    skin: Mapping[int, Array] = field(default_factory=dict)


def read_motion(  # noqa: PLR0913  options, each of which has a default
    file: File,
    *,
    fps: float | None = None,
    asf: str | Path | None = None,
    unit: str | float | None = None,
    partial: bool = False,
    clip: Clip = None,
    figure: Figure = None,
    rest: File | None = None,
    format: str | None = None,
) -> Motion:
    """Read a motion file or a binary file object; "file.glb#Walk" is the clip Walk of file.glb, or the figure
    Walk where no clip has this name.

    fps: the frame rate of a file that states none, such as AMC's and some of SMPL's.
    asf: the skeleton of an AMC file; by default it is looked for beside it.
    unit: the length unit if the file states none: "m", "cm", "mm", "inch" or a number of metres. For glTF, whose metre
        is only a convention, it applies unless the figure is human-sized in metres and not in that unit.
    partial: read the complete frames of a truncated AMC or BVH file instead of refusing it.
    clip: a motion of a file with several: a name from :func:`clips` or a number from 1; default: the first.
    figure: a skeleton of a file with several: a name from :func:`figures_in` or a number from 1; default: the one that
        moves the most, in BVH the first. Without a clip, the first clip that moves it is read.
    rest: a glTF file with the same joints in a T-pose, for glTF and FBX files whose rest pose is their first frame;
        "file.glb#TPose" means the first frame of that clip. For FBX, an FBX file works too.
    format: the extension, such as "bvh", if it differs from the path's; required for a file object.

    FormatError for an unknown extension, a missing file, one that is not a motion, and an option that the format does
    not take or the file contradicts.
    """
    # a clip or figure in the path counts unless one is given by name
    file, named_clip, named_figure = split_part(file, format)
    kind = _format(file, format, READABLE, "read")
    path = place_of(file)
    settings = {
        "fps": fps,
        "asf": asf,
        "partial": partial or None,
        "clip": named_clip if clip is None else clip,
        "figure": named_figure if figure is None else figure,
        "rest": rest,
    }
    options = _options_for(path, kind, settings)
    with naming(file):
        with np.errstate(over="ignore", invalid="ignore"):  # Motion refuses infinite values
            motion: Motion = kind.module().read(file, **options)
        log.debug("read %s: %r", path, motion)
        return motion if unit is None else _in_unit(path, motion, unit, kind.loose)


def _options_for(path: Path, kind: Format, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings that are not None; FormatError for one that the format does not take."""
    options = {name: value for name, value in settings.items() if value is not None}
    for name in options.keys() - set(kind.options):
        takers = " ".join(known.extension for known in FORMATS if name in known.options)
        raise FormatError(path, f"{name!r} is an option for {takers} files only")
    return options


def split_part(file: File, format: str | None = None) -> tuple[File, str | None, str | None]:
    """A file without the part named after its mark, and this part as a clip or, in a format without clips but with
    figures, as a figure."""
    file, named = split_clip(file, READABLE)
    if named is None:
        return file, None, None
    extension = _extension(file, format)
    has_only_figures = extension in FIGURED and extension not in CLIPPED
    return (file, None, named) if has_only_figures else (file, named, None)


def _in_unit(path: Path, motion: Motion, unit_name: str | float, loose: bool) -> Motion:
    """The motion with the length unit that its file leaves out or, if ``loose``, states only by convention."""
    unit = metres(unit_name)
    if motion.skeleton is None:
        raise FormatError(path, "a file without a skeleton has no length unit")
    # the file's own unit, where it states one, decides
    stated_unit = motion.skeleton.metres_per_unit
    height = motion.skeleton.height
    if stated_unit is None:
        return motion.with_unit(unit)
    # human figures, sole to crown or hand to hand, are .5 to 3 m high
    if loose and (0.5 <= height * unit <= 3.0 or not 0.5 <= height * stated_unit <= 3.0):
        return motion.with_unit(unit)
    if not math.isclose(stated_unit, unit, rel_tol=1e-6):
        message = "%s: the file states a length unit of %.6g m, so the given %.6g m is ignored"
        log.info(message, path, stated_unit, unit)
    return motion


def clips(file: File, *, format: str | None = None) -> Names:
    """The names of the motions in a file, for ``clip`` of :func:`read_motion`.

    They are unique; empty if the format holds one motion per file, or the file holds none. format: see
    :func:`read_motion`. FormatError for an unknown extension, or for a damaged file of a format with clips.
    """
    return contents_of(file, format=format).clips


def figures_in(file: File, *, format: str | None = None) -> Names:
    """The names of the skeletons in a file, for ``figure`` of :func:`read_motion`.

    They are unique; empty if the format holds one skeleton per file, or none. Errors like :func:`clips`.
    """
    return tuple(contents_of(file, format=format).figures)


def contents_of(file: File, *, format: str | None = None) -> Contents:
    """The names of the motions and skeletons in a file; errors like :func:`clips`."""
    kind = _format(file, format, READABLE, "read")
    if not {"clip", "figure"} & {*kind.options}:
        return Contents((), {})
    contents: Contents = kind.module().contents(file)
    return contents


def names_motion(text: str) -> bool:
    """Whether a text names a motion file, judging by its extension; with or without a clip."""
    return place_of(split_clip(text, READABLE)[0]).suffix.lower() in READABLE


def read_character(file: File) -> Character:
    """Read a skeleton to put motions onto: from the nodes of glTF, VRM and FBX, otherwise the motion's skeleton.

    The name of a rig in :data:`motet.figures.humanoid.RIGS`, such as "mixamo", gives that rig unless a file of that
    name exists. FormatError like :func:`read_motion`.
    """
    # a word without an extension is a rig of motet's own
    if isinstance(file, str | Path) and not Path(file).suffix and not Path(file).exists():
        try:
            return _character(rig(str(file)))
        except MotionError as error:
            raise FormatError(file, f"no such file, and {error}") from error
    kind = _format(file, None, READABLE, "read")
    if "rest" not in kind.options:
        return Character(read_motion(file))
    from motet.formats import fbx, gltf_character

    with np.errstate(over="ignore", invalid="ignore"):  # Skeleton refuses infinite values
        return gltf_character.read_character(fbx.as_gltf(file) if kind.reader == "formats.fbx" else file)


def _character(like: File | Character | Motion | Skeleton) -> Character:
    if isinstance(like, Skeleton):
        like = rest_motion(like)
    if isinstance(like, Motion):
        return Character(like)
    return like if isinstance(like, Character) else read_character(like)


def put_onto(motion: Motion, character: Character) -> Motion:
    """A motion of any human figure on a character's skeleton; unchanged if it already is on that skeleton, up to the
    rounding of its file.

    A character from a glTF file stands on the ground, and z becomes its facing direction at rest. MotionError, with the
    reason, if the motion's figure or the character is not human.
    """
    skeleton = character.rest.skeleton
    if motion.skeleton and skeleton and motion.skeleton.is_like(skeleton, 1e-6):
        return motion
    # over the humanoid, which every human figure is brought to
    humanoid_motion = on_humanoid(motion)
    joint_map = character.joint_map
    has_nodes = character.nodes is not None
    try:
        if has_nodes:
            humanoid_motion = grounded(humanoid_motion)
        put = from_humanoid(humanoid_motion, character.rest, joint_map, skin=character.skin, ahead=has_nodes)
    except MotionError as error:
        raise MotionError(f"the character cannot take a motion: {error}") from error
    return travel_on_root(put, joint_map)


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
    onto: a character's .glb, .gltf or .vrm; it is written with its mesh and materials and the motion, or several
        motions by clip name, as animations.

    FormatError, MotionError or OutputError if that is impossible; then nothing is written. ArgumentError for what is no
    motion, and has none as its ``motion``, as what models generate has.
    """
    motion = {name: _moving(each) for name, each in motion.items()} if isinstance(motion, Mapping) else _moving(motion)
    if onto is None:
        if isinstance(motion, Mapping):
            raise MotionError(
                "writing several motions into one file requires onto= and a character's .glb, .gltf or .vrm"
            )
        check_writable(file, format)
        # the motion itself, or on another figure's skeleton
        character = None if like is None else _character(like)
        return write_on(file, motion if character is None else put_onto(motion, character), character, format=format)
    # or with the character's mesh, as one of its animations
    check_writable(file, format, ONTO)
    if not isinstance(onto, Character):
        _format(onto, None, BODIES, "write onto")
        onto = read_character(onto)
    motions = motion if isinstance(motion, Mapping) else {"motion": motion}
    return write_all_on(file, {name: put_onto(each, onto) for name, each in motions.items()}, onto)


def _moving(moving: Any) -> Motion:
    """A motion, or that of what a model generated; ArgumentError for what has none."""
    (motion,) = motions_of([moving if isinstance(moving, Motion) else getattr(moving, "motion", moving)])
    return motion


def shaped(motion: Motion, character: Character | None, fps: float | None, is_in_place: bool) -> Motion:
    """A motion as it is to be written: on a character, at another frame rate, in place."""
    motion = put_onto(motion, character) if character else motion
    motion = motion.resample(fps) if fps else motion
    return in_place(motion) if is_in_place else motion


def write_on(file: File, motion: Motion, character: Character | None, *, format: str | None = None) -> None:
    """Write a motion like :func:`write_motion`; if a character is given, the motion is already on its skeleton."""
    kind = check_writable(file, format)
    with np.errstate(over="ignore", invalid="ignore"):  # writers refuse values that are too large
        if character and character.nodes and kind.writer == "formats.glb.write":
            from motet.formats import gltf_character

            gltf_character.write_clip(file, motion, character.nodes)
        else:
            kind.write()(file, motion)


def write_all_on(file: File, motions: Mapping[str, Motion], character: Character) -> None:
    """Write a character with motions that are on its skeleton already."""
    if character.nodes is None:
        raise MotionError(f"the character has no mesh to write: expected a file of it, one of {' '.join(BODIES)}")
    from motet.formats import gltf_character

    with np.errstate(over="ignore", invalid="ignore"):
        gltf_character.write_onto(file, motions, character.nodes)


def check_writable(file: File, format: str | None = None, allowed: Names = WRITABLE) -> Format:
    """The format; an unwritable path or a disallowed extension is refused before long work starts."""
    kind = _format(file, format, allowed, "write")
    if kind.needs and find_spec(kind.needs) is None:
        remedy = f"files need the package {kind.needs}: install the extra with  pip install 'motet[plot]'"
        raise OutputError(f"cannot write {place_of(file)}: {kind.extension} {remedy}")
    if isinstance(file, str | Path):
        check_place(file)
    return kind


def _format(file: File, format: str | None, allowed: Names, verb: str) -> Format:
    extension = _extension(file, format)
    if extension in allowed:
        return next(kind for kind in FORMATS if kind.extension == extension)
    what = f"files of type {extension!r}" if extension else "a file without an extension"
    if extension == ".c3d":
        what += ", which hold markers without a skeleton: first solve for one in the program that recorded them"
    raise FormatError(place_of(file), f"cannot {verb} {what}; expected one of {' '.join(allowed)}")


def _extension(file: File, format: str | None) -> str:
    """The format that the caller names, or else the extension."""
    return place_of(file).suffix.lower() if format is None else f".{format.lower().removeprefix('.')}"
