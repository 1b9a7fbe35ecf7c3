"""A file, and a folder, is written whole or not at all, whatever happens."""

import os
from pathlib import Path

import pytest

from motet.errors import BundleError, OutputError
from motet.files import new_folder, temporary_beside, write_whole


def test_text_and_bytes_are_written_and_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a"
    write_whole(path, b"one and longer")
    write_whole(str(path), "two é")
    assert path.read_text(encoding="utf-8") == "two é"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("stop", [PermissionError(13, "Permission denied"), KeyboardInterrupt(), MemoryError()])
@pytest.mark.parametrize("function", ["write_bytes", "replace"])
def test_an_interrupted_write_leaves_the_old_file_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, function: str, stop: BaseException
) -> None:
    path, original = tmp_path / "a", getattr(Path, function)
    path.write_text("old")

    def breaks(self: Path, *arguments: object) -> None:
        if function == "write_bytes":
            original(self, b"ne")
        raise stop

    monkeypatch.setattr(Path, function, breaks)
    with pytest.raises(OutputError if isinstance(stop, OSError) else type(stop)):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_in_the_middle_of_a_write_leaves_the_old_file_alone(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    path = tmp_path / "frames.bin"
    path.write_bytes(b"old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OutputError, match=r"frames\.bin"):
            write_whole(path, bytes(100_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_replaced_file_keeps_its_mode_and_a_link_its_target(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    write_whole(link, "new")
    assert link.is_symlink()
    assert (target.read_text(), target.stat().st_mode & 0o777) == ("new", 0o640)


def test_a_long_name_has_a_temporary_file_too(tmp_path: Path) -> None:
    path = tmp_path / ("ä" * 127)
    write_whole(path, "x")
    assert path.read_text() == "x"
    name = temporary_beside(path).name
    assert name.startswith(".ä")
    assert name.endswith(".partial")
    with pytest.raises(OutputError, match="cannot write"):
        write_whole(tmp_path / ("a" * 256), "x")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_places_that_are_no_files_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for place, said in (
        (tmp_path / "pipe", "not a regular file"),
        (tmp_path, "it is a folder"),
        (tmp_path / "no" / "a", "does not exist"),
        (tmp_path / "a\0b", "cannot write"),
        (Path("/dev/null"), "not a regular file"),
    ):
        with pytest.raises(OutputError, match=said):
            write_whole(place, "x")
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]


def test_what_was_written_is_there_in_the_end_alone(tmp_path: Path) -> None:
    place = tmp_path / "a" / "b"
    with new_folder(place) as folder:
        (folder / "x").write_text("1")
        assert not place.exists()
    assert [path.name for path in place.parent.iterdir()] == ["b"]
    assert (place / "x").read_text() == "1"


def interrupted(place: Path, error: type[BaseException]) -> None:
    with new_folder(place) as folder:
        (folder / "x").write_text("1")
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt, BundleError, MemoryError])
def test_after_an_exception_nothing_is_left(tmp_path: Path, error: type[BaseException]) -> None:
    for _ in range(2):  # and the next attempt is not in the way of the first
        with pytest.raises(error):
            interrupted(tmp_path / "b", error)
        assert list(tmp_path.iterdir()) == []


def test_what_exists_stays(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    with pytest.raises(OutputError, match="it exists"), new_folder(tmp_path / "b"):
        pytest.fail("the folder must not be given")
    assert (tmp_path / "b").is_dir()


def test_a_place_that_cannot_be_written_is_an_error_of_ours(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file/b"), new_folder(tmp_path / "file" / "b"):
        pytest.fail("there is no such folder")
