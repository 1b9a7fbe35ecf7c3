"""The wire format of protocol buffers: a message as its fields, without a schema and without copies."""

from collections.abc import Iterator

from motet.errors import BundleError

Value = int | memoryview
"""A number, or the bytes of a string or of a message within the message."""

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_SIZES = {_FIXED64: 8, _FIXED32: 4}


def fields(message: memoryview) -> Iterator[tuple[int, Value]]:
    """The fields of a message as (number, value), in their order; BundleError where the bytes are not a message.

    Groups are refused: no writer has used them since 2008, and what they hold would be hidden.
    """
    place = 0
    while place < len(message):
        tag, place = _varint(message, place)
        number, wire = tag >> 3, tag & 7
        if tag >> 32 or not number:
            raise BundleError("the graph is not valid ONNX: a field has an invalid number")
        if wire == _VARINT:
            value, place = _varint(message, place)
            yield number, value
            continue
        if wire == _BYTES:
            size, place = _varint(message, place)
        elif wire in _SIZES:
            size = _SIZES[wire]
        else:
            raise BundleError(f"the graph is not valid ONNX: a field has the wire type {wire}")
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
