"""A folder is written whole or not at all."""

from pathlib import Path

import pytest

from motet.errors import BundleError, OutputError
from motet.files import new_folder


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
