"""The published systems from the command line: train, stop and go on, evaluate, export."""

import json
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from click.testing import CliRunner, Result
from test_predict_data import write_files

from motet.bundle.manifest import Manifest
from motet.cli import main
from motet.formats import read_motion, write_motion
from motet.predict.model import PredictModel
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.papers.li2018 import SYSTEMS
from motet_train.papers.li2018.convseq2seq import Config
from motet_train.papers.li2018.expmap import H36M_LAYOUT, expmap_material, read_expmap, validation_files
from motet_train.papers.li2018.recipe import RECIPES, sized, validation_error
from motet_train.recipes.recipe import Recipe, Visits
from motet_train.runs import Run
from motet_train.trainer import CHECKPOINT


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


SETTINGS = shlex.split("--steps 2 --batch 2 --window 16 --loss square --learning-rate 3e-4 --l2 0.002 --adversary 0.01")
"""Of a run that is small and has nothing by default."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_files(tmp_path_factory.mktemp("data"), actions=("walking",))


@pytest.fixture(scope="module")
def trained(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "small"
    found = run("train", "convseq2seq", "--data", data, "--out", out, *SETTINGS)
    assert found.exit_code == 0, found.output
    return out


def test_a_run_says_what_it_is(trained: Path) -> None:
    manifest = Run.load(trained).manifest
    system = manifest["config"]["system"]
    assert (manifest["model"], system["window"], system["loss"]) == ("convseq2seq", 16, "square")
    training = manifest["training"]
    recipe = training["recipe"]
    assert (training["seed"], training["steps"]) == (0, 2)
    assert (recipe["batch"], recipe["learning_rate"], recipe["l2"], recipe["adversary"]) == (2, 3e-4, 0.002, 0.01)
    assert training["data"]["validation"] == ["train/walking/walking_1.txt"]
    assert training["parameters"] > 3e6


def test_it_goes_on_by_the_same_command_only(trained: Path, data: Path) -> None:
    again = run("train", "convseq2seq", "--data", data, "--out", trained, *SETTINGS, "--resume")
    assert again.exit_code == 0, again.output
    other = run("train", "convseq2seq", "--data", data, "--out", trained, "--steps", 2, "--batch", 3, "--resume")
    assert (other.exit_code, "other settings" in other.stderr) == (2, True)
    none = run("train", "convseq2seq", "--data", data, "--out", trained.parent, "--resume")
    assert (none.exit_code, CHECKPOINT in none.stderr) == (2, True)


def test_it_is_evaluated(trained: Path, data: Path) -> None:
    shown = run("evaluate", trained, "--data", data, "--json")
    assert shown.exit_code == 0, shown.output
    assert "frame_24" in shown.stdout


def test_motion_files_teach_it_to_continue_a_figure(tmp_path: Path) -> None:
    data, out = tmp_path / "data", tmp_path / "run"
    data.mkdir()
    walk = read_motion(CMU_FOLDER / "39_14.amc").scaled(0.01)
    for n in range(10):
        write_motion(data / f"{n:02}_01.npz", walk[5 * n : 5 * n + 340])
    given = ("--data", data, "-o", out, "--steps", 1, "--batch", 2)
    trained = run("train", "convseq2seq", *given, "--adversary", 0.01)
    assert trained.exit_code == 0, trained.output
    found = Run.load(out)
    assert len(found.manifest["training"]["data"]["test"]) == 1
    model = PredictModel(Manifest.from_json(found.manifest), found.torch_graphs())
    after = model.predict(walk, frames=60)
    assert (len(after), after.channels, after.skeleton) == (60, walk.channels, walk.skeleton)
    jump = np.abs(after.values[0, :3] - walk.values[-1, :3]).max()
    assert jump < 10  # centimetres: it goes on from where the walk ends
    for command, more, said in (
        ("srnn", (), "exponential-map text files"),
        ("convseq2seq", ("--all-files",), "--all-files is for text files"),
    ):
        refused = run("train", command, "--data", data, "-o", tmp_path / command, "--steps", 1, *more)
        assert (refused.exit_code, said in refused.stderr) == (2, True)


def test_what_is_kept_back_is_not_trained_on_and_is_measured(data: Path) -> None:
    corpus = read_expmap(data)
    names = validation_files(corpus)
    material = expmap_material(corpus, names)
    assert (len(material.sequences), len(material.validation)) == (1, 1)
    kept_back = corpus.train["walking"]["train/walking/walking_1.txt"][1:].astype(np.float32)
    assert any(np.array_equal(kept_back, sequence) for sequence in material.validation)
    assert not any(np.array_equal(kept_back, sequence) for sequence in material.sequences)

    class Still(torch.nn.Module):
        mean = torch.zeros(())

        def forward(self, frames: torch.Tensor, count: int) -> torch.Tensor:
            return frames[:, -1:].expand(-1, count, -1)

    starts = np.linspace(0, 199 - 149, 8).astype(int)
    windows = [s[start : start + 149 : 2] for s in material.validation for start in starts]
    moved = [column for column in material.kept if column >= 6]
    errors = [np.linalg.norm((w[50:] - w[49])[:, moved], axis=1).mean() for w in windows]
    found = validation_error(Still(), material)  # type: ignore[arg-type]
    np.testing.assert_allclose(found, np.mean(errors), rtol=1e-4)


def test_bad_settings_are_named_and_nothing_stays(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    short = run("train", "convseq2seq", "--data", data, "--out", out, "--padding", "valid", "--window", 5)
    assert (short.exit_code, "padding 'same'" in short.stderr, out.exists()) == (2, True, False)
    (tmp_path / "empty").mkdir()
    empty = run("train", "convseq2seq", "--data", tmp_path / "empty", "--out", out)
    assert (empty.exit_code, out.exists()) == (2, False)


@pytest.mark.parametrize(
    ("name", "preset", "parameters"),
    [
        ("convseq2seq", "paper", 3_348_806),
        ("rrnn", "default", 3_435_590),
        ("erd", "default", 14_851_670),
        ("lstm-3lr", "default", 22_117_570),
        ("lstm-ae", "default", 23_260_140),
    ],
)
def test_the_recipes_have_the_published_sizes(name: str, preset: str, parameters: int, data: Path) -> None:
    material = replace(expmap_material(read_expmap(data)), kept=tuple(range(70)))
    config = sized(RECIPES[name][preset], material)
    with torch.device("meta"):
        system = SYSTEMS[name][0](config)
    assert sum(parameter.numel() for parameter in system.parameters()) == parameters


def test_a_structural_net_needs_the_same_columns_left_and_right(data: Path, tmp_path: Path) -> None:
    found = run("train", "srnn", "--data", data, "--out", tmp_path / "run")
    assert (found.exit_code, "are not the same ones" in found.stderr) == (2, True)


def settings(recipe: Recipe) -> tuple[int, float, float]:
    assert recipe.training is not None
    return recipe.training.batch, recipe.training.learning_rate, recipe.training.l2


def test_the_presets_are_the_papers_and_its_codes(data: Path) -> None:
    material = replace(expmap_material(read_expmap(data)), kept=tuple(range(70)))
    paper, code = RECIPES["convseq2seq"]["paper"], RECIPES["convseq2seq"]["code"]
    assert settings(paper) == (64, 2e-4, 0.001)
    assert settings(code) == (16, 5e-5, 0.0005)
    assert sized(paper, material) == Config(70)
    assert sized(code, material) == Config(70, dropout=(0.2, 0.2, 0.5), predicted_share=0.95)
    human = replace(material, layout=H36M_LAYOUT)
    assert sized(paper, human) == Config(70, padding="same")
    assert sized(code, human).padding == "same"
    assert paper.visits == code.visits == Visits()  # neither the paper nor its code has augmentation


def test_log_has_a_line_for_each_validation(trained: Path) -> None:
    lines = [json.loads(line) for line in (trained / "log.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == [2]
    assert set(lines[0]) == {"step", "loss", "validation", "seconds", "steps_per_second"}
