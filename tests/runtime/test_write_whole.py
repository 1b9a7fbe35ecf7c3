"""A write that is interrupted leaves the old file, and nothing else."""

import os
from pathlib import Path

import pytest

from motet.errors import OutputError
from motet.files import write_whole


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file that is there already."""
    write_whole(tmp_path / "frames.bin", b"old")
    return tmp_path / "frames.bin"


def check_old(path: Path) -> None:
    assert path.read_bytes() == b"old"
    assert list(path.parent.iterdir()) == [path]


def test_a_full_disk_in_the_middle_of_a_write(path: Path) -> None:
    resource = pytest.importorskip("resource")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OutputError, match=r"frames\.bin"):
            write_whole(path, bytes(100_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    check_old(path)


@pytest.mark.parametrize("error", [PermissionError(13, "Permission denied"), KeyboardInterrupt(), MemoryError()])
def test_an_interruption_just_before_the_move(
    path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    def stop(*_: object) -> None:
        raise error

    for place, name in ((Path, "replace"), (Path, "rename"), (os, "replace"), (os, "rename")):
        monkeypatch.setattr(place, name, stop)
    with pytest.raises(OutputError if isinstance(error, OSError) else type(error)):
        write_whole(path, b"new and longer")
    monkeypatch.undo()
    check_old(path)


def test_a_whole_write_replaces_the_old_file(path: Path) -> None:
    write_whole(path, "two é")
    assert path.read_text(encoding="utf-8") == "two é"
    assert list(path.parent.iterdir()) == [path]
