"""The tensors a model expects of a graph, with shapes such as "batch time D", as docs/bundle.md writes them."""

from collections.abc import Collection, Mapping

from motet.bundle.graph import GraphSpec, TensorSpec
from motet.errors import BundleError

Sizes = dict[str, int]
"""Letter of an axis -> its size."""


def bind(
    role: str,
    spec: GraphSpec,
    inputs: Mapping[str, str],
    outputs: Mapping[str, str],
    sizes: Sizes,
    given: Collection[TensorSpec] = (),
) -> None:
    """Check a graph's tensors, and note the sizes of axes not known before.

    inputs, outputs: shapes by name. A small word is a dynamic axis; a capital letter is a size, the same wherever it
        stands; "*" in front is int64. The graph may have more outputs, and more inputs where something gives them.
    given: tensors that another graph gives. All other inputs must be fed back, and how they start be known.
    BundleError names the role, the tensor and what is expected.
    """
    for wanted, find in ((inputs, spec.input), (outputs, spec.output)):
        for name, shape in wanted.items():
            try:
                bind_tensor(find(name), shape.lstrip("*"), "int64" if shape.startswith("*") else "float32", sizes)
            except BundleError as error:
                raise BundleError(f"manifest, graphs.{role}: {error}") from error
    for tensor in spec.inputs:
        if tensor in given or tensor.name in inputs:
            continue
        if tensor.name not in spec.feedback:
            raise BundleError(f"manifest, graphs.{role}: input {tensor.name!r} is neither supplied nor fed back")
        spec.start_shape(tensor.name)


def bind_tensor(tensor: TensorSpec, shape: str, dtype: str, sizes: Sizes) -> None:
    """Check one tensor, whose shape is put as :func:`bind` has it; BundleError says what is expected."""
    axes = shape.split()
    expected = tuple(sizes.get(axis, axis) if axis.isupper() else axis for axis in axes)
    fits = tensor.dtype == dtype and len(tensor.shape) == len(axes)
    for axis, size in zip(axes, tensor.shape, strict=False):
        if axis.isdecimal():
            fits &= size == int(axis)
        elif axis.isupper():
            fits &= isinstance(size, int) and sizes.get(axis, size) == size
        else:
            fits &= isinstance(size, str)
    if not fits:
        raise BundleError(f"{tensor.name!r} is {tensor.dtype} {list(tensor.shape)}, expected {dtype} {list(expected)}")
    sizes.update({a: s for a, s in zip(axes, tensor.shape, strict=True) if a.isupper() and isinstance(s, int)})
