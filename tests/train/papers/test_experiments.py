"""The shipped model does what the thesis shows; what should fail, fails."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click import UsageError
from control_runs import control_run
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, GraphSpec, TensorSpec
from motet.errors import OutputError
from motet.models.load import load
from motet.papers.tdbn_control import TdbnModel
from motet.representation.contract import MotionContract
from motet_train.cli.evaluate import data_of
from motet_train.cli.suites import SUITES, Suite
from motet_train.data.errors import DataError
from motet_train.evaluate.figures import save
from motet_train.evaluate.tables import reached
from motet_train.papers.tdbn.clips import Clips, read_clips
from motet_train.papers.tdbn.experiments import constant_hysteresis, gait_transitions, limit_cycle
from motet_train.papers.tdbn.figures import drawings
from motet_train.papers.tdbn.recipe import RECIPES
from motet_train.papers.tdbn.report import GOALS, by_label, control_report, missed_goals, study_of
from motet_train.papers.tdbn.study import ControlStudy
from motet_train.papers.tdbn.tdbn import TDBNConfig


@pytest.fixture(scope="module")
def clips() -> Clips:
    return read_clips()


def test_the_shipped_bundle_reaches_every_goal_and_says_what_is_measured(clips: Clips) -> None:
    model = load("tdbn")
    report = control_report(study_of(model, clips))
    assert {name: _of(report, name) for name in GOALS if not reached(GOALS, name, _of(report, name))} == {}
    assert report["feet"]["slide_walk_recorded"] > 0
    for name in GOALS:
        group, key = name.split(".")
        if group in ("feet", "random"):  # not of the net but of how it is shown
            continue
        assert model.manifest.quality[group][key] == pytest.approx(_of(report, name), rel=0.05, abs=0.05), name


def test_a_candidate_is_judged_by_every_goal_but_its_training(monkeypatch: pytest.MonkeyPatch) -> None:
    groups: dict[str, dict[str, float]] = {}
    for name in GOALS:
        group, key = name.split(".")
        groups.setdefault(group, {})[key] = np.nan
    every: Any = {group: [lambda study, figures=figures: figures] for group, figures in groups.items()}
    monkeypatch.setattr("motet_train.papers.tdbn.report.experiments_of", lambda study: every)
    study: Any = SimpleNamespace(walk="walk", run="run", bend="bend")
    assert sorted(missed_goals(study, 1000)) == sorted(name for name in GOALS if not name.startswith("train."))


@pytest.mark.slow
@pytest.mark.parametrize(("clamped", "least", "most"), [(False, 1.5, np.inf), (True, 0.0, 1.0)])
def test_unclamped_control_units_make_the_state_leap(clips: Clips, clamped: bool, least: float, most: float) -> None:
    """The thesis' text unclamps them in the reconstruction; the switch is then a jump in one frame."""
    config = RECIPES["unclamped"].config
    config = replace(config, clamped=clamped, rbm=replace(config.rbm, epochs=300))
    study = study_of(control_run(clips, config).bundle_model(), clips)
    assert least < gait_transitions(study, count=8)["jump_ratio"] < most


@pytest.mark.slow
def test_gaits_that_borrow_persist_and_switch_where_pure_ones_rest_between(clips: Clips) -> None:
    """Seed 21, whose RBM has a state of rest between its gaits: it takes the walk away, and delays switches."""
    widths = []
    quick = []
    for config in (RECIPES["pure"].config, TDBNConfig()):
        alone = replace(config, restarts=1, tries=1, rounds=1, rbm=replace(config.rbm, epochs=300))
        study = study_of(control_run(clips, alone, seed=21).bundle_model(), clips)
        widths.append(constant_hysteresis(study)["constant_width"])
        quick.append(gait_transitions(study)["under_half"])
    pure, borrowed = widths
    assert pure < 0.2
    assert borrowed >= 0.25
    pure, borrowed = quick
    assert pure < 0.75
    assert borrowed >= 0.8


def test_a_linear_autoregression_has_no_cycle(clips: Clips) -> None:
    study = autoregression(study_of(load("tdbn"), clips))
    figures = limit_cycle(study, seconds=60.0)
    # what is linear dies out or blows up: no motion of the right size and period is left after a minute
    assert np.isfinite(figures["energy"])
    assert not (0.7 <= figures["energy"] <= 1.1 and figures["period_error"] < 0.02)


def test_figures_have_the_names_of_the_labels(clips: Clips) -> None:
    study = study_of(load("tdbn"), clips)
    other = replace(study, walk="stroll", run="jog", bend="wave")
    names = ("bend.share_from_run", "cycle_run.period_s", "hysteresis.walk_to", "gait.share")
    assert [by_label(study, name) for name in names] == list(names)
    expected = ["wave.share_from_jog", "cycle_jog.period_s", "hysteresis.stroll_to", "gait.share"]
    assert [by_label(other, name) for name in names] == expected
    assert by_label(replace(study, run=None), "bend.share_from_run") == "bend.share_from_run"


def test_figures_that_the_clips_allow_are_drawn(clips: Clips, tmp_path: Path) -> None:
    study = study_of(load("tdbn"), clips)
    assert len(drawings(study)) == 7
    assert list(drawings(replace(study, run=None, bend=None, legs=None))) == ["figure-5.2-limit-cycle"]
    some = {name: draw for name, draw in drawings(study).items() if "5.3" in name or "5.7" in name}
    for path in save(some, tmp_path / "new" / "plots"):
        assert path.read_bytes().startswith(b"\x89PNG")
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot write plots"):
        save({}, tmp_path / "file")


def test_a_run_is_evaluated_on_what_it_was_trained_on(tmp_path: Path) -> None:
    control, fill = SUITES["control"], SUITES["fill"]
    own = SimpleNamespace(representation="root_sixd")

    def found(
        command: str, data: Path | None = None, run: Path = Path("runs/x"), suite: Suite = control
    ) -> Path | None:
        model: Any = SimpleNamespace(manifest=SimpleNamespace(training={"command": command}, motion=own))
        return data_of({str(run): model}, suite, data)[str(run)]

    assert found(f"motet train tdbn --data {tmp_path} --out x") == tmp_path
    assert found(f"motet train tdbn --data={tmp_path} --out x") == tmp_path
    assert found("motet train tdbn --out x") is None
    assert found("motet train tdbn --data gone --out x", tmp_path) == tmp_path
    with pytest.raises(DataError, match=r"runs/x was trained on gone, which is missing: give --data"):
        found("motet train tdbn --data gone")
    run = tmp_path / "run"
    run.mkdir()
    (run / "run.toml").write_text(f"data = '{tmp_path}'\n")
    assert found("motet train tdbn --config own.toml --out x", run=run) == tmp_path
    assert found("motet train fill --config own.toml --out x", run=run, suite=fill) == tmp_path
    (tmp_path / "run-store").mkdir()
    (tmp_path / "run-store" / "store.json").touch()
    assert found("", run=run, suite=fill) == found("", tmp_path, run, fill) == tmp_path / "run-store"
    assert found("", tmp_path / "other", run, fill) == tmp_path / "other"
    with pytest.raises(UsageError, match=r"need --data: .*\(runs/x was trained on gone, which is missing\)"):
        found("motet train fill --data gone --out x", suite=fill)


def _of(report: Mapping[str, Mapping[str, float]], name: str) -> float:
    group, key = name.split(".")
    return report[group][key]


class Linear:
    """The next frame as a ridge regression on the last three: a control model's two graphs in numpy."""

    def __init__(self, contract: MotionContract, clips: list[NDArray[np.float64]]) -> None:
        self.mean, self.std = contract.mean, np.where(contract.std < 1e-3, 1, contract.std)
        z = [(clip - self.mean) / self.std for clip in clips]
        past = np.concatenate([np.concatenate([c[:-3], c[1:-2], c[2:-1], np.ones((len(c) - 3, 1))], axis=1) for c in z])
        target = np.concatenate([c[3:] for c in z])
        self.weight = np.linalg.solve(past.T @ past + 0.1 * np.eye(past.shape[1]), past.T @ target)

    def encode(self, feeds: Arrays) -> dict[str, NDArray[np.float32]]:
        return {"codes": ((feeds["frames"] - self.mean) / self.std).astype(np.float32)}

    def step(self, feeds: Arrays) -> dict[str, NDArray[np.float32]]:
        history = feeds["history"].astype(np.float64)
        one = np.ones((len(history), 1))
        code = np.concatenate([history.reshape(len(history), -1), one], axis=1) @ self.weight
        after = np.concatenate([history[:, 1:], code[:, None]], axis=1).clip(-1e6, 1e6)
        frame = code * self.std + self.mean
        return {"frame": frame.astype(np.float32), "next_history": after.astype(np.float32)}


def autoregression(study: ControlStudy) -> ControlStudy:
    """The study with an autoregression on the walk in place of its model."""
    contract, channels = study.model.contract, len(study.model.contract.channels)
    linear = Linear(contract, list(study.reference.motions["walk"]))
    history = TensorSpec("history", ("batch", 3, channels))
    codes, frame = (TensorSpec(name, ("batch", channels)) for name in ("codes", "frame"))
    settings = (TensorSpec(name, ("batch", 1)) for name in ("noise", "variety", "temperature"))
    inputs = (history, TensorSpec("control", ("batch", 3)), *settings)
    outputs = (replace(codes, name="next_codes"), frame, replace(history, name="next_history"))
    step = FunctionGraph(linear.step, GraphSpec(inputs, outputs, {"history": "next_history"}))
    encoder = FunctionGraph(linear.encode, GraphSpec((replace(frame, name="frames"),), (codes,)))
    model = TdbnModel(study.model.manifest, {"encoder": encoder, "step": step})
    return ControlStudy(model, study.reference, study.walk, study.run, study.bend, ())


class FunctionGraph:
    """Any function as a graph."""

    def __init__(self, function, spec: GraphSpec) -> None:  # type: ignore[no-untyped-def]
        self.function, self.spec = function, spec

    def __call__(self, feeds: Arrays) -> dict[str, NDArray[np.float32]]:
        result: dict[str, NDArray[np.float32]] = self.function(feeds)
        return result
