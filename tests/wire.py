"""ONNX graphs byte by byte, for tests where the onnx package is not installed."""


def varint(value: int) -> bytes:
    head = b""
    while value > 127:
        head, value = head + bytes([value & 127 | 128]), value >> 7
    return head + bytes([value])


def field(number: int, value: int | str | bytes) -> bytes:
    """A field of a message: a number, or the bytes of a string or of another message."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    data = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(data)) + data


def tensor(name: str, *extra: bytes, values: bytes = b"\0\0\0@\0\0\0@\0\0\0@") -> bytes:
    """A TensorProto of float32 (3,), by default 2, 2, 2."""
    return field(1, 3) + field(2, 1) + field(8, name) + (field(9, values) if values else b"") + b"".join(extra)


EXTERNAL = field(14, 1) + field(13, field(1, "location") + field(2, "weights.bin"))
"""What makes a tensor one whose data is in another file."""


def value_info(name: str) -> bytes:
    """float32 ("batch", 3)."""
    shape = field(1, field(2, "batch")) + field(1, field(1, 3))
    return field(1, name) + field(2, field(1, field(1, 1) + field(2, shape)))


def node(operator: str, inputs: list[str], outputs: list[str], *extra: bytes) -> bytes:
    names = b"".join(field(1, name) for name in inputs) + b"".join(field(2, name) for name in outputs)
    return names + field(3, f"the_{operator}") + field(4, operator) + b"".join(extra)


def graph(nodes: list[bytes], tensors: list[bytes]) -> bytes:
    """A GraphProto of x to y, both float32 ("batch", 3)."""
    parts = [field(1, one) for one in nodes] + [field(2, "main")] + [field(5, one) for one in tensors]
    return b"".join(parts) + field(11, value_info("x")) + field(12, value_info("y"))


def model(inner: bytes, *extra: bytes) -> bytes:
    return field(1, 8) + field(8, field(1, "") + field(2, 18)) + field(7, inner) + b"".join(extra)


def doubling(*extra: bytes, **options: bytes) -> bytes:
    """The model y = 2 x; ``extra`` goes into the node, ``weight`` in place of the tensor."""
    weight = options.get("weight", tensor("w"))
    return model(graph([node("Mul", ["x", "w"], ["y"], *extra)], [weight]))
