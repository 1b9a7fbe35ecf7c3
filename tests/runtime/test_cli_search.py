"""``motet search`` over a small model whose graphs are numpy."""

import json
import shutil
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, run
from fake_models import moving, search_model

import motet
from motet.errors import TextWarning
from motet.formats import read_motion, write_motion
from motet.models.load import load_as
from motet.search.model import INDEX_FILE, Index, IndexSettings, SearchModel


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


def test_a_unit_loses_no_file_that_states_its_own(clips: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """AMC files state their unit, BVH files of the same trial in centimetres do not."""
    monkeypatch.undo()
    for file in (*clips.glob("*.amc"), *clips.glob("*.asf")):
        shutil.copy(file, tmp_path)
    walk = read_motion(clips / "39_14.amc").scaled(0.01)
    write_motion(tmp_path / "39_14.bvh", walk)
    found = Index.open(tmp_path, load_as(SearchModel, "search"), unit="cm")
    assert not found.failed
    hits = found.search(walk, 10)
    assert len(hits) == len(list(clips.glob("*.amc"))) + 1
    assert {hit.path.name for hit in hits[:2]} == {"39_14.amc", "39_14.bvh"}
    assert min(hit.score for hit in hits[:2]) > 0.99


def test_a_pose_and_what_is_not_there_are_like_nothing(
    clips: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()
    kept = tmp_path / "kept.npz"
    index = Index.open(clips, load_as(SearchModel, "search"), kept)
    walk = index.model.prepared(read_motion(clips / "39_14.amc"))
    pose = np.zeros((40, len(walk.channels)))
    pose[:, walk.channels.index("root.height")] = 0.95
    assert index.search(walk)[0].like
    assert not index.search(replace(walk, values=pose))[0].like
    assert index.search("a person walks")[0].like
    for absent in ("a person lies down", "somebody climbs a ladder"):
        assert not index.search(absent)[0].like
    result = run("search", "a person lies down", kept)
    assert result.exit_code == 0
    assert result.stderr == f"motet: nothing like 'a person lies down' is in {kept}\n"


def test_unknown_words_are_said_once(folder: Path) -> None:
    result = run("search", "a person limps", folder)
    assert result.stderr.count("motet: the model does not know limps (in 'a person limps')\n") == 1
    assert result.stderr.count("nothing like 'a person limps'") == 1
    assert result.stderr.count("limps") == 3


def test_nothing_is_like_a_sentence_with_an_unknown_word(folder: Path) -> None:
    index = Index.open(folder, search_model())
    assert any(hit.like for hit in index.search("a person walks", 4))
    with pytest.warns(TextWarning, match="gravely"):
        hits = index.search("a person walks gravely", 4)
    assert [hit.like for hit in hits] == [False] * 4


def test_what_is_only_nearest_is_after_a_question_mark(folder: Path) -> None:
    """Each sentence is like the hits with at least the score of the setting; with none, nothing is like it."""
    least = search_model().settings(IndexSettings).like_text
    seen = set()
    for sentence in ("a person walks", "walks left", "left", "a person", "a person walks left"):
        result = run("search", sentence, folder, "--count", 4)
        rows = json.loads(run("search", sentence, folder, "--count", 4, "--json").stdout)
        assert [row["like"] for row in rows] == [row["score"] >= least for row in rows]
        assert ["?" in line for line in result.stdout.splitlines()] == [not row["like"] for row in rows]
        assert ("nothing like" in result.stderr) == (not rows[0]["like"])
        seen |= {row["like"] for row in rows}
        assert result.exit_code == 0
    assert seen == {True, False}


def test_refusals(folder: Path, out: Path) -> None:
    check_refused(run("search", "xyz", folder), "knows no word of 'xyz'", out)
    check_refused(run("search", "", folder), "has no words", out)
    check_refused(run("search", "walks", out), "no motion files", out)
    check_refused(run("search", out / "gone.bvh", folder), "gone.bvh", out)
    check_refused(run("search", "walks", folder, "--index", out / "no" / "x.npz"), "does not exist", out)
    assert not (folder / INDEX_FILE).exists()


def test_indexes_of_shards_are_merged_into_the_bytes_of_one(folder: Path, tmp_path: Path) -> None:
    (folder / "broken.bvh").write_text("")
    run("search", "walks", folder, "--index", tmp_path / "one.npz")
    (tmp_path / "shards").mkdir()
    for number in (1, 2, 3):
        file = tmp_path / "shards" / f"{number}.npz"
        result = run("search", "walks", folder, "--shard", f"{number}/3", "--index", file, "--json", "--count", 9)
        said = {Path(row["path"]).name for row in json.loads(result.stdout)}
        assert said == {path.name for path in sorted(folder.iterdir())[number - 1 :: 3]} - {"broken.bvh"}
        changed = file.stat().st_mtime_ns
        assert run("search", "walks", file, "--json", "--count", 9).stdout == result.stdout  # it stays a shard
        assert file.stat().st_mtime_ns == changed
    again = run("search", "walks", folder, "--merge", tmp_path / "shards", "--index", tmp_path / "all.npz")
    assert again.stdout == run("search", "walks", folder, "--index", tmp_path / "one.npz").stdout
    assert (tmp_path / "all.npz").read_bytes() == (tmp_path / "one.npz").read_bytes()


def test_merged_shards_are_not_embedded_again(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run("search", "walks", folder, "--shard", "1/2", "--index", tmp_path / "a.npz")
    read, asked = motet.search.model.read_motion, list[str]()
    monkeypatch.setattr(
        "motet.search.model.read_motion", lambda path, **rest: asked.append(path.name) or read(path, **rest)
    )
    run("search", "walks", folder, "--merge", tmp_path / "a.npz")
    assert asked == ["1.npz", "3.npz"]  # those of the shard that is missing


def test_shards_of_an_index_that_cannot_be(folder: Path, tmp_path: Path) -> None:
    assert "give --index FILE" in run("search", "walks", folder, "--shard", "1/2").stderr
    assert "no indexes of shards" in run("search", "walks", folder, "--merge", tmp_path).stderr
    refused = run("search", "walks", folder, "--shard", "9/9", "--index", tmp_path / "a.npz")
    assert "no motion files" in refused.stderr
    (tmp_path / "old.npz").write_text("hello")
    assert "old.npz: not an index" in run("search", "walks", folder, "--merge", tmp_path / "old.npz").stderr
