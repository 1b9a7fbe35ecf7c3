"""Figures of docs/results/speed.md: python tests/train/training_curves.py

Trains a small net to describe for 500 steps by one process, by two that torchrun starts, and by one that computes each
batch in four parts, without what is drawn at random, and prints how far their curves and weights are apart.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import torch
from language_data import small_store
from trainings import log_of

SETTINGS = """
epochs = 50  # of ten batches
batch = 5
[model]
embedding = 8
encoder_units = [16, 16]
decoder_units = [16, 16]
dropout = 0.0
frame_noise = 0.0
summary = 0.0
"""
TWO = ("-m", "torch.distributed.run", "--nproc-per-node", "2", "--standalone")


def trained(place: Path, name: str, more: str = "", start: tuple[str, ...] = ()) -> Path:
    """A run of so many processes."""
    (settings := place / f"{name}.toml").write_text(SETTINGS + more)
    command = ("-m", "motet", "train", "describe", "--data", place / "store", "--config", settings)
    called = [sys.executable, *start, *map(str, command), "--out", str(place / name)]
    subprocess.run(called, check=True, capture_output=True)
    return place / name


def curve(run: Path) -> torch.Tensor:
    """The losses and validation losses of all epochs, (epochs, 2)."""
    return torch.tensor([[line["loss"], line["validation"]] for line in log_of(run)])


def compare(name: str, one: Path, other: Path) -> None:
    """Print how far two runs are apart."""
    first, second = curve(one), curve(other)
    weights = [torch.load(run / "weights.pt", weights_only=True) for run in (one, other)]
    apart = max(float((value - weights[1][key]).abs().max()) for key, value in weights[0].items())
    off = float(((first - second).abs() / first).max())
    print(
        f"{name}: loss {float(first[0, 0]):.4f} to {float(first[-1, 0]):.4f}; the curves of {len(first)} epochs are at "
        f"most {off:.1e} apart, the weights {apart:.1e}",
        flush=True,
    )


def main() -> None:
    """Train three runs and compare."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        small_store(place)
        one = trained(place, "one")
        compare("two processes", one, trained(place, "two", start=TWO))
        compare("four parts", one, trained(place, "parts", "[training]\naccumulate = 4\n"))


if __name__ == "__main__":
    main()
