"""Stores of shards, merged: the oracle is the corpus prepared at once."""

import shutil
from pathlib import Path

import pytest
from kit_zip import write_kit_zip
from trainings import done, refused

from motet.formats import read_motion, write_motion
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.errors import DataError
from motet_train.data.merging import merge_stores


def prepared(corpus: Path, out: Path, *options: str) -> Path:
    done("prepare", corpus, "--out", out, *options)
    return out


def shards(corpus: Path, folder: Path, count: int, *options: str) -> list[Path]:
    numbers = range(1, count + 1)
    return [prepared(corpus, folder / f"{n}", *options, "--shard", f"{n}/{count}") for n in numbers]


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs with a table, a broken file, and a sentence without a motion."""
    folder = tmp_path_factory.mktemp("corpus") / "clips"
    folder.mkdir()
    motion = read_motion(CMU_FOLDER / "09_07.amc")
    for number in range(5):
        write_motion(folder / f"walk{number}.npz", motion[: 60 + 10 * number])
    (folder / "walk2.npz").write_bytes(b"broken")
    rows = "".join(f"{name}\ta person walks\n" for name in ("walk0", "walk1", "walk2", "walk3", "walk4", "lost"))
    (folder / "table.tsv").write_text(f"clip\tsentence\n{rows}")
    return folder


def test_merged_shards_are_the_bytes_of_the_whole(clips: Path, tmp_path: Path) -> None:
    whole = prepared(clips, tmp_path / "whole", "--for", "all")
    parts = shards(clips, tmp_path / "parts", 3, "--for", "all")
    done("prepare", *reversed(parts), "--out", tmp_path / "merged")
    files = sorted(path.relative_to(whole) for path in whole.rglob("*.*"))
    assert len(files) == 6
    for file in files:
        assert (tmp_path / "merged" / file).read_bytes() == (whole / file).read_bytes(), file


def test_so_are_those_of_kits_data(tmp_path: Path) -> None:
    corpus = write_kit_zip(tmp_path / "kit.zip", 5)
    whole = prepared(corpus, tmp_path / "whole")
    merge_stores(shards(corpus, tmp_path / "parts", 2), tmp_path / "merged")
    for name in ("frames.npy", "store.json"):
        assert (tmp_path / "merged" / name).read_bytes() == (whole / name).read_bytes()


def test_what_does_not_fit_is_refused_and_nothing_written(clips: Path, tmp_path: Path) -> None:
    first, second, third = shards(clips, tmp_path / "parts", 3)
    whole = prepared(clips, tmp_path / "whole")
    faster = prepared(clips, tmp_path / "faster", "--fps", "20", "--shard", "2/3")
    cases = {
        "shards are missing or of another count: 2/3": [first, third],
        "are both shard 1/3": [first, Path(shutil.copytree(first, tmp_path / "copy")), second, third],
        "is not the store of a shard": [whole],
        "prepared in another way": [first, faster, third],
    }
    for said, places in cases.items():
        with pytest.raises(DataError, match=said):
            merge_stores(places, tmp_path / "merged")
        assert not (tmp_path / "merged").exists()
    command = ("prepare", clips, "--out", tmp_path / "x", "--shard", "1/9")
    refused("5 motion files are too few for 9 shards", *command)
