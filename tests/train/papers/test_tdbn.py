from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from control_runs import control_run
from trainings import same

from motet_train.models.net import tuples
from motet_train.papers.tdbn.clips import body_parts, read_clips
from motet_train.papers.tdbn.rbm import Learning
from motet_train.papers.tdbn.recipe import RECIPES
from motet_train.papers.tdbn.tdbn import TDBN, Lessons, TDBNConfig
from motet_train.runs import Run, RunError

SHORT = replace(TDBNConfig(), restarts=1, tries=1, rounds=1, rbm=Learning(epochs=2), crbm=Learning(epochs=2))


def train(config: TDBNConfig = SHORT, seed: int = 0) -> Run:
    return control_run(read_clips(None, config.root_rotation), config, seed)


def test_the_net_has_the_thesis_sizes() -> None:
    clips = read_clips(None, root_rotation=False)
    parts = body_parts(clips.skeleton, clips.channels)
    assert sorted(np.bincount(parts.of_channel)) == [7, 7, 12, 12, 18]
    net = TDBN(replace(RECIPES["thesis"].config, control_units=20), parts.of_channel.tolist(), labels=1)
    assert net.crbm.past_weight.numel() == 67500  # thesis 4.1
    assert net.rbm.mask.shape == (56, 150)
    used = int(net.rbm.mask.sum()) + sum(p.numel() for p in net.parameters()) - net.rbm.weight.numel()
    assert used == 56 * 30 + 56 + 150 + 67500 + 150 + 20 * 150 + 20  # "about 72 k parameters in all"


def test_the_thesis_second_layer_is_one_block_for_two_gaits_and_equal_parts_for_three() -> None:
    """Thesis 5.3 and 5.4."""
    parts = [0, 0, 1]
    two, three = (TDBN(RECIPES["thesis"].config, parts, labels=count) for count in (2, 3))
    assert two.crbm.control_units == 20
    assert two.expansion.tolist() == [[0.0] * 20, [1.0] * 20]
    assert three.expansion.tolist() == np.repeat(np.eye(3), 7, axis=1).tolist()
    assert RECIPES["thesis"].config.rbm.steps == 1


def test_a_round_is_an_rbm_with_nets_on_it_and_the_next_begins_anew() -> None:
    config = replace(SHORT, tries=2, rounds=3)
    net = TDBN(config, [0, 0, 1], labels=1)
    net.measure_by(np.zeros(3), np.ones(3))
    rows = torch.randn(20, 3, generator=torch.Generator().manual_seed(0))
    stages, parts = net.stages(Lessons([[rows]], [[torch.ones(20, 1)]], [1.0]), torch.Generator().manual_seed(0))
    assert [stage.whole for stage in stages] == [False, True, True] * 3
    stages[0].begin()
    stages[0].layer().epoch(0)
    assert parts["rbms"].hidden_bias.any()
    stages[3].begin()
    assert not parts["rbms"].hidden_bias.any()
    assert not parts["rbms"].visible_bias.any()
    assert 0.005 < parts["rbms"].weight[parts["rbms"].weight != 0].std() < 0.02


def test_training_repeats_by_its_seed() -> None:
    first, again, other = (train(seed=seed).model.state_dict() for seed in (1, 1, 2))
    assert same(first, again)
    assert not torch.equal(first["crbm.past_weight"], other["crbm.past_weight"])


@pytest.mark.parametrize(
    "config", [SHORT, replace(SHORT, free_units=8), replace(RECIPES["thesis"].config, rbm=SHORT.rbm, crbm=SHORT.crbm)]
)
def test_a_run_reads_back_as_it_was(config: TDBNConfig, tmp_path: Path) -> None:
    run = train(config)
    run.save(tmp_path)
    other = Run.load(tmp_path)
    assert other.manifest == run.manifest
    assert tuples(TDBN.from_config(other.manifest["config"]).to_config()) == tuples(run.manifest["config"])
    frames = [made.bundle_model().start(seed=1, variety=0.5).frames(np.eye(3)) for made in (run, other)]
    np.testing.assert_array_equal(*frames)


def test_gibbs_iterations_run_where_there_are_free_units() -> None:
    model = train(replace(SHORT, free_units=8)).bundle_model()
    once, twice = (model.start(variety=1.0, iterations=n).frames(np.eye(3)) for n in (1, 2))
    assert once.shape == twice.shape == (1, 3, 59)
    assert not np.array_equal(once, twice)


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"is not a training run: it has no run.json"):
        Run.load(tmp_path)
    train().save(tmp_path)
    (tmp_path / "weights.pt").write_bytes(b"no weights")
    with pytest.raises(RunError, match="cannot be read"):
        Run.load(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(RunError, match="cannot be read"):
        Run.load(tmp_path)
