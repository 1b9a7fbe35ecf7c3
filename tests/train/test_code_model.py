"""The model that writes codes: its steps and its loss, the windows that it learns from, and its training."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from codes_data import CODEC, CODES, TEXT, small_store
from torch import Tensor, nn
from trainings import check_resumed, log_of, rebuilt, refused, trained

import motet
from motet.generate.memory import MemorySettings
from motet_train.data.sentences import actions_of
from motet_train.data.sixd_windows import CodedMotion, CodeWindows, memory_of
from motet_train.data.store import Store
from motet_train.models.action_net import ActionsConfig
from motet_train.models.codec import CodecConfig, MotionCodec
from motet_train.models.kinematics import Tree
from motet_train.models.motion_codes import CodeModelConfig, MotionCodes, MotionCodesConfig
from motet_train.recipes.codes import alike_distance, coded, codes_of
from motet_train.runs import Run

TREE = Tree((-1, 0), ((0.0, 0.0, 0.0), (0.0, 0.4, 0.0)), (0, 1))
MOVES, END, NOBODY, NOTHING = 6, 6, 4, 7
SIZES = (MOVES + 1, 15, 15)


def net(**changes: float) -> MotionCodes:
    """A tiny one, all of whose weights are drawn by chance."""
    torch.manual_seed(0)
    codec = CodecConfig(16, TREE, moves=MOVES, groups=2, levels=(3, 5), width=8, blocks=1, ahead=(1, 0), fine=4)
    text = ActionsConfig(9, NOBODY, (0, 1, 2, 3, 4, 5, 6, 6, 7), embedding=6, hidden=5)
    writer = CodeModelConfig(NOBODY, width=12, layers=2, heads=2, action=5, ages=6, **changes)  # type: ignore[arg-type]
    found = MotionCodes(MotionCodesConfig(codec, text, writer, remembered=20))
    for parameter in found.writer.parameters():
        nn.init.normal_(parameter, std=0.3)
    nn.init.normal_(found.codec.book)
    return found.eval()


def window(rows: int = 3, steps: int = 9, seed: int = 0) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """codes, before (B, N, P), action and age (B, N) by chance, two of the rows with an end."""
    rng = np.random.default_rng(seed)
    codes = np.stack([rng.integers(size - (part == 0), size=(rows, steps)) for part, size in enumerate(SIZES)], axis=-1)
    codes[0, 5, 0] = codes[2, 8, 0] = END
    before = np.concatenate([np.zeros_like(codes[:, :1]), codes[:, :-1]], axis=1)
    before[:, 0, 0] = NOTHING
    action, age = rng.integers(NOBODY + 1, size=(rows, steps)), rng.integers(9, size=(rows, steps))
    return tuple(torch.from_numpy(part) for part in (codes, before, action, age))  # type: ignore[return-value]


@torch.no_grad()
def known_of(model: MotionCodes, before: Tensor, action: Tensor, age: Tensor) -> Tensor:
    """What is known (B, N, C), the whole window at once."""
    codec, moves = model.codec, before[..., 0]
    there = (moves < END)[..., None].float()
    values = codec.from_codes(before[..., 1:])
    numbers = torch.cat([codec.book[moves.clamp_max(END - 1)] / codec.book_scale, values], dim=-1) * there
    known, _ = model.writer(moves, numbers, action, age, model.writer.start(len(moves)))
    found: Tensor = known
    return found


@torch.no_grad()
def test_step_by_step_is_the_whole_window_at_once() -> None:
    model, (_, before, action, age) = net(), window()
    expected, past, found = known_of(model, before, action, age), model.writer.start(3), []
    for step in range(9):
        now = slice(step, step + 1)
        known, past = model.step(before[:, now], action[:, now], age[:, now], past)
        found.append(known)
        assert past.shape[3] == step + 1
    torch.testing.assert_close(torch.stack(found, dim=1), expected, atol=1e-5, rtol=1e-5)
    # some steps at once
    _, past = model.step(before[:, :2], action[:, :2], age[:, :2], model.writer.start(3))
    known, past = model.step(before[:, 2:7], action[:, 2:7], age[:, 2:7], past)
    assert past.shape[3] == 7
    torch.testing.assert_close(known, expected[:, 6], atol=1e-5, rtol=1e-5)
    # all that it is told makes a difference, to this step and to later ones, never to earlier ones
    for place, part in enumerate((before, action, age)):
        others = [before, action, age]
        others[place] = part.clone()
        others[place][:, 4] = (part[:, 4] + 1) % 3
        apart = (known_of(model, *others) - expected).abs().amax(dim=(0, 2)) > 1e-6
        assert apart.tolist() == [False] * 4 + [True] * 5


@torch.no_grad()
def test_ages_beyond_those_told_apart_are_alike() -> None:
    model, (_, before, action, age) = net(), window()
    assert torch.equal(known_of(model, before, action, age + 6), known_of(model, before, action, age + 60))


def naive_loss(model: MotionCodes, known: Tensor, codes: list[int]) -> list[float]:
    """Of one step's parts: each by its own net, knowing the parts before it; nothing of what follows an end."""
    found = []
    for part, head in enumerate(model.writer.heads):
        logits = head(known).tolist()
        found.append(float(np.log(np.exp(logits).sum()) - logits[codes[part]]))
        if codes[0] == END:
            return [*found, 0.0, 0.0]
        if part < 2:
            known = known + model.writer.before[part].weight[codes[part]]  # type: ignore[union-attr, index, operator]
    return found


@torch.no_grad()
def test_the_loss_is_that_of_a_naive_twin_and_of_the_graph() -> None:
    model, (codes, before, action, age) = net(), window()
    known, found = known_of(model, before, action, age), model.losses(codes, before, action, age)
    assert found.shape == codes.shape
    expected = [[naive_loss(model, known[b, n], codes[b, n].tolist()) for n in range(9)] for b in range(3)]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)
    assert not found[0, 5, 1:].any()
    assert found[0, 5, 0] > 0
    chances = model.part(known.flatten(0, 1), codes.flatten(0, 1))
    assert chances.shape == (27, 3, 15)
    told = chances.gather(2, codes.flatten(0, 1)[..., None])[..., 0].unflatten(0, (3, 9))
    real = (codes[..., :1] != END) | torch.tensor([True, False, False])
    torch.testing.assert_close(-told[real], found[real], atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(chances.exp().sum(dim=2), torch.ones(27, 3))
    assert (chances[:, 0, len(range(MOVES + 1)) :] == -1e4).all()


def test_hidden_steps_tell_nothing() -> None:
    model, (_, before, action, age) = net(hidden=1.0).train(), window()
    others = before.flip(1)
    assert torch.equal(known_of(model, before, action, age), known_of(model, others, action, age))
    model.eval()
    assert not torch.equal(known_of(model, before, action, age), known_of(model, others, action, age))


def test_tables_hold_the_memory_and_the_numbers_of_its_codes() -> None:
    model = net()
    rows = np.random.default_rng(0).integers(6, size=(20, 5))
    model.memory.copy_(torch.from_numpy(rows))
    tables, (move, *codes) = model.tables(), rows[7, :3]
    np.testing.assert_array_equal(tables["memory"], rows)
    torch.testing.assert_close(torch.from_numpy(tables["moves"][move]), model.codec.book[move] / model.codec.book_scale)
    body = torch.from_numpy(tables["body"][codes].ravel())
    torch.testing.assert_close(body, model.codec.from_codes(torch.tensor([codes]))[0])


def test_the_distance_of_alike_steps_is_that_of_the_codec() -> None:
    """The default is the distance that the shipped codec has; one with numbers half as far apart has a quarter."""
    memory = motet.load("generate").source.memory
    # those of the recordings, which the setting was made of, and a few of commands
    assert alike_distance(memory) == pytest.approx(MemorySettings().alike_distance, abs=0.05)
    halves = replace(memory, moves=memory.moves / np.float32(2), body=memory.body / np.float32(2))
    assert alike_distance(halves) == pytest.approx(alike_distance(memory) / 4, abs=0.01)
    short = {action: rows[:40] for action, rows in memory.rows.items()}
    assert alike_distance(replace(memory, rows=short)) == memory.settings.alike_distance  # nothing to measure


def test_a_model_comes_back_from_its_configuration() -> None:
    model, (codes, *rest) = net(), window()
    assert torch.equal(rebuilt("motion-codes", model).losses(codes, *rest), model.losses(codes, *rest))


def test_of_the_codec_nothing_is_trained() -> None:
    model, (codes, *rest) = net().train(), window()
    model.losses(codes, *rest).sum().backward()
    assert all(parameter.grad is None for parameter in model.codec.parameters())
    assert all(parameter.grad is not None for parameter in model.writer.blocks.parameters())
    assert all(any(weight is own for own in model.writer.blocks.parameters()) for weight in model.matrices())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("codes")
    small_store(found)
    return found


@pytest.fixture(scope="module")
def store(folder: Path) -> Store:
    return Store.open(folder / "store")


def coded_store(store: Store, records: tuple[int, ...]) -> tuple[list[CodedMotion], MotionCodec]:
    contract = store.contract(records)
    torch.manual_seed(0)
    codec = MotionCodec(CodecConfig(len(contract.channels), TREE, moves=MOVES, groups=2, levels=(3, 5), fine=4))
    codec.measure_by(contract.mean, contract.std)
    nn.init.normal_(codec.book, std=0.1)
    return coded(store, records, codec.eval(), actions_of(store, records), contract.mirror), codec


def test_recordings_become_codes_as_they_are_and_mirrored(store: Store) -> None:
    records = (0, 1, 6)
    motions, codec = coded_store(store, records)
    mirror = store.contract(records).mirror
    assert len(motions) == 6
    actions = actions_of(store, records)
    for number, motion in enumerate(motions):
        record, mirrored = records[number // 2], bool(number % 2)
        frames = np.array(store.sequence(record), np.float64)
        frames = mirror(frames) if mirrored else frames
        steps = len(frames) // 4
        assert (motion.action, motion.starts, motion.first) == (actions.of[record, mirrored], True, True)
        assert motion.codes.shape == (steps + 1, 3)
        assert motion.codes[-1].tolist() == [MOVES, 0, 0]
        np.testing.assert_array_equal(motion.codes[:-1], codes_of(codec, frames, 30.0))
        body = codec.to_codes(codec.encode(torch.tensor(frames[None, : 4 * steps]).float()))[0]
        assert motion.codes[:-1, 1:].tolist() == body.tolist()
    assert codes_of(codec, np.zeros((3, len(store.channels))), 30.0).shape == (0, 3)
    kept = memory_of([*motions[:2], CodedMotion(motions[2].codes, 1, True, first=False)])
    assert kept[:, :3].tolist() == np.concatenate([motion.codes for motion in motions[:2]]).tolist()
    assert kept[:, 3].tolist() == [motion.action for motion in motions[:2] for _ in motion.codes]
    assert kept[:, 4].tolist() == [age for motion in motions[:2] for age in range(len(motion.codes))]


def motion_of(length: int, action: int, first: int, starts: bool = True) -> CodedMotion:
    """A motion each step of which is found again by its codes; it ends."""
    codes = np.stack([np.arange(length) % MOVES, np.full(length, first), np.arange(length)], axis=1)
    codes[-1] = END, 0, 0
    return CodedMotion(codes, action, starts, True)


def test_windows_are_parts_of_motions_with_what_was_before() -> None:
    motions = [motion_of(12, 0, 0), motion_of(5, 1, 1), motion_of(9, 2, 2, starts=False)]
    windows = CodeWindows(motions, 7, END, first=4.0)
    batch = windows.draw(400, 0.25, NOBODY, np.random.default_rng(0))
    codes, before, action, age, weights = batch.codes, batch.before, batch.action, batch.age, batch.weights
    assert codes.shape == before.shape == (400, 7, 3)
    assert action.shape == age.shape == weights.shape == (400, 7)
    starts = set()
    for row in range(400):
        motion, start = motions[int(codes[row, 0, 1])], int(age[row, 0])
        real = min(7, len(motion.codes) - start)
        assert codes[row, :real].tolist() == motion.codes[start : start + 7].tolist()
        assert not codes[row, real:].any()
        assert before[row, 1:real].tolist() == motion.codes[start : start + real - 1].tolist()
        assert before[row, 0].tolist() == (motion.codes[start - 1].tolist() if start else [NOTHING, 0, 0])
        assert age[row].tolist() == list(range(start, start + 7))
        first = (4.0 if motion.starts else 0.0) if start == 0 else 1.0
        assert weights[row].tolist() == [first] + [1.0] * (real - 1) + [0.0] * (7 - real)
        assert set(action[row].tolist()) in ({motion.action}, {NOBODY})
        starts.add((motion.action, start))
    assert {(0, 0), (0, 7), (1, 0), (2, 4)} <= starts
    assert (action[:, 0] == NOBODY).float().mean() == pytest.approx(0.25, abs=0.07)
    assert len(batch[1::2]) == 200
    assert torch.equal(batch[1::2].codes, codes[1::2])


def test_windows_of_rare_actions_are_drawn_oftener() -> None:
    windows = CodeWindows([motion_of(16, 0, 0), motion_of(9, 0, 1), motion_of(25, 1, 2)], 7, END, 1.0)
    np.testing.assert_allclose(windows.chances, np.array([16 / 5, 9 / 5, 5]) / 10)


@pytest.fixture(scope="module")
def parts(folder: Path) -> tuple[object, ...]:
    trained("codec", CODEC, folder / "store", folder / "codec")
    trained("actions", TEXT, folder / "store", folder / "actions")
    return "--codec", folder / "codec", "--actions", folder / "actions"


def test_a_run_learns_and_says_how_its_parts_were_made(folder: Path, parts: tuple[object, ...], tmp_path: Path) -> None:
    longer = CODES.replace("steps = 6\nevery = 3", "steps = 60\nevery = 20")
    run = trained("codes", longer, folder / "store", tmp_path / "run", *parts)
    log = log_of(tmp_path / "run")
    assert [line["step"] for line in log] == [20, 40, 60]
    assert log[-1]["loss"] < log[0]["loss"]
    manifest, model = run.manifest, run.model
    assert isinstance(model, MotionCodes)
    assert (manifest["verb"], manifest["model"], manifest["loop"]) == ("generate", "motion-codes", "codes")
    assert len(manifest["actions"]) == model.config.text.actions == model.config.writer.actions == 6
    assert len(model.memory) == model.config.remembered
    recipe = manifest["training"]["recipe"]
    assert (recipe["steps"], recipe["window"]) == (60, 6)
    ages = model.memory[:, -1]
    assert int((ages == 0).sum()) == int((model.memory[:, 0] == model.end).sum()) > 0
    for name in ("codec", "actions"):
        own = Run.load(folder / name).manifest
        assert {key: own["training"][key] for key in ("command", "seed", "steps", "seconds")} == manifest["training"][
            name
        ]
    assert (manifest["actions"], manifest["vocabulary"]) == (own["actions"], own["vocabulary"])


def test_resumed_training_is_the_same_to_the_bit(folder: Path, parts: tuple[object, ...], tmp_path: Path) -> None:
    def train(out: Path, *options: object) -> Run:
        return trained("codes", CODES, folder / "store", out, *parts, *options)

    whole = check_resumed(train, tmp_path, "--steps", 3).model.state_dict()
    # codec and net of actions are what they were
    for name, prefix in (("codec", "codec"), ("actions", "text")):
        kept = torch.load(folder / name / "weights.pt", weights_only=True)
        assert all(torch.equal(whole[f"{prefix}.{key}"], kept[key]) for key in kept)


def test_a_writer_is_trained_further_with_its_parts(folder: Path, parts: tuple[object, ...], tmp_path: Path) -> None:
    first = trained("codes", CODES, folder / "store", tmp_path / "first", *parts)
    of_first = ("--codec", tmp_path / "first", "--actions", tmp_path / "first", "--seed", 1, "--steps", 1)
    further = trained("codes", CODES, folder / "store", tmp_path / "further", *of_first)
    other = trained("codes", CODES, folder / "store", tmp_path / "other", *parts, "--seed", 1, "--steps", 1)
    weights = first.model.state_dict()

    def distance(run: Run) -> float:
        return sum(float((value - weights[name]).abs().sum()) for name, value in run.model.state_dict().items())

    assert 0 < distance(further) < 0.5 * distance(other)
    training = further.manifest["training"]
    assert training["codec"] == first.manifest["training"]["codec"]
    assert training["start"]["command"] == first.manifest["training"]["command"]
    # only one of the same sizes
    larger = tmp_path / "larger.toml"
    larger.write_text(CODES.replace("width = 12", "width = 24"))
    command = ("train", "codes", "--data", folder / "store", "--config", larger, *of_first, "--out", tmp_path / "out")
    refused("first is a writer of other sizes", *command)


def test_codes_need_a_codec_and_a_net_of_the_same_actions(
    folder: Path, parts: tuple[object, ...], tmp_path: Path
) -> None:
    small_store(tmp_path, 10)
    trained("actions", TEXT, tmp_path / "store", tmp_path / "other")
    codec, net, other = folder / "codec", folder / "actions", tmp_path / "other"
    other_sentences = "the net of actions other was trained on other sentences: train it on the same data and split"
    for first, second, reason in (
        (net, net, "codes need the run of a codec (motet train codec), not of motion-actions"),
        (codec, codec, "codes need the run of a net of actions (motet train actions), not of motion-codec"),
        (codec, other, other_sentences),
    ):
        runs = ("--codec", first, "--actions", second)
        refused(reason, "train", "codes", "--data", folder / "store", *runs, "--out", tmp_path / "run")
        assert not (tmp_path / "run").exists()
