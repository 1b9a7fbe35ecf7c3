"""Commands over files of several motions: --clip, file.glb#Walk, {clip} in the names of results."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from fake_models import moving, search_model
from gltf_files import write_clips
from test_retarget import dancing

import motet
from motet.search.model import Index

NAMES = ("Walk", "a/b: c?", "歩く", "..", "A|B", "A:B")
LABELS = ("Walk", "a_b_ c_", "歩く", "__", "A_B", "A_B_2")


@pytest.fixture
def many(tmp_path: Path) -> Path:
    """A file of six clips, of 3, 4, ... frames."""
    return write_clips(tmp_path / "many.glb", [(name, dancing(3 + i)) for i, name in enumerate(NAMES)])


def frames(folder: Path) -> dict[str, int]:
    return {path.name: len(motet.read(path)) for path in folder.iterdir()}


def test_all_clips_go_where_their_names_can_be(many: Path, tmp_path: Path, out: Path) -> None:
    result = run("convert", many, "--clip", "all", "-o", out / "{name}-{clip}.npz")
    assert (result.exit_code, result.stderr) == (0, "")
    assert frames(out) == {f"many-{label}.npz": 3 + i for i, label in enumerate(LABELS)}
    np.testing.assert_array_equal(motet.read(out / "many-A_B.npz").values, motet.read(f"{many}#A|B").values)


def test_a_clip_is_named_in_the_path_or_for_all_paths(many: Path, tmp_path: Path, out: Path) -> None:
    other = write_clips(tmp_path / "other.glb", [("Run", dancing(20)), ("歩く", dancing(21))])
    assert run("convert", f"{many}#Walk", other, "--clip", "2", "-o", out / "{clip}.npz").exit_code == 0
    assert frames(out) == {"Walk.npz": 3, "歩く.npz": 21}
    assert run("convert", many, out / "Walk.npz", "--clip", "歩く").exit_code == 0
    assert frames(out)["Walk.npz"] == 5
    assert run("convert", f"{many}#1", f"{many}#2", "-o", out / "n.npz").exit_code == 0
    assert (frames(out)["n-1.npz"], frames(out)["n-2.npz"]) == (3, 4)


def test_a_file_of_one_motion_is_its_own_clip(many: Path, tmp_path: Path, out: Path) -> None:
    motet.write(tmp_path / "stroll.npz", dancing(9))
    result = run("convert", many, tmp_path / "stroll.npz", "-o", out / "{clip}.npz")
    assert result.exit_code == 0
    assert result.stderr == f"motet: {many}: reading the first of 6 clips, 'Walk'; the next is many.glb#a/b: c?\n"
    assert frames(out) == {"Walk.npz": 3, "stroll.npz": 9}
    assert "clips: 'Walk', 'a/b: c?', '歩く'" in run("-v", "view", many).stderr


def test_what_cannot_be_read_is_said_once_and_the_rest_is_done(many: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.glb").write_bytes(b"glTF")
    result = run("convert", tmp_path / "bad.glb", f"{many}#None", many, "--clip", "all", "-o", tmp_path / "{clip}.csv")
    assert result.exit_code == 1
    first, second = result.stderr.splitlines()
    assert first.startswith(f"motet: {tmp_path / 'bad.glb'}: ")
    assert second.startswith(f"motet: {many}#None: no clip 'None': expected 'Walk', 'a/b: c?'")
    assert len(list(tmp_path.glob("*.csv"))) == len(NAMES)


def test_results_of_one_name_are_refused(many: Path, tmp_path: Path) -> None:
    result = run("convert", many, "--clip", "all", "-o", tmp_path / "{name}.npz")
    assert result.exit_code == 2
    assert "several results have the same name: give an OUT with {name} and, for clips, {clip}" in result.stderr
    assert not list(tmp_path.glob("*.npz"))


def test_describe_and_embed_take_all_clips_and_predict_those_of_the_option(tmp_path: Path) -> None:
    clips = [(name, dancing(frames)) for name, frames in (("Walk", 60), ("Run", 70))]
    path = write_clips(tmp_path / "many.glb", clips)
    rows = json.loads(run("describe", path, "--json").stdout)
    assert [(row["input"], row["stop"]) for row in rows] == [(f"{path}#Walk", 2.0), (f"{path}#Run", 70 / 30)]
    rows = json.loads(run("describe", path, "--clip", "Run", "--json").stdout)
    assert [row["input"] for row in rows] == [f"{path}#Run"]
    rows = json.loads(run("predict", path, "--clip", "all", "-o", tmp_path / "{clip}.bvh", "--json").stdout)
    assert [row["input"] for row in rows] == [f"{path}#Walk", f"{path}#Run"]
    assert (tmp_path / "Run.bvh").exists()
    rows = json.loads(run("embed", path, "-o", tmp_path / "all.npy", "--json").stdout)
    assert [row["input"] for row in rows] == [f"{path}#Walk", f"{path}#Run"]
    run("embed", path, "--clip", "Run", "-o", tmp_path / "one.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "all.npy")[1:], np.load(tmp_path / "one.npy"))


def test_where_one_motion_is_wanted_one_is_named(tmp_path: Path) -> None:
    path = write_clips(tmp_path / "many.glb", [("Walk", dancing(60)), ("A/B", dancing(60))])
    assert run("join", f"{path}#Walk", f"{path}#A/B", "-o", tmp_path / "a.bvh").exit_code == 0
    refused = run("join", path, path, "--clip", "all", "-o", tmp_path / "b.bvh")
    assert refused.exit_code == 2
    assert f"expected one motion, but {path} holds 2 motions: name one" in refused.stderr


def test_search_finds_each_clip_for_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motet.models.load.load", lambda name, options=None: search_model())
    path = write_clips(tmp_path / "many.glb", [(name, moving(20, seed=i)) for i, name in enumerate(("Walk", "Run"))])
    motet.write(tmp_path / "stroll.npz", moving(20, seed=5))
    for query in (f"{path}#Run", "a person walks"):
        rows = json.loads(run("search", query, tmp_path, "--count", 9, "--json").stdout)
        assert {(Path(row["path"]).name, row["clip"]) for row in rows} == {
            ("many.glb", "Walk"),
            ("many.glb", "Run"),
            ("stroll.npz", ""),
        }
    model = search_model()
    hits = Index.open(tmp_path, model).search(motet.read(path, clip="Run"))
    assert (hits[0].place, hits[0].score) == (f"{path}#Run", pytest.approx(1, abs=1e-6))
    assert run("search", f"{path}#Run", tmp_path).stdout.startswith(f"  1.00  {path}#Run  0.0 to ")


def test_an_index_names_the_clips_that_fail(tmp_path: Path) -> None:
    empty = dancing(3)
    path = write_clips(tmp_path / "many.glb", [("Walk", empty), ("Run", empty)])
    motet.write(tmp_path / "stroll.npz", moving(20, seed=5))
    index = Index.open(tmp_path, search_model())
    assert set(index.failed) == {Path(f"{path}#Walk"), Path(f"{path}#Run")}
    assert Index.open(tmp_path, search_model()).failed == index.failed
