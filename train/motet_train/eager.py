"""The same models run by torch eagerly: the baseline of ``motet bench``."""

import torch

from motet.bundle.manifest import Manifest
from motet.models.base import BundleModel
from motet.models.load import build
from motet_train.runs import MODELS, Run


def eager_model(manifest: Manifest, threads: int) -> BundleModel:
    """A bundle's model with the same sizes in torch, its weights untrained: speed does not depend on them."""
    torch.set_num_threads(threads)
    run = Run(manifest.source, MODELS[manifest.model](manifest.config))
    return build(manifest, run.torch_graphs(), run.tables())
