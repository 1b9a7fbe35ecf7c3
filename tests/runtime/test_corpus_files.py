"""Folders, patterns and zips of motions: which files are meant, and that every verb answers them as it does each."""

import pickle
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, run

import motet
from motet.corpus import ray_engine
from motet.corpus.answers import Check, Describe, Embed
from motet.corpus.sources import Source, files_of
from motet.jobs import FEW, in_batches


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, clips: Path) -> Path:
    """Enough motions for two processes, some of them broken, one below."""
    place = tmp_path_factory.mktemp("corpus")
    (place / "b").mkdir()
    walk = motet.to_humanoid(motet.read(clips / "39_14.amc")).motion
    for number in range(FEW):
        motet.write(place / f"{number}.bvh", walk[10 * number : 150 + 5 * number])
    (place / "3.bvh").write_text("hello")
    (place / "b" / "short.npz").write_bytes(b"PK")
    for name in ("39_14.amc", "39_14.asf"):
        (place / "b" / name).write_bytes((clips / name).read_bytes())
    (place / "notes.txt").write_text("no motion")
    return place


@pytest.fixture(scope="module")
def packed(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same files in a zip."""
    place = tmp_path_factory.mktemp("zip") / "corpus.zip"
    with zipfile.ZipFile(place, "w") as archive:
        for file in sorted(folder.rglob("*.*")):
            archive.write(file, file.relative_to(folder))
    return place


def test_a_folder_a_pattern_and_a_zip_mean_the_same_files(folder: Path, packed: Path) -> None:
    names = [path.relative_to(folder).as_posix() for path in files_of([folder])]
    assert names == [*(f"{number}.bvh" for number in range(FEW)), "b/39_14.amc", "b/short.npz"]
    assert [path.relative_to(packed).as_posix() for path in files_of([packed])] == names
    assert files_of([folder / "**" / "*.*"]) == files_of([folder])
    assert files_of([folder / "[12].bvh", folder / "none.bvh"]) == [folder / f"{name}.bvh" for name in (1, 2, "none")]


@pytest.mark.parametrize("named", ["{empty}", "{empty}/*.bvh", "{empty}/a.zip", "{empty}/bad.zip"])
def test_where_no_motions_are_is_refused(named: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("notes.txt", "no motion")
    (tmp_path / "bad.zip").write_text("hello")
    given = Path(named.format(empty=tmp_path))
    with pytest.raises(motet.FormatError, match=r"no motion files|not a readable zip") as caught:
        files_of([given])
    assert caught.value.path == given


@pytest.mark.parametrize("options", [["--json"], [], ["--timeline", "--json"]])
def test_describe_says_the_same_of_a_folder_by_two_processes_and_of_a_zip(
    folder: Path, packed: Path, options: list[str]
) -> None:
    one, two = (run("describe", folder, *options, "--jobs", jobs) for jobs in (1, 2))
    zipped = run("describe", packed, *options, "--jobs", 2)
    assert (one.exit_code, one.stdout, one.stderr) == (two.exit_code, two.stdout, two.stderr)
    assert one.exit_code == 1
    failed = [line for line in one.stderr.splitlines() if "in place" not in line]
    assert [line.split(": ")[1].split(",")[0] for line in failed] == [
        f"{folder / '3.bvh'}",
        f"{folder / 'b/short.npz'}",
    ]
    for said, there in ((zipped.stdout, one.stdout), (zipped.stderr, one.stderr)):
        assert said == there.replace(str(folder), str(packed))


def test_embed_and_convert_write_the_same_by_two_processes(folder: Path, tmp_path: Path) -> None:
    for jobs in (1, 2):
        (tmp_path / f"{jobs}").mkdir()
        assert run("embed", folder, "-o", tmp_path / f"{jobs}.npy", "--jobs", jobs).exit_code == 1
        run("convert", folder, "-o", tmp_path / f"{jobs}" / "{name}.npz", "--jobs", jobs)
    assert (tmp_path / "1.npy").read_bytes() == (tmp_path / "2.npy").read_bytes()
    assert len(np.load(tmp_path / "1.npy")) == FEW
    for path in sorted((tmp_path / "1").iterdir()):
        np.testing.assert_array_equal(motet.read(path).values, motet.read(tmp_path / "2" / path.name).values)
    assert len(list((tmp_path / "2").iterdir())) == FEW


def test_a_search_index_is_the_same_by_two_processes(folder: Path, tmp_path: Path) -> None:
    one, two = (
        run("search", "a person walks", folder, "--json", "--index", tmp_path / f"{n}.npz", "--jobs", n) for n in (1, 2)
    )
    assert one.stdout == two.stdout
    assert one.stderr == two.stderr
    with np.load(tmp_path / "1.npz") as first, np.load(tmp_path / "2.npz") as second:
        np.testing.assert_array_equal(first["vectors"], second["vectors"])


def test_a_verb_is_a_function_of_sources_in_a_library_too(folder: Path) -> None:
    sources = [Source(path) for path in files_of([folder])]
    answers = list(in_batches(Embed({}), sources, 2, 64))
    assert [answer.source for answer in answers] == sources
    assert [bool(answer.error) for answer in answers] == [source.name in ("3", "short") for source in sources]
    described = Describe({}, settings={"beams": 2, "decoding": "beam"})(sources[:1])
    assert len(described[0].rows[0]["hypotheses"]) == 2


def test_a_file_of_a_damaged_zip_is_named(folder: Path, packed: Path, tmp_path: Path) -> None:
    content = bytearray(packed.read_bytes())
    at = content.index(b"HIERARCHY") if b"HIERARCHY" in content else 60
    content[at + 20] ^= 0xFF
    (tmp_path / "bad.zip").write_bytes(content)
    result = run("check", tmp_path / "bad.zip")
    assert f"{tmp_path / 'bad.zip' / '0.bvh'}" in result.stdout.replace("\n", "")
    assert "cannot be unpacked: Bad CRC-32" in result.stdout


def test_an_unknown_bundle_is_one_message_also_from_other_processes(folder: Path, tmp_path: Path) -> None:
    check_refused(run("describe", folder, "--bundle", "nobody", "--jobs", 2), "nobody", tmp_path)


class Two(Describe):
    """Answers two at once."""

    most = 2  # type: ignore[assignment]


def test_of_long_motions_no_more_windows_than_needed_are_in_memory(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walk = motet.read(folder / "0.bvh").resample(10)
    for number, times in enumerate((1, 40, 1, 40)):  # 40 times are longer than a window
        motet.write(tmp_path / f"{number}.bvh", replace(walk, values=np.concatenate([walk.values] * times)))
    sources = [Source(path) for path in files_of([tmp_path])]
    at_once, verb = list[int](), Two({})
    whole, describe = Describe({})(sources), verb.model.describe
    monkeypatch.setattr(verb.model, "describe", lambda found, **k: at_once.append(len(found)) or describe(found, **k))
    assert [len(answer.rows) for answer in whole] == [1, 2, 1, 2]
    assert [answer.rows for answer in verb(sources)] == [answer.rows for answer in whole]
    assert at_once == [3, 3, 0]


def test_what_goes_to_a_cluster_and_back_are_pickles(clips: Path) -> None:
    actor = ray_engine.Actor(pickle.dumps(Check({})), Path.cwd())
    found = actor({"source": [pickle.dumps(Source(clips / "39_14.amc"))]})
    (answer,) = map(pickle.loads, found["answer"])
    assert answer.rows == Check({}).alone(Source(clips / "39_14.amc")).rows
