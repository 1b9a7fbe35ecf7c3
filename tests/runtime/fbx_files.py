"""Small FBX files as tests make them, ASCII and binary, and their joints by plain matrices."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from motet.motion.rotations import Array

SECOND = 46186158000
"""FBX's units of time."""

ORDERS = ("xyz", "xzy", "yzx", "yxz", "zxy", "zyx")
"""Which axis turns first, in the order of FBX's numbers."""


@dataclass(frozen=True)
class Bone:
    """A node: where it is in its parent, how it turns, and which object it is ("LimbNode", "Null", "Mesh", ...)."""

    name: str
    parent: int
    place: tuple[float, float, float]
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    order: int = 0
    kind: str = "LimbNode"


@dataclass(frozen=True)
class Curves:
    """A take: for bones and "T" or "R" the values (K, 3) at the times (K) in seconds; its keys' span or another."""

    name: str
    times: Sequence[float]
    values: Mapping[tuple[int, str], Array]
    span: tuple[float, float] | None = None


@dataclass(frozen=True)
class Record:
    """What FBX files are made of."""

    name: str
    values: tuple[Any, ...] = ()
    inside: tuple["Record", ...] = field(default=())


def document(
    bones: Sequence[Bone],
    takes: Sequence[Curves] = (),
    settings: Mapping[str, float] | None = None,
    bound: Mapping[int, Array] | None = None,
) -> tuple[Record, ...]:
    """The records of a file. bound: for bones of a skin the matrices (4, 4) that they are bound by."""
    objects, links = [_model(i, bone) for i, bone in enumerate(bones)], []
    for i, bone in enumerate(bones):
        objects.append(Record("NodeAttribute", (500 + i, "NodeAttribute::", bone.kind)))
        links += [(i + 1, bone.parent + 1, ""), (500 + i, i + 1, "")]
    for number, take in enumerate(takes, start=1):
        made, joined = _take(1000 * number, take)
        objects += made
        links += joined
    if bound is not None:
        made, joined = _skin(bound)
        objects += made
        links += joined
    said = tuple(
        _property(name, "double" if name == "UnitScaleFactor" else "int", value)
        for name, value in (settings or {}).items()
    )
    return (
        Record("FBXHeaderExtension", (), (Record("FBXVersion", (7400,)),)),
        Record("GlobalSettings", (), (Record("Properties70", (), said),)),
        Record("Objects", (), tuple(objects)),
        Record(
            "Connections",
            (),
            tuple(Record("C", ("OP" if name else "OO", a, b, *([name] if name else []))) for a, b, name in links),
        ),
    )


def _property(name: str, kind: str, *values: Any) -> Record:
    return Record("P", (name, kind, "", "", *values))


def _model(index: int, bone: Bone) -> Record:
    properties = (
        _property("RotationOrder", "enum", bone.order),
        _property("RotationActive", "bool", 1),
        _property("PreRotation", "Vector3D", *bone.pre),
        _property("Lcl Translation", "Lcl Translation", *bone.place),
        _property("Lcl Rotation", "Lcl Rotation", *bone.turn),
    )
    return Record("Model", (index + 1, f"Model::{bone.name}", bone.kind), (Record("Properties70", (), properties),))


def _take(first: int, take: Curves) -> tuple[list[Record], list[tuple[int, int, str]]]:
    start, stop = take.span or (take.times[0], take.times[-1])
    spans = tuple(
        _property(name, "KTime", round(at * SECOND)) for name, at in (("LocalStart", start), ("LocalStop", stop))
    )
    objects = [
        Record("AnimationStack", (first, f"AnimStack::{take.name}", ""), (Record("Properties70", (), spans),)),
        Record("AnimationLayer", (first + 1, "AnimLayer::Base", "")),
    ]
    links = [(first + 1, first, "")]
    for number, ((bone, what), values) in enumerate(take.values.items(), start=1):
        node = first + 10 * number
        objects.append(Record("AnimationCurveNode", (node, f"AnimCurveNode::{what}", "")))
        links += [(node, first + 1, ""), (node, bone + 1, {"T": "Lcl Translation", "R": "Lcl Rotation"}[what])]
        for axis, column in enumerate(np.asarray(values, np.float64).T, start=1):
            objects.append(_curve(node + axis, take.times, column))
            links.append((node + axis, node, f"d|{'XYZ'[axis - 1]}"))
    return objects, links


def _curve(number: int, times: Sequence[float], values: Array) -> Record:
    linear = 0x4
    inside = (
        Record("KeyVer", (4008,)),
        Record("KeyTime", (np.array([round(time * SECOND) for time in times], np.int64),)),
        Record("KeyValueFloat", (values.astype(np.float32),)),
        Record("KeyAttrFlags", (np.array([linear], np.int32),)),
        Record("KeyAttrDataFloat", (np.zeros(4, np.float32),)),
        Record("KeyAttrRefCount", (np.array([len(times)], np.int32),)),
    )
    return Record("AnimationCurve", (number, "AnimCurve::", ""), inside)


def _skin(bound: Mapping[int, Array]) -> tuple[list[Record], list[tuple[int, int, str]]]:
    mesh = Record("Vertices", (np.zeros(3),)), Record("PolygonVertexIndex", (np.array([0, 0, -1], np.int32),))
    objects = [
        Record("Model", (900, "Model::Body", "Mesh")),
        Record("Geometry", (901, "Geometry::", "Mesh"), mesh),
        Record("Deformer", (902, "Deformer::", "Skin")),
    ]
    links = [(900, 0, ""), (901, 900, ""), (902, 901, "")]
    for bone, matrix in bound.items():
        parts = {"Indexes": np.array([0], np.int32), "Weights": np.ones(1), "Transform": np.linalg.inv(matrix)}
        inside = [Record(name, (value.T.ravel(),)) for name, value in (parts | {"TransformLink": matrix}).items()]
        objects.append(Record("Deformer", (910 + bone, "SubDeformer::", "Cluster"), tuple(inside)))
        links += [(910 + bone, 902, ""), (bone + 1, 910 + bone, "")]
    return objects, links


def ascii_fbx(records: Sequence[Record]) -> bytes:
    return ("; FBX 7.4.0 project file\n" + "".join(_line(record, 0) for record in records)).encode()


def _line(record: Record, depth: int) -> str:
    tab = "\t" * depth
    if record.values and isinstance(record.values[0], np.ndarray):
        (array,) = record.values
        return f"{tab}{record.name}: *{len(array)} {{\n{tab}\ta: {','.join(str(x) for x in array.tolist())}\n{tab}}}\n"
    words = ", ".join(f'"{value}"' if isinstance(value, str) else str(value) for value in record.values)
    block = f" {{\n{''.join(_line(one, depth + 1) for one in record.inside)}{tab}}}" if record.inside else ""
    return f"{tab}{record.name}: {words}{block}\n"


def binary_fbx(records: Sequence[Record]) -> bytes:
    content = b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400)
    for record in records:
        content += _bytes(record, len(content))
    return content + bytes(13) + bytes(160)


def _bytes(record: Record, start: int) -> bytes:
    values = b"".join(_value(value) for value in record.values)
    head = struct.pack("<IIB", len(record.values), len(values), len(record.name)) + record.name.encode()
    content = head + values
    for one in record.inside:
        content += _bytes(one, start + 4 + len(content))
    content += bytes(13) if record.inside else b""
    return struct.pack("<I", start + 4 + len(content)) + content


def _value(value: Any) -> bytes:
    if isinstance(value, np.ndarray):
        kind = {"f8": b"d", "f4": b"f", "i8": b"l", "i4": b"i"}[value.dtype.str[1:]]
        return kind + struct.pack("<III", len(value), 0, value.nbytes) + value.tobytes()
    if isinstance(value, str):
        kind, mark, name = value.partition("::")
        text = f"{name}\0\x01{kind}".encode() if mark else value.encode()
        return b"S" + struct.pack("<I", len(text)) + text
    return b"L" + struct.pack("<q", value) if isinstance(value, int) else b"D" + struct.pack("<d", value)


def places(bones: Sequence[Bone], take: Curves, times: Sequence[float]) -> Array:
    """Positions (T, B, 3) in the file's own unit and axes: Lcl Translation, PreRotation, Lcl Rotation, node by node."""
    found = np.zeros((len(times), len(bones), 3))
    for t, time in enumerate(times):
        worlds: list[Array] = []
        for i, bone in enumerate(bones):
            place, turn = (_at(take, (i, what), rest, time) for what, rest in (("T", bone.place), ("R", bone.turn)))
            local = np.eye(4)
            local[:3, :3] = turned(bone.pre, 0) @ turned(turn, bone.order)
            local[:3, 3] = place
            worlds.append(worlds[bone.parent] @ local if bone.parent >= 0 else local)
            found[t, i] = worlds[i][:3, 3]
    return found


def _at(take: Curves, key: tuple[int, str], rest: Sequence[float], time: float) -> Array:
    if key not in take.values:
        return np.array(rest, np.float64)
    return np.array([np.interp(time, take.times, column) for column in np.asarray(take.values[key], np.float64).T])


def turned(degrees: Sequence[float], order: int) -> Array:
    """The matrix (3, 3) of three angles about x, y and z, the first of ORDERS' axes nearest to the bone."""
    made: Array = np.eye(3)
    for axis in ORDERS[order]:
        i = "xyz".index(axis)
        j, k, angle = (i + 1) % 3, (i + 2) % 3, np.radians(degrees[i])
        one = np.eye(3)
        one[j, j] = one[k, k] = np.cos(angle)
        one[k, j], one[j, k] = np.sin(angle), -np.sin(angle)
        made = one @ made
    return made
