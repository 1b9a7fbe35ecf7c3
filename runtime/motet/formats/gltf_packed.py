"""Parts of glTF buffers packed by meshoptimizer: EXT_meshopt_compression or KHR_meshopt_compression."""

from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from motet.errors import FormatError

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

MAX_UNPACKED = 2**25
"""Total bytes of all unpacked parts: 12 minutes of a figure of 90 joints with 60 keys per second."""


def packing(view: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The extension that describes how a buffer view is packed; None if it is not."""
    found = view.get("extensions", {})
    return next((found[name] for name in MESHOPT if name in found), None)


def unpacked(path: Path, packed: Mapping[str, Any], buffers: tuple[bytes, ...], room: int) -> bytes:
    """The bytes of a packed view, at most ``room``; FormatError if it is damaged, or the extra is not installed."""
    if find_spec("meshopt") is None:
        raise FormatError(
            path,
            "its animations are packed by meshoptimizer: install the extra with  pip install 'motet[meshopt]', or "
            "unpack the file with  npx gltfpack -i IN.glb -o OUT.glb -noq -kn -ac",
        )
    start, length = packed.get("byteOffset", 0), packed["byteLength"]
    count, stride = packed["count"], packed["byteStride"]
    content = buffers[packed["buffer"]][start : start + length]
    if not 0 <= start <= start + length or len(content) < length:
        raise FormatError(path, "a packed part extends beyond its buffer: the file is truncated")
    # bytes that one packed byte can expand to: a block of 256 equal bytes takes two bits
    if not (count > 0 and stride > 0 and count * stride <= min(room, 1024 * length)):
        raise FormatError(path, f"a packed part of {length} bytes cannot hold {count} elements of {stride} bytes")
    decode = import_module("meshopt").decode_gltf_buffer
    try:
        found: bytes = decode(content, count, stride, packed["mode"], packed.get("filter")).tobytes()
    except (ValueError, TypeError) as error:
        raise FormatError(path, f"a packed part is broken: {str(error)[:200]}") from error
    return found
