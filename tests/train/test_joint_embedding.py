"""Motions and sentences in one space: what the net sees, its loss, its graphs, and its training."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from language_data import records
from stores import prepare
from torch import Tensor
from trainings import check_resumed, log_of, rebuilt, trained

from motet.figures.humanoid.bones import HUMANOID
from motet.motion.kinematics import positions
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS
from motet_train.data.batches import Pairs, views
from motet_train.data.preparation import Preparation
from motet_train.data.sentences import alike
from motet_train.data.store import Store
from motet_train.models.joint_embedding import (
    DEVIATION_FLOOR,
    JointEmbedding,
    JointEmbeddingConfig,
    contrast,
    of_frames,
    of_speeds,
)
from motet_train.models.kinematics import EulerPlaces, Figure, figure_of
from motet_train.recipes.language import divided

JOINTS = [joint.name for joint in HUMANOID.joints[1:] if not joint.name.endswith("_end")]
CHANNELS = (*ROOT_BLOCK, *(f"{name}.r{axis}" for name in JOINTS for axis in "xyz"))
UNITS = (*ROOT_BLOCK_UNITS, *("deg",) * (len(CHANNELS) - len(ROOT_BLOCK)))
D, V = len(CHANNELS), 12
CONTRACT = MotionContract("root_angles", CHANNELS, UNITS, 10.0, np.zeros(D), np.full(D, 20.0), HUMANOID)


def net(**changes: float) -> JointEmbedding:
    torch.manual_seed(0)
    config = JointEmbeddingConfig(D, V, figure_of(CONTRACT), embedding=8, vector=6)
    found = JointEmbedding(replace(config, **changes))
    found.measure_by(CONTRACT.mean, CONTRACT.std)
    return found


FRAMES = 20 * torch.randn(4, 9, D, generator=torch.Generator().manual_seed(1))
LENGTHS = torch.tensor([9, 2, 5, 3])
WORDS = torch.tensor([[5, 4, 3], [6, 0, 0], [7, 8, 0], [9, 10, 11]])
COUNTS = (WORDS != 0).sum(dim=1)


def test_places_are_those_of_the_motion_that_plays() -> None:
    values = np.random.default_rng(0).normal(0, 40, (7, D))
    values[:, :3] = 0  # it stays and faces z
    world = positions(CONTRACT.motion(values, plant=False))
    kept = [HUMANOID.names.index(name) for name in JOINTS]
    found = EulerPlaces(figure_of(CONTRACT))(torch.tensor(values, dtype=torch.float32)[None])
    np.testing.assert_allclose(found[0].reshape(7, -1, 3), world[:, kept] - world[:, :1], atol=1e-5)


def test_frames_that_are_no_euler_angles_have_no_places() -> None:
    assert figure_of(replace(CONTRACT, representation="root_vectors")) == Figure()
    assert figure_of(replace(CONTRACT, skeleton=None)) == Figure()


def test_statistics_are_those_of_numpy() -> None:
    x = torch.randn(3, 8, 6, generator=torch.Generator().manual_seed(0))
    lengths = torch.tensor([8, 2, 5])
    found, speeds = of_frames(x, lengths), of_speeds(x, lengths)
    for row, length in enumerate(lengths.tolist()):
        frames = x[row, :length].numpy()
        of = [frames[[t for t in range(length) if 3 * t // length == part]] for part in range(3)]
        means = [one.mean(axis=0) if len(one) else frames.mean(axis=0) for one in of]
        wanted = [frames.mean(axis=0), frames.std(axis=0), frames.min(axis=0), frames.max(axis=0), *means]
        np.testing.assert_allclose(found[row], np.concatenate(wanted), atol=1e-5)
        steps = np.diff(frames, axis=0, prepend=frames[:1]).reshape(length, 2, 3)
        speed = np.hypot(np.linalg.norm(steps, axis=-1), DEVIATION_FLOOR)
        np.testing.assert_allclose(speeds[row], np.sqrt([*speed.mean(axis=0), *speed.max(axis=0)]), atol=1e-5)


def test_a_row_of_a_padded_batch_gets_what_it_gets_alone() -> None:
    model = net().eval()
    motions, texts = model.embed_motion(FRAMES, LENGTHS), model.embed_text(WORDS, COUNTS)
    assert torch.allclose(motions.norm(dim=1), torch.ones(4))
    assert torch.allclose(texts.norm(dim=1), torch.ones(4))
    for row in range(4):
        alone = model.embed_motion(FRAMES[row : row + 1, : LENGTHS[row]], LENGTHS[row : row + 1])
        torch.testing.assert_close(alone, motions[row : row + 1])
        alone = model.embed_text(WORDS[row : row + 1, : COUNTS[row]], COUNTS[row : row + 1])
        torch.testing.assert_close(alone, texts[row : row + 1])


def naive_contrast(scores: Tensor, groups: list[int]) -> list[float]:
    """Each row's and column's log-probability of its own, of those that are right or show something else."""
    found = []
    for own in range(len(groups)):
        asked = [i for i in range(len(groups)) if i == own or groups[i] != groups[own]]
        ways = [[float(scores[own, i]) for i in asked], [float(scores[i, own]) for i in asked]]
        found.append(sum(np.log(np.exp(way).sum()) - float(scores[own, own]) for way in ways) / 2)
    return found


def test_the_loss_is_that_of_a_naive_twin() -> None:
    scores = torch.randn(5, 5, generator=torch.Generator().manual_seed(0))
    groups = [0, 1, 0, 2, 1]
    np.testing.assert_allclose(contrast(scores, torch.tensor(groups)), naive_contrast(scores, groups), rtol=1e-5)


def test_motions_are_set_against_sentences_and_sentences_against_wordings() -> None:
    model, groups = net(wordings=0.5).eval(), torch.tensor([0, 1, 0, 2])
    motions = model.embed_motion(FRAMES, LENGTHS)
    texts, others = model.embed_text(WORDS, COUNTS), model.embed_text(WORDS.flip(0), COUNTS.flip(0))
    wanted = contrast(motions @ texts.T / 0.1, groups) + 0.5 * contrast(texts @ others.T / 0.1, groups)
    pairs = Pairs(model.statistics(FRAMES, LENGTHS), WORDS, WORDS.flip(0), groups)
    torch.testing.assert_close(model.losses(pairs), wanted)
    assert torch.equal(pairs[1:3].groups, groups[1:3])


def test_what_shows_the_same_is_what_is_linked_by_sentences() -> None:
    rng = np.random.default_rng(0)
    said = [rng.integers(0, 30, 2).tolist() for _ in range(20)]
    found = alike(said)
    linked = np.array([[bool(set(a) & set(b)) for b in said] for a in said])
    reached = np.linalg.matrix_power(linked.astype(float), 20) > 0
    assert [[a == b for b in found] for a in found] == reached.tolist()


def test_a_net_comes_back_from_its_configuration() -> None:
    model = net().eval()
    again = rebuilt("joint-embedding", model)
    assert torch.equal(again.embed_motion(FRAMES, LENGTHS), model.embed_motion(FRAMES, LENGTHS))


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Walkers of whom nothing is said twice."""
    folder = tmp_path_factory.mktemp("search") / "store"
    said = (
        replace(r, sentences=(f"walker {chr(97 + i)} walks", f"here {chr(97 + i)} goes"))
        for i, r in enumerate(records(20))
    )
    prepare(said, folder, Preparation("root_angles", humanoid=False, trim=False, cut=False))
    return folder


def test_views_are_parts_of_the_motions_with_their_sentences(store: Path) -> None:
    found = divided(Store.open(store), mirror=False)
    examples = found.examples(found.parts.train)
    made = views(examples, lambda frames, lengths: frames[:, :1].sum(dim=2), 3, lambda frames, rng: frames[1:], seed=0)
    assert made.seen.shape == (1, len(examples.records), 3, 1)
    np.testing.assert_array_equal(made.only([2, 0]).seen, made.seen[:, [2, 0]])
    (pairs,) = made.epoch(np.random.default_rng(0), 100)
    firsts = [{float(f.sum()) for o in range(3) for f in found.store.sequence(r, o)} for r in examples.records]
    for seen, words, other in zip(pairs.seen, pairs.words, pairs.others, strict=True):
        (record,) = [i for i, known in enumerate(firsts) if any(np.isclose(float(seen), one) for one in known)]
        said = [ids.tolist() for ids in examples.sentences[record]]
        assert words[words != 0].tolist() in said
        assert other[other != 0].tolist() in said


SETTINGS = "[training]\nepochs = 4\nevery = 2\nbatch = 8\nwarm_up = 0\ncosine = false\n[model]\nvector = 5\n"


def test_a_run_says_what_it_is_and_learns(store: Path, tmp_path: Path) -> None:
    manifest = trained("search", SETTINGS, store, tmp_path / "run").manifest
    assert (manifest["verb"], manifest["model"], manifest["loop"]) == ("search", "joint-embedding", "nearest")
    lines = log_of(tmp_path / "run")
    assert [line["epoch"] for line in lines] == [2, 4]
    assert lines[1]["loss"] < lines[0]["loss"]
    assert all(0 <= line["first_5"] <= 1 for line in lines)


def test_resumed_training_is_the_same_to_the_bit(store: Path, tmp_path: Path) -> None:
    check_resumed(partial(trained, "search", SETTINGS, store), tmp_path, "--epochs", 2)


def test_vectors_of_many_views_are_of_length_1() -> None:
    net = JointEmbedding(JointEmbeddingConfig(D, V)).eval()
    vectors = net.embed_statistics(torch.randn(2, 3, 4, len(net.seen_mean)))
    torch.testing.assert_close(vectors.norm(dim=-1), torch.ones(2, 3, 4))
