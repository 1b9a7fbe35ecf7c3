"""How long work reports its progress."""

from collections.abc import Callable

Progress = Callable[[int, int], object]
"""Called with how many are done, and how many there are."""


def silent(done: int, total: int) -> None:
    """Say nothing."""
