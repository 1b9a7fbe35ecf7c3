"""Graphs that could reach outside their own bytes are refused before ONNX Runtime sees them.

ONNX Runtime opens the files that a tensor's ``external_data`` names, also where it is given a model as bytes: some
versions only below the working directory, older ones anywhere. So this walks the whole protocol buffer, with every
graph in the attributes of If, Loop and Scan, and refuses data outside of the file, operators that ONNX does not define,
functions, and all fields of ONNX's messages that it does not know. Loop is refused, too, since nothing bounds how often
it goes round; Scan takes as many steps as the tensor that it walks has.
"""

from collections.abc import Iterator
from typing import NamedTuple

from motet.errors import BundleError

Value = int | memoryview
"""A number, or the bytes of a string or of a message within the message."""

MAX_FIELDS = 100_000
MAX_TEXT = 1 << 20
MAX_DEPTH = 64
"""Fields of a whole graph, bytes of a field that is no tensor's data, and messages within each other."""


class Message(NamedTuple):
    """What may be in a message of ONNX: plain fields by number, and messages that are looked into."""

    plain: frozenset[int]
    nested: dict[int, str]
    name: int = 0
    domain: int = 0


MESSAGES = {
    "model": Message(frozenset({1, 2, 3, 4, 5, 6, 14}), {7: "graph", 8: "opset"}),
    "opset": Message(frozenset({1, 2}), {}, domain=1),
    "graph": Message(frozenset({2, 10, 11, 12, 13, 14, 16}), {1: "node", 5: "tensor", 15: "sparse"}, name=2),
    "node": Message(frozenset({1, 2, 3, 4, 6, 7, 8, 9}), {5: "attribute"}, name=3, domain=7),
    "attribute": Message(
        frozenset({1, 2, 3, 4, 7, 8, 9, 13, 14, 15, 20}),
        {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
        name=1,
    ),
    "sparse": Message(frozenset({3}), {1: "tensor", 2: "tensor"}),
    "tensor": Message(frozenset({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 16}), {}, name=8),
}
"""The fields of onnx.proto by number. Types of values (fields 11 to 13 of a graph, 14 and 15 of an attribute) and
annotations hold neither tensors nor nodes."""

DATA = frozenset({4, 5, 6, 7, 9, 10, 11})
"""The fields of a tensor that hold its numbers."""


def check_graph(model: bytes) -> None:
    """BundleError where an ONNX model is damaged or could reach outside its bytes: what was found, and where."""
    if model[4:8] == b"ORTM":
        raise BundleError("the graph is in ONNX Runtime's own format, which cannot be checked")
    waiting = [("model", memoryview(model), "the graph", 0)]
    count = 0
    while waiting:
        # messages wait on a list, not on the stack, which a deep graph would exhaust
        kind, data, outer, depth = waiting.pop()
        if depth > MAX_DEPTH:
            raise BundleError(f"the graph is nested more than {MAX_DEPTH} messages deep")
        inner = []
        for number, value in fields(data):
            count += 1
            if count > MAX_FIELDS:
                raise BundleError(f"the graph has more than {MAX_FIELDS} fields")
            # messages are looked into later; of plain fields each is judged here
            if number in MESSAGES[kind].nested:
                inner.append((MESSAGES[kind].nested[number], _bytes(value)))
            elif fault := _fault(kind, number, value):
                raise BundleError(f"{_place(kind, data, outer)} {fault}")
        if inner:
            place = _place(kind, data, outer)
            waiting += [(message, part, place, depth + 1) for message, part in inner]


def fields(message: memoryview) -> Iterator[tuple[int, Value]]:
    """The fields of a message of protocol buffers as (number, value), in their order, without a schema or copies.

    BundleError where the bytes are not a message. Groups are refused: no writer has used them since 2008, and what they
    hold would be hidden.
    """
    place = 0
    while place < len(message):
        # a tag has the number of the field and how its value is written
        tag, place = _varint(message, place)
        number = tag >> 3
        wire = tag & 7
        if tag >> 32 or not number:
            raise BundleError("the graph is not valid ONNX: a field has an invalid number")
        if wire not in (0, 1, 2, 5):
            raise BundleError(f"the graph is not valid ONNX: a field has the wire type {wire}")
        if wire in (0, 2):  # a number, and bytes after their count; else 8 or 4 bytes
            size, place = _varint(message, place)
        else:
            size = 8 if wire == 1 else 4
        if wire == 0:
            yield number, size
            continue
        if size > len(message) - place:
            raise BundleError("the graph is not valid ONNX: it is truncated")
        yield number, message[place : place + size]
        place += size


def _varint(message: memoryview, place: int) -> tuple[int, int]:
    """The number at ``place``, seven bits a byte, and where it ends."""
    value = 0
    for shift, byte in enumerate(message[place : place + 10]):
        value |= (byte & 127) << 7 * shift
        if byte < 128:
            return value, place + shift + 1
    raise BundleError("the graph is not valid ONNX: a number is unterminated")


def _fault(kind: str, number: int, value: Value) -> str | None:
    """What is wrong with a field that holds no message to look into."""
    place = (kind, number)
    fault = None
    is_data = kind == "tensor" and number in DATA
    if place == ("tensor", 13) or (place == ("tensor", 14) and value != 0):
        fault = "has its data in another file"
    elif kind == "model" and number in (20, 25):
        fault = "holds training information" if number == 20 else "holds functions"
    elif number not in MESSAGES[kind].plain and place != ("tensor", 14):
        fault = f"has the unknown field {number}"
    elif not is_data and not isinstance(value, int) and len(value) > MAX_TEXT:
        fault = f"has a text of {len(value)} bytes; at most {MAX_TEXT} are read"
    elif place == ("node", 4) and _text(value) == "Loop":
        fault = "may never end; unroll it, or use Scan"
    # quantised graphs need no other domain than ONNX's own (MatMulInteger, DynamicQuantizeLinear)
    elif number == MESSAGES[kind].domain and (domain := _text(value)) not in ("", "ai.onnx"):
        fault = f"needs operators of the domain {domain[:60]!r}; only ONNX's own are allowed"
    return fault


def _place(kind: str, data: memoryview, outer: str) -> str:
    """What a message is called: its name, after that of the message around it."""
    number = MESSAGES[kind].name
    if not number or (kind == "graph" and outer == "the graph"):
        return outer
    names = [_text(value) for at, value in fields(data) if at == number]
    return f"{outer}, {kind} {names[-1][:60]!r}" if names else f"{outer}, a {kind} without a name"


def _text(value: Value) -> str:
    try:
        return str(_bytes(value), "utf-8")
    except UnicodeDecodeError as error:
        raise BundleError("the graph is not valid ONNX: a name is not UTF-8") from error


def _bytes(value: Value) -> memoryview:
    if isinstance(value, int):
        raise BundleError("the graph is not valid ONNX: a number where a message belongs")
    return value
