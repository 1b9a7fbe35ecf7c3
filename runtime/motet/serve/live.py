"""Figures that are steered live on the server's own port: a connection that asks for it at /live is handed over.

It is served as by ``motet live``, with all of its limits.
"""

import asyncio
from collections.abc import Sequence

from websockets.asyncio.connection import Connection as AnyConnection
from websockets.protocol import State
from websockets.server import ServerProtocol
from websockets.typing import Origin

from motet.live.protocol import LOCAL
from motet.live.server import Connection, LiveClients, connection_options, log
from motet.steering.model import SteerModel


class _Serving:
    """What a connection asks of the server that it belongs to."""

    def is_serving(self) -> bool:
        return True


class Upgraded(Connection):
    """A connection whose socket listened to HTTP before: no server of websockets has begun it."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the socket over."""
        AnyConnection.connection_made(self, transport)  # what comes between would call the server


class LiveDoor:
    """The clients of live figures on a server's port, who come from programs, from pages of this machine or of
    ``origins``; others get 403."""

    def __init__(self, model: SteerModel, origins: Sequence[str]) -> None:
        self._clients = LiveClients(model)
        self._origins = [None, LOCAL, *map(Origin, origins)]
        self._tasks = set[asyncio.Task[None]]()

    def take(self, transport: asyncio.Transport, head: bytes) -> None:
        """Take a connection over from HTTP, with the request that asks for it."""
        limits = self._clients.limits
        protocol = ServerProtocol(origins=self._origins, max_size=limits.message_bytes, logger=log)
        connection = Upgraded(protocol, _Serving(), **connection_options(limits))  # type: ignore[arg-type]
        connection.connection_made(transport)
        transport.set_protocol(connection)
        connection.data_received(head)
        task = asyncio.get_running_loop().create_task(self._served(connection))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def close(self) -> None:
        """Drop all clients."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _served(self, connection: Upgraded) -> None:
        try:
            async with asyncio.timeout(10.0):
                await connection.handshake(server_header=None)
            if connection.protocol.state is State.OPEN:
                connection.start_keepalive()
                await self._clients.connected(connection)
                await connection.close()
        finally:
            connection.abort()
