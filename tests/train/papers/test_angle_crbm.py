"""The baseline straight on the angles: what it does well, and what it cannot (reference: models.md C.5)."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from control_runs import control_run

from motet_export.bundles import export_run
from motet_train.models.net import tuples
from motet_train.papers.tdbn.clips import read_clips
from motet_train.papers.tdbn.experiments import limit_cycle, switch
from motet_train.papers.tdbn.rbm import CRBM, DivergedError, Learning
from motet_train.papers.tdbn.report import experiments_of, study_of
from motet_train.papers.tdbn.tdbn import AngleCRBM, AngleCRBMConfig
from motet_train.runs import Run

SHORT = replace(AngleCRBMConfig(), iterations=3, crbm=Learning(3, 3e-2, temperature=(1.0, 1.0)))


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    """More threads only get into each other's way on a net of this size."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def train(*labels: str, config: AngleCRBMConfig = SHORT) -> Run:
    return control_run(read_clips().only(labels), config)


@pytest.mark.slow
def test_a_slow_rate_from_the_past_keeps_walking() -> None:
    study = study_of(train("walk", config=replace(AngleCRBMConfig(), iterations=10)).bundle_model(), read_clips())
    assert study.run == ""
    assert set(experiments_of(study)) == {"cycle", "feet", "random", "sync"}
    figures = limit_cycle(study, seconds=30.0)
    assert figures["period_error"] < 0.05
    assert figures["drift"] < 0.005
    assert 0.6 < figures["energy"] < 1.1


@pytest.mark.slow
def test_with_one_control_unit_running_starts_and_never_ends() -> None:
    config = replace(AngleCRBMConfig(), iterations=10)
    run = train("walk", "run", config=replace(config, crbm=replace(config.crbm, epochs=150)))
    study = study_of(run.bundle_model(), read_clips())
    assert np.isfinite(switch(study, "walk", "run", 4)[0]).all()
    assert not np.isfinite(switch(study, "run", "walk", 4)[0]).any()


@pytest.mark.parametrize("labels", [("walk",), ("walk", "run")])
def test_a_fast_rate_from_the_past_blows_up(labels: tuple[str, ...]) -> None:
    with pytest.raises(DivergedError, match="diverged"):
        train(*labels, config=replace(AngleCRBMConfig(), past_rate=2e-2))


def test_the_past_drives_free_units_and_visible_units_are_real() -> None:
    crbm = CRBM(visible=3, taps=2, control=1, free=2, taylor=True)
    generator = torch.Generator().manual_seed(0)
    for value in crbm.parameters():
        value.normal_(0, 1, generator=generator)
    visible, past = torch.randn(4, 3, generator=generator), torch.randn(4, 6, generator=generator)
    total = crbm.hidden_bias[1:] + visible @ crbm.hidden_weight[1:].T + past @ crbm.free_past_weight
    torch.testing.assert_close(crbm.free(visible, past, 2.0), torch.sigmoid(total / 2))
    free = torch.rand(4, 2, generator=generator)
    drive = crbm.visible_bias + past @ crbm.past_weight + crbm.hidden_weight[0]
    found = crbm.visible(crbm.drive(past, torch.ones(4, 1)), free, 2.0)
    torch.testing.assert_close(found, drive + free @ crbm.hidden_weight[1:])


def test_variety_is_normal_about_the_mean() -> None:
    net = AngleCRBM(SHORT, channels=5, labels=1)
    noise = torch.rand(20000, net.noise_units, generator=torch.Generator().manual_seed(0))
    mean = torch.arange(5.0).expand(20000, 5)
    assert torch.equal(net.vary(mean, noise, torch.zeros(20000, 1)), mean)
    away = net.vary(mean, noise, torch.full((20000, 1), 0.5)) - mean
    np.testing.assert_allclose(away.mean(dim=0), 0, atol=0.02)
    np.testing.assert_allclose(away.T.cov(), 0.25 * np.eye(5), atol=0.02)


@pytest.mark.slow
def test_a_run_reads_back_exports_and_iterates_as_its_manifest_says(tmp_path: Path) -> None:
    run = train("walk", "run")
    run.save(tmp_path)
    again = Run.load(tmp_path)
    assert AngleCRBM.from_config(again.manifest["config"]).to_config() == tuples(run.manifest["config"])
    export_run(again, tmp_path / "bundle.zip")
    model = run.bundle_model()
    found, three, one = (model.start(iterations=n).frames(np.eye(2)) for n in (None, 3, 1))
    np.testing.assert_array_equal(found, three)
    assert not np.array_equal(found, one)
