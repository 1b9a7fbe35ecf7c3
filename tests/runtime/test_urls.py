"""Motions at URLs, as fsspec reads them."""

import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import run

import motet
from motet.corpus import sources
from motet.corpus.sources import Source, files_of, size_of

fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def bucket(clips: Path) -> str:
    """A folder in memory with a motion, its skeleton, one below and another file."""
    system = fsspec.filesystem("memory")
    system.store.clear()
    for name in ("a/39_14.amc", "a/39_14.asf", "a/b/09_07.amc", "a/b/09_07.asf", "a/notes.txt"):
        content = (clips / Path(name).name).read_bytes() if "notes" not in name else b"no motion"
        with system.open(f"/{name}", "wb") as file:
            file.write(content)
    return "memory://a"


def test_the_files_at_a_url_are_read(bucket: str, clips: Path) -> None:
    files = files_of([Path(bucket)])
    assert [file.name for file in files] == ["39_14.amc", "09_07.amc"]
    assert files_of([Path(f"{bucket}/*.amc")]) == files[:1]
    np.testing.assert_array_equal(Source(files[0]).read().values, motet.read(clips / "39_14.amc").values)
    assert size_of(files[0]) == (clips / "39_14.amc").stat().st_size


def test_a_missing_file_or_file_system_is_named(bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(motet.FormatError, match="cannot be fetched"):
        Source(Path(f"{bucket}/none.bvh")).read()
    with pytest.raises(motet.FormatError, match=r"pip install 'motet\[scale\]'"):
        files_of([Path("nowhere://a/b.bvh")])
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(motet.FormatError, match=r"pip install 'motet\[scale\]'"):
        files_of([Path(bucket)])


def test_commands_take_urls(bucket: str) -> None:
    result = run("check", bucket, "--jobs", 1)
    assert result.exit_code == 0
    assert result.stdout.splitlines()[-1] == "2 motions: 2 understood"


def test_what_is_fetched_is_bounded(bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "MAX_FILE", 1000)
    with pytest.raises(motet.FormatError, match="cannot be fetched: it has more than 1000 bytes"):
        Source(Path(f"{bucket}/39_14.amc")).read()


@pytest.mark.parametrize("name", ["..", "b\\..\\c.bvh", "C:x.bvh"])
def test_names_at_a_url_are_no_paths_of_this_machine(bucket: str, name: str) -> None:
    with pytest.raises(motet.FormatError, match="is not a plain file name"):
        Source(Path(f"{bucket}/{name}")).read()


def test_whatever_fails_at_a_url_is_a_format_error(bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    class OwnError(Exception):
        """As file systems have them."""

    def fail(*_: object, **__: object) -> None:
        raise OwnError("it is closed today")

    system = fsspec.filesystem("memory")
    for name in ("isdir", "open", "size"):
        monkeypatch.setattr(type(system), name, fail)
    for call in (lambda: files_of([Path(bucket)]), lambda: Source(Path(f"{bucket}/39_14.amc")).read()):
        with pytest.raises(motet.FormatError, match="cannot be fetched: it is closed today"):
            call()
    assert size_of(Path(f"{bucket}/39_14.amc")) == -1
