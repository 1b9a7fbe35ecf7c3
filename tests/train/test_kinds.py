"""Kinds of action, disguised motions, people kept back, and how sure answers are."""

import numpy as np
import pytest
import torch

from motet.models.describe import DescribeModel
from motet.models.load import load_as
from motet.models.nearest_neighbour import GOES_LEFT, GOES_RIGHT, GOES_STRAIGHT
from motet.representation.root_block import ROOT_BLOCK
from motet_train.data.batches import Views
from motet_train.data.disguise import Disguise, seen_as
from motet_train.data.errors import DataError
from motet_train.data.kinds import KIND_PATTERNS, careful, named, shown_by
from motet_train.data.store import KEYED, Entry, split
from motet_train.evaluate.language.actions import calibration_error
from motet_train.models.discriminant import discriminate
from motet_train.models.joint_embedding import JointEmbedding, JointEmbeddingConfig
from motet_train.recipes.known import Tried, grouped, learned, way_of

WALKS = ("a person walks", "she strolls along", "He walks on.", "walking to the left", "one hops a bit", "goes on foot")


def test_sentences_name_kinds_of_action() -> None:
    assert named("A man jogs backwards") == {"run", "backwards"}
    assert named("he walks without jumping") == {"walk"}
    assert named("he lifts his left arm") == frozenset()
    assert named("somebody gets up from the chair") == {"rise", "sit"}
    assert len(KIND_PATTERNS) > 40


def test_what_one_annotator_says_makes_nothing_right() -> None:
    shown = shown_by(WALKS)
    assert shown.shown == {"walk"}
    assert shown.right("a person strolls")
    assert not shown.right("a person hops")
    assert not shown.right("a person")
    assert shown_by(WALKS, "walk to hop").right("hopping")
    assert careful(WALKS, shown.shown, 2) == ["a person walks", "she strolls along"]


def test_where_sentences_say_that_somebody_goes() -> None:
    assert way_of("she walks and turns left") == (GOES_LEFT, 0, 1)
    assert way_of("he veers to the right by 45 degrees while running")[:2] == (GOES_RIGHT, 45)
    assert way_of("he runs straight ahead") == (GOES_STRAIGHT, 0, 1)
    assert way_of("a person walks using the left and the right foot in turn")[0] == 0
    assert way_of("he pivots right")[0] == GOES_RIGHT
    assert way_of("someone walks off to the left")[0] == way_of("she runs diagonally left")[0] == GOES_LEFT
    assert way_of("a man runs and changes direction to the right")[0] == GOES_RIGHT
    assert way_of("she sits")[2] == 0


def test_a_side_is_that_of_the_path_whatever_the_verb() -> None:
    assert way_of("a woman walks straight and then continues to the right") == (GOES_RIGHT, 0, 1)
    assert way_of("the running man does not keep straight but bears left") == (GOES_LEFT, 0, 1)
    assert way_of("man walks then 90 degrees right") == (GOES_RIGHT, 90, 1)
    # who steps or jumps to a side does not turn there
    assert way_of("quick sidestep left")[0] == way_of("a figure jumps right and stops")[0] == 0


def test_the_ways_that_ship_are_those_of_their_sentences() -> None:
    known = load_as(DescribeModel, "describe").known
    np.testing.assert_array_equal(known.ways, [way_of(sentence) for sentence in known.sentences])


def test_disguised_motions_are_cut_moved_and_repeated() -> None:
    channels, rng = (*ROOT_BLOCK, "spine.rx", "hips.x"), np.random.default_rng(0)
    frames = np.random.default_rng(1).normal(size=(100, 8)).astype(np.float32)
    plain = seen_as(frames, rng, Disguise(share=0.0, crop=1.0), (25, 120), channels, 10.0)
    assert 10 <= len(plain) <= 40
    assert any(np.array_equal(plain, frames[start : start + len(plain)]) for start in range(100))
    still = seen_as(frames, rng, Disguise(share=1.0, standing=1.0, off=0.0), (25, 120), channels, 10.0)
    assert not still[:, :2].any()
    off = seen_as(np.zeros((100, 8)), rng, Disguise(share=1.0), (25, 120), channels, 10.0)
    assert (np.ptp(off, axis=0) < 1e-12).all()
    assert off[0, 6] != 0
    assert off[0, 7] == 0
    loop = seen_as(frames[:12], rng, Disguise(share=1.0, repeated=1.0, tempo=0.0), (25, 120), channels, 10.0)
    np.testing.assert_array_equal(loop[:12], loop[12:24])


def test_clips_of_a_pattern_are_kept_back() -> None:
    entries = [Entry(f"{who}_{take}", who, ("walks",), ((0, 9),)) for who in "ABCDEFGHIJKL" for take in range(2)]
    parts = split(entries, 0, "B_*")
    assert {entries[i].subject for i in parts.test} == {"B"}
    assert {*parts.train, *parts.validation, *parts.test} == set(range(24))
    people = [{entries[i].subject for i in part} for part in (parts.train, parts.validation)]
    assert people[0].isdisjoint(people[1])
    assert "B" not in people[0] | people[1]
    assert {entries[i].subject for i in split(entries, 0, "B_*,C_0").test} == {"B", "C"}
    # what nobody performed is trained on, and the same people are for validation with it as without
    keyed = [Entry(f"{KEYED}_{take}", KEYED, ("waves",), ((0, 9),)) for take in range(100)]
    with_keyed = split([*entries, *keyed], 0, "B_*")
    assert (with_keyed.validation, with_keyed.test) == (parts.validation, parts.test)
    assert set(with_keyed.train) == {*parts.train, *range(24, 124)}
    with pytest.raises(DataError, match="0 of 24 motions match"):
        split(entries, 0, "X_*")


def test_people_of_one_corpus_are_one_group() -> None:
    groups = grouped(["ACCAD_1", "ACCAD_2", "01", "02", "ACCAD_1", "02"], 2)
    assert groups.tolist() == [0, 0, 1, 1, 0, 1]


def test_the_probability_is_that_of_being_right() -> None:
    rng = np.random.default_rng(0)
    share, similarity = rng.uniform(0, 1, 4000), rng.uniform(0.2, 1, 4000)
    right, one = rng.random(4000) < share, np.zeros(4000, np.int64)
    how = learned(Tried(share, similarity, one, right), 0.9)
    assert how.share == pytest.approx(1.0, abs=0.15)
    assert abs(how.bias) < 0.4
    trusted = share > 1 / (1 + (1 - how.sure) / how.sure)
    assert right[trusted].mean() == pytest.approx(0.9, abs=0.04)
    assert 0.2 < how.outside < 0.22
    assert calibration_error(share, right) < 0.05
    assert calibration_error(np.full(4000, 0.95), right) == pytest.approx(0.95 - right.mean())


def test_what_is_sure_is_right_in_every_group() -> None:
    rng = np.random.default_rng(0)
    share, group = rng.uniform(0, 1, 4000), np.repeat([0, 1], [3000, 1000])
    right = rng.random(4000) < np.where(group == 0, share**0.2, share)
    easy = learned(Tried(share[:3000], share[:3000], group[:3000], right[:3000]), 0.9)
    both = learned(Tried(share, share, group, right), 0.9)
    bounds = [
        share[1 / (1 + (share / (1 - share)) ** -h.share * np.exp(-h.bias)) >= h.sure].min() for h in (easy, both)
    ]
    assert bounds[0] < 0.45
    assert bounds[1] > 0.7
    assert right[(group == 1) & (share >= bounds[1])].mean() > 0.88


def test_directions_that_tell_actions_apart_count() -> None:
    """Of three statistics the first is wide and says nothing, the second tells the actions, the third is noise."""
    rng, net = np.random.default_rng(0), JointEmbedding(JointEmbeddingConfig(1, 0, vector=1)).eval()
    sizes = len(net.seen_mean)
    seen = torch.from_numpy(rng.normal(size=(1, 60, 5, sizes))).float()
    groups = np.arange(60)[None] % 2
    seen[..., 0] += torch.from_numpy(6 * rng.normal(size=(1, 60, 1))).float()
    seen[..., 1] += torch.from_numpy(3.0 * groups[..., None])
    discriminate(net, Views(seen, np.full((60, 5), 9), ((),), groups))
    with torch.no_grad():
        found = net.embed_statistics(seen[0, :, 0])[:, 0].numpy()
    assert abs(((found > 0) == groups[0]).mean() - 0.5) > 0.4  # either side is an action's
    weights = net.motion.weight[0].abs().tolist()
    assert weights[1] > 10 * max(weights[:1] + weights[2:])
