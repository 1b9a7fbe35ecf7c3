"""Zips of motions: no name in one is a path of this machine, and what it unpacks to is bounded."""

import stat
import struct
import zipfile
from pathlib import Path

import pytest
from command_line import run

import motet
from motet.corpus import archives
from motet.corpus.archives import ZipFiles
from motet.corpus.sources import Source, files_of, opened

BVH = (Path(__file__).parent / "skeletons/mixamo.bvh").read_bytes()


def zipped(path: Path, *members: tuple[str, bytes], mode: int = stat.S_IFREG | 0o644) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members:
            info = zipfile.ZipInfo("x")
            info.filename = name  # as it is, where the constructor would mend it
            info.orig_filename = name
            info.external_attr = mode << 16
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, content)
    return path


HOSTILE = {
    "absolute": "{host}/private.bvh",
    "up": "../private.bvh",
    "up below": "a/../../private.bvh",
    "drive": "C:/private.bvh",
    "backslash": "a\\..\\private.bvh",
    "two slashes": "//private.bvh",
    "dot": "./private.bvh",
    "line feed": "a\nb.bvh",
    "NUL": "a\0.bvh",
    "none": "",
    "hidden": ".private.bvh",
    "hidden folder": ".a/private.bvh",
    "of a Mac": "__MACOSX/private.bvh",
}


@pytest.mark.parametrize("name", HOSTILE.values(), ids=HOSTILE)
def test_only_plain_names_are_files_of_a_zip(tmp_path: Path, name: str) -> None:
    host = tmp_path / "host"
    host.mkdir()
    (host / "private.bvh").write_bytes(BVH)
    (tmp_path / "private.bvh").write_bytes(BVH)
    packed = zipped(tmp_path / "c.zip", (name.format(host=host), b"junk"), ("plain.bvh", BVH))
    assert files_of([packed]) == [packed / "plain.bvh"]
    (tmp_path / "out").mkdir()
    result = run("convert", packed, "-o", tmp_path / "out/{name}.glb", "--unit-in", "cm")
    assert result.exit_code == 0
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["plain.glb"]


@pytest.mark.parametrize("name", [name for kind, name in HOSTILE.items() if "hidden" not in kind and "Mac" not in kind])
def test_nothing_is_unpacked_to_where_a_name_leads(tmp_path: Path, name: str) -> None:
    name = name.format(host=tmp_path)
    packed = zipped(tmp_path / "c.zip", (name, BVH))
    with ZipFiles(packed) as files, pytest.raises(motet.FormatError, match="no plain file of this name"):
        files.unpack(name, tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == [packed]


def test_a_link_and_a_name_that_is_not_listed_are_refused(tmp_path: Path) -> None:
    packed = zipped(tmp_path / "c.zip", ("link.bvh", b"/etc/passwd"), mode=stat.S_IFLNK | 0o777)
    for name in ("link.bvh", "none.bvh"):
        with pytest.raises(motet.FormatError, match="no plain file of this name"), opened(packed / name):
            pass


def test_a_zip_in_a_zip_is_not_opened(tmp_path: Path) -> None:
    inner = zipped(tmp_path / "inner.zip", ("a.bvh", BVH))
    outer = zipped(tmp_path / "outer.zip", ("inner.zip", inner.read_bytes()), ("b.bvh", BVH))
    assert files_of([outer]) == [outer / "b.bvh"]
    with pytest.raises(motet.FormatError, match="no plain file"), opened(outer / "inner.zip" / "a.bvh"):
        pass


def test_a_bomb_is_not_unpacked_whatever_its_zip_announces(tmp_path: Path) -> None:
    packed = zipped(tmp_path / "bomb.zip", ("a.bvh", b"\0" * (archives.SMALL_FILE + 1)))
    with pytest.raises(motet.FormatError, match=r"a\.bvh: cannot be unpacked: it has more than 16777216 bytes"):
        Source(packed / "a.bvh").read()
    with ZipFiles(packed) as files, pytest.raises(motet.FormatError):
        files.unpack("a.bvh", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    content = bytearray(packed.read_bytes())
    struct.pack_into("<L", content, content.index(b"PK\x01\x02") + 24, 1000)  # of its unpacked size
    packed.write_bytes(content)
    with pytest.raises(motet.FormatError, match="cannot be unpacked"):
        Source(packed / "a.bvh").read()


def ending(content: bytes, kind: str) -> bytes:
    """A zip that ends otherwise: as large ones do, and with other numbers where they do not matter."""
    end = content.rindex(b"PK\x05\x06")
    count, table, start = struct.unpack("<HLL", content[end + 10 : end + 20])
    if kind == "misleading":  # where the table begins is not looked at, and looks like the end
        return content[: end + 16] + b"PK\x05\x06" + content[end + 20 :]
    if kind == "commented":
        return content[:-2] + struct.pack("<H", 9) + b"a comment"
    if not kind.startswith("64 bits"):
        return content
    large = struct.pack("<4sQHHLLQQQQ", b"PK\x06\x06", 44, 45, 45, 0, 0, count, count, table, start)
    locator = struct.pack("<4sLQL", b"PK\x06\x07", 0, 0 if "misled" in kind else end, 1)
    small = content[end : end + 10] + struct.pack("<HLLH", 0xFFFF, 0xFFFFFFFF, 0xFFFFFFFF, 0)
    return content[:end] + large + locator + small


@pytest.mark.parametrize("kind", ["plain", "misleading", "commented", "64 bits", "64 bits, misled"])
def test_a_long_table_of_contents_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    packed = zipped(tmp_path / "many.zip", *((f"{number}.bvh", b"") for number in range(100)))
    packed.write_bytes(ending(packed.read_bytes(), kind))
    if kind != "64 bits, misled":  # which newer versions of Python refuse
        with ZipFiles(packed) as files:
            assert len(files.names) == 100
    monkeypatch.setattr(archives, "MAX_TABLE", 1000)
    with pytest.raises(motet.FormatError, match="not a readable zip file") as caught:
        files_of([packed])
    reason = "it holds too many files: unpack it (its table of contents has 5"
    assert reason in str(caught.value) or kind == "64 bits, misled"


def test_a_zip_that_changes_while_it_is_read_is_refused(tmp_path: Path) -> None:
    packed = zipped(tmp_path / "c.zip", ("a.bvh", BVH), ("b.bvh", BVH))
    with ZipFiles(packed) as files:
        packed.write_bytes(packed.read_bytes()[:100])
        with pytest.raises(motet.FormatError, match=r"b\.bvh: cannot be unpacked"):
            files.unpack("b.bvh", tmp_path)


def test_an_encrypted_file_is_refused(tmp_path: Path) -> None:
    packed = zipped(tmp_path / "c.zip", ("a.bvh", BVH))
    content = bytearray(packed.read_bytes())
    for signature, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(signature) + flags] |= 1
    packed.write_bytes(content)
    with pytest.raises(motet.FormatError, match=r"a\.bvh: cannot be unpacked: .*encrypted"):
        Source(packed / "a.bvh").read()


def test_of_two_files_of_one_name_the_last_is_read(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="Duplicate name"):
        packed = zipped(tmp_path / "c.zip", ("a.bvh", b"junk"), ("a.bvh", BVH))
    assert files_of([packed]) == [packed / "a.bvh"]
    with opened(packed / "a.bvh") as place:
        assert place.read_bytes() == BVH


def test_only_the_skeleton_that_is_asked_for_is_unpacked(tmp_path: Path, clips: Path) -> None:
    amc, asf = ((clips / f"39_14.{kind}").read_bytes() for kind in ("amc", "asf"))
    for folder in ("", "asf/"):
        below = "amc/" if folder else ""
        others = [(f"{folder}{number}.asf", b"junk") for number in range(100, 160)]
        packed = zipped(tmp_path / f"{bool(folder)}.zip", (f"{below}39_14.amc", amc), (f"{folder}39.asf", asf), *others)
        with opened(packed / f"{below}39_14.amc") as place:
            root = place.parents[1 if folder else 0]
            unpacked = sorted(path.name for path in root.rglob("*.*"))
        assert unpacked == ["39.asf", "39_14.amc"]
        assert len(Source(packed / f"{below}39_14.amc").read()) == len(motet.read(clips / "39_14.amc"))


def test_damage_is_refused_with_the_name_of_the_file(tmp_path: Path) -> None:
    packed = zipped(tmp_path / "c.zip", ("a.bvh", BVH))
    content = bytearray(packed.read_bytes())
    content[50] ^= 0xFF
    packed.write_bytes(content)
    with pytest.raises(motet.FormatError, match="cannot be unpacked") as caught:
        Source(packed / "a.bvh").read()
    assert caught.value.path == packed / "a.bvh"
