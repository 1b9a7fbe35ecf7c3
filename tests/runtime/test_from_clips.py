"""A figure that is steered by a folder of clips: its tags, whether it goes where it is steered, saving, bad input."""

from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, run

import motet
from motet.bundle.bundle import Bundle
from motet.models.load import verify
from motet.motion.motion import Motion
from motet.steering import from_clips
from motet.steering.from_clips import Clip, recorded, tags_of
from motet.steering.model import SteerModel
from motet.steering.pose import Pose

SCRIPTS = {
    "walk_1": "walk 4s speed 1.2, turn left 90, walk 2s speed 1.2, turn right 120, walk 2s, turn left 45, walk 2s",
    "walk_stop": "stop 1s, walk 3s speed 1.4, stop 2s, walk 2s speed 1.0, stop 1s",
    "walk_back": "walk 4s backwards speed 1, walk 4s left speed 1, walk 4s right speed 1",
    "run_1": "run 4s speed 2.5, turn left 90, run 2s, turn right 90, run 2s",
    "idle": "stop 3s",
    "salute_01": "act jump, stop 2s",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, steer_model: SteerModel) -> Path:
    """Clips of the shipped figure, some in a folder below, and what is no clip."""
    place = tmp_path_factory.mktemp("clips")
    (place / "runs").mkdir()
    for name, script in SCRIPTS.items():
        motet.write(place / ("runs" if name.startswith("run") else ".") / f"{name}.bvh", steer_model.run(script))
    (place / "notes.txt").write_text("no clip")
    return place


@pytest.fixture(scope="module")
def model(folder: Path) -> SteerModel:
    return SteerModel.from_clips(folder)


@pytest.mark.parametrize(
    ("name", "tags"),
    [
        ("walk_01", {"walk"}),
        ("WalkTurnLeft90", {"walk"}),
        ("B5-JogToWalk", {"walk", "run"}),
        ("idle2", {"idle"}),
        ("TURN left", {"idle"}),
        ("high_jump", {"jump"}),
        ("wave_right_02", {"wave right"}),
        ("39_14", {"39_14"}),
        ("moves#Walk Loop", {"walk"}),
    ],
)
def test_a_clip_is_tagged_by_the_words_of_its_name(name: str, tags: set[str]) -> None:
    stem, _, clip = name.partition("#")
    assert tags_of(Clip(Path(f"a/{stem}.bvh"), clip or None)) == tags


def test_gaits_and_acts_are_those_of_the_clips(model: SteerModel, folder: Path) -> None:
    assert set(model.gaits) == {"walk", "run", "salute"}
    assert [model.usual[name] > 0 for name in ("walk", "run", "salute")] == [True, True, False]
    assert model.gaits[-1] == "salute"
    table = model.matcher.table
    idle = table.shows[:, model.gaits.index("walk")] & table.shows[:, model.gaits.index("run")]
    parts = recorded(Clip(folder / "idle.bvh", None), frozenset({"idle"}))
    assert idle.sum() == sum(len(part.features) for part in parts) > 45
    assert list(model.takes) == ["salute"]


def poses_of(model: SteerModel, ticks: int, **command: object) -> list[Pose]:
    session = model.start()
    session.control(**command)  # type: ignore[arg-type]
    return [session.tick() for _ in range(ticks)]


@pytest.mark.parametrize(
    ("gait", "speed", "direction", "faced"),
    [("walk", 1.2, 0.0, 0.0), ("walk", 1.0, 120.0, 120.0), ("run", 2.5, -60.0, -60.0), ("walk", 0.9, 90.0, 0.0)],
)
def test_it_goes_as_fast_and_where_it_is_steered(
    model: SteerModel, gait: str, speed: float, direction: float, faced: float
) -> None:
    facing = {} if faced == direction else {"facing": faced}
    poses = poses_of(model, 210, gait=gait, speed=speed, direction=direction, **facing)
    ground = np.array([pose.ground[0] for pose in poses])
    way = ground[-1, :2] - ground[90, :2]
    assert np.hypot(*way) / 119 * 30 == pytest.approx(speed, rel=0.06)
    assert np.degrees(np.arctan2(*way)) == pytest.approx(direction, abs=3)
    turned = np.degrees(ground[120:, 2]) - faced
    assert np.abs((turned + 180) % 360 - 180).mean() < 8


def test_it_stops_and_acts(model: SteerModel) -> None:
    session = model.start()
    session.control(speed=1.2)
    for _ in range(60):
        session.tick()
    session.control(speed=0)
    stopped = [session.tick() for _ in range(90)]
    assert np.abs(stopped[-1].ground - stopped[-30].ground).max() < 0.02
    session.act("salute")
    heights = [session.tick().height[0] for _ in range(60)]
    assert np.ptp(heights) > 0.1


def test_tags_say_what_names_do_not(folder: Path) -> None:
    files = [folder / "walk_1.bvh", folder / "idle.bvh", folder / "salute_01.bvh"]
    named = SteerModel.from_clips(files, tags={"walk_*": "stride", "salute_01": "hop over"})
    assert named.gaits == ("stride", "hop over")
    assert named.usual["stride"] == pytest.approx(1.2, abs=0.15)


def test_a_saved_figure_moves_the_same(model: SteerModel, tmp_path: Path) -> None:
    model.save(tmp_path / "mine.zip")
    verify(Bundle.open(tmp_path / "mine.zip"))
    loaded = motet.load(tmp_path / "mine.zip")
    assert isinstance(loaded, SteerModel)
    assert loaded.speeds == model.speeds
    for pose, other in zip(
        poses_of(model, 60, gait="run", speed=2.0), poses_of(loaded, 60, gait="run", speed=2.0), strict=True
    ):
        assert (pose.rotations == other.rotations).all()
        assert (pose.ground == other.ground).all()
    assert "walk" in motet.live_page(model)


def test_no_walk_no_figure(folder: Path) -> None:
    with pytest.raises(
        motet.MotionError, match=r"no clip walks or runs; tags are (salute, idle|idle, salute)\. .*tags="
    ):
        SteerModel.from_clips([folder / "idle.bvh", folder / "salute_01.bvh"])


def test_clips_that_cannot_be_used_are_named(folder: Path, clips: Path, tmp_path: Path) -> None:
    broken = tmp_path / "walk_broken.bvh"
    broken.write_text((folder / "walk_1.bvh").read_text()[:5000])
    short = tmp_path / "run_short.bvh"
    motet.write(short, motet.read(folder / "runs" / "run_1.bvh")[:20])
    table = tmp_path / "walk_table.bvh"
    channels = "Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    table.write_text(
        f"HIERARCHY\nROOT plate\n{{\nOFFSET 0 0 0\nCHANNELS 6 {channels}\nEnd Site\n{{\nOFFSET 0 1 0\n}}\n}}\n"
        "MOTION\nFrames: 90\nFrame Time: 0.0333333\n" + "0 0 0 0 0 0\n" * 90
    )
    with pytest.raises(motet.MotionError) as fault:
        SteerModel.from_clips([folder / "walk_1.bvh", broken, short, table])
    text = str(fault.value)
    assert text.startswith("3 of 4 clips cannot be used: walk_broken: ")
    assert "run_short: it lasts 0.67 s, and a clip needs 1.5 s" in text
    assert "walk_table: " in text
    assert text.endswith("Mend them, or leave them out: tags={'clip': None}")
    files = [folder / "walk_1.bvh", broken, short, table]
    assert SteerModel.from_clips(files, tags={"walk_[bt]*": None, "run_short": None}).gaits == ("walk",)


def test_folders_without_clips_and_wrong_arguments(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(motet.FormatError, match="no motion files"):
        SteerModel.from_clips(tmp_path)
    with pytest.raises(motet.MotionError, match="the list of motion files is empty"):
        SteerModel.from_clips([])
    with pytest.raises(motet.MotionError, match="1 of 1 clips cannot be used: walk"):
        SteerModel.from_clips([tmp_path / "walk.bvh"])
    with pytest.raises(motet.ArgumentError, match="expected a folder or a list"):
        SteerModel.from_clips(3)  # type: ignore[arg-type]
    with pytest.raises(motet.ArgumentError, match="no clip is called 'wlak_1'; there are idle"):
        SteerModel.from_clips(folder, tags={"wlak_1": "walk"})
    with pytest.raises(motet.ArgumentError, match="expected tags such as 'walk'"):
        SteerModel.from_clips(folder, tags={"walk_1": "walk,"})


def test_too_many_and_too_long_clips_are_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[Path] = []

    def counting(path: Path, **_: object) -> Motion:
        read.append(path)
        return motet.read(path)

    monkeypatch.setattr(from_clips, "read_motion", counting)
    with pytest.raises(motet.MotionError, match="10000 clips: a figure is made of at most 2000"):
        SteerModel.from_clips([folder / "walk_1.bvh"] * 10_000)
    assert read == []
    monkeypatch.setattr(from_clips, "MOST_SECONDS", 6)
    with pytest.raises(motet.MotionError, match=r"longer than 0\.1 minutes together"):
        SteerModel.from_clips([folder / "walk_1.bvh"] * 50)
    assert len(read) == 1


def test_a_script_is_run_by_clips(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.bvh"
    assert run("control", "walk 3s speed 1.2, stop", "--clips", folder, "-o", out).exit_code == 0
    assert motet.read(out).duration > 3
    out.unlink()
    check_refused(run("control", "walk 3s", "--clips", tmp_path, "-o", out), "no motion files", tmp_path)
