"""The manifest of a bundle or of a training run, read once and with types (docs/reference/bundle.md)."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from motet.bundle.fields import Fields, Json, parse
from motet.bundle.graph import GraphSpec
from motet.bundle.members import MAX_SIZE, NAME
from motet.errors import BundleError, MotionError
from motet.motion.motion import UNITS
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet.representation.contract import REPRESENTATIONS, MotionContract

FORMAT = 3
"""Version of the bundle format that this motet writes and reads."""

MANIFEST = "manifest.json"

TABLE_DTYPES = ("float16", "float32", "int8", "uint8", "int16", "uint16", "int32", "int64")
"""Of the numbers of a table."""

MAX_CHANNELS = 10_000
"""Of a model, and its joints."""


class FileEntry(NamedTuple):
    """A file of the bundle: its size in bytes and its sha256, in hexadecimal digits."""

    size: int
    sha256: str


class GraphEntry(NamedTuple):
    """The graph of a role, and its contract. files: "file" and, if it shares some with other graphs, "weights"."""

    files: Mapping[str, str]
    spec: GraphSpec


class TableEntry(NamedTuple):
    """A plain array: the .npy file that it is in, its dtype and its shape."""

    file: str
    dtype: str
    shape: tuple[int, ...]


class Control(NamedTuple):
    """What a model of control is told: its labels, and for each the frames (K, D) that a run starts from."""

    labels: tuple[str, ...]
    starts: Mapping[str, Array]


class Golden(NamedTuple):
    """The golden vectors: their file, the largest error that is taken for rounding, and the settings of the run."""

    file: str
    tolerance: float
    run: Json


@dataclass(frozen=True, eq=False)
class Manifest:
    """All that is known about a model.

    A training run has no graphs, tables, files and golden vectors; text, vocabulary and control are of verbs that need
    them. settings: of each feature the values that are not its code's. source: the JSON object that the rest was read
    from.
    """

    name: str
    verb: str
    model: str
    loop: str
    version: str
    motion: MotionContract
    defaults: Json
    settings: Mapping[str, Json]
    text: Json | None
    vocabulary: tuple[str, ...]
    common: Mapping[str, str]
    control: Control | None
    config: Json
    licence: Json
    training: Json
    quality: Json
    parity: Json
    graphs: Mapping[str, GraphEntry]
    tables: Mapping[str, TableEntry]
    files: Mapping[str, FileEntry]
    golden: Golden | None
    source: Json

    @cached_property
    def identity(self) -> str:
        """A unique identity of the model: its name, its version and a hash of its manifest."""
        text = json.dumps(self.source, sort_keys=True).encode()
        return f"{self.name} {self.version} {hashlib.sha256(text).hexdigest()[:16]}"

    @staticmethod
    def from_json(data: object) -> "Manifest":
        """Read the manifest of a bundle or of a training run; BundleError names the key that is wrong."""
        top = Fields(data)
        motion = read_contract(top.fields("motion"))
        golden = _golden(top.fields("golden")) if "golden" in top else None
        texts: dict[str, Any] = {key: top.text(key) for key in ("name", "verb", "model", "loop")}
        return Manifest(
            **texts,
            **_records(top),
            version=top.text("version") if "version" in top else "",
            motion=motion,
            defaults=top.fields("defaults").data,
            settings={feature: values.data for feature, values in top.entries("settings")},
            text=top.mapping("text") if "text" in top else None,
            vocabulary=top.texts("vocabulary") if "vocabulary" in top else (),
            common=_common(top.fields("common")) if "common" in top else {},
            control=_control(top.fields("control"), len(motion.channels)) if "control" in top else None,
            **_entries(top),
            golden=golden,
            source=top.data,
        )

    @staticmethod
    def of_bundle(text: bytes) -> "Manifest":
        """Read the ``manifest.json`` of a bundle; BundleError for another format, and where it contradicts itself."""
        # the format first, since all else depends on it
        data = parse(text)
        version = data.get("format") if isinstance(data, dict) else None
        if version in (1, 2) and not isinstance(version, bool):
            raise BundleError(
                f"it has format {version}, of an older motet: export its training run again (motet export RUN), or use "
                "the older one"
            )
        if version != FORMAT:
            raise BundleError(f"it has the format {version!r}; this motet reads format {FORMAT}")
        # a training run has no graphs and golden vectors, a bundle must
        manifest = Manifest.from_json(data)
        if manifest.golden is None or not (manifest.graphs or manifest.tables):
            raise BundleError("manifest: it needs graphs or tables, and golden vectors")
        # every file that the manifest names must be in its list, which has the sizes and hashes
        named = {f"tables.{name}.file": table.file for name, table in manifest.tables.items()}
        named["golden.file"] = manifest.golden.file
        for role, graph in manifest.graphs.items():
            named |= {f"graphs.{role}.{key}": file for key, file in graph.files.items()}
        for key, file in named.items():
            if file not in manifest.files:
                raise BundleError(f"manifest, {key}: {file!r} is not among its files")
        return manifest


def _records(top: Fields) -> dict[str, Any]:
    """What is told of the model and its training, and not read by this package."""
    return {key: top.mapping(key) for key in ("config", "licence", "training", "quality", "parity")}


def _entries(top: Fields) -> dict[str, Any]:
    """The graphs, tables and files, by role or name."""
    return {
        "graphs": {role: _graph(fields) for role, fields in top.entries("graphs")},
        "tables": {name: _table(fields) for name, fields in top.entries("tables")},
        "files": {name: _file(name, fields) for name, fields in top.entries("files")},
    }


def read_contract(data: Fields) -> MotionContract:
    """The motion contract that :meth:`MotionContract.to_json` wrote; BundleError names the key that is wrong."""
    # the channels, which the rest is measured against
    name = data.one_of("representation", REPRESENTATIONS)
    channels = data.texts("channels")
    if not 1 <= len(channels) <= MAX_CHANNELS:
        raise data.fault(f"1 to {MAX_CHANNELS} names", len(channels), "channels")
    if lacking := [channel for channel in REPRESENTATIONS[name].required if channel not in channels]:
        raise BundleError(f"manifest, {data.at('channels')}: {name} needs {', '.join(lacking)}")
    units = _units(data, len(channels))
    # the scale of their numbers, and the figure
    fps = data.number("fps", 1, 1000)
    mean = data.numbers("mean", len(channels))
    std = data.numbers("std", len(channels), low=0.0)
    skeleton = _skeleton(data.fields("skeleton"), channels) if "skeleton" in data else None
    return MotionContract(name, channels, units, fps, mean, std, skeleton)


def _units(data: Fields, channels: int) -> tuple[str, ...]:
    units = data.items("units")
    if len(units) != channels or any(unit not in UNITS for unit in units):
        raise data.fault(f"one of {', '.join(UNITS)} for each of {channels} channels", units, "units")
    return tuple(units)


def _skeleton(data: Fields, channels: tuple[str, ...]) -> Skeleton:
    if "metres_per_unit" in data:
        data.number("metres_per_unit", 1e-6, 1e6)
    joints = data.list_of_fields("joints")
    if len(joints) > MAX_CHANNELS:
        raise data.fault(f"at most {MAX_CHANNELS} joints", len(joints), "joints")
    for joint in joints:
        joint.whole("parent", -1, len(joints))
        joint.numbers("offset", 3)
        joint.numbers("axis", 3)
        joint.text("order")
    # the root is a joint by this name in every representation
    known = {joint.text("name") for joint in joints} | {"root"}
    unknown = [name for name in channels if name.rpartition(".")[0] not in known]
    if unknown:
        raise data.fault("a skeleton with the joints of all channels", f"one without {unknown[0]}", "joints")
    try:
        return Skeleton.from_json(data.data)
    except MotionError as error:
        raise BundleError(f"manifest, {data.path}: {error}") from error


def _golden(data: Fields) -> Golden:
    tolerance = data.number("tolerance", 0.0, 1.0)
    return Golden(data.text("file"), tolerance, data.mapping("run"))


def _control(data: Fields, channels: int) -> Control:
    labels = data.texts("labels")
    starts = data.fields("starts")
    # each label has frames to start from
    if not labels or set(starts.data) != set(labels):
        raise data.fault(f"frames for each of {', '.join(labels)}", list(starts.data), "starts")
    return Control(labels, {label: starts.table(label, channels) for label in labels})


def _common(data: Fields) -> dict[str, str]:
    return {word: data.text(word) for word in data.data}


def _graph(data: Fields) -> GraphEntry:
    files = {"file": data.text("file")}
    if "weights" in data:
        files["weights"] = data.text("weights")
    return GraphEntry(files, GraphSpec.read(data))


def _table(data: Fields) -> TableEntry:
    return TableEntry(data.text("file"), data.one_of("dtype", TABLE_DTYPES), data.wholes("shape", 1, MAX_SIZE))


def _file(name: str, data: Fields) -> FileEntry:
    if not NAME.fullmatch(name):
        raise BundleError(f"manifest, files: {name[:80]!r} is not a plain file name")
    return FileEntry(data.whole("size", 0, MAX_SIZE), data.text("sha256"))
