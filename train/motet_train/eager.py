"""The same models run by torch eagerly: the baseline of ``motet bench``."""

from collections.abc import Mapping
from typing import Any

import torch

from motet.models.load import VERBS, Model
from motet_train.runs import MODELS, Run


def eager_model(manifest: Mapping[str, Any], threads: int) -> Model:
    """A bundle's model with the same sizes in torch, its weights untrained: speed does not depend on them."""
    torch.set_num_threads(threads)
    return VERBS[manifest["verb"]](
        manifest, Run(manifest, MODELS[manifest["model"]](manifest["config"])).torch_graphs()
    )
