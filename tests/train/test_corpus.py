import json
import shutil
import time
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit_zip import JOINTS, mmm_xml, write_kit_zip
from stores import prepare

from motet.figures.feet.treadmill import with_travel
from motet.formats import read_motion, write_motion
from motet.formats.glb import container
from motet.formats.gltf_data import parse
from motet.formats.mmm import read
from motet.motion import in_place
from motet_train.data import recorded
from motet_train.data.archive import Archive
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.corpus import Record, Skipped, read_corpus, recordings
from motet_train.data.errors import DataError
from motet_train.data.preparation import SIXD
from motet_train.data.recorded import gaits_of
from motet_train.data.table import Person, person, read_gaits, read_people, read_table


def of(corpus: object) -> tuple[dict[str, Record], dict[str, str]]:
    """Records by name, and the reasons of what was skipped."""
    items = list(corpus)  # type: ignore[call-overload]
    records = {item.name: item for item in items if isinstance(item, Record)}
    return records, {item.name: item.reason for item in items if isinstance(item, Skipped)}


def table(path: Path, *rows: str, header: str = "clip\tsentence") -> Path:
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Three recordings, two of them AMC with a skeleton in another folder, beside a table."""
    folder = tmp_path / "own"
    (folder / "amc").mkdir(parents=True)
    (folder / "asf").mkdir()
    for clip in ("02_06", "09_07"):
        shutil.copy(CMU_FOLDER / f"{clip}.amc", folder / "amc" / f"{clip}.amc")
        shutil.copy(CMU_FOLDER / f"{clip}.asf", folder / "asf" / f"{clip[:2]}.asf")
    write_motion(folder / "stroll.npz", read_motion(CMU_FOLDER / "39_14.amc"))
    rows = ("02_06\tbend\tSomeone bends.", "09_07\trun\tA person runs.", "09_07\trun\tSomebody runs fast.")
    table(folder / "texts.tsv", *rows, "stroll\twalk\tA man walks.", header="clip\tdescription\tsentence")
    return folder


def zipped(folder: Path) -> Path:
    path = folder.with_suffix(".zip")
    with zipfile.ZipFile(path, "w") as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file() and file.suffix != ".tsv":
                archive.write(file, file.relative_to(folder))
        archive.writestr("__MACOSX/amc/._02_06.amc", b"\0")
    shutil.move(folder / "texts.tsv", path.parent / "texts.tsv")
    return path


@pytest.mark.parametrize("pack", [lambda folder: folder, zipped])
def test_a_folder_and_a_zip_give_the_same_records(own: Path, pack: object) -> None:
    corpus = read_corpus(pack(own))  # type: ignore[operator]
    records, skipped = of(corpus)
    assert (len(corpus), list(records), skipped) == (3, ["02_06", "09_07", "stroll"], {})
    assert not corpus.kit
    assert records["09_07"].sentences == ("A person runs.", "Somebody runs fast.")
    assert [record.subject for record in records.values()] == ["02", "09", "stroll"]
    for clip in ("02_06", "09_07"):
        np.testing.assert_array_equal(records[clip].motion.values, read_motion(CMU_FOLDER / f"{clip}.amc").values)
    assert [len(list(corpus)) for _ in range(2)] == [3, 3]


def test_what_cannot_be_used_is_named_and_skipped(own: Path) -> None:
    text = (own / "amc" / "02_06.amc").read_text()
    (own / "amc" / "02_06.amc").write_text(text[: len(text) // 2])
    (own / "asf" / "09.asf").rename(own / "asf" / "10.asf")
    shutil.copy(own / "stroll.npz", own / "amc" / "stroll.npz")
    shutil.copy(own / "stroll.npz", own / "silent.npz")
    with (own / "texts.tsv").open("a") as file:
        file.write("empty\tx\t  \nlost\tx\tA person is lost.\n\n")
    records, skipped = of(read_corpus(zipped(own)))
    assert list(records) == ["stroll"]
    assert skipped["02_06"].startswith("amc/02_06.amc, line ")
    assert set(skipped) == {"02_06", "09_07", "silent", "stroll", "lost"}
    assert skipped["silent"] == "no sentence"
    assert skipped["stroll"] == "a second motion of this name: stroll.npz"
    assert skipped["lost"] == "no motion file of this name"


def test_clips_of_one_name_in_two_folders_are_told_apart_by_their_path(tmp_path: Path) -> None:
    for folder in ("ann", "bob"):
        (tmp_path / folder).mkdir()
        shutil.copy(CMU_FOLDER / "09_07.amc", tmp_path / folder / "run.amc")
        shutil.copy(CMU_FOLDER / "09_07.asf", tmp_path / folder / "run.asf")
    table(tmp_path / "texts.tsv", "ann/run\tAnn runs.", "bob/run\tBob runs.")
    records, _ = of(read_corpus(tmp_path))
    said = {name: record.sentences for name, record in records.items()}
    assert said == {"ann/run": ("Ann runs.",), "bob/run": ("Bob runs.",)}


def test_who_moved_is_what_the_table_says_or_the_beginning_of_the_name(own: Path) -> None:
    rows = (
        "02_06\tann\tSomeone bends.",
        "09_07\t\tA person runs.",
        "09_07\t\tSomebody runs.",
        "stroll\tann\tHe walks.",
    )
    table(own / "texts.tsv", *rows, header="clip\tsubject\tsentence")
    records, _ = of(read_corpus(own))
    subjects = {name: record.subject for name, record in records.items()}
    assert subjects == {"02_06": "ann", "09_07": "09", "stroll": "ann"}
    with pytest.raises(DataError, match="line 3: the subject of a is 'y', and 'x' above"):
        read_table(table(own / "texts.tsv", "a\tx\tOne.", "a\ty\tTwo.", header="clip\tsubject\tsentence"))


def test_of_two_places_the_later_counts(own: Path, tmp_path: Path) -> None:
    more = tmp_path / "more"
    (more / "amc").mkdir(parents=True)
    bend = read_motion(CMU_FOLDER / "02_06.amc")
    write_motion(more / "amc" / "02_06.amc", bend[:50])
    (more / "amc" / "02_06.asf").rename(more / "amc" / "02.asf")
    for first in (own, zipped(own)):
        records, skipped = of(read_corpus([first, more], own.parent / "texts.tsv" if first != own else None))
        assert (list(records), skipped) == (["02_06", "09_07", "stroll"], {})
        assert len(records["02_06"].motion) == 50
    with pytest.raises(DataError, match="no such corpus"):
        read_corpus([own, tmp_path / "none"])


def test_sentences_of_the_pool_for_tests_are_kept_apart(tmp_path: Path) -> None:
    header = "clip\tsentence\tpool"
    rows = ("run\tA person runs.\ttrain", "run\tSomeone jogs.\ttest", "run\tHe runs.\t", "bend\tShe bends.\ttest")
    found = read_table(table(tmp_path / "texts.tsv", *rows, header=header))
    assert list(found) == ["run"]
    assert (found["run"].sentences, found["run"].unseen) == (["A person runs.", "He runs."], ["Someone jogs."])
    with pytest.raises(DataError, match="line 2: the pool is one of train, test, not 'dev'"):
        read_table(table(tmp_path / "texts.tsv", "run\tHe runs.\tdev", header=header))


def test_a_table_of_people_says_who_moves_by_patterns(tmp_path: Path) -> None:
    rows = ("Male1_*\tMale1\t", "60_*\t60 and 61\tdance", "*\tsomebody\t")
    people = read_people(table(tmp_path / "people.tsv", *rows, header="clip\tsubject\ttake"))
    assert person(people, "some/Male1_A_B").subject == "Male1"
    assert (person(people, "60_02").subject, person(people, "60_02").take) == ("60 and 61", "dance")
    assert person(people, "39_01").subject == "somebody"
    assert person(people[:1], "39_01") == Person("39_01", "39")
    with pytest.raises(DataError, match="needs the columns clip and subject"):
        read_people(table(tmp_path / "texts.tsv", "a\tb"))


def test_a_column_or_a_table_of_patterns_says_which_gaits_are_shown(own: Path) -> None:
    rows = ("02_06\tSomeone bends.\t\t", "09_07\tA person runs.\trun\trun, jog", "stroll\tA man walks.\t\twalk")
    table(own / "texts.tsv", *rows, header="clip\tsentence\tdescription\tgait")
    patterns = own / "gaits.toml"
    patterns.write_text('[[gait]]\nname = "sprint"\nactions = ["r*"]\n\n[[gait]]\nname = "walk"\nactions = ["s*"]\n')
    for gaits, expected in (
        ((), [(), ("run", "jog"), ("walk",)]),
        (read_gaits(patterns), [(), ("run", "jog", "sprint"), ("walk",)]),
    ):
        store = prepare(read_corpus(own, gaits=gaits), own.parent / f"store{len(gaits)}", SIXD)
        assert [record.gaits for record in store.records] == expected
        assert next(iter(gaits_of(store))).name == "walk"  # of the most frames: what a figure starts in
    unsaid = replace(store, records=tuple(replace(record, gaits=()) for record in store.records))
    assert gaits_of(unsaid) == read_gaits()
    with pytest.raises(DataError, match="shows the gait 'walk': name gaits in a column gait"):
        recorded.recordings(unsaid, gaits_of(unsaid))
    for wrong in ('name = "sprint"', 'name = 3\nactions = ["s*"]', 'name = "sprint"\nactions = ["s*", 3]'):
        patterns.write_text(f"[[gait]]\n{wrong}\n")
        with pytest.raises(DataError, match=r"gaits\.toml is not a table of gaits"):
            read_gaits(patterns)


def test_clips_in_place_travel_and_periods_repeat(own: Path) -> None:
    standing = in_place(read_motion(CMU_FOLDER / "39_14.amc"))
    write_motion(own / "stroll.npz", standing)
    rows = ("stroll\tA man walks.\tyes\tno", "stroll\tSomebody walks.\t\tyes")
    table(own / "texts.tsv", *rows, header="clip\tsentence\tin_place\tloops")
    found = of(read_corpus(own))[0]["stroll"]
    assert found.loops
    np.testing.assert_array_equal(found.motion.values, with_travel(read_motion(own / "stroll.npz")).values)
    short = replace(found, motion=found.motion[: round(1.2 * found.motion.fps)])
    once, often = (
        prepare([replace(short, loops=loops)], own.parent / f"loops-{loops}", SIXD) for loops in (False, True)
    )
    period, sequence = once.sequence(0), often.sequence(0)
    np.testing.assert_array_equal(sequence, np.concatenate([period, period[1:], period[1:]]))
    assert 105 < len(sequence) < 105 + len(period)


def test_recordings_need_no_table(own: Path) -> None:
    (own / "02_06.npz").write_bytes(b"no motion")
    with Archive(own) as archive:
        found = {item.name: item for item in recordings(archive)}
    assert list(found) == ["02_06", "09_07", "stroll"]
    assert isinstance(found["02_06"], Skipped)
    run = found["09_07"]
    assert (run.subject, run.sentences) == ("09", ())


def test_a_long_table_is_read_in_time(tmp_path: Path) -> None:
    path = table(tmp_path / "texts.tsv", *(f"clip\t{'word ' * 5}{i}" for i in range(100_000)), f"long\t{'x' * 200_000}")
    start = time.process_time()
    found = read_table(path)
    assert time.process_time() - start < 5
    assert (len(found["clip"].sentences), len(found["long"].sentences[0])) == (100_000, 200_000)


def test_a_length_unit_can_be_given(tmp_path: Path) -> None:
    write_motion(tmp_path / "run.bvh", read_motion(CMU_FOLDER / "09_07.amc"))
    table(tmp_path / "texts.tsv", "run\tA person runs.")
    records = [of(read_corpus(tmp_path, unit=unit))[0] for unit in (None, "cm", 0.5)]
    skeletons = [found["run"].motion.skeleton for found in records]
    assert [skeleton and skeleton.metres_per_unit for skeleton in skeletons] == [None, 0.01, 0.5]


def test_a_length_unit_is_that_of_files_which_do_not_say_theirs(own: Path) -> None:
    metres, plain = (of(read_corpus(own, unit=unit))[0] for unit in ("m", None))
    assert metres.keys() == plain.keys()
    assert all(metres[name].motion.skeleton == record.motion.skeleton for name, record in plain.items())


def test_each_clip_of_a_file_is_a_motion_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "many.glb"
    write_motion(path, read_motion(CMU_FOLDER / "09_07.amc"))
    gltf = parse(path)
    walk, *_ = gltf.document["animations"]
    document = gltf.document | {"animations": [walk | {"name": "Run"}, walk | {"name": "Jump/1"}]}
    path.write_bytes(container(document, gltf.buffers[0]))
    table(tmp_path / "texts.tsv", "many#Run\tA person runs.", "many#Jump/1\tA person jumps.", "many\tNobody.")
    for corpus in (tmp_path, zipped(tmp_path)):
        records, skipped = of(read_corpus(corpus))
        said = {name: record.sentences for name, record in records.items()}
        assert said == {"many#Run": ("A person runs.",), "many#Jump/1": ("A person jumps.",)}
        assert skipped == {"many": "no motion file of this name"}


@pytest.mark.parametrize(
    ("rows", "header", "reason"),
    [
        ((), "clip,sentence", "line 1: the header needs the columns clip and sentence"),
        (("a\tb\tc",), "clip\tsentence", "line 2: 3 columns where the header has 2"),
        (("a\tb", "", "c"), "clip\tsentence", "line 4: 1 columns"),
        (("a\tb\tno", "a\tb\tperhaps"), "clip\tsentence\tloops", "line 3: loops is yes or no, not 'perhaps'"),
    ],
)
def test_a_table_that_is_none_is_refused_with_its_line(
    tmp_path: Path, rows: tuple[str, ...], header: str, reason: str
) -> None:
    with pytest.raises(DataError, match=reason):
        read_table(table(tmp_path / "texts.tsv", *rows, header=header))


def test_what_is_no_corpus_is_refused(tmp_path: Path, own: Path) -> None:
    with pytest.raises(DataError, match="no such corpus"):
        read_corpus(tmp_path / "none")
    (tmp_path / "bad.zip").write_text("no zip")
    with pytest.raises(DataError, match="neither a folder nor a readable zip"):
        read_corpus(tmp_path / "bad.zip")
    with zipfile.ZipFile(tmp_path / "silent.zip", "w") as archive:
        archive.writestr("00001_mmm.xml", mmm_xml(10))
    with pytest.raises(DataError, match=r"no motion files .*nor KIT's NNNNN_annotations\.json"):
        read_corpus(tmp_path / "silent.zip")
    (own / "texts.tsv").unlink()
    with pytest.raises(DataError, match=r"needs one table of sentences .*found: none"):
        read_corpus(own)


@pytest.mark.parametrize("inside", ["", "release/2016/"])
def test_kit_is_read_from_a_zip_or_a_folder(tmp_path: Path, inside: str) -> None:
    path = write_kit_zip(tmp_path / "kit.zip", 5, (0.1, 0.4))
    folder = tmp_path / "kit" / inside
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    for place in (path, tmp_path / "kit"):
        corpus = read_corpus(place)
        records, skipped = of(corpus)
        assert (len(corpus), corpus.kit, skipped) == (5, True, {})
        assert list(records) == [f"{number:05}" for number in range(1, 6)]
        for name, record in records.items():
            np.testing.assert_array_equal(record.motion.values, read(folder / f"{name}_mmm.xml").values)
            assert list(record.sentences) == json.loads((folder / f"{name}_annotations.json").read_text())
        assert [record.subject for record in records.values()] == [f"subject_id_{n % 5}" for n in range(1, 6)]
        assert records["00001"].motion.channels[6:] == JOINTS


def test_bad_files_of_kit_are_named_and_skipped(tmp_path: Path) -> None:
    path = tmp_path / "kit.zip"
    texts = {"1": "[]", "2": '["A person walks."]', "3": '["   "]', "4": "[1]", "5": "no json", "6": '["Fine."]'}
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in texts.items():
            archive.writestr(f"{name}_annotations.json", text)
            archive.writestr(f"{name}_mmm.xml", mmm_xml(20) if name != "2" else mmm_xml(20)[:900])
        archive.writestr("7_mmm.xml", mmm_xml(20))
    records, skipped = of(read_corpus(path))
    assert list(records) == ["6"]
    assert [skipped[name] for name in "137"] == ["no sentence"] * 3
    assert skipped["2"].startswith("2_mmm.xml, line ")
    assert skipped["4"] == "4_annotations.json is not a list of sentences"
    assert skipped["5"].startswith("5_annotations.json is not JSON")


def test_a_damaged_zip_member_is_skipped(tmp_path: Path) -> None:
    path = write_kit_zip(tmp_path / "kit.zip", 3, (0.1, 0.4))
    with zipfile.ZipFile(path) as archive:
        info = archive.getinfo("00002_mmm.xml")
    content = bytearray(path.read_bytes())
    middle = info.header_offset + 60 + info.compress_size // 2
    content[middle : middle + 20] = bytes(20)
    path.write_bytes(content)
    records, skipped = of(read_corpus(path))
    assert (list(records), list(skipped)) == (["00001", "00003"], ["00002"])
