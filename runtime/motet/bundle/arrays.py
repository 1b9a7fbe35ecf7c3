"""Plain arrays as .npy files: numbers and nothing else, read without unpickling or executing anything."""

import io
import math
import struct
import tokenize
from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.errors import BundleError

_NOT_AN_ARRAY = (
    ValueError,
    SyntaxError,
    TypeError,
    EOFError,
    struct.error,
    tokenize.TokenError,
    RecursionError,
    MemoryError,
)


def array_of(content: bytes, name: str, dtypes: Collection[str]) -> NDArray[Any]:
    """The array of a .npy file called ``name``, read-only; the dtypes that it may have are named as in "float32".

    BundleError for another version or dtype, Fortran order, a header of more than 10,000 bytes, or bytes that are
    lacking or left over.
    """
    file = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(file)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
        rest = content[file.tell() :]
        known = dtype.name in dtypes and dtype.isnative
        if version != (1, 0) or fortran or not known or math.prod(shape) * dtype.itemsize != len(rest):
            raise ValueError(f"expected {' or '.join(dtypes)} in C order, and nothing after it")
        return np.frombuffer(rest, dtype).reshape(shape)
    except _NOT_AN_ARRAY as error:
        raise BundleError(f"{name!r} is not a plain array: {error}") from error


def array_bytes(array: NDArray[Any]) -> bytes:
    """An array as a .npy file."""
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ascontiguousarray(array), (1, 0), allow_pickle=False)
    return buffer.getvalue()
