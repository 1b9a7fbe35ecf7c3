import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit_zip import JOINTS, write_kit_zip
from language_data import walker
from stores import prepare
from trainings import done, refused

from motet.errors import OutputError
from motet.figures.humanoid import on_humanoid
from motet.figures.humanoid.bones import HUMANOID, MIXAMO
from motet.figures.humanoid.retarget import from_humanoid, to_humanoid
from motet.figures.trimming import trim
from motet.formats import read_motion, write_motion
from motet.motion.kinematics import euler_of, local_rotations, positions, with_channels
from motet.motion.motion import Motion
from motet.representation.contract import LIVING_STD, sequences
from motet.representation.root_block import ROOT_BLOCK, from_root_block
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.corpus import Record, Skipped, read_corpus
from motet_train.data.errors import DataError
from motet_train.data.preparation import ANGLES, FULL, SIXD, VECTORS, Preparation, preparation
from motet_train.data.store import Entry, Store, prepare_parts, split

PLAIN = Preparation("root_angles", humanoid=False, trim=False, cut=False)


def cmu(clip: str = "09_07", name: str = "") -> Record:
    return Record(name or clip, clip[:2], read_motion(CMU_FOLDER / f"{clip}.amc"), ("A person moves.",))


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return prepare([cmu("02_06"), cmu("09_07")], tmp_path_factory.mktemp("store") / "cmu", PLAIN)


def test_each_offset_is_a_sequence_of_the_contracts_frames(store: Store) -> None:
    contract = store.contract([0, 1])
    assert contract.channels[:6] == ROOT_BLOCK
    assert (len(contract.channels), contract.fps, contract.skeleton.metres_per_unit) == (62, 10, 1)
    for number, entry in enumerate(store.records):
        motion = read_motion(CMU_FOLDER / f"{entry.name}.amc")
        assert len(entry.spans) == 12
        for offset in (0, 5, 11):
            expected = contract.frames(motion[offset:])
            np.testing.assert_array_equal(store.sequence(number, offset), expected.astype(np.float32))
    assert np.shares_memory(store.sequence(1), store.frames)


def test_mean_and_deviation_are_those_of_the_records_asked_for(store: Store) -> None:
    for indices in ([0], [1], [0, 1]):
        frames = np.concatenate([store.sequence(i, offset) for i in indices for offset in range(12)]).astype(np.float64)
        contract = store.contract(indices)
        np.testing.assert_allclose(contract.mean, frames.mean(axis=0), rtol=1e-6, atol=1e-9)
        std = frames.std(axis=0)
        np.testing.assert_allclose(
            contract.std, np.where(std < [LIVING_STD[unit] for unit in store.units], 0, std), rtol=1e-6
        )
        assert not contract.std[contract.channels.index("lfingers.rx")]
    with pytest.raises(DataError, match="at least one record"):
        store.contract([])


def test_the_store_is_what_numpy_reads(store: Store, tmp_path: Path) -> None:
    prepare([cmu()], tmp_path / "one", PLAIN)
    frames = np.load(tmp_path / "one" / "frames.npy")
    assert (frames.dtype, frames.shape) == (np.float32, (138, 62))
    np.testing.assert_array_equal(frames, store.frames[-138:])
    assert sorted(file.name for file in (tmp_path / "one").iterdir()) == ["frames.npy", "store.json"]


def test_another_rate_gives_one_interpolated_sequence(tmp_path: Path) -> None:
    record = cmu("02_06")
    odd = replace(record, motion=replace(record.motion, fps=59.94))
    found = prepare([odd], tmp_path / "odd", PLAIN)
    assert len(found.records[0].spans) == 1
    assert len(found.sequence(0)) == round(len(record.motion) / 5.994)


def test_kits_angles_are_stored_in_radians_without_the_root(tmp_path: Path) -> None:
    corpus = read_corpus(write_kit_zip(tmp_path / "kit.zip", 4))
    found = prepare(corpus, tmp_path / "store", ANGLES)
    contract = found.contract(range(4))
    assert (found.channels, set(found.units), found.skeleton) == (JOINTS, {"rad"}, None)
    for number, item in enumerate(corpus):
        assert len(found.records[number].spans) == 10
        for offset in (0, 9):
            expected = contract.frames(item.motion[offset:])
            np.testing.assert_array_equal(found.sequence(number, offset), expected.astype(np.float32))


def test_channels_in_another_order_are_put_in_order(store: Store, tmp_path: Path) -> None:
    record = cmu()
    turned = replace(record, name="turned", motion=record.motion.select(record.motion.channels[::-1]))
    found = prepare([record, turned], tmp_path / "both", PLAIN)
    np.testing.assert_array_equal(found.sequence(0, 3), found.sequence(1, 3))


def lame(motion: Motion) -> Motion:
    return motion.select(tuple(name for name in motion.channels if not name.startswith("lfoot")))


def bent(motion: Motion) -> Motion:
    """A figure whose left thigh lies at a right angle to where it should at rest."""
    joints = motion.skeleton.joints
    turned = [replace(j, offset=(0.0, j.offset[2], -j.offset[1])) if j.name == "ltibia" else j for j in joints]
    return replace(motion, skeleton=replace(motion.skeleton, joints=tuple(turned)))


def test_what_does_not_fit_is_skipped_with_its_reason(tmp_path: Path) -> None:
    run, bend = cmu(), cmu("02_06").motion
    long = Motion(np.tile(bend.values, (11, 1)), bend.channels, bend.units, bend.fps, bend.skeleton)
    others = {
        "frame": (run.motion[:1], "0.00833 s (1 frames)"),
        "long": (long, "31.3 s"),
        "lame": (lame(run.motion), "lacks 2 of 62 channels: lfoot.rx, lfoot.rz"),
        "bent": (bent(run.motion), "the bone to 'ltibia' points 90 degrees away"),
        "rootless": (run.motion.select(run.motion.channels[3:]), "lacks root.tx, root.ty, root.tz"),
    }
    records = [replace(run, name=name, motion=motion) for name, (motion, _) in others.items()]
    seen: list[object] = []
    prepare_parts([run, Skipped("gone", "it is gone"), *records], tmp_path / "store", {".": PLAIN}, seen.append)
    found = Store.open(tmp_path / "store")
    assert [entry.name for entry in found.records] == ["09_07"]
    assert len(found.frames) == 138
    reasons = {item.name: item.reason for item in found.skipped}
    assert reasons.pop("gone") == "it is gone"
    for name, (_, reason) in others.items():
        assert reason in reasons[name]
    assert [item.name for item in seen] == ["09_07", "gone", *others]  # type: ignore[attr-defined]


def test_everybody_keeps_their_own_bones(tmp_path: Path) -> None:
    people = [cmu(), cmu("02_06"), cmu("09_07", "again")]
    found = prepare(people, tmp_path / "store", PLAIN)
    assert ([entry.skeleton for entry in found.records], len(found.skeletons)) == ([0, 1, 0], 2)
    for number, record in enumerate(people):
        own = record.motion.skeleton
        features = found.motion(number)
        assert features.skeleton == own.scaled(1.0)
        # metres of this person's root go with this person's legs
        expected = record.motion.continuous().resample(10)
        apart = positions(from_root_block(features))
        places = positions(expected) * own.metres_per_unit
        np.testing.assert_allclose(
            np.linalg.norm(np.diff(apart, axis=1), axis=-1), np.linalg.norm(np.diff(places, axis=1), axis=-1), atol=1e-5
        )


def test_lengths_of_all_joints_are_scaled_with_the_skeleton(tmp_path: Path) -> None:
    """A figure in centimetres whose spine has a translation of its own, as in files of many studios."""
    motion = walker(0, 60)
    spine = replace(
        motion.scaled(0.01),
        values=np.column_stack([motion.scaled(0.01).values, np.full(60, 30.0)]),
        channels=(*motion.channels, "spine.ty"),
        units=(*motion.units, "length"),
    )
    found = prepare([Record("x", "x", spine, ("A person walks.",))], tmp_path / "store", PLAIN)
    features = found.motion(0)
    assert features.units[features.channels.index("spine.ty")] == "m"
    np.testing.assert_allclose(features.values[:, features.channels.index("spine.ty")], 0.3, rtol=1e-6)
    tall = np.ptp(positions(from_root_block(features))[0, :, 1])
    assert tall == pytest.approx(np.ptp(positions(motion)[0, :, 1]), abs=0.01)


def test_joints_about_other_axes_are_brought_to_the_first_ones(tmp_path: Path) -> None:
    record = cmu()
    skeleton = record.motion.skeleton
    place = skeleton.index("lfemur")
    turned = replace(skeleton.joints[place], order="xyz", axis=(0.0, 30.0, 0.0))
    rotations = local_rotations(record.motion, [place])[:, 0]
    names = tuple(f"lfemur.r{axis}" for axis in "xyz")
    joints = (*skeleton.joints[:place], turned, *skeleton.joints[place + 1 :])
    motion = with_channels(record.motion, names, np.degrees(euler_of(rotations, turned)), ("deg",) * 3)
    other = replace(record, name="x", motion=replace(motion, skeleton=replace(skeleton, joints=joints)))
    found = prepare([record, other], tmp_path / "store", PLAIN)
    np.testing.assert_allclose(found.sequence(1), found.sequence(0), atol=1e-4)


def test_a_store_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    def broken() -> Iterator[Record]:
        yield cmu()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        prepare(broken(), tmp_path / "store", PLAIN)
    with pytest.raises(DataError, match="no motion can be used, 1 were skipped: x: because"):
        prepare([Skipped("x", "because")], tmp_path / "store", PLAIN)
    assert not list(tmp_path.iterdir())
    (tmp_path / "store").mkdir()
    with pytest.raises(OutputError, match="it exists"):
        prepare([cmu()], tmp_path / "store", PLAIN)


def test_a_folder_that_is_no_store_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="not a prepared store"):
        Store.open(tmp_path)
    prepare([cmu()], tmp_path / "store", PLAIN)
    frames = np.load(tmp_path / "store" / "frames.npy")
    np.save(tmp_path / "store" / "frames.npy", frames[:-1])
    with pytest.raises(DataError, match="does not match"):
        Store.open(tmp_path / "store")


def entries(sizes: list[int]) -> list[Entry]:
    return [Entry(f"{s}_{n}", f"{s}", ("x",), ((0, 1),)) for s, size in enumerate(sizes) for n in range(size)]


@pytest.mark.parametrize("by", ["trial", "subject"])
def test_a_split_is_a_partition_of_about_80_10_10(by: str) -> None:
    everything = entries([20, 5, 10, 3, 40, 7, 8, 2, 5])
    for seed in range(20):
        found = split(everything, seed, by)
        assert found == split(everything, seed, by)
        assert sorted(found.train + found.validation + found.test) == list(range(100))
        sizes = [len(found.validation), len(found.test)]
        assert sizes == [10, 10] if by == "trial" else 2 <= min(sizes) <= max(sizes) <= 10
        if by == "subject":
            people = [{everything[i].subject for i in part} for part in (found.train, found.validation, found.test)]
            assert sum(map(len, people)) == len(set.union(*people)) == 9
    assert split(everything, 0, by) != split(everything, 1, by)


def test_a_split_by_none_trains_on_everything() -> None:
    everything = entries([20, 5, 10])
    found, usual = split(everything, 0, "none"), split(everything, 0)
    assert found.train == tuple(range(35))
    assert (found.validation, found.test) == (usual.validation, usual.test)


def test_a_split_of_too_little_is_refused() -> None:
    with pytest.raises(DataError, match="2 motions of 2 trials are too few"):
        split(entries([2]), 0)
    with pytest.raises(DataError, match="100 motions of 2 subjects are too few"):
        split(entries([50, 50]), 0, "subject")
    assert [len(part) for part in (split(entries([3]), 0).validation, split(entries([3]), 0).test)] == [1, 1]
    with pytest.raises(DataError, match="by trial, by subject, by none or by a pattern"):
        split(entries([30]), 0, "day")


def test_codes_are_made_of_what_is_above_the_floor() -> None:
    standing = on_humanoid(cmu().motion)
    values = standing.values - 0.3 * np.array([name == "hips.ty" for name in standing.channels])
    lowest = []
    for how in (SIXD, replace(SIXD, floor=False)):
        (piece,) = how.pieces(replace(standing, values=values))
        lowest.append(positions(piece)[..., 1].min())
    assert lowest[0] > -0.02
    assert lowest[1] < -0.2


def still(motion: Motion, before: int, after: int) -> Motion:
    values = np.concatenate([motion.values[:1].repeat(before, 0), motion.values, motion.values[-1:].repeat(after, 0)])
    return replace(motion, values=values)


def test_half_a_second_of_stillness_is_kept() -> None:
    run = cmu().motion
    np.testing.assert_array_equal(trim(run).values, run.values)
    trimmed = trim(still(run, 360, 240))
    # the first and last quarter of a second of movement show it, so that much more stillness may stay
    assert 0 <= len(trimmed) - (len(run) + 120) <= 60
    np.testing.assert_array_equal(trim(still(run, 10, 20)).values, still(run, 10, 20).values)
    frozen = still(run[:1], 300, 300)
    assert len(trim(frozen)) == len(frozen)


def test_a_leap_from_another_pose_is_cut_off() -> None:
    run = cmu().motion
    away = np.array(run.values)
    away[:7, :3] += 300
    away[-4:, :3] -= 300
    trimmed = trim(replace(run, values=away))
    np.testing.assert_array_equal(trimmed.values, run.values[7:-4])
    middle = np.array(run.values)
    middle[66:, :3] += 300
    assert len(trim(replace(run, values=middle))) == len(run)
    assert len(trim(run[:1])) == 1


def test_trimming_never_moves_a_joint() -> None:
    bend = still(cmu("02_06").motion, 200, 0)
    trimmed = trim(bend)
    start = len(bend) - len(trimmed)
    np.testing.assert_allclose(positions(trimmed), positions(bend)[start:])


def test_the_command_prepares_and_names_what_it_skips(tmp_path: Path) -> None:
    path = write_kit_zip(tmp_path / "kit.zip", 3)
    out = tmp_path / "stores" / "store"
    output = done("prepare", path, "--out", out).output
    assert "3 motions of" in output
    assert "6 sentences, 44 channels at 10 fps; 0 skipped" in output
    assert len(Store.open(out).records) == 3
    refused("it exists", "prepare", path, "--out", out)
    assert json.loads((out / "store.json").read_text())["channels"] == list(JOINTS)
    assert [path.name for path in out.parent.iterdir()] == ["store"]


def test_when_most_motions_do_not_fit_the_first_it_is_named(tmp_path: Path) -> None:
    for name, channels in (("a", 62), ("b", 61), ("c", 61)):
        motion = cmu().motion
        write_motion(tmp_path / f"{name}.npz", motion.select(motion.channels[:channels]))
    (tmp_path / "said.tsv").write_text("clip\tsentence\n" + "".join(f"{name}\tA person runs.\n" for name in "abc"))
    result = done("prepare", tmp_path, "--figure", "own", "--out", tmp_path / "store")
    assert "2 skipped" in result.stdout
    assert "channels and axes are taken from the first, a" in result.stderr


def test_how_a_corpus_is_prepared_for_a_verb() -> None:
    assert preparation("describe", kit=True) == ANGLES
    assert preparation("describe", kit=True, figure="humanoid") == preparation("generate", kit=False) == FULL
    assert preparation("codes", kit=False) == SIXD
    assert preparation("predict", kit=True) == preparation("predict", kit=False) == VECTORS
    own = preparation("describe", kit=False, figure="own", fps=30)
    assert own == replace(FULL, humanoid=False, fps=30)
    assert {ANGLES.fps, FULL.fps, ANGLES.longest, FULL.longest} == {10, 30}


def test_a_long_motion_is_cut_into_pieces_that_share_what_is_said(tmp_path: Path) -> None:
    bend = cmu("02_06").motion
    long = replace(bend, values=np.tile(bend.values, (22, 1)))
    record = Record("bends", "02", long, ("A person bends.",), ("Somebody bows.",))
    found = prepare([record, cmu()], tmp_path / "store", replace(PLAIN, cut=True))
    assert [entry.name for entry in found.records] == ["bends.1", "bends.2", "bends.3", "09_07"]
    takes = [("bends", False), ("bends", False), ("bends", True), ("09_07", True)]
    assert [(entry.take, entry.ends) for entry in found.records] == takes
    assert {(entry.sentences, entry.unseen) for entry in found.records[:3]} == {(record.sentences, record.unseen)}
    lengths = [stop - start for entry in found.records[:3] for start, stop in entry.spans]
    assert (sum(lengths), max(lengths) - min(lengths)) == (len(long), 1)
    assert max(lengths) < 10 * PLAIN.longest
    whole = next(sequences(PLAIN.representation, long, PLAIN.fps)).values
    np.testing.assert_allclose(found.sequence(0)[:-2], whole[: len(found.sequence(0)) - 2], atol=1e-3)


def test_figures_of_all_kinds_become_one_store(tmp_path: Path) -> None:
    """A walk in CMU's joints, and the same on a skeleton with other names and proportions."""
    walk = read_motion(CMU_FOLDER / "39_14.amc")[:240]
    other = from_humanoid(to_humanoid(walk).motion, MIXAMO)
    records = [Record(name, name, motion, ("A person walks.",)) for name, motion in (("a", walk), ("b", other))]
    found = prepare(records, tmp_path / "store", FULL)
    assert ([entry.skeleton for entry in found.records], found.skeletons) == ([0, 0], (HUMANOID,))
    speeds = [found.sequence(number)[:, found.channels.index("root.forward")] for number in range(2)]
    np.testing.assert_allclose(*speeds, atol=0.02)
    angles = [column for column, unit in enumerate(found.units) if unit == "deg"]
    apart = np.abs(found.sequence(0)[:, angles] - found.sequence(1)[:, angles])
    assert apart.mean() < 1


def test_takes_are_not_divided() -> None:
    everything = [replace(entry, take=entry.name[:3]) for entry in entries([30, 30, 30])]
    for seed in range(5):
        parts = split(everything, seed)
        takes = [{everything[i].take for i in part} for part in (parts.train, parts.validation, parts.test)]
        assert sum(map(len, takes)) == len(set.union(*takes))
