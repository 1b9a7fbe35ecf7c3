"""Calls that wait at once are answered by one call of a model."""

import asyncio
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Generic, TypeVar

from motet.errors import MotetError

Key = TypeVar("Key", bound=Hashable)
Item = TypeVar("Item")
Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class _Waiting(Generic[Key, Item, Found]):
    key: Key
    item: Item
    result: asyncio.Future[Found]


class Batcher(Generic[Key, Item, Found]):
    """Awaits ``call(key, items)``, which gives one result for each item, for items that come one by one.

    Those that wait until the worker is free share a call with all others of their key, such as the same settings; at
    most ``batch`` at once. Where a call raises one of motet's errors, each item is tried alone, so that only the one at
    fault fails. worker: runs the calls. Who stops waiting before the call leaves the batch.
    """

    def __init__(self, call: Callable[[Key, list[Item]], Sequence[Found]], worker: Executor, batch: int) -> None:
        self._call = call
        self._worker = worker
        self._batch = batch
        self._waiting: deque[_Waiting[Key, Item, Found]] = deque()
        self._running: asyncio.Task[None] | None = None

    def __len__(self) -> int:
        """How many items wait."""
        return len(self._waiting)

    async def __call__(self, key: Key, item: Item) -> Found:
        """The result for an item; the errors of ``call`` for it."""
        waiting = _Waiting[Key, Item, Found](key, item, asyncio.get_running_loop().create_future())
        self._waiting.append(waiting)
        if self._running is None or self._running.done():
            self._running = asyncio.create_task(self._run())
        return await waiting.result

    async def _run(self) -> None:
        while self._waiting:
            await asyncio.sleep(0)  # those who were answered give the worker what they need next
            await asyncio.get_running_loop().run_in_executor(self._worker, bool)  # its turn; until then more may come
            batch = self._next()
            if batch and not await self._answered(batch):
                for waiting in batch:
                    await self._answered([waiting])

    def _next(self) -> list[_Waiting[Key, Item, Found]]:
        here = [waiting for waiting in self._waiting if not waiting.result.done()]
        batch = [waiting for waiting in here if waiting.key == here[0].key][: self._batch]
        self._waiting = deque(waiting for waiting in here if waiting not in batch)
        return batch

    async def _answered(self, batch: Sequence[_Waiting[Key, Item, Found]]) -> bool:
        """Answer a batch, by an error where all are at fault; False where one of several is."""
        run = asyncio.get_running_loop().run_in_executor
        try:
            results = await run(self._worker, self._call, batch[0].key, [waiting.item for waiting in batch])
        except Exception as error:
            if len(batch) > 1 and isinstance(error, MotetError):
                return False
            for waiting in batch:
                if not waiting.result.done():
                    waiting.result.set_exception(error)
            return True
        for waiting, result in zip(batch, results, strict=True):
            if not waiting.result.done():
                waiting.result.set_result(result)
        return True
