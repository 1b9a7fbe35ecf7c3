"""From a folder of recordings to bundles of every verb, by two commands; stopped once on the way, with tiny nets."""

import logging
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import Result
from trainings import done, log_of, refused, same
from trainings import motet as command

import motet
from motet.formats import read_motion, write_motion
from motet_train import run_folder
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.corpus import read_corpus
from motet_train.data.store import Store
from motet_train.plan import PLANNED_VERBS, STAGES, Plan
from motet_train.progress import Shown
from motet_train.runs import Run, RunError
from motet_train.settings import SettingsError, read_stages

SHORT = "training.steps = 2\ntraining.every = 1\ntraining.batch = 4\ntraining.warm_up = 0\n"
SETTINGS = f"""
[control]
{SHORT}model.even = 6
model.odd = 6
[search]
training.epochs = 1
training.every = 1
training.batch = 6
training.warm_up = 0
model.embedding = 6
visits.views = 1
[predict]
{SHORT}model.hidden = 8
model.members = 1
model.blocks = 1
[actions]
{SHORT}model.embedding = 6
model.hidden = 5
[codec]
{SHORT}model.moves = 8
model.groups = 2
model.levels = [3, 5]
model.width = 12
model.blocks = 1
model.ahead = [1, 0]
model.fine = 6
visits.frames = 16
[decoder]
{SHORT}visits.frames = 16
[sharp]
{SHORT}visits.frames = 16
[generate]
{SHORT}model.width = 12
model.layers = 2
model.heads = 2
model.action = 5
model.ages = 6
visits.window = 6
[fill]
{SHORT}model.width = 8
model.layers = 1
model.heads = 2
model.inner = 8
model.waves = 2
visits.context = 5
visits.least = 2
visits.gaps = [2, 30]
[describe]
training.epochs = 1
training.batch = 6
model.encoder_units = [4, 4]
model.decoder_units = [6, 6]
model.embedding = 4
"""
SAID = {"walk": "a person walks", "run": "a person runs", "bend": "someone bends down"}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten clips of 1.9 to 2.8 s with a table of sentences and gaits, and settings of tiny nets."""
    folder = tmp_path_factory.mktemp("own") / "recordings"
    folder.mkdir()
    walk, bend = (read_motion(CMU_FOLDER / f"{trial}.amc") for trial in ("39_14", "02_06"))
    made = {"walk": walk, "run": replace(walk, fps=150.0), "bend": bend}
    rows = ["clip\tsentence\tdescription\tgait"]
    for number in range(10):
        name = list(SAID)[number % 3]
        write_motion(folder / f"{name}{number}.bvh", made[name][number:])
        rows.append(f"{name}{number}\t{SAID[name]}\t{name}\t{'' if name == 'bend' else name}")
    (folder / "texts.tsv").write_text("\n".join(rows) + "\n")
    (folder.parent / "tiny.toml").write_text(SETTINGS)
    return folder


class Stopped(Shown):
    """Ctrl-C after the first chunk of the codec."""

    def chunk(self, line: object, total: int, unit: str) -> None:
        super().chunk(line, total, unit)  # type: ignore[arg-type]
        if Stopped.place.parent.joinpath("codec").is_dir():
            raise KeyboardInterrupt

    place: Path


@pytest.fixture(scope="module")
def outputs(recordings: Path) -> Iterator[list[Result]]:
    """What the same command says when it is stopped, when it is started again, and when all is done."""
    out = recordings.parent / "runs"
    told = ("train", "all", recordings, "-o", out, "--config", recordings.parent / "tiny.toml", "--licence", "CC0-1.0")
    Stopped.place = out / "codec"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_folder, "Shown", Stopped)
        found = [command(*told)]
    found += [command(*told), command(*told)]
    yield found
    logging.getLogger("motet.train").setLevel(logging.NOTSET)


def test_what_was_stopped_resumes_and_what_is_done_is_passed_over(outputs: list[Result], recordings: Path) -> None:
    stopped, resumed, again = outputs
    runs = recordings.parent / "runs"
    assert stopped.exit_code == 130
    assert stopped.output.startswith("motet: 11 trainings into")
    assert f"stopped: the same command continues from {runs / 'codec' / 'checkpoint.pt'}" in stopped.output
    assert resumed.exit_code == again.exit_code == 0, resumed.output
    for name in ("control", "search", "predict", "actions"):
        assert f"{name} is trained already" in resumed.output
    assert all(f"{name} is trained already" in again.output for name in STAGES)
    steps = [line["step"] for line in log_of(runs / "codec")]
    assert (steps, "step 1 of 2" in stopped.output, "step 2 of 2" in resumed.output) == ([1, 2], True, True)
    assert f"next: motet export {runs} -o bundles" in resumed.output


def test_one_store_serves_every_stage_and_a_stage_alone_too(outputs: list[Result], recordings: Path) -> None:
    runs = recordings.parent / "runs"
    parts = {path.parent.name: Store.open(path.parent) for path in runs.glob("store/*/store.json")}
    rates = {"root_angles": 10, "root_sixd": 30, "root_vectors": 30}
    assert {name: store.fps for name, store in parts.items()} == rates
    assert all(len(store.records) == 10 for store in parts.values())
    config = ("--config", runs / "fill" / "run.toml", "-o", runs.parent / "again")
    alone = done("train", "fill", *config)  # its settings repeat it, from the same store
    assert f"next: motet evaluate {runs.parent / 'again'}; motet export" in alone.output
    assert same(*(Run.load(place).model.state_dict() for place in (runs / "fill", runs.parent / "again")))
    assert Run.load(runs / "control").manifest["config"]["gaits"] == ["walk", "run"]


def test_a_stage_that_fails_is_named_and_stops_no_other(recordings: Path, tmp_path: Path) -> None:
    table = (recordings / "texts.tsv").read_text().replace("\tgait", "\tmanner")
    (tmp_path / "texts.tsv").write_text(table)
    changes = read_stages(recordings.parent / "tiny.toml", STAGES)
    plan = Plan(
        read_corpus(recordings, tmp_path / "texts.tsv"), tmp_path / "runs", ("control", "search"), changes=changes
    )
    with pytest.raises(RunError, match="of 2 trainings 1 failed"):
        plan.train()
    assert [path.name for path in sorted((tmp_path / "runs").iterdir())] == ["search", "store"]
    reason = "control failed: no recording of 1.5 s shows the gait 'walk': name gaits in a column gait"
    refused(reason, "train", "all", tmp_path / "runs" / "store", "-o", tmp_path / "runs", "--only", "control")


def test_settings_of_unknown_stages_are_refused(tmp_path: Path) -> None:
    for text, said in (("[describes]\n", "describes"), ("[codec.train]\n", r"codec\.train"), ("codec = 1\n", "codec")):
        (tmp_path / "bad.toml").write_text(text)
        with pytest.raises(SettingsError, match=rf"unknown table \[{said}"):
            read_stages(tmp_path / "bad.toml", STAGES)


@pytest.mark.slow
def test_bundles_are_exported_and_run(outputs: list[Result], recordings: Path) -> None:
    bundles, chosen = recordings.parent / "bundles", recordings.parent / "chosen"
    shutil.copytree(recordings.parent / "runs", chosen, ignore=shutil.ignore_patterns("store"))
    done("export", chosen, "-o", bundles)
    verbs = sorted([*PLANNED_VERBS, "known"])  # which answers for describe
    assert sorted(path.stem for path in bundles.iterdir()) == verbs
    models = {verb: motet.load(bundles / f"{verb}.zip") for verb in verbs}
    assert all(model.manifest.licence["weights"] == "CC0-1.0" for model in models.values())
    motion = read_motion(recordings / "walk0.bvh")
    assert all(one.log_probability < 0 for one in models["describe"].describe(motion))
    (made,) = models["generate"].generate("a person walks", seconds=2)
    assert len(made.motion) == 60
    assert len(models["predict"].predict(motion, frames=10)) == 10
    assert len(models["fill"].fill(motion, gaps=[(1.0, 1.4)])) == len(motion)
    assert len(motet.Index.open(recordings, models["search"]).search("a person walks")) > 0
    session = models["control"].start()
    session.control(gait="run", speed=2.0)
    assert [session.tick().rotations.shape for _ in range(5)] == [(1, 22, 4)] * 5
