"""Settings of a run in a file: read, refused, and written so that they repeat the run."""

import re
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from language_data import small_store
from test_predict_data import write_files
from trainings import done, motet, refused, same

from motet.formats import read_motion, write_motion
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.errors import DataError
from motet_train.data.table import read_gaits
from motet_train.papers.li2018.recipe import RECIPES as SYSTEMS
from motet_train.papers.tdbn import experiments
from motet_train.papers.tdbn.recipe import RECIPES as CONTROL
from motet_train.recipes import codec, codes, language, predict
from motet_train.runs import Run
from motet_train.settings import SettingsError, changed, read_settings, to_toml

RECIPES = [
    *language.RECIPES.values(),
    *predict.RECIPES.values(),
    *codec.RECIPES.values(),
    *codes.RECIPES.values(),
    *CONTROL.values(),
    *(recipe for presets in SYSTEMS.values() for recipe in presets.values()),
]
recipes = pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.model)


@recipes
def test_what_is_written_reads_back_as_the_same_recipe(recipe, tmp_path: Path) -> None:
    options = {"name": 'a "b" \\ é 🙂', "seed": 3, "no": None, "data": Path("some/where"), "all-files": False}
    path = tmp_path / "run.toml"
    path.write_text(to_toml(options, recipe), encoding="utf-8")
    read, tables = read_settings(path)
    assert read == {"name": options["name"], "seed": 3, "data": "some/where", "all_files": False}
    derived = {name: getattr(recipe.config, name) for name in recipe.derived}
    plain = replace(recipe, config=type(recipe.config)(**derived), training=recipe.training and type(recipe.training)())
    assert changed(plain, tables, {}) == recipe


@recipes
def test_a_setting_is_of_the_training_or_of_the_visits(recipe) -> None:
    """An option changes every field of its name, and the manifest has one value for each."""
    parts = [{field.name for field in fields(part)} for part in (recipe.training, recipe.visits) if part is not None]
    assert len(set().union(*parts)) == sum(map(len, parts))


def test_options_win_over_tables_and_reach_the_field_of_their_name() -> None:
    recipe = SYSTEMS["convseq2seq"]["default"]
    tables = {"training": {"batch": 5, "clip": 2}, "model": {"kernel": [3, 5]}, "visits": {"mirror": 0.5}}
    found = changed(recipe, tables, {"batch": 7, "window": 16, "steps": None})
    assert found.training == replace(recipe.training, batch=7, clip=2)
    assert found.config == replace(recipe.config, kernel=(3, 5), window=16)
    assert found.visits.mirror == 0.5
    nested = changed(CONTROL["default"], {"model": {"rbm": {"epochs": 3}}}, {})
    assert nested.config == replace(CONTROL["default"].config, rbm=replace(CONTROL["default"].config.rbm, epochs=3))


@pytest.mark.parametrize(
    "value", ["9" * 5000, "[" * 100_000, "1 2", '"\udcff"'], ids=["long", "deep", "two", "no text"]
)
def test_what_is_no_toml_is_refused(value: str, tmp_path: Path) -> None:
    path = tmp_path / "run.toml"
    path.write_text(f"seed = {value}\n", encoding="utf-8", errors="surrogateescape")
    with pytest.raises(SettingsError, match=r"the settings .*run\.toml cannot be read"):
        read_settings(path)
    with pytest.raises(DataError, match=r"run\.toml is not a table of gaits"):
        read_gaits(path)


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"training": {"rate": 1.0}}, r"unknown setting training\.rate of convseq2seq: expected one of accumulate, "),
        ({"model": {"dimensions": 3}}, r"unknown setting model\.dimensions"),
        ({"training": {"batch": 1.5}}, r"training\.batch = 1\.5 does not fit: expected int"),
        ({"training": {"batch": True}}, r"training\.batch = true does not fit"),
        ({"training": {"optimiser": "best"}}, r"training\.optimiser = \"best\" does not fit"),
        ({"training": {"decay": [0.9]}}, r"training\.decay"),
        ({"model": {"kernel": [2, "x"]}}, r"model\.kernel"),
    ],
)
def test_what_does_not_fit_is_named(tables, said: str) -> None:
    with pytest.raises(SettingsError, match=said):
        changed(SYSTEMS["convseq2seq"]["default"], tables, {})


def test_what_does_not_fit_in_a_nested_table_is_named() -> None:
    with pytest.raises(SettingsError, match=r"unknown setting model\.rbm\.rates: expected one of epochs, rate, "):
        changed(CONTROL["default"], {"model": {"rbm": {"rates": 1.0}}}, {})
    with pytest.raises(SettingsError, match=r"unknown setting training\.batch of tdbn: expected one of none"):
        changed(CONTROL["default"], {"training": {"batch": 2}}, {})


SMALL = {
    "describe": "epochs = 2\n[model]\nencoder_units = [4, 4]\ndecoder_units = [6, 6]\nembedding = 4\n",
    "predict": "steps = 5\n[model]\nhidden = 8\n[training]\nevery = 2\nlearning-rate = 1e-2\n",
    "rrnn": "steps = 3\nbatch = 2\n[model]\nunits = 4\n",
    "tdbn": "seed = 1\n[model]\nrestarts = 1\ntries = 1\nhidden_per_part = 4\n"
    "[model.rbm]\nepochs = 3\n[model.crbm]\nepochs = 2\n",
    "crbm": "labels = 'walk'\nepochs = 3\n",
}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[object, ...]]:
    folder = tmp_path_factory.mktemp("data")
    small_store(folder)
    files = write_files(folder / "files", actions=("walking",))
    where = {"describe": folder / "store", "predict": files, "rrnn": files}
    return {name: ("--data", where[name]) if name in where else () for name in SMALL}


@pytest.fixture
def quick_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    """A control model is chosen from its candidates by one experiment of the many."""
    quick = {"cycle": [experiments.limit_cycle]}
    monkeypatch.setattr("motet_train.papers.tdbn.report.experiments_of", lambda study: quick)


@pytest.mark.usefixtures("quick_choice")
@pytest.mark.parametrize("model", SMALL)
def test_the_file_of_a_run_repeats_it(model: str, data: dict[str, tuple[object, ...]], tmp_path: Path) -> None:
    (tmp_path / "small.toml").write_text(SMALL[model])
    command = ("train", model, "--out")
    done(*command, tmp_path / "a", *data[model], "--config", tmp_path / "small.toml", "--licence", "CC0-1.0")
    done(*command, tmp_path / "b", "--config", tmp_path / "a" / "run.toml")
    first, again = (Run.load(tmp_path / name) for name in "ab")
    assert same(first.model.state_dict(), again.model.state_dict())
    assert first.manifest["config"] == again.manifest["config"]
    assert first.manifest["licence"] == again.manifest["licence"]
    assert again.manifest["licence"]["weights"] == "CC0-1.0"
    files = [(tmp_path / name / "run.toml").read_text() for name in "ab"]
    assert files[0] == files[1]


def test_each_chunk_is_told_once_unless_asked_to_be_quiet(tmp_path: Path) -> None:
    (tmp_path / "small.toml").write_text(SMALL["crbm"])
    command = ("train", "crbm", "--config", tmp_path / "small.toml", "--out")
    assert done(*command, tmp_path / "a").output.count("epoch 3 of 3: loss") == 1
    assert done("--quiet", *command, tmp_path / "b").output.count("epoch 3 of 3: loss") == 0


def test_a_line_comes_soon_where_a_chunk_is_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motet_train.progress.SOON", -1.0)
    (tmp_path / "small.toml").write_text(SMALL["crbm"])
    said = motet("train", "crbm", "--config", tmp_path / "small.toml", "--out", tmp_path / "a").output
    assert [said.count(f"epoch {done} of 3: loss") for done in (1, 2, 3)] == [1, 0, 1]


def test_the_command_line_wins_over_the_file(data: dict[str, tuple[object, ...]], tmp_path: Path) -> None:
    (tmp_path / "small.toml").write_text(SMALL["predict"] + "batch = 3\n")
    config = ("--config", tmp_path / "small.toml", "--steps", 3)
    done("train", "predict", *data["predict"], *config, "--out", tmp_path / "a")
    recipe = Run.load(tmp_path / "a").manifest["training"]["recipe"]
    assert (recipe["steps"], recipe["batch"], recipe["learning_rate"]) == (3, 3, 1e-2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("stepps = 3", "unknown setting stepps: expected one of "),
        ("steps = 'many'", "'many' is not a valid integer"),
        ("[trainig]\nbatch = 2", "unknown table [trainig]: expected one of training, model, visits"),
        ("steps = ", "cannot be read"),
        ("[model]\nunit = 3", "unknown setting model.unit of trajectory"),
    ],
)
def test_a_bad_file_is_refused_and_nothing_written(
    text: str, said: str, data: dict[str, tuple[object, ...]], tmp_path: Path
) -> None:
    (tmp_path / "bad.toml").write_text(text)
    refused(said, "train", "predict", *data["predict"], "--config", tmp_path / "bad.toml", "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("quick_choice")
@pytest.mark.parametrize("model", ["predict", "tdbn"])
def test_these_resume_from_the_command_line_too(
    model: str, data: dict[str, tuple[object, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("motet_train.papers.tdbn.recipe.EPOCHS_A_CHUNK", 2)
    (tmp_path / "small.toml").write_text(SMALL[model])
    command = ("train", model, *data[model], "--config", tmp_path / "small.toml", "--out")
    done(*command, tmp_path / "whole")
    with monkeypatch.context() as patched:
        steps = iter([None] * 3)
        patched.setattr("motet_train.progress.Shown.step", lambda *_: next(steps, KeyboardInterrupt) and stop())
        stopped = motet(*command, tmp_path / "parts")
    assert (stopped.exit_code, "--resume continues" in stopped.output) == (130, True)
    refused("it exists", *command, tmp_path / "parts")
    done(*command, tmp_path / "parts", "--resume")
    assert same(*(Run.load(tmp_path / name).model.state_dict() for name in ("whole", "parts")))


def stop() -> None:
    raise KeyboardInterrupt


def test_a_unit_that_files_do_not_say_is_asked_for_and_taken(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    walk = read_motion(CMU_FOLDER / "39_14.amc")
    for subject in range(10):
        write_motion(folder / f"{subject:02}_01.bvh", walk[10 * subject : 10 * subject + 160])
    (tmp_path / "said.tsv").write_text("clip\tsentence\n" + "".join(f"{n:02}_01\ta person walks\n" for n in range(10)))
    own = ("prepare", folder, "--figure", "own", "--out", tmp_path / "deep" / "store")
    prepared = motet(*own)
    assert (prepared.exit_code, "--unit-in" in prepared.output, "skipped" in prepared.output) == (2, True, False)
    for command in ((*own, "--unit-in", "inch"), ("prepare", folder, "--out", tmp_path / "humanoid")):
        assert "0 skipped" in done(*command).output
    options = ("--preset", "files", "--figure", "own", "--data", folder, "--steps", 1)
    command = ("train", "predict", *options, "--out", tmp_path / "run")
    assert motet(*command).exit_code == 2
    done(*command, "--unit-in", "inch")
    assert np.isfinite(Run.load(tmp_path / "run").model.scale.numpy()).all()


def test_help_lists_the_commands_in_whole_sentences() -> None:
    text = motet("train", "--help").stdout.partition("Commands:")[2]
    lines = re.findall(r"^  (\S+) +(.+(?:\n {5,}.+)*)", text, re.MULTILINE)
    assert {"tdbn", "describe", "predict", "convseq2seq", "erd"} <= {name for name, _ in lines}
    assert all(said.endswith(".") and not said.endswith(("...", "et al.")) for _, said in lines)


def test_tensorboard_is_asked_for_where_it_is_missing(
    data: dict[str, tuple[object, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    options = ("--steps", 1, "--tensorboard", "--out", tmp_path / "run")
    refused("pip install 'motet[tensorboard]'", "train", "predict", *data["predict"], *options)
    assert not (tmp_path / "run").exists()
