"""``motet search`` over a small model whose graphs are numpy."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest
from command_line import check_refused, run
from fake_models import moving, search_model

from motet.formats import read_motion, write_motion
from motet.models.search import INDEX_FILE, Index


@pytest.fixture(autouse=True)
def bundles(monkeypatch: pytest.MonkeyPatch) -> None:
    """A small model in the place of the shipped one."""
    monkeypatch.setattr("motet.models.load.load", lambda name, options=None: search_model())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "motions"
    place.mkdir()
    for seed in range(4):
        write_motion(place / f"{seed}.npz", moving(20, seed=seed))
    return place


def test_search_prints_what_the_index_finds(folder: Path, tmp_path: Path) -> None:
    result = run("search", "a person walks", folder, "--count", 3, "--json", "--index", tmp_path / "kept.npz")
    assert (result.exit_code, result.stderr) == (0, "")
    wanted = Index.open(folder, search_model()).search("a person walks", 3)
    rows = json.loads(result.stdout)
    assert rows == [{**asdict(hit), "path": str(hit.path)} for hit in wanted]
    lines = run("search", "a person walks", folder).stdout.splitlines()
    assert lines == [f"{hit.score:6.2f}  {hit.path}  0.0 to 2.0 s" for hit in wanted[:2]]
    assert run("search", "a person walks", tmp_path / "kept.npz").stdout.splitlines() == lines


def test_search_by_a_motion(folder: Path) -> None:
    rows = json.loads(run("search", folder / "2.npz", folder, "--json").stdout)
    wanted = Index.open(folder, search_model()).search(read_motion(folder / "2.npz"))
    assert [row["path"] for row in rows] == [str(hit.path) for hit in wanted]
    assert rows[0]["path"] == str(folder / "2.npz")


def test_a_file_that_fails_is_named_and_the_rest_is_found(folder: Path) -> None:
    (folder / "broken.bvh").write_text("")
    result = run("search", "walks", folder, "--count", 9)
    assert (result.exit_code, len(result.stdout.splitlines())) == (1, 4)
    assert result.stderr.startswith(f"motet: {folder / 'broken.bvh'}: ")


def test_the_unit_of_files_that_do_not_state_it(tmp_path: Path) -> None:
    for seed in range(2):
        write_motion(tmp_path / f"{seed}.bvh", moving(20, seed=seed))
    refused = run("search", "walks", tmp_path)
    assert refused.exit_code == 2
    assert "length unit of this skeleton is unknown" in refused.stderr
    assert "--unit-in" in refused.stderr
    rows = json.loads(run("search", tmp_path / "1.bvh", tmp_path, "--unit-in", "m", "--json").stdout)
    assert rows[0]["path"] == str(tmp_path / "1.bvh")
    assert rows[0]["score"] == pytest.approx(1, abs=1e-6)
    assert Index.open(tmp_path, search_model(), unit="m").unit == "m"


def test_unknown_words_are_said_once(folder: Path) -> None:
    result = run("search", "a person limps", folder)
    assert result.stderr == "motet: the model does not know limps (in 'a person limps')\n"


def test_refusals(folder: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    check_refused(run("search", "xyz", folder), "knows no word of 'xyz'", empty)
    check_refused(run("search", "", folder), "has no words", empty)
    check_refused(run("search", "walks", empty), "no motion files", empty)
    check_refused(run("search", empty / "gone.bvh", folder), "gone.bvh", empty)
    check_refused(run("search", "walks", folder, "--index", empty / "no" / "x.npz"), "does not exist", empty)
    assert not (folder / INDEX_FILE).exists()
