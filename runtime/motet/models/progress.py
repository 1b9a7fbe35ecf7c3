"""How long-running work reports its progress."""

from collections.abc import Callable

Progress = Callable[[int, int], object]
"""Called with the number done and the total."""


def silent(done: int, total: int) -> None:
    """Say nothing."""
