"""A torch module behind the same face as an ONNX graph, so that one decoding loop serves both."""

from typing import Any

import torch
from numpy.typing import NDArray
from torch import nn

from motet.bundle.graph import Arrays, GraphSpec


class TorchGraph:
    """Named arrays in, named arrays out; the forward takes the inputs by name and gives the outputs in order."""

    def __init__(self, module: nn.Module, spec: GraphSpec) -> None:
        self.module, self.spec = module.eval(), spec

    @torch.inference_mode()
    def __call__(self, feeds: Arrays) -> dict[str, NDArray[Any]]:
        """Run eagerly on the CPU."""
        inputs = {tensor.name: torch.tensor(feeds[tensor.name]) for tensor in self.spec.inputs}
        outputs = self.module(**inputs)
        outputs = outputs if isinstance(outputs, tuple) else (outputs,)
        return {tensor.name: output.numpy() for tensor, output in zip(self.spec.outputs, outputs, strict=True)}
