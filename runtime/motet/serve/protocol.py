"""HTTP with limits on clients: how long a request may take to arrive, and how many connections there are.

uvicorn bounds neither. Here the head of a request has ten seconds and 64 KB, and a body a floor of bytes a second.
Where there are as many connections as there may be, in all or of one address, the one that has waited longest without a
request gives way to the new one.
"""

import asyncio
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from motet.serve.limits import Limits

try:
    import resource
except ImportError:  # no limits of files there
    resource = None  # type: ignore[assignment]


def most_connections(limits: Limits) -> int:
    """How many connections there may be: fewer where the system allows this process fewer files."""
    if resource is None:
        return limits.connections
    files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    # this process needs a hundred files beside its connections
    return max(1, min(limits.connections, files - 100))


class BoundedProtocol(H11Protocol):
    """A connection of a client; see the module. The application's state has its ``limits``, and ``live``, which takes
    over connections that ask for it at /live."""

    timer: asyncio.TimerHandle | None = None
    arrived = 0  # bytes of a body since the timer was set

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Make room for it, or refuse it where nobody gives way."""
        super().connection_made(transport)
        self.since = self.loop.time()
        state = self.config.app.state  # type: ignore[union-attr]
        self.limits: Limits = state.limits
        self.live = state.live
        of_address = [other for other in self._others() if other.client and self._address() == other.client[0]]
        room = len(of_address) < self.limits.connections_of_address or _gave_way(of_address)
        if room:
            others = self._others()
            room = len(others) < most_connections(self.limits) or _gave_way(others)
        if room:
            self._set_timer(self.limits.head_seconds)
        else:
            transport.abort()

    def data_received(self, data: bytes) -> None:
        """Watch the head or the body that arrives."""
        waited = self.waits()
        self.arrived += len(data)
        super().data_received(data)
        sends_body = self.conn.their_state is h11.SEND_BODY
        handed_over = self.transport.get_protocol() is not self
        if handed_over or self.transport.is_closing() or not (self.waits() or sends_body):
            self._end_timer()
        elif self.timer is None or (waited and sends_body):
            self._set_timer(self.limits.head_seconds)

    def connection_lost(self, exc: Exception | None) -> None:
        """End watching it."""
        self._end_timer()
        super().connection_lost(exc)

    def waits(self) -> bool:
        """Whether it is between requests, or within the head of one."""
        return self.conn.their_state is h11.IDLE

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Hand the connection to the live figures."""
        self.connections.discard(self)
        self._end_timer()
        lines = [b" ".join((event.method, event.target, b"HTTP/1.1")), *(b": ".join(pair) for pair in self.headers)]
        self.live.take(self.transport, b"\r\n".join((*lines, b"", b"")))

    def _should_upgrade_to_ws(self) -> bool:
        return bool(self.scope["path"] == "/live")

    def _others(self) -> list["BoundedProtocol"]:
        return [other for other in self.connections if isinstance(other, BoundedProtocol) and other is not self]

    def _address(self) -> str | None:
        return self.client[0] if self.client else None

    def _set_timer(self, seconds: float) -> None:
        self._end_timer()
        self.arrived = 0
        self.timer = self.loop.call_later(seconds, self._late)

    def _end_timer(self) -> None:
        if self.timer is not None:
            self.timer.cancel()
            self.timer = None

    def _late(self) -> None:
        """Cut off a client whose head has not arrived, or whose body arrives too slowly to ever end."""
        self.timer = None
        if self.transport.is_closing():
            return
        sends_body = self.conn.their_state is h11.SEND_BODY and not self.flow.read_paused
        slow = self.arrived < self.limits.body_bytes_a_second * self.limits.head_seconds
        if self.waits() or (sends_body and slow):
            self.transport.abort()
        elif self.conn.their_state is h11.SEND_BODY:
            self._set_timer(self.limits.head_seconds)


def _gave_way(others: list[BoundedProtocol]) -> bool:
    """Whether one of them did: the one that has waited longest without a request."""
    waiting = [other for other in others if other.waits()]
    if not waiting:
        return False
    oldest = min(waiting, key=lambda other: other.since)
    oldest.transport.abort()
    oldest.connections.discard(oldest)
    return True


class Seldom(logging.Filter):
    """Lets a few records a minute through, so that no client fills a disk with what it is told of it."""

    def __init__(self, most: int = 20) -> None:
        super().__init__()
        self.most = most
        self.minute = 0
        self.count = 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a record is let through; the last one of a minute says that there are more."""
        minute = int(time.monotonic() // 60)
        if minute != self.minute:
            self.minute = minute
            self.count = 0
        self.count += 1
        if self.count == self.most:
            record.msg = f"{record.getMessage()}; more of this minute is left out"
            record.args = ()
            record.exc_info = None
        return self.count <= self.most


@contextmanager
def quieter(*names: str) -> Iterator[None]:
    """Loggers have one bound together, as long as the context lasts."""
    seldom = Seldom()
    loggers = [logging.getLogger(name) for name in names]
    for logger in loggers:
        logger.addFilter(seldom)
    try:
        yield
    finally:
        for logger in loggers:
            logger.removeFilter(seldom)


OPTIONS: dict[str, Any] = {
    "http": BoundedProtocol,
    "h11_max_incomplete_event_size": (1 << 16),
    "ws": "none",
    "backlog": 128,  # connections that are accepted at once, before any of them can give way
}
"""Of :class:`uvicorn.Config`."""
