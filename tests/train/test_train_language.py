import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from language_data import records, small_store
from trainings import check_resumed, done, log_of, motet, refused, same

from motet.bundle.fields import Fields
from motet.bundle.manifest import read_contract
from motet.formats import write_motion
from motet_train.data.store import Store
from motet_train.descent import Training
from motet_train.models.motion_to_language import MotionToLanguageConfig
from motet_train.papers.plappert2017 import recipe as generate
from motet_train.papers.plappert2017.language_to_motion import LanguageToMotionConfig
from motet_train.progress import Shown
from motet_train.recipes import language
from motet_train.recipes.language import LanguageVisits, divided, train_language
from motet_train.recipes.recipe import SETTINGS, Job, Recipe
from motet_train.runs import About, Run
from motet_train.trainer import CHECKPOINT, LOG

COMMANDS = {"describe": "describe", "mixture": "generate"}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("corpus")
    small_store(folder)
    return folder / "store"


@pytest.fixture(autouse=True)
def small_nets(monkeypatch: pytest.MonkeyPatch) -> None:
    """The nets of the default recipes with few units."""
    sizes = {"encoder_units": (4, 4), "decoder_units": (6, 6), "embedding": 4}
    training = Training(epochs=3, batch=16, optimiser="nadam", clip=8.0)
    for module, config in (
        (language, MotionToLanguageConfig(0, 0, **sizes)),  # type: ignore[arg-type]
        (generate, LanguageToMotionConfig(0, 0, components=2, loss="likelihood", **sizes)),  # type: ignore[arg-type]
    ):
        recipe = replace(module.RECIPES["default"], config=config, training=training)
        monkeypatch.setitem(module.RECIPES, "default", recipe)


def trained(verb: str, store: Path, out: Path, *options: object) -> Run:
    done("train", verb, "--data", store, "--out", out, *options)
    return Run.load(out)


@pytest.mark.parametrize(("command", "verb"), COMMANDS.items())
def test_the_manifest_says_all(command: str, verb: str, store: Path, tmp_path: Path) -> None:
    options = ("--name", "mine", "--data-licence", "free", "--seed", 3, "--no-mirror")
    run = trained(command, store, tmp_path / "run", *options)
    manifest, training = run.manifest, run.manifest["training"]
    found = divided(Store.open(store), mirror=False)
    assert (manifest["name"], manifest["verb"]) == ("mine", verb)
    assert manifest["licence"] == {"weights": None, "data": "free"}
    assert manifest["loop"] == {"describe": "beam", "generate": "mixture"}[verb]
    assert manifest["vocabulary"] == list(found.vocabulary.words)
    limit = {"confidence": {"log_probability": -5.5}}  # which a few validation motions do not change
    assert manifest["settings"] == {"describe": limit, "generate": {}}[verb]
    contract = read_contract(Fields(manifest["motion"], "motion"))
    np.testing.assert_allclose(contract.mean, found.contract.mean, atol=1e-9)
    np.testing.assert_allclose(run.model.scale.numpy(), contract.std, rtol=1e-6)
    assert training["split"]["test"] == [f"{i:02}" for i in found.parts.test]
    assert training["split"]["validation"] == [f"{i:02}" for i in found.parts.validation]
    assert (training["seed"], training["epochs"], training["recipe"]["mirror"]) == (3, 3, False)
    assert training["data"] == {"name": "store", "motions": 20, "sentences": 60, "skipped": 0, "unusable_sentences": 0}
    lines = log_of(tmp_path / "run")
    assert [line["epoch"] for line in lines] == [1, 2, 3]
    assert lines[-1]["loss"] < lines[0]["loss"]
    assert training["validation"] == min(line["validation"] for line in lines)


@pytest.mark.parametrize("verb", COMMANDS)
def test_resumed_training_is_the_same_to_the_bit(verb: str, store: Path, tmp_path: Path) -> None:
    check_resumed(partial(trained, verb, store), tmp_path, "--epochs", 1)


def test_a_stopped_run_says_how_it_goes_on(store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "run"
    stop_at(monkeypatch, epoch=2)
    result = motet("train", "describe", "--data", store, "--out", out)
    assert result.exit_code == 130
    assert "the same command with --resume continues" in result.output
    assert {path.name for path in out.iterdir()} == {CHECKPOINT, LOG, SETTINGS, "run.json", "weights.pt"}
    assert Run.load(out).manifest["verb"] == "describe"


def test_nothing_is_left_of_a_run_without_an_epoch(
    store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop_at(monkeypatch, epoch=1)
    assert motet("train", "mixture", "--data", store, "--out", tmp_path / "run").exit_code == 130
    assert list(tmp_path.iterdir()) == []


def stop_at(monkeypatch: pytest.MonkeyPatch, epoch: int) -> None:
    def interrupt(progress: Shown, done: int, total: int, unit: str, loss: float) -> None:
        if done == epoch:
            raise KeyboardInterrupt

    monkeypatch.setattr(Shown, "step", interrupt)


@pytest.mark.parametrize("options", [(), ("--resume",)])
def test_a_run_killed_before_its_first_checkpoint_starts_over(store: Path, tmp_path: Path, options: tuple[str]) -> None:
    whole, killed = trained("describe", store, tmp_path / "whole"), tmp_path / "killed"
    killed.mkdir()
    for name in (SETTINGS, LOG, "weights.pt", ".run.json.0123"):
        (killed / name).write_bytes(b"half")
    again = trained("describe", store, killed, *options)
    assert same(whole.model.state_dict(), again.model.state_dict())


def test_a_folder_with_anything_else_is_not_touched(store: Path, tmp_path: Path) -> None:
    trained("describe", store, tmp_path / "ended", "--epochs", 1)
    (tmp_path / "ended" / CHECKPOINT).unlink()
    (tmp_path / "mine" / "deep").mkdir(parents=True)
    for name in ("ended", "mine"):
        for options in ((), ("--resume",)):
            command = ("train", "describe", "--data", store, "--out", tmp_path / name, *options)
            refused("cannot write the run", *command)
    assert (tmp_path / "mine" / "deep").is_dir()
    assert Run.load(tmp_path / "ended")


def test_refusals(store: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    (tmp_path / "empty").mkdir()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("")
    command = ("train", "describe", "--data", store, "--out")
    refused("it has no checkpoint.pt", *command, tmp_path / "other", "--resume")
    refused("no motion files", "train", "describe", "--data", tmp_path / "empty", "--out", out)
    trained("describe", store, out, "--epochs", 1)
    before = (out / CHECKPOINT).read_bytes()
    refused("it exists", *command, out)
    refused("cannot be resumed: seed, batch", *command, out, "--resume", "--seed", 1, "--batch", 8)
    assert (out / CHECKPOINT).read_bytes() == before
    if not torch.cuda.is_available():
        refused("no CUDA device", *command, tmp_path / "x", "--device", "cuda")


def test_a_corpus_is_prepared_beside_the_run(tmp_path: Path) -> None:
    folder = tmp_path / "mocap"
    folder.mkdir()
    lines = ["clip\tsentence"]
    for record in records(12):
        write_motion(folder / f"{record.name}.npz", record.motion)
        lines += [f"{record.name}\t{sentence}" for sentence in record.sentences]
    (tmp_path / "said.tsv").write_text("\n".join(lines))
    out = tmp_path / "runs" / "mine"
    command = ("train", "describe", "--data", folder, "--out", out, "--sentences", tmp_path / "said.tsv", "--epochs", 1)
    refused("figures that are not human need --figure own", *command)
    done(*command, "--figure", "own")
    assert Run.load(out).manifest["training"]["data"]["motions"] == 12
    assert len(Store.open(tmp_path / "runs" / "mine-store").records) == 12
    refused("it exists", *command, "--figure", "own")
    shutil.rmtree(out)
    refused(f"{out}-store: it exists", *command, "--figure", "own")


@pytest.mark.parametrize(("representation", "travelled"), [("root_angles", 2), ("angles", 0)])
def test_only_channels_that_travel_are_summed(store: Path, tmp_path: Path, representation: str, travelled: int) -> None:
    recipe = language.RECIPES["default"]
    config, visits = replace(recipe.config, travelled=2), replace(recipe.visits, mirror=False)
    job = Job(replace(recipe, config=config, visits=visits), About("x", "x"), tmp_path)
    run = train_language(replace(Store.open(store), representation=representation), job)
    assert run.manifest["config"]["travelled"] == run.model.config.travelled == travelled


def test_either_loss_can_be_trained(store: Path, tmp_path: Path) -> None:
    runs = [trained("mixture", store, tmp_path / loss, "--loss", loss) for loss in ("surrogate", "likelihood")]
    assert [run.manifest["config"]["loss"] for run in runs] == ["surrogate", "likelihood"]
    assert runs[0].manifest["training"]["loss"] != runs[1].manifest["training"]["loss"]


PAPER: list[tuple[Recipe, Callable[[int, int], object], float]] = [
    (language.PAPER, MotionToLanguageConfig, 8.0),
    (generate.RECIPES["paper"], LanguageToMotionConfig, 25.0),
]


@pytest.mark.parametrize(("recipe", "config", "clip"), PAPER)
def test_the_paper_preset_is_table_1(recipe: Recipe, config: Callable[[int, int], object], clip: float) -> None:
    assert recipe.sized(channels=44, words=1344) == config(44, 1344)
    assert recipe.training == Training(
        epochs=100, batch=128, learning_rate=1e-3, optimiser="nadam", clip=clip, keep="last"
    )
    assert recipe.visits == LanguageVisits(offsets=None, windows=None, mirror=False, pairs=True)
