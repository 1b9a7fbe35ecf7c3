"""The training loop: what is kept, and going on after any stop, for every kind of learner."""

import logging
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from trainings import log_of, same

from motet_train import trainer
from motet_train.descent import GradientLearner, Term, Terms, Training, rate
from motet_train.papers.li2018.convseq2seq import Config, ConvSeq2Seq, Discriminator
from motet_train.papers.li2018.recipe import Adversary
from motet_train.papers.li2018.stepwise import Stepwise
from motet_train.papers.tdbn.clips import body_parts, read_clips
from motet_train.papers.tdbn.rbm import Learning
from motet_train.papers.tdbn.recipe import DivergenceLearner
from motet_train.papers.tdbn.tdbn import TDBN, AngleCRBM, AngleCRBMConfig, Lessons, TDBNConfig
from motet_train.progress import Shown
from motet_train.runs import WEIGHTS, RunError, read_state
from motet_train.trainer import CHECKPOINT, LOG, Learner, kept, train

EPOCHS = Training(epochs=4, batch=8, optimiser="nadam", learning_rate=0.05, falling=0.5, clip=1.0)
STEPS = Training(steps=11, every=3, batch=8, learning_rate=0.02, l2=1e-3)
AVERAGED = replace(STEPS, average=0.9, optimiser="adamw", weight_decay=0.01, warm_up=3, cosine=True, keep="last")
SEED = 5


class Regression(nn.Module):
    """A linear map with dropout."""

    def __init__(self) -> None:
        super().__init__()
        self.layer, self.dropout = nn.Linear(4, 3), nn.Dropout(0.2)

    def loss(self, rows: Tensor) -> Terms:
        losses = (self.layer(self.dropout(rows[:, :4])) - rows[:, 4:]).square().mean(dim=1)
        return (Term(losses, len(rows)),)


def rows(rng: np.random.Generator, count: int) -> Tensor:
    """Four numbers and what three of them are, times 2."""
    given = rng.normal(size=(count, 4)).astype(np.float32)
    return torch.from_numpy(np.concatenate([given, 2 * given[:, :3]], axis=1))


def regression(training: Training, validate: Callable[[], Mapping[str, Any]] | None = None) -> GradientLearner:
    torch.manual_seed(0)
    net, held_out = Regression(), rows(np.random.default_rng(9), 32)

    def batches(rng: np.random.Generator) -> Iterator[Tensor]:
        for _ in range(2 if training.epochs else 1):
            yield rows(rng, training.batch)

    @torch.no_grad()
    def loss() -> dict[str, float]:
        return {"validation": float(net.loss(held_out)[0].losses.mean())}

    return GradientLearner(net, training, net.loss, batches, validate or loss)


def adversarial() -> GradientLearner:
    torch.manual_seed(0)
    config = Config(20, filters=(2, 2, 2), units=4, padding="same")
    net = Stepwise(ConvSeq2Seq(config), 20, range(20), 50)
    training = replace(STEPS, batch=2, adversary=0.01)
    adversary = Adversary(net, Discriminator(config, 53), training)

    def batches(rng: np.random.Generator) -> Iterator[Tensor]:
        yield torch.from_numpy(rng.normal(size=(training.batch, 53, 20)).astype(np.float32))

    return GradientLearner(net, training, adversary.loss, batches, others=adversary.parts)


def control(restarts: int = 2, missed: Callable[[int], list[str]] | None = None) -> DivergenceLearner:
    clips = read_clips()
    parts = body_parts(clips.skeleton, clips.channels).of_channel.tolist()
    lower, upper = Learning(epochs=5), Learning(epochs=3)
    net = TDBN(TDBNConfig(rbm=lower, crbm=upper, restarts=restarts, tries=1, rounds=1, hidden_per_part=4), parts, 3)
    frames = [[torch.tensor(motion[::6].values).float() / 30 for motion in group] for group in clips.motions.values()]
    generator = torch.Generator().manual_seed(SEED)
    controls = [
        [label.expand(len(one), -1) for one in group] for label, group in zip(torch.eye(3), frames, strict=True)
    ]
    stages, others = net.stages(Lessons(frames, controls, (1.0, 1.0, 1.0)), generator)
    return DivergenceLearner(net, stages, generator, missed or (lambda enough: ["a", "b"]), others)


def baseline() -> DivergenceLearner:
    net = AngleCRBM(AngleCRBMConfig(crbm=Learning(epochs=6, rate=1e-3)), 4, 1)
    frames = [[rows(np.random.default_rng(0), 40)[:, :4]]]
    generator = torch.Generator().manual_seed(SEED)
    stages, others = net.stages(Lessons(frames, [[torch.ones(40, 1)]], (1.0,)), generator)
    return DivergenceLearner(net, stages, generator, None, others)


LEARNERS: dict[str, Callable[[], Learner]] = {
    "epochs": lambda: regression(EPOCHS),
    "steps": lambda: regression(STEPS),
    "averaged": lambda: regression(AVERAGED),
    "adversary": adversarial,
    "tdbn": control,
    "crbm": baseline,
}
families = pytest.mark.parametrize("family", LEARNERS)


@pytest.fixture(autouse=True)
def short_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motet_train.papers.tdbn.recipe.EPOCHS_A_CHUNK", 2)


def trained(learner: Learner, folder: Path, **options: Any) -> dict[str, Tensor]:
    folder.mkdir(exist_ok=True)
    train(learner, SEED, folder, **options)
    return learner.kept.state_dict()


def lines(folder: Path) -> list[dict[str, Any]]:
    return [{key: value for key, value in line.items() if "second" not in key} for line in log_of(folder)]


class StopsAt:
    """Progress that is interrupted at some step."""

    def __init__(self, step: int) -> None:
        self.left = step

    def step(self, done: int, total: int, unit: str, loss: float) -> None:
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt

    def chunk(self, line: Mapping[str, Any], total: int, unit: str) -> None:
        """Nothing."""


@families
@pytest.mark.parametrize("step", [1, 4, 5])
def test_interrupted_and_resumed_is_the_same_to_the_bit_as_never_stopped(
    family: str, step: int, tmp_path: Path
) -> None:
    whole = trained(LEARNERS[family](), tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        trained(LEARNERS[family](), tmp_path / "parts", progress=StopsAt(step))
    assert same(whole, trained(LEARNERS[family](), tmp_path / "parts"))
    assert lines(tmp_path / "whole") == lines(tmp_path / "parts")
    ends = [torch.load(tmp_path / name / CHECKPOINT, weights_only=True)["states"]["net"] for name in ("whole", "parts")]
    assert same(*ends)


@families
@pytest.mark.parametrize("crash", [WEIGHTS, LOG, CHECKPOINT])
def test_a_crash_before_any_write_of_any_chunk_changes_nothing(
    family: str, crash: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The checkpoint is the last to be written: were it not, its chunk would count as done without its weights."""
    whole, write, written = trained(LEARNERS[family](), tmp_path / "whole"), trainer.write_whole, set[int]()

    def crashing(path: Path, content: str | bytes) -> None:
        chunk = len((path.parent / LOG).read_text().splitlines()) if (path.parent / LOG).exists() else 0
        if path.name == crash and chunk not in written:
            written.add(chunk)
            raise MemoryError
        write(path, content)

    monkeypatch.setattr(trainer, "write_whole", crashing)
    for _ in range(20):
        with suppress(MemoryError):
            again = trained(LEARNERS[family](), tmp_path / "parts")
            break
    assert len(written) > 1 or crash == WEIGHTS
    assert same(whole, again)
    assert lines(tmp_path / "whole") == lines(tmp_path / "parts")


def test_chunks_depend_on_the_seed(tmp_path: Path) -> None:
    other = regression(EPOCHS)
    train(other, SEED + 1, tmp_path)
    assert not same(other.kept.state_dict(), trained(regression(EPOCHS), tmp_path / "one"))


@pytest.mark.parametrize("training", [EPOCHS, STEPS])
def test_a_finished_run_goes_on_for_longer(training: Training, tmp_path: Path) -> None:
    training = replace(training, falling=0.0)
    longer = replace(training, epochs=6) if training.epochs else replace(training, steps=18)
    trained(regression(training), tmp_path)
    trained(regression(longer), tmp_path)
    done = [line[training.unit] for line in lines(tmp_path)]
    assert done == ([1, 2, 3, 4, 5, 6] if training.epochs else [3, 6, 9, 11, 12, 15, 18])


def test_the_average_of_the_weights_is_kept(tmp_path: Path) -> None:
    learner, seen = regression(AVERAGED), []
    step = learner.descent.step

    def noted(*given: Any) -> tuple[float, float]:
        found = step(*given)
        seen.append(learner.net.layer.weight.detach().clone())  # type: ignore[union-attr, operator]
        return found

    learner.descent.step = noted  # type: ignore[method-assign]
    weights = trained(learner, tmp_path)
    expected = seen[0]
    for weight in seen[1:]:
        expected = 0.9 * expected + 0.1 * weight
    torch.testing.assert_close(weights["layer.weight"], expected)
    assert not torch.allclose(weights["layer.weight"], seen[-1], atol=1e-3)
    kept_on_disk = torch.load(tmp_path / WEIGHTS, weights_only=True)
    assert same(kept_on_disk, weights)


def test_the_weights_of_the_best_validation_are_kept_or_the_last(tmp_path: Path) -> None:
    found = {}
    for keep in ("best", "last"):
        errors = iter([0.5, 0.3, 0.4, 0.3])
        learner = regression(replace(EPOCHS, keep=keep), lambda errors=errors: {"validation": next(errors)})  # type: ignore[misc]
        states: list[dict[str, Tensor]] = []
        validate = learner.validate
        learner.validate = lambda: (states.append(clone(learner.net)), validate())[1]  # noqa: B023
        found[keep] = trained(learner, tmp_path / keep), states
    assert same(found["best"][0], found["best"][1][1])
    assert same(found["last"][0], found["last"][1][3])


def clone(net: nn.Module) -> dict[str, Tensor]:
    return {name: value.clone() for name, value in net.state_dict().items()}


def test_patience_ends_training_and_keeps_the_best(tmp_path: Path) -> None:
    errors = iter([0.5, 0.3, 0.4, 0.35, 0.2])
    learner = regression(replace(STEPS, steps=100, patience=2), lambda: {"validation": next(errors)})
    trained(learner, tmp_path)
    log = lines(tmp_path)
    assert [line["validation"] for line in log] == [0.5, 0.3, 0.4, 0.35]
    assert kept(log, "best")["step"] == 6


def test_the_first_candidate_that_misses_nothing_is_taken_and_no_other_is_trained(tmp_path: Path) -> None:
    misses = iter([["a"], [], ["b"]])
    learner = control(3, lambda enough: next(misses))
    trained(learner, tmp_path)
    assert [line["missed"] for line in lines(tmp_path) if "missed" in line] == [["a"], []]
    assert lines(tmp_path)[-1]["epoch"] == 5 + 2 * 3


def test_else_the_candidate_that_misses_least_and_counting_stops_early(tmp_path: Path) -> None:
    misses, limits = iter([["a", "b", "c"], ["a"], ["b", "c"], ["c"]]), []
    states: list[dict[str, Tensor]] = []

    def missed(enough: int) -> list[str]:
        limits.append(enough)
        states.append(clone(learner.kept))
        return next(misses)

    learner = control(4, missed)
    assert same(trained(learner, tmp_path), states[1])
    assert limits[1:] == [3, 1, 1]


def test_it_learns_and_is_told_how_far_it_is(tmp_path: Path) -> None:
    learner, shares = regression(replace(STEPS, steps=300, every=100, l2=0.0)), []
    learner.on_share = shares.append
    trained(learner, tmp_path)
    log = lines(tmp_path)
    assert log[-1]["validation"] < 0.4 * log[0]["validation"]
    np.testing.assert_allclose(shares, np.arange(300) / 300)


def test_the_bar_is_full_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    logging.getLogger("motet.train").setLevel(logging.INFO)
    shown = Shown()
    for epoch in (1, 2):
        shown.step(epoch, 2, "epoch", 0.5)
        assert shown.bar.n == epoch - 1
        shown.chunk({"epoch": epoch, "seconds": 1.0}, 2, "epoch")
    assert shown.bar.n == 2
    shown.close()


def test_learning_rates() -> None:
    by_epoch = Training(epochs=10, learning_rate=2.0, falling=0.4)
    assert [rate(by_epoch, done) for done in (0, 5, 6, 7, 9)] == pytest.approx([2.0, 2.0, 2.0, 1.5, 0.5])
    falling = Training(steps=100, learning_rate=1.0, falling=0.5)
    np.testing.assert_allclose([rate(falling, step) for step in (0, 50, 75, 99)], [1, 1, 0.5, 0.02])
    decaying = Training(steps=100, learning_rate=1.0, decay=(0.95, 10))
    np.testing.assert_allclose([rate(decaying, step) for step in (9, 10, 35)], [1, 0.95, 0.95**3])
    wave = Training(steps=100, learning_rate=1.0, warm_up=4, cosine=True)
    expected = [0.25, 0.75 * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * 0.02))), 0.505, 0.01]
    np.testing.assert_allclose([rate(wave, step) for step in (0, 2, 50, 100)], expected)
    warm = Training(epochs=9, learning_rate=2.0, warm_up=4)  # the first epoch learns, too
    assert [rate(warm, done) for done in range(6)] == [0.5, 1.0, 1.5, 2.0, 2.0, 2.0]


def test_l2_is_a_term_of_the_loss_and_leaves_biases_alone() -> None:
    training = Training(steps=1, optimiser="sgd", learning_rate=0.1, l2=0.03)
    one, other, given = regression(training), regression(training), rows(np.random.default_rng(0), 4)
    one.net.eval(), other.net.eval()
    one.descent.step([(given, True)])
    weight = other.net.layer.weight  # type: ignore[union-attr]
    (term,) = other.net.loss(given)  # type: ignore[operator]
    loss = term.losses.mean() + 0.03 * weight.square().sum()  # type: ignore[operator]
    gradients = torch.autograd.grad(loss, list(other.net.parameters()))
    for stepped, before, gradient in zip(one.net.parameters(), other.net.parameters(), gradients, strict=True):
        torch.testing.assert_close(stepped, before - 0.1 * gradient)


def test_the_gradient_is_clipped() -> None:
    training = Training(steps=1, optimiser="sgd", learning_rate=1.0)
    one, before = regression(training), regression(training)
    one.descent.step([(rows(np.random.default_rng(0), 4), True)], clip=1e-3)
    moved = [a - b for a, b in zip(one.net.parameters(), before.net.parameters(), strict=True)]
    np.testing.assert_allclose(float(torch.cat([part.flatten() for part in moved]).norm().detach()), 1e-3, rtol=1e-3)


def ragged(rows: Tensor) -> Tensor:
    """Which losses of a row count: one to three, as sentences have different numbers of words."""
    return torch.arange(3) < 1 + rows[:, :1].abs() * 2


class Words(Regression):
    """A regression whose rows have different numbers of losses."""

    def loss(self, rows: Tensor) -> Terms:
        losses = (self.layer(rows[:, :4]) - rows[:, 4:]).square()[ragged(rows)]
        return (Term(losses, len(losses)),)


def test_a_batch_in_parts_is_the_step_of_the_whole(tmp_path: Path) -> None:
    def learnt(parts: int) -> tuple[Any, list[float]]:
        torch.manual_seed(0)
        net, training = Words(), replace(EPOCHS, batch=7, accumulate=parts)

        def batches(rng: np.random.Generator) -> Iterator[Tensor]:
            yield from (rows(rng, 7), rows(rng, 2))  # the second has fewer rows than parts

        learner = GradientLearner(net, training, net.loss, batches)
        (tmp_path / f"{parts}").mkdir()
        losses = [line["loss"] for line in train(learner, SEED, tmp_path / f"{parts}")]
        return net.state_dict(), losses

    whole, parts = learnt(1), learnt(3)
    torch.testing.assert_close(whole[0], parts[0], atol=1e-5, rtol=1e-5)
    np.testing.assert_allclose(whole[1], parts[1], rtol=1e-5)


def test_products_in_bfloat16_learn_about_the_same(tmp_path: Path) -> None:
    exact, half = (
        trained(regression(replace(STEPS, precision=precision)), tmp_path / precision)  # type: ignore[arg-type]
        for precision in ("float32", "bfloat16")
    )
    assert half["layer.weight"].dtype == torch.float32
    assert not same(exact, half)
    torch.testing.assert_close(exact, half, atol=0.02, rtol=0.05)


def test_bad_trainings_are_named(tmp_path: Path) -> None:
    learner = regression(EPOCHS)
    nn.init.constant_(learner.net.layer.weight, float("inf"))  # type: ignore[union-attr, arg-type]
    with pytest.raises(RunError, match="no longer finite"):
        trained(learner, tmp_path)
    assert list(tmp_path.iterdir()) == []
    trained(regression(EPOCHS), tmp_path)
    with pytest.raises(RunError, match="does not belong to this run"):
        trained(control(), tmp_path)
    (tmp_path / CHECKPOINT).write_bytes(b"nothing")
    with pytest.raises(RunError, match="cannot be read"):
        trained(regression(EPOCHS), tmp_path)


class Hostile:
    """What makes a folder where it is unpickled."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        return os.mkdir, (str(self.folder),)


@pytest.mark.parametrize("zipped", [True, False])
def test_a_hostile_checkpoint_is_refused_and_executes_nothing(zipped: bool, tmp_path: Path) -> None:
    path, folder = tmp_path / CHECKPOINT, tmp_path / "executed"
    torch.save({"states": {"net": Hostile(folder)}}, path, _use_new_zipfile_serialization=zipped)
    with pytest.raises(RunError, match="holds objects other than tensors and plain values") as refused:
        read_state(path)
    assert "\n" not in str(refused.value)
    assert not folder.exists()
    torch.load(path, weights_only=False)
    assert folder.exists()  # it is hostile


@pytest.mark.parametrize("cut", [0, 1, 40, 200, -1, -30])
def test_a_damaged_checkpoint_is_refused(cut: int, tmp_path: Path) -> None:
    path = tmp_path / CHECKPOINT
    torch.save({"states": {"net": torch.arange(9.0)}}, path)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(RunError, match=r"checkpoint\.pt cannot be read: \S"):
        read_state(path)
