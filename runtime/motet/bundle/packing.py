"""Arrays in JSON: gzipped, column by column, of each column first all first bytes: so they are pressed best."""

import gzip
from base64 import b64decode, b64encode
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def packed(tables: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Arrays of rows as ``tables``, the kind and shape of each, and ``bytes``, base64: ``Packed`` of ``packing.ts``."""
    rows = {name: array.reshape(len(array), -1) for name, array in tables.items()}
    return {
        "tables": {name: {"kind": array.dtype.str[1:], "shape": array.shape} for name, array in rows.items()},
        "bytes": b64encode(gzip.compress(b"".join(map(_shuffled, rows.values())), mtime=0)).decode(),
    }


def unpacked(document: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """The arrays (rows, width) of what :func:`packed` made."""
    data = gzip.decompress(b64decode(document["bytes"]))
    arrays = {}
    start = 0
    for name, table in document["tables"].items():
        kind = np.dtype(f"<{table['kind']}")
        rows, width = table["shape"]
        stop = start + rows * width * kind.itemsize
        split = np.frombuffer(data[start:stop], np.uint8).reshape(width, kind.itemsize, rows)
        columns = np.ascontiguousarray(np.swapaxes(split, 1, 2)).view(kind).reshape(width, rows)
        arrays[name] = np.ascontiguousarray(columns.T)
        start = stop
    return arrays


def _shuffled(values: NDArray[Any]) -> bytes:
    """The bytes of an array, column by column, of each column first all first bytes: so they are pressed best."""
    columns = np.ascontiguousarray(values.T)
    split = columns.view(np.uint8).reshape(*columns.shape, -1)
    return np.ascontiguousarray(np.swapaxes(split, 1, 2)).tobytes()
