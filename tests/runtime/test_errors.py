"""Errors cross processes: one bad file in a pool of readers comes back as its error."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

from motet import errors
from motet.formats import read_motion

ERRORS = [
    kind
    for kind in vars(errors).values()
    if isinstance(kind, type) and issubclass(kind, Exception) and kind.__module__ == errors.__name__
]
ARGUMENTS = {
    errors.FormatError: ("a.bvh", "the frame breaks off", 3),
    errors.ScriptError: ("walk 3", 5, "the script needs a duration"),
}


@pytest.mark.parametrize("kind", ERRORS)
def test_every_error_survives_pickling(kind: type[Exception]) -> None:
    error = kind(*ARGUMENTS.get(kind, ("what was wrong",)))
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert (str(again), vars(again)) == (str(error), vars(error))


def test_messages_say_the_place() -> None:
    assert str(errors.FormatError("a.bvh", "no such file")) == "a.bvh: no such file"
    assert str(errors.FormatError("a.bvh", "too short", 7)) == "a.bvh, line 7: too short"
    assert str(errors.ScriptError("walk 3", 5, "more")) == "more\n  walk 3\n       ^"


def test_a_bad_file_in_a_pool_is_an_error_and_no_hang(tmp_path: Path) -> None:
    (tmp_path / "bad.bvh").write_text("hello")
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        (found,) = [pool.submit(read_motion, tmp_path / "bad.bvh").exception(timeout=60)]
    assert isinstance(found, errors.FormatError)
    assert found.line == 1
