"""Errors cross processes: one bad file in a pool of readers comes back as its error."""

import pickle
import re
import threading
import warnings
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

import motet
from motet import errors
from motet.errors import ControlWarning, TextWarning, TravelWarning, collected, each_once, warn
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


def test_what_is_collected_is_that_of_one_thread_and_leaves_all_filters_alone() -> None:
    filters = list(warnings.filters)
    started, said = threading.Barrier(8), dict[int, list[str]]()

    def work(number: int) -> None:
        with collected(TextWarning) as notes:
            started.wait()
            for _ in range(200):
                warn(f"of {number}", TextWarning)
        said[number] = each_once(notes)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(work, range(8)))
    assert said == {number: [f"of {number}"] for number in range(8)}
    assert warnings.filters == filters
    with pytest.warns(TextWarning, match="later") as caught:
        warn("later", TextWarning)
    assert caught[0].filename == __file__  # at the caller's line


def test_the_innermost_collects_its_categories_and_others_go_on() -> None:
    with collected(TextWarning, ControlWarning) as outer, collected(TextWarning) as inner:
        warn("a word", TextWarning)
        warn("a speed", ControlWarning)
        with pytest.warns(TravelWarning, match="a path"):
            warn("a path", TravelWarning)
    with pytest.warns(TextWarning, match="after both"):
        warn("after both", TextWarning)
    assert (each_once(outer), each_once(inner)) == (["a speed"], ["a word"])


def test_the_library_changes_no_filters() -> None:
    root = Path(motet.__file__).parent
    changing = re.compile(r"catch_warnings|simplefilter|filterwarnings|resetwarnings")
    assert [path for path in root.rglob("*.py") if changing.search(path.read_text(encoding="utf-8"))] == []
