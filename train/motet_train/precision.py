"""Products of matrices in bfloat16: which devices have them."""

from dataclasses import replace

import torch

from motet_train import distributed
from motet_train.progress import log
from motet_train.recipes.recipe import Recipe


def has_bfloat16(device: str) -> bool:
    """Whether a device multiplies in bfloat16 itself.

    Where it does not, torch's layers take 4 to 30 times as long as in float32, and its LSTM refuses to run.
    """
    if device.startswith("cuda"):
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    try:  # what torch no longer answers is a no; oneDNN's answer heeds ONEDNN_MAX_CPU_ISA
        return bool(torch.ops.mkldnn._is_mkldnn_bf16_supported() and torch.cpu._is_avx512_bf16_supported())
    except (AttributeError, RuntimeError):
        return False


def for_device(recipe: Recipe, device: str) -> Recipe:
    """The recipe, in float32 where it says bfloat16 and the device does not have that, which is logged."""
    if recipe.training is None or recipe.training.precision == "float32" or has_bfloat16(device):
        return recipe
    if distributed.rank() == 0:
        log.info("%s has no products in bfloat16: training in float32", device)
    return replace(recipe, training=replace(recipe.training, precision="float32"))
