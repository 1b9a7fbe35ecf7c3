"""The index of a folder: what it finds, and what it does with files that change, vanish or cannot be read."""

import json
import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_models import moving, search_model

from motet.errors import DecodingError, FormatError, MotionError, OutputError, TextError
from motet.formats import read_motion, write_motion
from motet.search import model as searching
from motet.search.model import INDEX_FILE, Hit, Index, Member, SearchModel

FILES = ("a.npz", "b.npz", "inner/c.npz", "d.npz")


@pytest.fixture(scope="module")
def model() -> SearchModel:
    return search_model()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four motions, one of them in a folder within."""
    place = tmp_path / "motions"
    (place / "inner").mkdir(parents=True)
    for seed, name in enumerate(FILES):
        write_motion(place / name, moving(20, seed=seed))
    return place


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the files that an index reads."""
    found: list[str] = []

    def noted(path: Path, unit: str | float | None = None, clip: str | None = None) -> object:
        found.append(path.name)
        return read_motion(path, unit=unit, clip=clip)

    monkeypatch.setattr(searching, "read_motion", noted)
    return found


def test_hits_are_those_of_a_naive_search(folder: Path, model: SearchModel) -> None:
    query = model.embed_text("a person walks")
    scores = {folder / name: float(model.embed(read_motion(folder / name)) @ query) for name in FILES}
    wanted = sorted(scores, key=lambda path: -scores[path])
    hits = Index.open(folder, model).search("a person walks", 3)
    assert [hit.path for hit in hits] == wanted[:3]
    np.testing.assert_allclose([hit.score for hit in hits], [scores[path] for path in wanted[:3]], atol=1e-6)
    assert {(hit.start, hit.stop) for hit in hits} == {(0.0, 2.0)}
    assert len(Index.open(folder, model).search("walks")) == 2  # the model's default


def test_files_are_found_behind_many_windows_of_another(model: SearchModel, tmp_path: Path) -> None:
    rng, query = np.random.default_rng(0), model.embed_text("a person walks")
    spans = {"long.npz": 5000, "b.npz": 1, "c.npz": 2}
    members = tuple(Member(name, 0, 0, ((0.0, 1.0),) * count) for name, count in spans.items())
    nearness = np.concatenate([0.9 + 0.1 * rng.random(5000), [0.5], [0.6, 0.7]])
    vectors = (nearness[:, None] * query).astype(np.float32)
    hits = Index(model, tmp_path, members, vectors).search("a person walks", 3)
    assert [hit.path.name for hit in hits] == ["long.npz", "c.npz", "b.npz"]
    np.testing.assert_allclose([hit.score for hit in hits], [nearness[:5000].max(), 0.7, 0.5], atol=1e-6)


def test_a_motion_is_nearest_to_itself(folder: Path, model: SearchModel) -> None:
    first, *_ = Index.open(folder, model).search(read_motion(folder / "b.npz"))
    assert (first.path, first.score) == (folder / "b.npz", pytest.approx(1, abs=1e-6))


def test_a_hit_says_the_seconds_of_a_long_motion(folder: Path, model: SearchModel) -> None:
    walk, rest = moving(80, seed=7), moving(160, seed=8)
    values = np.concatenate([rest.values[:80], walk.values, rest.values[80:]])
    write_motion(folder / "long.npz", replace(rest, values=values))
    hit = Index.open(folder, model).search(walk, 1)[0]
    assert hit == Hit(folder / "long.npz", 8.0, 16.0, pytest.approx(1, abs=1e-6))


def test_a_second_time_nothing_is_read(folder: Path, model: SearchModel, reads: list[str]) -> None:
    first = Index.open(folder, model)
    assert sorted(reads) == ["a.npz", "b.npz", "c.npz", "d.npz"]
    reads.clear()
    told: list[tuple[int, int]] = []
    again = Index.open(folder, model, progress=lambda done, total: told.append((done, total)))
    assert (reads, told) == ([], [(1, 4), (2, 4), (3, 4), (4, 4)])
    assert again.search("a person", 4) == first.search("a person", 4)


def test_changed_files_are_embedded_anew(folder: Path, model: SearchModel, reads: list[str]) -> None:
    Index.open(folder, model)
    reads.clear()
    write_motion(folder / "b.npz", moving(31, seed=9))
    write_motion(folder / "e.npz", moving(20, seed=10))
    found = Index.open(folder, model)
    assert reads == ["b.npz", "e.npz"]
    assert found.search(moving(31, seed=9), 1)[0] == Hit(folder / "b.npz", 0.0, 3.1, pytest.approx(1, abs=1e-6))


def test_vanished_files_are_named_and_left_out(
    folder: Path, model: SearchModel, caplog: pytest.LogCaptureFixture
) -> None:
    Index.open(folder, model)
    (folder / "a.npz").unlink()
    with caplog.at_level(logging.WARNING, "motet"):
        found = Index.open(folder, model)
    assert found.vanished == (folder / "a.npz",)
    assert caplog.messages == [f"{folder / 'a.npz'} has vanished since it was indexed"]
    assert folder / "a.npz" not in [hit.path for hit in found.search("walks", 9)]
    assert Index.open(folder, model).vanished == ()


def test_unreadable_files_are_named_and_the_rest_works(folder: Path, model: SearchModel, reads: list[str]) -> None:
    (folder / "broken.bvh").write_text("HIERARCHY\nROOT")
    write_motion(folder / "short.npz", moving(1))
    whole = Index.open(folder, model)
    assert set(whole.failed) == {folder / "broken.bvh", folder / "short.npz"}
    assert "two frames" in whole.failed[folder / "short.npz"]
    assert len(whole.search("walks", 9)) == 4
    reads.clear()
    assert Index.open(folder, model).failed == whole.failed
    assert reads == []


def test_another_unit_is_read_anew(tmp_path: Path, model: SearchModel, reads: list[str]) -> None:
    write_motion(tmp_path / "a.bvh", moving(20, seed=1))
    write_motion(tmp_path / "b.bvh", moving(20, seed=2))
    with pytest.raises(MotionError, match=r"none of 2 motion files .* unit"):
        Index.open(tmp_path, model)
    own = read_motion(tmp_path / "b.bvh", unit="cm")
    reads.clear()
    found = Index.open(tmp_path, model, unit="cm")
    assert sorted(reads) == ["a.bvh", "b.bvh"]
    assert found.search(own, 1) == [Hit(tmp_path / "b.bvh", 0.0, 2.0, pytest.approx(1, abs=1e-6))]
    reads.clear()
    (tmp_path / "a.bvh").unlink()
    same = Index.open(tmp_path, model, unit="cm")
    assert (reads, same.unit, same.vanished) == ([], "cm", (tmp_path / "a.bvh",))
    other = Index.open(tmp_path, model, unit="m")
    assert (reads, other.unit, other.vanished) == (["b.bvh"], "m", ())
    assert not np.allclose(other.vectors, same.vectors)
    with pytest.raises(MotionError, match="length unit"):
        Index.open(tmp_path, model, unit="parsec")


def test_an_index_of_before_there_were_units_is_taken(folder: Path, model: SearchModel, reads: list[str]) -> None:
    Index.open(folder, model)
    with np.load(folder / INDEX_FILE) as arrays:
        text, vectors = json.loads(arrays["index"].tobytes()), arrays["vectors"]
    del text["unit"]
    np.savez(folder / INDEX_FILE, index=np.frombuffer(json.dumps(text).encode(), np.uint8), vectors=vectors)
    reads.clear()
    Index.open(folder, model)
    assert reads == []


def test_an_index_file_elsewhere_finds_its_folder(folder: Path, model: SearchModel, tmp_path: Path) -> None:
    file = tmp_path / "kept.npz"
    hits = Index.open(folder, model, file).search("walks")
    assert not (folder / INDEX_FILE).exists()
    assert Index.open(file, model).search("walks") == hits


def test_a_folder_that_cannot_be_written_to_is_searched_all_the_same(
    folder: Path, model: SearchModel, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(path: Path, content: bytes) -> None:
        raise OutputError(f"cannot write {path}: Read-only file system")

    monkeypatch.setattr(searching, "write_whole", refuse)
    with caplog.at_level(logging.WARNING, "motet"):
        assert len(Index.open(folder, model).search("walks", 9)) == 4
    assert caplog.messages == [f"the index is not kept: cannot write {folder / INDEX_FILE}: Read-only file system"]
    with pytest.raises(OutputError, match="Read-only"):
        Index.open(folder, model, folder / "own.npz")


def test_an_index_of_another_model_is_refused(folder: Path, model: SearchModel) -> None:
    Index.open(folder, model)
    with pytest.raises(FormatError, match=r"made by the model fake-search .*, not other .*: remove it"):
        Index.open(folder, search_model("other"))


def test_what_is_no_index_is_refused(folder: Path, model: SearchModel) -> None:
    with pytest.raises(FormatError, match="not an index of motions"):
        Index.open(folder / "a.npz", model)
    for content in (b"", b"PK\x03\x04", b"no zip at all"):
        (folder / INDEX_FILE).write_bytes(content)
        with pytest.raises(FormatError, match="not an index of motions"):
            Index.open(folder, model)


def test_vectors_that_are_not_those_of_the_windows_are_refused(folder: Path, model: SearchModel) -> None:
    Index.open(folder, model)
    with np.load(folder / INDEX_FILE) as arrays:
        text, vectors = arrays["index"], arrays["vectors"]
    np.savez(folder / INDEX_FILE, index=text, vectors=vectors[:-1])
    with pytest.raises(FormatError, match="damaged"):
        Index.open(folder, model)


def test_folders_without_motions_are_refused(tmp_path: Path, model: SearchModel) -> None:
    with pytest.raises(FormatError, match="no motion files"):
        Index.open(tmp_path, model)
    with pytest.raises(FormatError, match="neither a folder"):
        Index.open(tmp_path / "nowhere", model)
    (tmp_path / "broken.bvh").write_text("")
    with pytest.raises(MotionError, match=r"none of 1 motion files .*broken.bvh"):
        Index.open(tmp_path, model)


def test_what_cannot_be_asked(folder: Path, model: SearchModel) -> None:
    found = Index.open(folder, model)
    with pytest.raises(TextError, match="knows no word"):
        found.search("xyz")
    with pytest.raises(DecodingError, match="between 1 and 1000"):
        found.search("walks", 0)
    with pytest.raises(MotionError, match="two frames"):
        found.search(moving(1))
