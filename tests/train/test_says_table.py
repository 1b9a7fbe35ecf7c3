"""The table of does what it says on made-up trials and generators, its measures, and the command."""

import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from says_figures import HIPS, led, shifted, standing, stepping, times, walking
from trainings import done, refused

import motet
import motet.keyed
from motet.errors import TextError, TextWarning
from motet.figures.humanoid.bones import HUMANOID
from motet.figures.humanoid.retarget import on_humanoid
from motet.motion.motion import Motion
from motet.representation.root_block import to_root_block
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.errors import DataError
from motet_train.data.store import INDEX, Entry, Store
from motet_train.evaluate.figures import save
from motet_train.evaluate.positions import jerk, length
from motet_train.evaluate.text_adherence import table
from motet_train.evaluate.text_adherence.prompts import (
    EVERYDAY_PROMPTS,
    OUTSIDE,
    LookUp,
    Prompt,
    Trial,
    read_trials,
    trained_on,
)
from motet_train.evaluate.text_adherence.table import (
    depth,
    head_pitch,
    poses,
    said_to_be_outside,
    says_drawings,
    says_table,
    says_text,
    slide,
    spread,
)
from motet_train.evaluate.text_adherence.track import RATE, Track, track_of

STILL, LYING, LEFT, ZOMBIE = (
    "a person just stands there",
    "a man is lying on the floor",
    "a person walks forward and turns left 90 degrees",
    "a zombie walks with arms stretched out",
)


def gliding(speed: float = 0.0, turn: float = 0.0, tip: float = 0.0, seconds: float = 3.0) -> Motion:
    """A stiff humanoid led over the ground, or turned over forward by so many degrees."""
    facing = np.linspace(0, turn, len(times(seconds)))
    path = np.cumsum(np.stack([np.sin(np.radians(facing)), np.cos(np.radians(facing))], axis=1), axis=0) * speed / RATE
    height = np.full(len(facing), 0.2 if tip else HIPS)
    values = np.column_stack([path[:, 0], height, path[:, 1], np.full(len(facing), tip), facing, 0 * facing])
    channels = (*(f"hips.t{axis}" for axis in "xyz"), *(f"hips.r{axis}" for axis in "xyz"))
    return Motion(values, channels, ("length",) * 3 + ("deg",) * 3, RATE, HUMANOID)


TRIALS = (
    Trial("ACCAD_Male2_A1_Stand", ("someone stands",), gliding()),
    Trial("ACCAD_Female1_A01_Stand", ("she stands there", "she does nothing"), gliding(speed=1.0)),
    Trial("ACCAD_Male2_A9_Lie", ("a man is on the floor",), gliding(tip=90)),
    Trial("16_01", ("a person jumps there",), gliding()),
    Trial("unheard_of", ("a person just stands there and then there",), gliding(speed=2.0)),
)


class Half:
    """Stands still with even seeds, glides with others, turns by 80 or 100 degrees; knows no zombie."""

    def generate(self, text: str, seed: int) -> Motion:
        if "zombie" in text:
            raise TextError("no word is known")
        return gliding(turn=80 + 20 * (seed % 2)) if "90 degrees" in text else gliding(speed=seed % 2)


def only(*texts: str) -> tuple[Prompt, ...]:
    return tuple(prompt for prompt in EVERYDAY_PROMPTS if prompt.text in texts)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some prompts instead of all."""
    monkeypatch.setattr(table, "EVERYDAY_PROMPTS", only(STILL, LYING, LEFT, ZOMBIE))


@pytest.mark.usefixtures("few")
def test_shares_of_a_generator_that_does_it_half_of_the_times() -> None:
    report = says_table(Half().generate, TRIALS, training=[trial.name for trial in TRIALS[:4]], seeds=4)
    assert report["prompt"][STILL] == 0.5
    assert report["prompt"][ZOMBIE] == 0
    assert report["turn"][LEFT] == pytest.approx(90 * 0.9, abs=1)  # 0.3 s at each end are averaged
    assert report["says"] == {"all": 0.125, "locomotion": 0, "rest": 0.25, "known": 0.25}


@pytest.mark.usefixtures("few")
def test_the_columns_of_trials() -> None:
    report = says_table(Half().generate, TRIALS, training=[trial.name for trial in TRIALS[:4]], seeds=2)
    assert report["prompt_real"][STILL] == 0.5  # of two who stand one moves
    assert report["prompt_real"][LYING] == 1
    assert np.isnan(report["prompt_real"][LEFT])  # no trial shows it
    assert report["prompt_others"][LYING] == 0
    assert report["prompt_others"][STILL] == 0.5  # the "jump" stands, too, who lies does not; one is of no known action
    assert report["prompt_lookup"][LYING] == 1
    assert report["quality_real"]["seconds"] == pytest.approx(3, abs=0.1)


@pytest.mark.usefixtures("few")
def test_without_trials_there_are_no_other_columns() -> None:
    report = says_table(Half().generate, seeds=1)
    assert set(report) == {"says", "quality", "turn", "prompt"}
    assert set(report["says"]) == {"all", "locomotion", "rest"}
    assert "real" not in says_text({"half": report})
    with pytest.raises(DataError, match="none of the trials is one of the training motions"):
        says_table(Half().generate, TRIALS, training=["05_01"], seeds=1)


def test_the_text_has_a_column_for_each_generator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "EVERYDAY_PROMPTS", only(STILL, LEFT))
    report = says_table(Half().generate, TRIALS, seeds=2)
    lines = says_text({"runs/a": report, "runs/b": report}).splitlines()
    assert lines[0].split() == ["%", "a", "b", "lookup", "real", "others"]
    assert lines[2].split("   ")[0] == STILL
    assert lines[2].split()[-5:] == ["50", "50", "0", "50", "50"]
    assert any(line.startswith("says.all") and line.endswith("NOT REACHED") for line in lines)


def test_the_look_up_shares_most_words_in_fewest() -> None:
    look_up = LookUp(TRIALS)
    assert look_up.nearest(STILL).name == "unheard_of"  # five words
    assert look_up.nearest("he stands").name == "ACCAD_Male2_A1_Stand"  # one word of two, before one of three
    assert look_up.nearest("what is it").name == "ACCAD_Male2_A9_Lie"  # "is"
    assert look_up.nearest("xyzzy").name == "ACCAD_Male2_A1_Stand"  # nothing is shared: the shortest, and by name
    assert look_up.generate(LYING, 3) is TRIALS[2].motion
    with pytest.raises(DataError, match="no trial to look up has a sentence"):
        LookUp([replace(TRIALS[0], sentences=())])


def test_training_trials_are_those_not_held_out() -> None:
    class Told:
        training = {"split": {"validation": ["16_01"], "test": ["unheard_of"]}}  # noqa: RUF012

    names = {trial.name for trial in TRIALS}
    assert trained_on(Told(), list(TRIALS)) == names - {"16_01", "unheard_of"}  # type: ignore[arg-type]
    Told.training["split"]["by"] = "none"  # type: ignore[assignment]
    assert trained_on(Told(), list(TRIALS)) == names  # type: ignore[arg-type]


def test_a_store_gives_its_motions_where_they_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    motion = gliding(speed=1.5, turn=60)
    block = to_root_block(motion)
    frames = block.values.astype(np.float32)
    entry = Entry("16_01", "16", ("a jump",), ((0, len(frames)),), 0)
    store = Store(frames, "root_angles", block.channels, block.units, RATE, (HUMANOID,), (entry,), ())
    (tmp_path / INDEX).touch()
    monkeypatch.setattr(Store, "open", lambda _: store)
    (trial,) = read_trials(tmp_path)
    assert trial.action == "jump"
    np.testing.assert_allclose(trial.track.pace, 1.5, atol=0.02)
    assert trial.track.turn == pytest.approx(54, abs=1)


def test_a_motion_that_is_no_human_is_named() -> None:
    motion = Motion(np.zeros((5, 1)), ("box.tx",), ("m",), 30.0)
    with pytest.raises(DataError, match="16_01 cannot be judged"):
        _ = Trial("16_01", (), motion).track


def test_feet_of_a_figure_that_is_led_slide_as_fast_as_it() -> None:
    assert slide(Track(led(standing(), 1.5))) == pytest.approx(1.5)
    assert slide(Track(standing())) == 0
    # a foot that goes back under a figure that goes forward stays in place
    assert slide(Track(led(shifted(standing(), "Foot", z=-1.5 * times(2.0)), 1.5))) == pytest.approx(1.5)
    assert slide(Track(led(shifted(standing(), "Toes", z=-1.5 * times(2.0)), 1.5))) == pytest.approx(0, abs=1e-9)
    lifted = shifted(standing(), "Toes", y=0.2 * (times(2.0) > 1))
    assert slide(Track(led(lifted, 1.0 + (times(2.0) > 1)))) == pytest.approx(1.0)  # in the air it may be fast


def test_jerk_of_a_cubic_and_of_a_tremble() -> None:
    assert jerk(shifted(standing(), "", x=0.5 * times(2.0) ** 3), RATE) == pytest.approx(3.0)
    tremble = 0.01 * (-1.0) ** np.arange(61)
    assert jerk(shifted(standing(), "", y=tremble), RATE) == pytest.approx(8 * 0.01 * RATE**3)
    assert np.isnan(jerk(standing()[:3], RATE))


def test_depth_is_under_the_ground() -> None:
    assert depth(Track(shifted(standing(), "", y=-0.02))) == pytest.approx(0.02)
    assert depth(Track(shifted(standing(), "", y=0.02))) == 0


def test_a_head_is_pitched_by_where_its_top_is_from_the_facing() -> None:
    neck_to_top = HUMANOID.offsets[HUMANOID.index("head_end")][1]
    assert head_pitch(Track(standing())) == pytest.approx(0, abs=1e-9)
    bowed = shifted(standing(), "head_end", z=neck_to_top)
    assert head_pitch(Track(bowed)) == pytest.approx(45)
    assert head_pitch(Track(led(bowed, 1.0, turn=90))) == pytest.approx(45, abs=1)


def test_poses_differ_by_what_a_figure_does_alone() -> None:
    here = poses(Track(walking(1.0)))
    np.testing.assert_allclose(here, poses(Track(walking(1.0) + np.array([3.0, 0.0, 5.0]))), atol=1e-9)
    assert length(here - poses(Track(led(stepping(4.0), 0.0, turn=120)))).mean() < 1e-9
    raised = shifted(standing(), "Hand", y=0.5)
    moved = sum("Hand" in name for name in HUMANOID.names)
    expected = 0.5 * moved / len(HUMANOID.names)
    assert length(poses(Track(raised)) - poses(Track(standing(5.0)))).mean() == pytest.approx(expected)
    assert spread([Track(raised), Track(standing()), Track(standing())]) == pytest.approx(expected * 2 / 3)
    assert np.isnan(spread([Track(raised)]))


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    """The three trials that motet carries, with sentences."""
    for file in CMU_FOLDER.iterdir():
        if file.suffix in (".amc", ".asf"):
            (tmp_path / file.name).symlink_to(file)
    rows = ["clip\tsentence", "39_14\tshe walks", "09_07\tsomebody runs", "02_06\tsomeone picks something up"]
    (tmp_path / "said.tsv").write_text("\n".join(rows) + "\n")
    return tmp_path


def test_trials_of_a_folder(corpus: Path) -> None:
    found = {trial.name: trial for trial in read_trials(corpus)}
    actions = {name: trial.action for name, trial in found.items()}
    assert actions == {"02_06": "bend over, scoop up, rise, lift arm", "09_07": "run", "39_14": "walk"}
    assert found["09_07"].sentences == ("somebody runs",)
    assert np.median(found["09_07"].track.pace) > 3


def test_the_command_asks_a_bundle(corpus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = "a person runs straight forward"
    monkeypatch.setattr(table, "EVERYDAY_PROMPTS", only(run))
    result = done("evaluate", "language-to-motion", "--says", "--data", corpus, "--json")
    report = json.loads(result.stdout)
    assert report["prompt"] == report["prompt_real"] == report["prompt_lookup"] == {run: 1.0}
    assert report["says"] == {"all": 1.0, "locomotion": 1.0, "rest": None, "known": 1.0}
    assert report["r_precision"]["1"] is None  # there is no other prompt
    assert report["frechet"]["generated_motions"] == 10
    assert report["frechet"]["trials_motions"] == 1


def test_the_command_says_what_does_not_go_together(tmp_path: Path) -> None:
    command = ("evaluate", "--says")
    refused("drop --save", *command, "language-to-motion", "--save")
    refused("not describe", *command, "describe")
    refused("need one for 'search'", *command, "language-to-motion", "--search", "describe")
    refused("no motion files", *command, "language-to-motion", "--data", tmp_path)


class Walks:
    """Whatever is asked, it walks; and remembers what it was asked."""

    def __init__(self, walk: Motion) -> None:
        self.walk, self.asked = on_humanoid(walk), list[str]()

    def generate(self, text: str, seed: int) -> Motion:
        self.asked.append(text)
        return self.walk


def test_prompts_are_drawn_that_are_done_and_those_passed_over_are_counted(tmp_path: Path) -> None:
    walks = Walks(motet.read(CMU_FOLDER / "39_14.amc"))
    drawings = says_drawings(walks.generate)
    figure = drawings["says"]()
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    done = [prompt.text for prompt in EVERYDAY_PROMPTS if prompt.passes(track_of(walks.walk))]
    assert titles[0] == walks.asked[0] == "a person walks straight forward"
    assert set(titles) <= set(done)
    eights = [EVERYDAY_PROMPTS[start : start + 8] for start in range(0, len(EVERYDAY_PROMPTS), 8)]
    assert titles == [
        next(p.text for p in part if p.text in done) for part in eights if set(done) & {p.text for p in part}
    ]
    assert figure.get_suptitle().startswith(
        f"every eighth prompt; {len(walks.asked) - len(titles)} whose motions did not"
    )
    (picture,) = save(drawings, tmp_path)
    assert picture.name == "says.png"


def test_what_no_recording_shows_is_said_to_be_outside() -> None:
    model = motet.load("generate")
    keyed = {act.says[0] for act in motet.keyed.ours().values()}
    others = []
    for sentence in OUTSIDE:
        if not any(model.likeliest(part).action in keyed for part in model.parts(sentence)):
            others.append(sentence)
    assert len(others) == 18
    assert said_to_be_outside(model, others) >= 0.8
    silent = set()
    for sentence in others:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", TextWarning)
            model.generate(sentence, max_seconds=0.2)
        silent |= set() if told else {sentence}
    # what hand-keyed clips show
    assert silent == {"a man does push ups", "a woman does yoga in the lotus position"}
    assert said_to_be_outside(model, ["a person walks forward", "a man is running", "someone kicks"]) == 0
    assert said_to_be_outside(model, ["xyzzy", ""]) == 1
