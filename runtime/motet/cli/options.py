"""Options that several commands share."""

import functools
from collections.abc import Callable
from typing import Any

import click
import onnxruntime

from motet.bundle.graph import MAX_THREADS, SessionOptions

_SUFFIX = "ExecutionProvider"


def session_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command ``--threads`` and ``--provider``; it gets them as ``session``, a SessionOptions."""

    @click.option(
        "--threads",
        type=click.IntRange(1, MAX_THREADS),
        default=1,
        show_default=True,
        help="Threads within a graph call.",
    )
    @click.option(
        "--provider",
        "providers",
        multiple=True,
        metavar="NAME",
        help="Execution provider of ONNX Runtime, such as CUDA; may be given several times.  [default: CPU]",
    )
    @functools.wraps(command)
    def with_session(*args: Any, threads: int, providers: tuple[str, ...], **kwargs: Any) -> Any:
        session = SessionOptions(threads, tuple(map(_provider, providers or ("CPU",))))
        return command(*args, session=session, **kwargs)

    return with_session


def _provider(name: str) -> str:
    """ONNX Runtime's name of a provider: its letters may be of any case, and its ending left out."""
    available: list[str] = onnxruntime.get_available_providers()
    known = {provider.removesuffix(_SUFFIX).lower(): provider for provider in available}
    return known.get(name.removesuffix(_SUFFIX).lower(), name)
