"""Answers by Ray Data: the same verbs, loaded once in each actor of a cluster (extra ``scale``)."""

import logging
import os
import pickle
import re
import socket
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from motet.corpus.answers import Answer, Verb
from motet.corpus.sources import Source
from motet.errors import MotetError
from motet.files import Json
from motet.jobs import cores


class Actor:
    """A verb in a process of the cluster, in the folder that paths are relative to, where its machine has that."""

    def __init__(self, verb: bytes, folder: Path) -> None:
        with suppress(OSError):
            os.chdir(folder)
        self.verb: Verb = pickle.loads(verb)

    def __call__(self, batch: Json) -> dict[str, list[bytes]]:
        """Pickled sources to pickled answers."""
        return {"answer": [pickle.dumps(answer) for answer in self.verb(list(map(pickle.loads, batch["source"])))]}


def answers(verb: Verb, sources: Sequence[Source], workers: int | None, address: str | None) -> Iterator[Answer]:
    """The answers in order, from a cluster that is started here, or the one at an address.

    workers: actors, of one core each; None: one for each core, of a cluster elsewhere as many as it has. What an actor
    that dies had in hand is done again by another. MotetError without Ray, or where nothing answers.
    """
    ray = _connected(workers, address)
    count = workers or int(ray.cluster_resources().get("CPU", 2)) - 1
    # answers come in order, without Ray's own progress and log
    context = ray.data.DataContext.get_current()
    context.execution_options.preserve_order = True
    context.enable_progress_bars = False
    logging.getLogger("ray.data").setLevel(logging.ERROR)
    items = [{"source": pickle.dumps(source)} for source in sources]
    if not items:
        return
    size = max(1, min(verb.most, len(items) // (16 * count)))  # small, so that all actors end at once
    rows = ray.data.from_items(items, override_num_blocks=-(-len(items) // size)).map_batches(
        Actor,
        fn_constructor_args=(pickle.dumps(verb), Path.cwd()),
        batch_size=size,
        compute=ray.data.ActorPoolStrategy(size=max(1, count)),
        num_cpus=1,
    )
    for row in rows.iter_rows():
        yield pickle.loads(row["answer"])


def _connected(workers: int | None, address: str | None) -> Any:
    try:
        import ray
        import ray.data
    except ImportError as error:
        raise MotetError(f"the engine ray needs Ray ({error.name}): pip install 'motet[scale]'") from error
    quiet: dict[str, Any] = {"logging_level": "ERROR", "log_to_driver": False}
    try:
        if not ray.is_initialized() and address:
            if host := re.fullmatch(r"(?:ray://)?([^:/]+):(\d+)", address):  # Ray itself tries for minutes
                socket.create_connection((host[1], int(host[2])), timeout=5).close()
            ray.init(address=address, **quiet)
        elif not ray.is_initialized():  # one core more reads and hands out what the actors work on
            ray.init(num_cpus=(workers or cores()) + 1, include_dashboard=False, **quiet)
    except (ConnectionError, OSError, RuntimeError, ValueError) as error:
        remedy = "; see ray status there, or leave --address out for a cluster of this machine" if address else ""
        raise MotetError(f"no Ray cluster answers at {address or 'this machine'}: {error}{remedy}") from error
    return ray
