"""Plain arrays of a bundle: written, read, checked against what the manifest declares."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from motet.bundle.bundle import Bundle, write_bundle
from motet.bundle.manifest import TABLE_DTYPES
from motet.bundle.members import array_bytes
from motet.errors import BundleError
from motet.search.model import SearchModel

ROWS = np.arange(12, dtype=np.float16).reshape(4, 3)


def written(path: Path, content: bytes, **declared: Any) -> Bundle:
    """The shipped bundle of search with a table "rows"."""
    source = Bundle.open("search")
    files = {name: source.read(name) for name in source.manifest.files}
    entry = {"file": "rows.npy", "dtype": "float16", "shape": [4, 3], **declared}
    write_bundle(path, {**source.manifest.source, "tables": {"rows": entry}}, {**files, "rows.npy": content})
    return Bundle.open(path)


@pytest.mark.parametrize("dtype", TABLE_DTYPES)
def test_a_table_comes_back(tmp_path: Path, dtype: str) -> None:
    rows = ROWS.astype(dtype)
    found = written(tmp_path / "x.zip", array_bytes(rows), dtype=dtype).table("rows")
    np.testing.assert_array_equal(found, rows)
    assert found.dtype == rows.dtype
    assert not found.flags.writeable


def test_a_model_asks_for_its_tables(tmp_path: Path) -> None:
    model = SearchModel.load(written(tmp_path / "x.zip", array_bytes(ROWS)))
    np.testing.assert_array_equal(model.table("rows", "R 3", "float16"), ROWS)
    assert model.sizes["R"] == 4
    for shape, dtype in (("R 4", "float16"), ("D 3", "float16"), ("R", "float16"), ("R 3", "float32")):
        with pytest.raises(BundleError, match=f"'rows' is float16 .4, 3., expected {dtype}"):
            model.table("rows", shape, dtype)
    with pytest.raises(BundleError, match="manifest, tables: there is no table 'memory'"):
        model.table("memory", "R 3", "float16")


def infinite() -> NDArray[Any]:
    rows = ROWS.copy()
    rows[1, 1] = np.inf
    return rows


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (array_bytes(ROWS.astype(np.float32)), "'rows.npy' is not a plain array: expected float16"),
        (array_bytes(ROWS.astype(">f2")), "expected float16"),
        (array_bytes(ROWS.T), r"its shape is \[3, 4\], declared as \[4, 3\]"),
        (array_bytes(ROWS)[:-1], "and nothing after it"),
        (array_bytes(ROWS) + b"x", "and nothing after it"),
        (array_bytes(infinite()), "not between -1e.09 and 1e.09"),
        (b"", "is not a plain array"),
    ],
)
def test_what_is_not_the_declared_table_is_refused(tmp_path: Path, content: bytes, reason: str) -> None:
    bundle = written(tmp_path / "x.zip", content)
    with pytest.raises(BundleError, match=f"bundle {tmp_path}/x.zip, table rows: .*{reason}"):
        bundle.table("rows")
    model = SearchModel.load(bundle)
    with pytest.raises(BundleError, match=reason):
        model.ready()
    with pytest.raises(BundleError, match=reason):
        model.tables["rows"]


@pytest.mark.parametrize(
    ("declared", "reason"),
    [
        ({"dtype": "object"}, r"tables\.rows\.dtype: must be one of float16"),
        ({"shape": 4}, r"tables\.rows\.shape: must be a list"),
        ({"shape": [4, True]}, r"tables\.rows\.shape\.1: must be a whole number between 1 and"),
        ({"shape": [4, -3]}, r"tables\.rows\.shape\.1: must be a whole number between 1 and"),
        ({"shape": [4, "3"]}, r"tables\.rows\.shape\.1: must be a whole number between 1 and"),
        ({"file": "other.npy"}, r"tables\.rows\.file: 'other\.npy' is not among its files"),
    ],
)
def test_a_declaration_that_is_none_is_refused(tmp_path: Path, declared: dict[str, Any], reason: str) -> None:
    with pytest.raises(BundleError, match=reason):
        written(tmp_path / "x.zip", array_bytes(ROWS), **declared)
