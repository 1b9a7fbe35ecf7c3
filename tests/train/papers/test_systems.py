"""The published systems from the command line: train, stop and go on, evaluate, export."""

import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from test_predict_data import write_files
from trainings import done, log_of, motet, refused

from motet.formats import read_motion, write_motion
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.papers.li2018 import SYSTEMS
from motet_train.papers.li2018.convseq2seq import Config
from motet_train.papers.li2018.expmap import H36M_LAYOUT, expmap_material, read_expmap, validation_files
from motet_train.papers.li2018.recipe import RECIPES, sized, validation_error
from motet_train.recipes.recipe import Recipe, Visits
from motet_train.runs import Run
from motet_train.trainer import CHECKPOINT

SETTINGS = shlex.split("--steps 2 --batch 2 --window 16 --loss square --learning-rate 3e-4 --l2 0.002 --adversary 0.01")
"""Of a run that is small and has nothing by default."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_files(tmp_path_factory.mktemp("data"), actions=("walking",))


@pytest.fixture(scope="module")
def trained(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "small"
    done("train", "convseq2seq", "--data", data, "--out", out, *SETTINGS)
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
    command = ("train", "convseq2seq", "--data", data, "--resume", "--out")
    done(*command, trained, *SETTINGS)
    refused("other settings", *command, trained, "--steps", 2, "--batch", 3)
    refused(CHECKPOINT, *command, trained.parent)


def test_it_is_evaluated(trained: Path, data: Path) -> None:
    assert "frame_24" in done("evaluate", trained, "--data", data, "--json").stdout


def test_motion_files_teach_it_to_continue_a_figure(tmp_path: Path) -> None:
    data, out = tmp_path / "data", tmp_path / "run"
    data.mkdir()
    walk = read_motion(CMU_FOLDER / "39_14.amc").scaled(0.01)
    for n in range(10):
        write_motion(data / f"{n:02}_01.npz", walk[5 * n : 5 * n + 340])
    settings = ("--steps", 1, "--batch", 2, "--adversary", 0.01)
    done("train", "convseq2seq", "--data", data, "-o", out, *settings)
    found = Run.load(out)
    assert len(found.manifest["training"]["data"]["test"]) == 1
    after = found.bundle_model().predict(walk, frames=60)
    assert (len(after), after.channels, after.skeleton) == (60, walk.channels, walk.skeleton)
    jump = np.abs(after.values[0, :3] - walk.values[-1, :3]).max()
    assert jump < 10  # centimetres: it goes on from where the walk ends
    options = ("--data", data, "-o", tmp_path / "other", "--steps", 1)
    refused("exponential-map text files", "train", "srnn", *options)
    refused("--all-files is for text files", "train", "convseq2seq", *options, "--all-files")


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
    command = ("train", "convseq2seq", "--out", tmp_path / "run", "--data")
    refused("padding 'same'", *command, data, "--padding", "valid", "--window", 5)
    (tmp_path / "empty").mkdir()
    assert motet(*command, tmp_path / "empty").exit_code == 2
    assert not (tmp_path / "run").exists()


LSTM_3LR = 71 * 500 + 4000 * 1501 + 2 * 4000 * 2001 + 1001 * 70


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("rrnn", 3 * 1024 * (70 + 1024 + 1) + 1025 * 70),
        ("erd", 71 * 500 + 501 * 500 + 4000 * (500 + 1000 + 1) + 4000 * 2001 + 1001 * 500 + 501 * 100 + 101 * 70),
        ("lstm-3lr", LSTM_3LR),
        ("lstm-ae", LSTM_3LR + 71 * 1000 + 1001 * 500 + 501 * 1000 + 1001 * 70),
    ],
)
def test_the_recipes_have_the_published_sizes(name: str, parameters: int, data: Path) -> None:
    material = replace(expmap_material(read_expmap(data)), kept=tuple(range(70)))
    config = sized(RECIPES[name]["default"], material)
    with torch.device("meta"):
        system = SYSTEMS[name][0](config)
    assert sum(parameter.numel() for parameter in system.parameters()) == parameters


def test_a_structural_net_needs_the_same_columns_left_and_right(data: Path, tmp_path: Path) -> None:
    refused("are not the same ones", "train", "srnn", "--data", data, "--out", tmp_path / "run")


def settings(recipe: Recipe) -> tuple[int, float, float]:
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
    lines = log_of(trained)
    assert [line["step"] for line in lines] == [2]
    assert set(lines[0]) == {"step", "loss", "validation", "seconds", "steps_per_second"}
