"""The memory that a call takes."""

import tracemalloc
from collections.abc import Callable


def traced(call: Callable[[], object]) -> int:
    """The most bytes that are held during a call."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
