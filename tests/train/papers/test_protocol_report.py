"""The table of systems that predict: rows of several seeds, published rows, costs and stick figures."""

import json
import zipfile
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from test_predict_data import write_files

from motet.errors import MotionError
from motet.formats import read_motion
from motet.motion.kinematics import heading, local_rotations, positions
from motet.motion.rotations import axis_to_rotmat, rotmat_to_rotvec, rotvec_to_rotmat
from motet_train.cli.suites import Inputs, suite_of
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.evaluate.figures import looks_of, save
from motet_train.evaluate.predict.floors import CONSTANT, DAMPED, ZERO
from motet_train.papers.li2018 import from_config, published
from motet_train.papers.li2018.convseq2seq import Config
from motet_train.papers.li2018.expmap import (
    CMU_LAYOUT,
    H36M_LAYOUT,
    ExpmapCorpus,
    Layout,
    expmap_material,
    parse,
    read_expmap,
)
from motet_train.papers.li2018.figures import FRAMES_APART, SEED_POSES, places, strips
from motet_train.papers.li2018.protocol import windows
from motet_train.papers.li2018.report import (
    FEW,
    MANY,
    MEAN,
    Errors,
    Results,
    cost_table,
    harness_table,
    protocol_table,
    seed_groups,
)
from motet_train.runs import Run

FIVE = ("basketball", "jumping", "running", "soccer", "walking")
SKELETON = read_motion(CMU_FOLDER / "39_14.amc").skeleton

ERD = "ERD (Fragkiadaki 2015)"
RRNN = "RRNN (Martinez 2017)"
CONV = "ConvSeq2Seq (Li 2018)"


def manifest(seed: int | None, model: str = "convseq2seq", recipe: dict[str, Any] | None = None, **system: Any) -> Any:
    """A model of which nothing but its manifest is asked."""
    training = {"recipe": {"steps": 5, **(recipe or {})}, "data": {}, "parameters": 12345, "machine": "M, CPU"}
    seeded = {} if seed is None else {"seed": seed, "seconds": 10.0 * seed, "threads": 1}
    settings = {"window": 20, "kernel": [2, 7], "padding": "valid", "long_term": "convolutional", **system}
    config = {"channels": 117, "system": settings}
    return SimpleNamespace(manifest=SimpleNamespace(model=model, config=config, training={**training, **seeded}))


def constant(actions: Sequence[str] = FIVE, **values: float) -> Errors:
    """Systems of a constant error, in some actions."""
    parts = [(kind, action) for kind in (FEW, MANY) for action in (*actions, MEAN)]
    return {name: {part: np.full(25, value) for part in parts} for name, value in values.items()}


def line(text: str, start: str) -> str:
    return next(line for line in text.splitlines() if line.strip().startswith(start))


@pytest.mark.parametrize("layout", ["cmu-expmap", "h36m-expmap"])
def test_the_published_actions_have_the_published_averages(layout: str) -> None:
    actions, known = published.BY_ACTION[layout], published.AVERAGES[layout]
    found = published.mean_over(actions, actions)
    assert set(found) == {RRNN, CONV}
    for name, values in found.items():
        np.testing.assert_allclose(values, known[name], atol=0.0075)  # tables have two decimals


def test_the_published_mean_of_the_complete_actions() -> None:
    found = published.mean_over(published.BY_ACTION[CMU_LAYOUT.name], FIVE)
    assert [f"{value:.2f}" for value in found[CONV]] == ["0.33", "0.50", "0.83", "0.94", "1.39"]
    assert [f"{value:.3f}" for value in found[RRNN]] == ["0.406", "0.632", "1.036", "1.172", "1.556"]
    assert published.mean_over(published.BY_ACTION[CMU_LAYOUT.name], ("walking", "unheard of")) == {}
    assert set(published.BY_ACTION[H36M_LAYOUT.name]) == set(H36M_LAYOUT.test)
    assert set(published.BY_ACTION[CMU_LAYOUT.name]) == set(CMU_LAYOUT.test)


def test_runs_that_differ_in_the_seed_alone_are_one_row() -> None:
    models = {
        "runs/conv-4x4-0": manifest(0),
        "runs/rrnn-0": manifest(0, "rrnn"),
        "runs/conv-4x4-1": manifest(1),
        "runs/none-0": manifest(0, long_term="none"),
        "bundle.zip": manifest(0),  # the first run again
        "runs/short-1": manifest(1, recipe={"steps": 4}),
        "old": manifest(None),
        "older": manifest(None),
    }
    assert list(seed_groups(models).items()) == [
        ("conv-4x4 (2 seeds)", ["runs/conv-4x4-0", "runs/conv-4x4-1"]),
        ("rrnn-0", ["runs/rrnn-0"]),
        ("none-0", ["runs/none-0"]),
        ("bundle.zip", ["bundle.zip"]),
        ("short-1", ["runs/short-1"]),
        ("old", ["old"]),
        ("older", ["older"]),
    ]


def test_titles_stay_different() -> None:
    same = {"a/x-0": manifest(0), "b/x-0": manifest(0, window=5)}
    assert list(seed_groups(same)) == ["a/x-0", "b/x-0"]
    stems = {f"x-{n}": manifest(n, window=5 if n > 1 else 20) for n in range(4)}
    assert list(seed_groups(stems)) == ["x-0 (2 seeds)", "x-2 (2 seeds)"]
    apart = {"one": manifest(0), "two": manifest(1)}
    assert list(seed_groups(apart)) == ["one (2 seeds)"]


def test_rows_are_means_and_spreads() -> None:
    part = FEW, "walking"
    drawn = np.random.default_rng(0).random((4, 25))
    errors = {name: {part: values} for name, values in zip("zabc", drawn, strict=True)}
    rows = {"ac (2 seeds)": ["a", "c"], "b": ["b"]}
    models = {name: manifest(0) for name in "abc"}
    results = Results(models, ExpmapCorpus(CMU_LAYOUT, {}, {}, ()), rows, errors)
    one, other = errors["a"][part], errors["c"][part]
    found, apart = results.grouped(), results.spreads()
    assert (list(found), list(apart)) == (["z", "ac (2 seeds)", "b"], ["ac (2 seeds)"])
    np.testing.assert_allclose(found["ac (2 seeds)"][part], (one + other) / 2)
    np.testing.assert_allclose(apart["ac (2 seeds)"][part], np.abs(one - other))
    np.testing.assert_array_equal(found["b"][part], errors["b"][part])


def shown(layout: Layout, actions: tuple[str, ...]) -> str:
    corpus = ExpmapCorpus(layout, {}, {action: {} for action in actions}, ())
    return protocol_table(constant(actions, **{ZERO: 1.0}), corpus, {})


def test_published_rows_stand_under_ours() -> None:
    few, many = shown(CMU_LAYOUT, FIVE).split("256 windows of each action")
    blocks = few.split("mean of basketball, jumping, running, soccer, walking")
    jumping = blocks[0].split("jumping\n")[1].split("running\n")[0].splitlines()
    assert [one.split() for one in jumping[0:2]] == [
        ["zero", "velocity", *["1.00"] * 6],
        ["published:", "RRNN", "(Martinez", "2017)", "0.56", "0.88", "1.77", "2.02", "2.40"],
    ]
    assert jumping[2].endswith("   0.39   0.60   1.36   1.56          2.01")
    assert line(blocks[1], f"published: {CONV}").endswith("   0.33   0.50   0.83   0.94          1.39")
    measured, averages = many.split("average of all 8 actions")
    assert "published" not in measured
    assert line(averages, "published: LTD").endswith("   0.25   0.39   0.68   0.79          1.33")
    assert line(blocks[1], "goal  ").endswith("   0.26   0.39   0.67   0.78          1.20")
    assert line(measured, "goal  ").endswith("   0.25   0.39   0.64   0.74          1.10")
    assert len({len(one) for one in few.splitlines() if "." in one}) == 1


def test_published_rows_of_human36m() -> None:
    text = shown(H36M_LAYOUT, ("walking", "posing"))
    assert line(text, f"published: {ERD}").endswith("   0.93   1.18   1.59   1.78")
    ours, first, second = (row.split() for row in text.split("mean of walking, posing\n")[1].splitlines()[:3])
    assert (ours[:2], first[1], second[1]) == (["zero", "velocity"], "RRNN", "ConvSeq2Seq")
    errors = [float(cell) for cell in second[-5:]]
    assert errors == pytest.approx([0.31, 0.57, 0.90, 1.05, 1.785], abs=0.0051)
    assert "goal" not in text


def test_costs_are_those_of_the_manifests() -> None:
    models = {"c-1": manifest(1), "c-2": manifest(2), "old": manifest(None)}
    text = cost_table(models, seed_groups(models))
    assert line(text, "c (2 seeds)").split()[3:] == ["12,345", "15", "M,", "CPU,", "threads:", "1"]
    assert line(text, "old").split() == ["old", "12,345", "M,", "CPU"]


def test_training_is_that_of_the_manifests() -> None:
    recipe = {"warp": 0.15, "reverse": 0.3, "mirror": 0.5, "average": 0.99, "learning_rate": 0.001, "keep": "best"}
    models = {f"c-{n}": manifest(n, recipe=recipe) for n in (0, 1, 2)} | {"old": manifest(None)}
    for n in range(3):
        training = models[f"c-{n}"].manifest.training
        training |= {"data": {"files": 27, "validation": ["a", "b"]}, "steps": 500, "kept_step": 300 + 100 * n}
    text = harness_table(models, seed_groups(models))
    cells = ["0-2", "27", "2", "0.15", "0.3", "0.5", "0.99", "0.001", "500", "300-500", "best"]
    assert line(text, "c (3 seeds)").split()[3:] == cells
    assert line(text, "old").split() == ["old"]  # what is not said is left out


def test_spreads_stand_behind_means_of_several_seeds() -> None:
    models = {"c-0": manifest(0), "c-1": manifest(1), "d": manifest(0, window=5)}
    found = constant(**{ZERO: 0.5, "c-0": 0.25, "c-1": 0.375, "d": 1.0})
    corpus = ExpmapCorpus(CMU_LAYOUT, {}, {action: {} for action in FIVE}, ())
    results = Results(models, corpus, seed_groups(models), found)
    text = protocol_table(results.grouped(), corpus, results.spreads())
    assert line(text, "c (2 seeds)").split("seeds)")[1].split() == ["0.31", "[.12]"] * 6
    assert line(text, "d ").split() == ["d", *["1.00"] * 6]
    assert line(text, "zero velocity").split() == ["zero", "velocity", *["0.50"] * 6]
    assert "largest seed's minus the smallest's" in text
    ends = {name: line(text, name).index(cell) for name, cell in (("c (2", "0.31"), ("d ", "1.00"), ("zero", "0.50"))}
    assert len(set(ends.values())) == 1  # means stand under each other


def test_the_mean_is_that_of_the_actions_with_all_their_files() -> None:
    gone = ("train/washwindow/washwindow_2.txt", "train/washwindow/washwindow_1.txt", "test/soccer/soccer_1.txt")
    test = {action: {} for action in (*FIVE, "washwindow") if action != "soccer"}
    found = constant(list(test), **{ZERO: 1.0})
    head = protocol_table(found, ExpmapCorpus(CMU_LAYOUT, {}, test, gone), {}).splitlines()
    assert "mean of basketball, jumping, running, walking" in head


def test_twenty_systems_look_different() -> None:
    looks = looks_of([ZERO, CONSTANT, DAMPED, *(str(n) for n in range(20))])
    assert len({(look["color"], look.get("linestyle")) for look in looks.values()}) == 23
    assert {looks[floor]["color"] for floor in (ZERO, CONSTANT, DAMPED)} == {"0.6"}


def test_places_are_those_of_the_motion() -> None:
    motion = read_motion(CMU_FOLDER / "39_14.amc")[:60]
    vectors = rotmat_to_rotvec(local_rotations(motion).swapaxes(-1, -2))
    frames = np.concatenate([np.full((60, 3), 7.0), vectors.reshape(60, -1)], axis=1)
    points = positions(motion)
    turned = axis_to_rotmat("y", -heading(motion))[:, None] @ (points - points[:, :1])[..., None]
    np.testing.assert_allclose(places(frames, SKELETON), turned[..., 0], atol=1e-9)
    with pytest.raises(MotionError, match="99 columns do not fit a skeleton of 38 joints"):
        places(frames[:, :99], SKELETON)


def test_text_files_hold_the_rotations_of_their_trials(shared: Path, cmu: Path) -> None:
    for group, trial in (("walking", "35_01"), ("soccer", "11_01")):
        with zipfile.ZipFile(shared / "cmu-expmap.zip") as archive:
            text = archive.read(f"test/{group}/{group}_1.txt").decode()
        frames = parse(text, group, 117)[1:]
        motion = read_motion(cmu / "amc" / f"{trial}.amc")[: len(frames)]
        vectors = frames[: len(motion), 3:].reshape(len(motion), 38, 3)
        found, expected = rotvec_to_rotmat(vectors).swapaxes(-1, -2), local_rotations(motion)
        np.testing.assert_allclose(found[:, 1:], expected[:, 1:], atol=0.02)  # another order or axis is off by .2


def saved(folder: Path, data: Path, seed: int, **settings: Any) -> Path:
    """The run of a small convolutional predictor that has not been trained."""
    material = expmap_material(read_expmap(data))
    torch.manual_seed(seed)
    sizes = Config(len(material.kept), filters=(2, 2, 2), units=4)
    known = {"channels": 117, "kept": list(material.kept), "seed_frames": 50}
    config = json.loads(json.dumps({**known, "system": asdict(replace(sizes, **settings))}))
    net = from_config("convseq2seq", config)
    training = {"seed": seed, "recipe": {}, "data": material.about, "parameters": 1, "seconds": 1.0}
    parts = {"name": folder.name, "version": "1", "verb": "predict", "model": "convseq2seq", "loop": "free_run"}
    more = {"motion": material.contract.to_json(), "defaults": {"horizon": 25}, "config": config, "licence": {}}
    folder.mkdir()
    Run({**parts, **more, "training": training}, net.eval()).save(folder)
    return folder


def test_all_runs_are_evaluated_at_once(tmp_path: Path) -> None:
    data = write_files(tmp_path / "data", actions=("running",))
    runs = [saved(tmp_path / f"conv-{n}", data, n) for n in range(2)]
    runs.append(saved(tmp_path / "none-0", data, 0, long_term="none"))
    models = {str(run): Run.load(run).bundle_model() for run in runs}
    results = suite_of(models).measure(models, Inputs(dict.fromkeys(models, data)))
    found, text = results.figures, results.text
    files = save(results.drawings()[""], tmp_path / "plots")
    assert [path.name for path in files] == ["predict-error.png", "predict-running.png"]
    assert line(text, "none-0")
    assert json.loads(json.dumps(found)) == found
    assert set(found) == {*map(str, runs), "grouped"}
    floors = {"zero_velocity", "constant_velocity", "damped_velocity"}
    assert set(found[str(runs[0])]) == {"windows_8", "windows_256", "rotation", *floors}
    (title, grouped), *others = found["grouped"].items()
    assert (title, others, grouped["runs"]) == ("conv (2 seeds)", [], [str(run) for run in runs[:2]])
    one, other = (found[str(run)]["windows_8"]["running"]["frame_9"] for run in runs[:2])
    assert one != other
    assert grouped["windows_8"]["running"]["frame_9"] == pytest.approx((one + other) / 2, abs=2e-4)
    assert grouped["spread"]["windows_8"]["running"]["frame_9"] == pytest.approx(abs(one - other), abs=2e-4)


def test_strips_are_seed_frames_and_what_follows(tmp_path: Path) -> None:
    data = write_files(tmp_path / "data")
    corpus = read_expmap(data)
    model = Run.load(saved(tmp_path / "run", data, 0)).bundle_model()
    found = strips({"run": model}, corpus, "walking", SKELETON)
    window = windows([corpus.test["walking"]["test/walking/walking_1.txt"]])[0]
    assert [points.shape for points in found.values()] == [(SEED_POSES + 13, 38, 3)] * 2
    np.testing.assert_allclose(found["truth"][SEED_POSES - 1], places(window[[50 - FRAMES_APART]], SKELETON)[0])
    np.testing.assert_allclose(found["truth"][-1], places(window[-1:], SKELETON)[0])
    np.testing.assert_array_equal(found["run"][:SEED_POSES], found["truth"][:SEED_POSES])
    assert np.abs(found["run"][SEED_POSES:] - found["truth"][SEED_POSES:]).max(axis=(1, 2)).min() > 0
