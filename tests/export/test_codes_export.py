"""The model that writes codes as an ONNX bundle: what torch computes, decoded to motions code by code."""

import json
import warnings
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import torch
from codes_data import humanoid_contract
from small_runs import check_parity, check_rows_alone
from torch import nn

import motet
from motet.bundle.bundle import Bundle
from motet.errors import TextWarning
from motet.generate.model import CodesModel
from motet.models.load import verify
from motet.motion.kinematics import positions
from motet.text.vocabulary import NEW_MODEL_RULES, SPECIALS
from motet_export.bundles import export_run
from motet_export.parity import walks
from motet_train.models.action_net import ActionsConfig, stems_of
from motet_train.models.codec import CodecConfig
from motet_train.models.kinematics import tree_of
from motet_train.models.motion_codes import CodeModelConfig, MotionCodes, MotionCodesConfig
from motet_train.recipes.codes import DRAWING_SETTINGS
from motet_train.runs import Run

pytestmark = pytest.mark.slow  # torch's exporter

WORDS = [*SPECIALS, "a", "person", "walks", "runs", "left", "right", "stands", "still"]
COMMON = {"strolls": "walks", "sprinted": "runs"}
SAID = ("a person walks", "a person runs left", "a person stands still")
CONTRACT = humanoid_contract((0.5, 0.0, 0.0, 0.9), std=0.1)
D, MOVES, PARTS = len(CONTRACT.channels), 6, 3


def run() -> Run:
    torch.manual_seed(0)
    codec = CodecConfig(D, tree_of(CONTRACT), moves=MOVES, groups=2, levels=(3, 3), width=8, blocks=1, fine=6)
    stems, table = stems_of(WORDS, tuple(COMMON)), {"common": len(COMMON), "vector": 4}
    text = ActionsConfig(len(WORDS), len(SAID), stems, embedding=6, hidden=5, **table)
    writer = CodeModelConfig(len(SAID), width=12, layers=2, heads=2, action=5, ages=16)
    net = MotionCodes(MotionCodesConfig(codec, text, writer, remembered=36))
    net.text.start_from(torch.randn(len(stems), 4))
    for parameter in net.writer.parameters():
        nn.init.normal_(parameter, std=0.3)
    net.measure_by(CONTRACT.mean, CONTRACT.std)
    net.codec.measure_by(CONTRACT.mean, CONTRACT.std)
    nn.init.normal_(net.codec.book, std=0.1)
    net.memory.copy_(torch.from_numpy(remembered()))
    named = {"name": "small-codes", "verb": "generate", "model": "motion-codes", "loop": "codes"}
    actions = [{"sentence": said, "words": said.split()} for said in SAID]
    plain = json.loads(json.dumps(asdict(net.config)))
    known = {"text": NEW_MODEL_RULES.to_json(), "vocabulary": WORDS, "common": COMMON, "actions": actions}
    settings = {"defaults": {**DRAWING_SETTINGS, "memory": 0.3}, "config": plain, "licence": {}, "training": {}}
    return Run({**named, **known, **settings, "motion": CONTRACT.to_json()}, net.eval())


def remembered() -> np.ndarray:
    """Three motions (36, P + 2) of eleven steps and an end, one for each action."""
    rng = np.random.default_rng(0)
    codes = np.concatenate([rng.integers(MOVES, size=(36, 1)), rng.integers(9, size=(36, 2))], axis=1)
    codes[11::12] = MOVES, 0, 0
    return np.column_stack([codes, np.arange(36) // 12, np.arange(36) % 12]).astype(np.int16)


@pytest.fixture(scope="module")
def bundle(folder: Path) -> Path:
    export_run(run(), folder / "codes.zip")
    return folder / "codes.zip"


def test_a_bundle_keeps_its_contracts_and_carries_its_parity(bundle: Path) -> None:
    opened = Bundle.open(bundle)
    roles = CodesModel.ROLES
    tables = ("body.npy", "memory.npy", "moves.npy")
    assert verify(opened).files == tuple(sorted(("golden.npz", *tables, *(f"{role}.onnx" for role in roles))))
    rungs = {name for name, rung in opened.manifest.parity.items() if isinstance(rung, dict) and "bound" in rung}
    assert {f"{role}.one_step" for role in roles} | {"runs"} <= rungs
    check_parity(opened, run(), rungs, golden=1e-4)


@pytest.mark.parametrize("role", CodesModel.ROLES)
def test_a_row_of_a_batch_gets_what_it_gets_alone(bundle: Path, role: str) -> None:
    below = {"words": len(WORDS), "codes": MOVES, "action": 4, "age": 16}
    check_rows_alone(Bundle.open(bundle).graph(role), below, 1e-5)


def test_a_loaded_bundle_computes_what_the_net_computes(bundle: Path) -> None:
    model, net = motet.load(bundle), run().model
    assert isinstance(model, CodesModel)
    frames = walks(CONTRACT, np.random.default_rng(1), 1, 24)[0].astype(np.float64)
    codes = model.codec.codes_of(frames)
    assert codes.shape == (6, PARTS)
    with torch.no_grad():
        body = net.codec.to_codes(net.codec.encode(torch.from_numpy(frames).float()[None]))[0]
        said = net.text(torch.tensor([[4, 5, 6]]), torch.tensor([3]))[0]
    assert codes[:, 1:].tolist() == body.tolist()
    np.testing.assert_allclose(model.embed("a person walks"), said, atol=1e-6)


def test_motions_last_as_long_as_is_asked_and_differ(bundle: Path) -> None:
    model = motet.load(bundle)
    found = model.generate("a person walks", 3, seconds=2)
    assert [generated.frames.shape for generated in found] == [(60, D)] * 3
    assert np.isfinite(positions(found[0].motion)).all()
    assert len({generated.frames.tobytes() for generated in found}) == 3
    free = model.generate(["a person walks", "a person runs left"], 2, max_seconds=1, seed=5)
    # eight steps of four frames are as near to a second as steps come
    assert all(4 <= len(generated.frames) <= 32 for row in free for generated in row)
    alone = model.generate("a person runs left", 2, max_seconds=1, seed=6)
    for one, other in zip(alone, free[1], strict=True):
        np.testing.assert_array_equal(one.frames, other.frames)


def test_all_from_memory_plays_what_is_remembered(bundle: Path) -> None:
    """Whatever action is drawn, the whole motion is one of the three, through the codec."""
    model, net = motet.load(bundle), run().model
    codes = torch.from_numpy(remembered()).long().reshape(3, 12, 5)[:, :-1, :PARTS]
    with torch.no_grad():
        known = net.decode(codes)[0].flatten(1, 2)[..., 4:].numpy()
    for generated in model.generate("a person walks", 4, memory=1.0):
        off = [float(np.abs(generated.frames[:, 4:] - one).max()) for one in known if len(generated.frames) == len(one)]
        assert min(off) < 1e-4


def test_common_words_reach_the_graph_with_their_vectors(bundle: Path) -> None:
    model, net = CodesModel.load(Bundle.open(bundle)), run().model
    with torch.no_grad():
        for text, ids in (("a person strolls", [4, 5, 12]), ("a person sprinting", [4, 5, 13]), ("sprintd", [13])):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", TextWarning)
                found = model.embed(text)
            expected = net.text(torch.tensor([ids]), torch.tensor([len(ids)]))[0]
            torch.testing.assert_close(torch.from_numpy(found), expected)
    assert not np.array_equal(model.embed("a person strolls"), model.embed("a person walks"))
    assert model.lacking("a person strolls", 0) == []
    assert model.lacking("a person strolls", 1) == ["strolls"]
    known, near = (model.understood(text).confidence for text in ("a person walks", "a person strolls"))
    assert 0 < near < known <= 1
    with pytest.warns(TextWarning, match="'sprintd' is read as 'sprinted'"):
        model.embed("sprintd")
    with pytest.warns(TextWarning, match=r"does not know eine, geht .*; it is for English"):
        model.ids("eine a geht")
