import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from language_data import small_store
from motet_train.checkpoint import CHECKPOINT, LOG, WEIGHTS
from motet_train.fit import Fitted, Fitting, fit, rate, validate
from torch import Tensor, nn

from motet_train.data.batches import Examples
from motet_train.models.language.batch import Batch
from motet_train.recipes.language import material
from motet_train.runs import RunError

FITTING = Fitting(clip=1.0, epochs=4, batch=8, learning_rate=0.05)
Data = tuple[Examples, Examples]


class Bag(nn.Module):
    """The words of a sentence from the mean frame: not much of a net, but with dropout and a loss."""

    def __init__(self, channels: int, words: int) -> None:
        super().__init__()
        self.layer = nn.Linear(channels, words)

    def losses(self, batch: Batch) -> Tensor:
        mean = batch.frames.sum(dim=1) / batch.lengths[:, None] / 10
        scores = self.layer(nn.functional.dropout(mean, 0.2, self.training)).log_softmax(dim=1)
        return -scores.gather(1, batch.words)[batch.words > 0]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Data:
    found = material(small_store(tmp_path_factory.mktemp("corpus")), mirror=False)
    return found.examples(found.parts.train), found.examples(found.parts.validation)


def bag(data: Data) -> Bag:
    torch.manual_seed(0)
    return Bag(data[0].store.frames.shape[1], 40)


def train(data: Data, folder: Path, fitting: Fitting = FITTING, **options: object) -> tuple[Bag, Fitted]:
    folder.mkdir(exist_ok=True)
    net = bag(data)
    return net, fit(net, data, fitting, 7, folder, **options)  # type: ignore[arg-type]


def stopping_at(step: int) -> Callable[[int, int], None]:
    steps = iter(range(1000))

    def progress(epoch: int, epochs: int) -> None:
        if next(steps) == step:
            raise KeyboardInterrupt

    return progress


def same(one: nn.Module, other: nn.Module) -> bool:
    return all(torch.equal(a, b) for a, b in zip(one.parameters(), other.parameters(), strict=True))


def weights(folder: Path) -> dict[str, Tensor]:
    found: dict[str, Tensor] = torch.load(folder / CHECKPOINT, weights_only=True)["net"]
    return found


def without_seconds(folder: Path) -> list[dict[str, float]]:
    lines = [json.loads(line) for line in (folder / LOG).read_text().splitlines()]
    return [{key: value for key, value in line.items() if "second" not in key} for line in lines]


@pytest.mark.parametrize("step", [3, 14, 20])
def test_stopped_and_resumed_is_the_same_to_the_bit_as_never_stopped(data: Data, tmp_path: Path, step: int) -> None:
    whole, _ = train(data, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        train(data, tmp_path / "parts", progress=stopping_at(step))
    parts, fitted = train(data, tmp_path / "parts")
    assert same(whole, parts)
    ends = weights(tmp_path / "whole"), weights(tmp_path / "parts")
    assert all(torch.equal(ends[0][name], ends[1][name]) for name in ends[0])
    assert without_seconds(tmp_path / "whole") == without_seconds(tmp_path / "parts")
    assert [line["epoch"] for line in fitted.log] == [1, 2, 3, 4]


def test_more_epochs_go_on_from_a_finished_run(data: Data, tmp_path: Path) -> None:
    train(data, tmp_path / "parts", replace(FITTING, epochs=2))
    parts, _ = train(data, tmp_path / "parts")
    whole, _ = train(data, tmp_path / "whole")
    assert same(whole, parts)


def test_the_weights_of_the_best_validation_loss_are_kept(data: Data, tmp_path: Path) -> None:
    fitting = replace(FITTING, epochs=12, learning_rate=0.5)
    net, fitted = train(data, tmp_path, fitting)
    losses = [line["validation_loss"] for line in fitted.log]
    assert losses[-1] > min(losses) == fitted.kept["validation_loss"]  # it overfits
    assert validate(net, data[1], fitting) == pytest.approx(min(losses), abs=1e-6)
    kept = torch.load(tmp_path / WEIGHTS, weights_only=True)
    assert all(torch.equal(kept[name], value) for name, value in net.state_dict().items())
    assert fitted.log[3]["train_loss"] < fitted.log[0]["train_loss"]
    last, fitted = train(data, tmp_path / "last", replace(fitting, keep="last"))
    assert validate(last, data[1], fitting) == pytest.approx(losses[-1], abs=1e-6)
    assert fitted.kept["epoch"] == 12


def test_the_loss_of_validation_is_the_mean_over_all_steps(data: Data) -> None:
    net = bag(data).eval()
    every = torch.cat([net.losses(batch) for batch in data[1].everything(1)])
    assert validate(net, data[1], FITTING) == pytest.approx(every.mean().item(), abs=1e-5)


def test_the_learning_rate_falls_over_the_last_epochs() -> None:
    fitting = Fitting(clip=1.0, epochs=10, learning_rate=2.0, decay=0.4)
    assert [rate(fitting, epoch) for epoch in (1, 6, 7, 8, 10)] == pytest.approx([2.0, 2.0, 2.0, 1.5, 0.5])
    assert rate(replace(fitting, decay=0.0), 10) == 2.0


def test_a_checkpoint_that_does_not_fit_is_refused(data: Data, tmp_path: Path) -> None:
    train(data, tmp_path, replace(FITTING, epochs=1))
    with pytest.raises(RunError, match="is not of this training"):
        fit(Bag(3, 4), data, FITTING, 7, tmp_path)
    (tmp_path / CHECKPOINT).write_bytes(b"no checkpoint")
    with pytest.raises(RunError, match="cannot be read"):
        train(data, tmp_path)


def test_a_loss_that_is_not_finite_ends_training(data: Data, tmp_path: Path) -> None:
    net = bag(data)
    nn.init.constant_(net.layer.weight, float("inf"))
    with pytest.raises(RunError, match="no longer finite"):
        fit(net, data, FITTING, 7, tmp_path)
    assert list(tmp_path.iterdir()) == []
