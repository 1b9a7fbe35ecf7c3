"""Animations that meshoptimizer packed: what its own encoder wrote, and what is damaged."""

from importlib import util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_files import read_document, write_clips, write_document
from test_retarget import dancing

import motet
from motet.errors import FormatError
from motet.formats import gltf_data
from motet.formats.text import ContentError

EXT, KHR = "EXT_meshopt_compression", "KHR_meshopt_compression"


def pack(path: Path, out: Path, extension: str = EXT) -> tuple[dict[str, Any], bytes]:
    """A file with its rotations in 16 bits, filtered, its translations in exponents, and all packed."""
    meshopt = pytest.importorskip("meshopt")
    document, binary = read_document(path)
    packed = b""
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        values = np.frombuffer(binary, "<f4", view["byteLength"] // 4, view["byteOffset"])
        values = values.reshape(accessor["count"], -1)
        how: dict[str, Any] = {"mode": "ATTRIBUTES"}
        if accessor["type"] == "VEC4":
            accessor |= {"componentType": 5122, "normalized": True}
            values, how["filter"] = meshopt.encode_filter_quat(values, 8, 16), "QUATERNION"
        elif accessor["type"] == "VEC3":
            values, how["filter"] = meshopt.encode_filter_exp(values, 20), "EXPONENTIAL"
        part = meshopt.encode_gltf_buffer(values, "ATTRIBUTES", int(extension == KHR))
        size = values.nbytes // len(values)
        how |= {"buffer": 0, "byteOffset": len(packed), "byteLength": len(part), "byteStride": size}
        view.clear()
        view |= {"buffer": 1, "byteLength": values.nbytes, "extensions": {extension: how | {"count": len(values)}}}
        packed += part
    document |= {"extensionsRequired": [extension], "extensionsUsed": [extension]}
    write_document(out, document, packed)
    return document, packed


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    return write_clips(tmp_path / "plain.glb", [("Walk", dancing(300)), ("Run", dancing(40))], skin=False)


@pytest.mark.parametrize("extension", [EXT, KHR])
def test_a_packed_file_is_read_as_the_plain_one(extension: str, plain: Path, tmp_path: Path) -> None:
    path = tmp_path / "packed.glb"
    pack(plain, path, extension)
    assert path.stat().st_size < plain.stat().st_size / 2
    for clip in ("Walk", "Run"):
        found, wanted = motet.read(path, clip=clip), motet.read(plain, clip=clip)
        assert (found.fps, len(found), found.skeleton) == (wanted.fps, len(wanted), wanted.skeleton)
        np.testing.assert_allclose(motet.motion.positions(found), motet.motion.positions(wanted), atol=1e-3)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"count": 10**9}, r"a packed part of \d+ bytes cannot hold 1000000000 elements of 8 bytes"),
        ({"count": -1}, "cannot hold -1 elements of 8 bytes"),
        ({"byteStride": 0}, "cannot hold 300 elements of 0 bytes"),
        ({"byteStride": 12}, "a packed part is broken: quaternion rows are 8 bytes"),
        ({"count": 256}, "a packed part is broken: Malformed buffer data"),
        ({"count": 2.5}, "a packed part is broken"),
        ({"mode": "VERTICES"}, "a packed part is broken: mode must be ATTRIBUTES"),
        ({"filter": "BLUR"}, "a packed part is broken: filter must be NONE"),
        ({"byteLength": 10**6}, "a packed part extends beyond its buffer"),
        ({"byteOffset": -8}, "a packed part extends beyond its buffer"),
        ({"byteLength": 20}, "a packed part is broken: Malformed buffer data"),
        ({"buffer": 7}, "accessor 1 is broken"),
    ],
)
def test_a_damaged_part_is_refused(changes: dict[str, Any], said: str, plain: Path, tmp_path: Path) -> None:
    document, packed = pack(plain, tmp_path / "a.glb")
    view = document["bufferViews"][document["accessors"][1]["bufferView"]]
    assert view["extensions"][EXT]["byteStride"] == 8
    view["extensions"][EXT] |= changes
    with pytest.raises(FormatError, match=said):
        motet.read(write_document(tmp_path / "b.glb", document, packed))


@pytest.mark.parametrize(("length", "count", "fits"), [(64, 64 * 128, True), (64, 64 * 128 + 1, False)])
def test_a_packed_part_holds_at_most_what_its_bytes_can_expand_to(length: int, count: int, fits: bool) -> None:
    """A block of 256 equal bytes takes two bits: 1,024 bytes a byte. Beyond that nothing is unpacked at all."""
    pytest.importorskip("meshopt")
    gltf = gltf_data.Gltf(Path("a.glb"), {}, (bytes(length),))
    part = {"buffer": 0, "byteLength": length, "count": count, "byteStride": 8, "mode": "ATTRIBUTES"}
    with pytest.raises(ContentError, match="is broken: Malformed" if fits else f"cannot hold {count} elements"):
        gltf._unpack(part)


def test_all_parts_together_are_bounded(plain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pack(plain, tmp_path / "a.glb")
    monkeypatch.setattr("motet.formats.gltf_data.MAX_UNPACKED", 4000)
    with pytest.raises(FormatError, match="cannot hold 300 elements"):
        motet.read(tmp_path / "a.glb")


def test_without_the_extra_its_remedy_is_named(plain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document, binary = read_document(plain)
    for view in document["bufferViews"]:
        view["extensions"] = {EXT: {}}
    find = util.find_spec
    monkeypatch.setattr(gltf_data, "find_spec", lambda name: None if name == "meshopt" else find(name))
    path = write_document(tmp_path / "a.glb", document, binary)
    assert motet.clips(path) == ("Walk", "Run")
    with pytest.raises(FormatError, match=r"pip install 'motet\[meshopt\]', or unpack the file with  npx gltfpack"):
        motet.read(path)
