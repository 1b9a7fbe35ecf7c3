"""Known motions from training to evaluation, as a user has them."""

import json
from pathlib import Path

import numpy as np
import pytest
from language_data import small_store
from trainings import done, refused

from motet.models.describe import DescribeModel
from motet.models.nearest_neighbour import NOTHING
from motet.text.vocabulary import NEW_MODEL_RULES
from motet_train.data.store import INDEX, KEYED, Store
from motet_train.evaluate.language.actions import error_by_chance
from motet_train.runs import Run

NETS = "[model]\nencoder_units = [4, 4]\ndecoder_units = [6, 6]\nembedding = 4\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("known")
    small_store(found, 40)
    # some of the motions were performed by nobody
    index = json.loads((found / "store" / INDEX).read_text())
    for entry in index["records"][::4]:
        entry["subject"] = KEYED
    (found / "store" / INDEX).write_text(json.dumps(index))
    (found / "small.toml").write_text(NETS)
    given = ("--data", found / "store", "--split", "trial", "--epochs", 1, "--config", found / "small.toml")
    done("train", "describe", *given, "--out", found / "writer")
    done("train", "known", *given[:4], "--writer", found / "writer", "--out", found / "known")
    return found


def test_known_motions_answer_for_clips_kept_back(folder: Path) -> None:
    run, store = Run.load(folder / "known"), Store.open(folder / "store")
    model = run.bundle_model()
    assert isinstance(model, DescribeModel)
    split = run.manifest["training"]["split"]
    test = [i for i, entry in enumerate(store.records) if entry.name in split["test"]]
    said = {NEW_MODEL_RULES.normalise(s) for entry in store.records for s in entry.sentences}
    for row in model.describe([store.motion(i) for i in test], 3):
        assert len({one.text for one in row}) == len(row)
        for one in row:
            plain = one.text.removesuffix(", turning left").removesuffix(", turning right")
            assert one.text == NOTHING or plain in said
            assert one.score == pytest.approx(one.probability, abs=1e-5)
    tried = np.load(folder / "known" / "tried.npz")
    held_out = {*split["validation"], *split["test"]}
    performed = [entry for entry in store.records if entry.name not in held_out and entry.subject != KEYED]
    assert 0 < len(performed) < split["train"]
    assert {len(tried[name]) for name in tried} == {3 * len(performed)}


def test_descriptions_are_judged_by_action(folder: Path) -> None:
    for clips, count in (("test", 4), ("0*,1*", 20)):
        result = done("evaluate", folder / "known", "--actions", clips, "--data", folder / "store", "--json")
        report = json.loads(result.stdout)
        assert report["actions"]["of"] == count
        assert 0 <= report["actions"]["right"] <= report["actions"]["reachable"] <= 1
        assert 0 <= report["lookup"]["right"] <= 1
        assert 0 <= report["actions"]["calibration_by_chance"] <= 1
    refused("--actions takes describe models", "evaluate", "search", "--actions", "test")


def test_known_motions_need_a_net_that_writes(folder: Path) -> None:
    command = ("train", "known", "--data", folder / "store", "--out", folder / "none", "--writer", folder / "known")
    refused("known motions need a run of describe (--writer)", *command)
    assert not (folder / "none" / "run.json").exists()


def test_probabilities_that_are_right_err_by_chance_alone() -> None:
    chances = np.random.default_rng(0).random(20_000)
    assert error_by_chance(np.array([0.0, 1.0])) == 0
    assert error_by_chance(np.full(1, 0.5)) == pytest.approx(0.5)
    assert 0.2 > error_by_chance(chances[:60], 100) > 4 * error_by_chance(chances, 20) > 0
