"""The small predictor: what it is before and after training, and the commands around it."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from test_predict_data import write_files
from torch import nn
from trainings import done, log_of, refused

from motet.formats import read_motion, write_motion
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.evaluate.predict.floors import ZERO
from motet_train.models.figure_predictor import (
    ERROR_FLOOR,
    ErrorHead,
    FigurePredictor,
    FigurePredictorConfig,
    error_signs,
)
from motet_train.models.kinematics import VectorFigure, VectorPoints
from motet_train.models.predictor import Predictor, PredictorConfig
from motet_train.papers.li2018.expmap import CMU_LAYOUT, expmap_material, read_expmap
from motet_train.papers.li2018.report import FEW, MEAN, complete, protocol_results
from motet_train.recipes.predict import DEFAULT, train_predict
from motet_train.recipes.recipe import Job
from motet_train.runs import About, Run

ACTIONS = tuple(CMU_LAYOUT.test)


def job(folder: Path, seed: int = 0, **training: float) -> Job:
    """A job by the recipe with other settings, in a new folder."""
    folder.mkdir()
    recipe = replace(DEFAULT, training=replace(DEFAULT.training, **training))  # type: ignore[arg-type]
    return Job(recipe, About("small", "motet train predict", seed), folder)


def stirred(kind: type[nn.Module], config: object) -> Any:
    """A net whose weights are not those it starts with."""
    torch.manual_seed(0)
    net = kind(config)
    with torch.no_grad():
        for parameter in net.parameters():
            parameter.add_(0.05 * torch.randn_like(parameter))
    return net.eval()


def test_the_protocols_size_is_small() -> None:
    net = Predictor(PredictorConfig(117, tuple(range(70)), held=6))
    assert sum(parameter.numel() for parameter in net.parameters()) == 318_405


def test_before_training_it_predicts_zero_velocity() -> None:
    frames = torch.randn(3, 10, 9)
    net = Predictor(PredictorConfig(9, (0, 1, 2, 5, 6, 7, 8))).eval()
    torch.testing.assert_close(net(frames), frames[:, -1:].expand(-1, 25, -1))


def test_held_and_constant_channels_stay_and_the_place_does_not_matter() -> None:
    net, frames = stirred(Predictor, PredictorConfig(9, (0, 1, 2, 5, 6, 7), held=3)), torch.randn(4, 10, 9)
    found = net(frames)
    torch.testing.assert_close(found[..., [0, 1, 2, 3, 4, 8]], frames[:, -1:, [0, 1, 2, 3, 4, 8]].expand(-1, 25, -1))
    assert (found[..., 5:8] - frames[:, -1:, 5:8]).abs().min() > 0
    moved = frames + torch.tensor([7.0, -3, 2, 0, 0, 0, 0, 0, 0])
    torch.testing.assert_close(net(moved)[..., 5:8], found[..., 5:8], atol=1e-4, rtol=1e-4)


def test_the_mirror_image_of_a_seed_gives_the_mirror_image() -> None:
    config = PredictorConfig(6, tuple(range(6)), mirrored=(3, 4, 5, 0, 1, 2), signs=(1.0, -1.0, -1.0) * 2)
    net = stirred(Predictor, config)
    frames = torch.randn(4, 10, 6)
    torch.testing.assert_close(net(net.mirror(frames)), net.mirror(net(frames)))


def test_training_learns_and_repeats_itself(tmp_path: Path) -> None:
    material = expmap_material(read_expmap(write_files(tmp_path / "data")))
    settings = {"steps": 60, "batch": 16, "learning_rate": 1e-2, "warm_up": 5, "average": 0.9}
    runs = [train_predict(material, job(tmp_path / name, 3, **settings)) for name in ("a", "b")]
    for one, other in zip(runs[0].model.parameters(), runs[1].model.parameters(), strict=True):
        torch.testing.assert_close(one, other, atol=0, rtol=0)
    models = {"a": Run.load(tmp_path / "a").bundle_model()}
    corpus = read_expmap(tmp_path / "data")
    errors = protocol_results(models, corpus).errors
    assert complete(corpus) == ["running", "walking"]  # none is, so all count
    for action in ("walking", "running"):
        assert errors["a"][FEW, action].mean() < 0.9 * errors[ZERO][FEW, action].mean()
    assert [line["step"] for line in log_of(tmp_path / "a")] == [60]


def test_train_and_evaluate_from_the_command_line(tmp_path: Path) -> None:
    data, out = write_files(tmp_path / "data"), tmp_path / "run"
    refused("has its own test files", "train", "predict", "--data", data, "--out", out, "--split", "trial")
    trained = done("train", "predict", "--data", data, "--out", out, "--steps", 3, "--seed", 1)
    lacking = [line for line in trained.stderr.splitlines() if "lacks" in line]
    assert len(lacking) == 11  # a line for each of ten files, and how many more there are
    assert lacking[0].endswith("lacks train/basketball/basketball_1.txt")
    assert lacking[-1].endswith("lacks 32 files more")
    shown = done("evaluate", out, "--data", data, "--plots", tmp_path / "plots")
    assert "true 33 67 133 167 233 417" in " ".join(shown.stdout.split())
    assert "label them 80 160 320 400 560 1000" in " ".join(shown.stdout.split())
    assert "published: ConvSeq2Seq (Li 2018)" in shown.stdout
    assert (tmp_path / "plots" / "predict-error.png").stat().st_size > 1000
    found = json.loads(done("evaluate", out, "--data", data, "--json", "--save").stdout)
    floors = {"zero_velocity", "constant_velocity", "damped_velocity"}
    assert set(found) == {"windows_8", "windows_256", "rotation", *floors}
    assert list(found["windows_8"]["walking"]) == [f"frame_{n}" for n in (1, 3, 7, 9, 13, 24)]
    assert Run.load(out).manifest["quality"] == found


@pytest.mark.parametrize(
    ("file", "options", "unit"),
    [("{:02}_01.npz", (), ()), ("set-2_{:02}.bvh", ("--split", "trial"), ("--unit-in", "cm"))],
    ids=["people", "trials of one person in BVH"],
)
def test_motion_files_are_trained_on_and_measured_in_centimetres(
    tmp_path: Path, file: str, options: tuple[str, ...], unit: tuple[str, ...]
) -> None:
    data, out = tmp_path / "data", tmp_path / "run"
    data.mkdir()
    walk = read_motion(CMU_FOLDER / "39_14.amc").scaled(0.01)
    for n in range(10):
        write_motion(data / file.format(n), walk[10 * n : 10 * n + 160])
    command = ("train", "predict", "--data", data, *unit, *options, "-o", out)
    refused("train with --preset files", *command)
    done(*command, "--preset", "files", "--steps", 3, "--data-licence", "free")
    manifest = Run.load(out).manifest
    assert (manifest["licence"]["data"], len(manifest["training"]["data"]["test"])) == ("free", 1)
    recipe = manifest["training"]["recipe"]
    assert (recipe["warp"], recipe["reverse"], recipe["mirror"]) == (0.0, 0.0, 0.5)
    net = Run.load(out).model
    assert isinstance(net, FigurePredictor)
    assert (net.doubt.bias != 0).all()
    model = Run.load(out).bundle_model()
    expected = model.expected_errors([walk, walk[:200]])
    assert expected.shape == (2, 25)
    assert (expected > 0).all()
    np.testing.assert_allclose(expected[1], model.expected_errors(walk[:200]), rtol=1e-3)
    store = tmp_path / "run-store"
    found = json.loads(done("evaluate", out, "--data", data, "--json", "--plots", tmp_path / "plots").stdout)
    still = found["zero_velocity"]["place_cm"]
    assert 60 < still["frame_24"] < 130  # a walk at 1.4 m/s, after .83 s
    assert still["frame_1"] < still["frame_24"]
    assert found["zero_velocity"]["pose_cm"]["frame_24"] < still["frame_24"]
    assert found["constant_velocity"]["place_cm"]["frame_1"] < still["frame_1"]
    assert found["damped_velocity_of_joints"]["place_cm"]["frame_24"] < still["frame_24"]
    assert found["kinds"]["everything else"]["place_cm"] == found["place_cm"]  # nothing is said of these files
    names = sorted(path.name for path in (tmp_path / "plots").iterdir())
    assert names == sorted(["predict-distance.png", f"predict-{manifest['training']['data']['test'][0]}.png"])
    shown = done("evaluate", out, "--data", store).stdout
    assert "milliseconds 67 133 267 333 467 833" in " ".join(shown.split())


def test_the_mean_is_that_of_complete_actions(tmp_path: Path) -> None:
    data = write_files(tmp_path, 160, ACTIONS[:2])
    for action in ACTIONS[:2]:
        for n in (3, 4, 5):
            source = data / "train" / action / f"{action}_1.txt"
            (source.parent / f"{action}_{n}.txt").write_bytes(source.read_bytes())
    (data / "train" / ACTIONS[1] / f"{ACTIONS[1]}_4.txt").unlink()
    corpus = read_expmap(data)
    assert complete(corpus) == ["basketball"]
    errors = protocol_results({}, corpus).errors[ZERO]
    np.testing.assert_array_equal(errors[FEW, MEAN], errors[FEW, "basketball"])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["train", "predict", "--data", "{data}", "--out", "{data}"], "it exists"),
        (["train", "predict", "--data", "{data}/none", "--out", "{out}"], "no such corpus"),
        (["train", "predict", "--preset", "files", "--data", "{empty}", "--out", "{out}"], "no motion files"),
        (["evaluate", "{run}"], "need --data"),
        (["evaluate", "{run}", "tdbn", "--data", "{data}"], "separately"),
        (["evaluate", "{run}", "--data", "{empty}"], "not a prepared store"),
    ],
)
def test_bad_input_is_refused(tmp_path: Path, arguments: list[str], said: str) -> None:
    places = {name: tmp_path / name for name in ("data", "empty", "run", "out")}
    places["empty"].mkdir()
    write_files(places["data"])
    train_predict(expmap_material(read_expmap(places["data"])), job(places["run"], steps=1))
    refused(said, *(argument.format(**places) for argument in arguments))
    assert not places["out"].exists()


def test_doubt_finds_the_law_that_errors_follow() -> None:
    torch.manual_seed(0)
    logarithms = torch.randn(4000, 3, 6) * torch.tensor([1.0, 0.5, 2.0, 1.0, 0.1, 1.0]) - 2
    weight, bias = torch.tensor([0.5, 0, -0.2, 0.3, 0, 0.1]), torch.tensor([-3.0, -2.5, -2.0])
    mean = torch.exp((logarithms * weight).sum(-1) + bias)
    doubt = ErrorHead(3)
    logarithms = logarithms.movedim(-1, 0)
    doubt.fit(logarithms, mean * torch.empty(4000, 3).exponential_())
    found = doubt(logarithms)
    assert float((found / mean).log().abs().mean()) < 0.08
    np.testing.assert_allclose(found.mean(0), mean.mean(0), rtol=0.08)


def test_signs_grow_with_what_they_are_signs_of() -> None:
    past = torch.randn(5, 9, 4, 3)
    steps = torch.randn(5, 3, 4, 3)
    agreed = torch.zeros(5, 3)
    alike = error_signs(past, steps, agreed)
    faster = error_signs(2 * past, steps, agreed)
    apart = error_signs(past, steps, agreed + 1)
    assert (faster > alike).sum(dim=(1, 2)).tolist() == [15, 15, 15, 0, 0, 0]
    assert (apart > alike).sum(dim=(1, 2)).tolist() == [0, 0, 0, 0, 15, 0]
    torch.testing.assert_close(apart[4], torch.log(torch.tensor([1.0, 2, 3]) + ERROR_FLOOR).expand(5, 3))


SIDES = FigurePredictorConfig(
    12,
    VectorFigure(
        (-1, 0, 0),
        ((0, 1, 0), (0.2, 0, 0), (-0.2, 0, 0)),
        (0, 1, 2),
        tuple(range(6, 12)),
        tuple(range(6)),
        partners=(0, 2, 1),
    ),
    hidden=8,
    blocks=1,
)
"""A root with a joint on either side."""

MIRRORED = torch.tensor((0, 1, 2, 3, 4, 5, 9, 10, 11, 6, 7, 8))
SIGNS = torch.tensor((1.0, -1.0, -1.0, 1.0, 1.0, -1.0) + (1.0, -1.0, -1.0) * 2)
"""What mirrors its frames."""


def test_before_training_a_figure_stands_still() -> None:
    frames = torch.randn(3, 10, 12)
    after = FigurePredictor(SIDES).eval()(frames)
    torch.testing.assert_close(after[..., :3], torch.zeros(3, 25, 3), atol=2e-5, rtol=0)
    torch.testing.assert_close(after[..., 3:], frames[:, -1:, 3:].expand(-1, 25, -1), atol=1e-5, rtol=1e-5)


def test_a_figures_mirror_image_goes_on_as_its_mirror_image() -> None:
    net = stirred(FigurePredictor, SIDES)
    frames = 0.3 * torch.randn(4, 10, 12)
    mirrored = net(frames[..., MIRRORED] * SIGNS)
    torch.testing.assert_close(mirrored, net(frames)[..., MIRRORED] * SIGNS, atol=1e-4, rtol=1e-4)


def test_bones_keep_their_lengths_and_are_aimed_at_their_points() -> None:
    chain = VectorFigure(
        (-1, 0, 1, 2),
        ((0, 1, 0), (0, 0.3, 0), (0, 0.4, 0), (0.2, 0, 0)),
        (0, 1, 2),
        tuple(range(6, 12)),
        tuple(range(6)),
    )
    points = VectorPoints(chain)
    frames = 0.5 * torch.randn(2, 12, 12)
    last = points(frames, 4)[:, 4:5]
    shaken = points(frames, 4)[:, 5:] + 0.1 * torch.randn(2, 7, 7, 3)
    after = points.frames(points.from_parents(torch.cat([last, shaken], dim=1)), frames[:, 4:5])
    found = points(torch.cat([frames[:, :5], after], dim=1), 4)[:, 5:]
    torch.testing.assert_close(found[:, :, 0], shaken[:, :, 0], atol=1e-5, rtol=1e-5)
    for joint, length in ((1, 0.3), (2, 0.4), (3, 0.2)):
        bone = found[:, :, joint] - found[:, :, joint - 1]
        torch.testing.assert_close(bone.norm(dim=-1), torch.full((2, 7), length), atol=1e-5, rtol=0)
        aim = shaken[:, :, joint] - found[:, :, joint - 1]
        torch.testing.assert_close(torch.cosine_similarity(bone, aim, dim=-1), torch.ones(2, 7), atol=1e-5, rtol=0)


def test_a_figure_without_known_sides_has_no_mirror_image() -> None:
    torch.manual_seed(0)
    net = FigurePredictor(replace(SIDES, figure=replace(SIDES.figure, partners=())))
    for member in net.members:
        torch.nn.init.normal_(member.outward.weight, std=0.01)
    frames = 0.3 * torch.randn(4, 10, 12)
    seen = net.eval().seen(frames)
    points = seen[:, -1:] + net.steps(net.weights(seen).mean(0))
    vectors = net.points.from_parents(torch.cat([seen[:, -1:], points], dim=1))
    torch.testing.assert_close(net(frames), net.points.frames(vectors, frames[:, -1:]), atol=1e-3, rtol=1e-3)


def test_frames_come_back_from_points_whatever_the_angles() -> None:
    chain = VectorFigure((-1, 0, 1), ((0, 1, 0), (0, 0.3, 0), (0, 0.4, 0)), (0, 1), (6, 7, 8), tuple(range(6)))
    points = VectorPoints(chain)
    # all angles up to half a turn, and those near its ends
    angles = torch.cat([torch.linspace(0, np.pi, 480), np.pi - torch.logspace(-6, -2, 20)])
    axes = torch.nn.functional.normalize(torch.randn(500, 3), dim=-1)
    frames = 0.3 * torch.randn(500, 2, 9)
    frames[:, 1, 6:] = axes * angles[:, None]
    back = points.frames(points.from_parents(points(frames, 0)), frames[:, :1])
    torch.testing.assert_close(back[..., :6], frames[:, 1:, :6], atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(back[:470, :, 6:], frames[:470, 1:, 6:], atol=1e-4, rtol=1e-4)
    same = points(torch.cat([frames[:, :1], back], dim=1), 0)
    torch.testing.assert_close(same, points(frames, 0), atol=2e-3, rtol=0)
