"""A run of the weights of a bundle, with heads shown as :mod:`motet_train.data.habits` mends those of recordings.

    python docs/results/level_heads.py generate.zip store runs/level

Of the weights only those change by which the last layer of the decoder gives the head's rotation, so all other joints
stay as they are and codes keep their meaning. They are the least squares for the mended heads of a store, rare actions
weighing more, and for a change that is steady, so that heads move as before.
"""

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from motet.bundle.bundle import Bundle
from motet.files import new_folder
from motet_export.restored import restored
from motet_train.data.batches import frame_mirror
from motet_train.data.habits import without_habits
from motet_train.data.store import Store
from motet_train.models.codec import MotionCodec
from motet_train.models.motion_codes import MotionCodes
from motet_train.recipes.codes import codes_of

STEADY = 100.0
"""Weight of the second difference of the change, from frame to frame, relative to how far off heads are."""


@torch.no_grad()
def level(codec: MotionCodec, store: Store) -> None:
    """Change the weights of a codec's head."""
    mended = without_habits(store)
    contract = mended.contract(range(len(store.records)))
    heads = [place for place, channel in enumerate(contract.channels) if channel.startswith("head.")]
    layer = codec.decoder.outward
    spans = [(record.shows, *span) for record in store.records for span in record.spans]
    durations = Counter[str | int]()
    for action, start, stop in spans:
        durations[action] += stop - start

    # the normal equations, from recordings and their mirror images
    count = layer.in_features + 1
    left = torch.zeros(count, count, dtype=torch.float64)
    right = torch.zeros(count, len(heads), dtype=torch.float64)
    for action, start, stop in spans:
        weight = durations[action] ** -0.5
        for seen in (lambda frames: frames, frame_mirror(contract)):
            inputs, shown = decoded(codec, seen(store.values(start, stop)), store.fps)
            wanted = torch.from_numpy(seen(mended.values(start, stop)))[: len(shown)]
            off = ((wanted - shown) / codec.scale)[:, heads].double()
            bends = inputs.diff(n=2, dim=0)
            left += weight * (inputs.T @ inputs + STEADY * bends.T @ bends)
            right += weight * inputs.T @ off

    change = torch.linalg.solve(left, right).float()
    layer.weight[heads] += change[:-1].T
    layer.bias[heads] += change[-1]


def decoded(codec: MotionCodec, frames: NDArray[Any], fps: float) -> tuple[Tensor, Tensor]:
    """Of frames (T, D), encoded, the inputs (T', H + 1) of the decoder's last layer with a 1 for its bias, and what it
    shows (T', D)."""
    codes = torch.from_numpy(codes_of(codec, frames, fps))[None]
    if not codes.numel():
        return torch.zeros(0, codec.decoder.outward.in_features + 1).double(), torch.zeros(0, frames.shape[1])
    hidden = list[Tensor]()
    handle = codec.decoder.outward.register_forward_pre_hook(lambda _, inputs: hidden.append(inputs[0][0]))
    shown = codec.decode(codes[..., 0], codec.from_codes(codes[..., 1:]))[0]
    handle.remove()
    return functional.pad(hidden[0], (0, 1), value=1.0).double(), shown


def main(path: str, data: str, out: str) -> None:
    """Write the run, which keeps the commands of the bundle."""
    bundle = Bundle.open(path)
    run = restored(bundle)
    assert isinstance(run.model, MotionCodes)
    level(run.model.codec, Store.open(Path(data)))
    # what is remembered is as it was, with the commands
    memory = torch.from_numpy(bundle.table("memory").copy())
    run.model.memory = memory
    training = run.manifest["training"]
    about = {
        "config": {**run.manifest["config"], "remembered": len(memory)},
        "training": {**training, "codec": {**training["codec"], "heads": "docs/results/level_heads.py"}},
    }
    with new_folder(Path(out)) as folder:
        replace(run, manifest={**run.manifest, **about}).save(folder)


if __name__ == "__main__":
    main(*sys.argv[1:])
