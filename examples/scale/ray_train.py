"""Trains by Ray Train, on as many workers as are asked for, which share a folder with this machine:

    python examples/scale/ray_train.py 2 describe --data store --out run

What follows the number of workers is a command of ``motet train``, and the run is the one that it would write alone.
Workers have a GPU each if ``--device cuda`` is among its options. RAY_ADDRESS names a cluster; without it one of this
machine is started.
"""

import os
import sys
from pathlib import Path
from typing import Any

import ray
from ray.train import ScalingConfig
from ray.train.torch import TorchTrainer


def train(asked: dict[str, Any]) -> None:
    """What each worker does; Ray has made its process group."""
    from motet.cli import main

    os.chdir(asked["folder"])
    main(["train", *asked["command"]], standalone_mode=False)


if __name__ == "__main__":
    workers, *command = sys.argv[1:]
    asked = {"folder": str(Path.cwd()), "command": command}
    if "RAY_ADDRESS" not in os.environ:  # a core more for what starts the workers
        ray.init(num_cpus=int(workers) + 2)
    scaling = ScalingConfig(num_workers=int(workers), use_gpu="cuda" in command)
    TorchTrainer(train, train_loop_config=asked, scaling_config=scaling).fit()
