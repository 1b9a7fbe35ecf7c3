"""A server of live figures: every client has figures of its own, steers them, and gets their poses many times a second.

It needs the library websockets, which the extra ``live`` installs. What is said is in :mod:`motet.live.protocol`.
"""

import asyncio
import logging
import re
import socket
from collections.abc import Callable, Sequence
from typing import Self

from motet.errors import MotetError, OutputError
from motet.live import protocol
from motet.live.protocol import ClientSession, ProtocolError
from motet.models.steer import SteerModel
from motet.motion.pose import Pose

try:
    from websockets.asyncio.server import Server, ServerConnection, serve
    from websockets.exceptions import ConnectionClosed
    from websockets.frames import Frame, Opcode
    from websockets.protocol import Event
    from websockets.typing import Origin
except ImportError as error:
    raise ImportError(
        "motet.live.server needs websockets: install the extra with  pip install 'motet[live]'"
    ) from error

log = logging.getLogger(__name__)

HOST, PORT = "127.0.0.1", 8765

MAX_BYTES = 1 << 14
"""Of a client's message."""

MAX_CLIENTS = 32

MAX_FIGURES = 64
"""Of all clients together: about as many as one core moves 30 times a second."""

MAX_MESSAGES = 50
"""Of a client between two ticks."""

MAX_CONTROLS = 50
"""Frames of a client in a second that are no messages: pings, pongs, and parts of messages."""

READ = 1 << 12
"""Bytes of a client that are looked at before others have their turn, as far as it breaks a rule with them."""

PING = 5
"""Seconds after which a client is pinged, and in which it has to answer."""

BUFFER = 1 << 16
"""Bytes that wait for a client, in this process and again in the system; then it has STALL seconds to take some."""

STALL = 2.0

REFUSED, BUSY = 1008, 1013
"""Codes with which a connection is closed: a rule was broken; too many clients."""

LOCAL = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")
"""Origins of web pages that may connect, next to programs, which have none."""


class Connection(ServerConnection):
    """One that is cut off where its client sends too many frames that are no messages: they are answered unread."""

    controls, since = 0, 0.0

    def data_received(self, data: bytes) -> None:
        """See the class."""
        for start in range(0, len(data), READ):
            if not self.transport.is_closing():
                super().data_received(data[start : start + READ])

    def process_event(self, event: Event) -> None:
        """See the class."""
        super().process_event(event)
        if not isinstance(event, Frame) or event.opcode in (Opcode.TEXT, Opcode.BINARY):
            return
        now = self.loop.time()
        self.controls, self.since = (self.controls + 1, self.since) if now < self.since + 1 else (1, now)
        if self.controls > MAX_CONTROLS and not self.transport.is_closing():
            log.warning("dropped a client: more than %d pings, pongs and parts of messages in a second", MAX_CONTROLS)
            self.transport.abort()


class LiveServer:
    """Listens while it is entered (``async with``).

    characters: that a client has at first. rate: ticks a second, by default the model's, which is life's speed.
    origins: of further web pages that may connect, such as "null" (a page that was opened as a file). stall: seconds
    for which a client may take nothing. watch: called with each pose of the client that is here the longest.
    OutputError where it cannot listen, ControlError for a number of characters that a client cannot have.
    """

    def __init__(  # noqa: PLR0913  settings, each of which has a default
        self,
        model: SteerModel,
        host: str = HOST,
        port: int = PORT,
        *,
        characters: int = 1,
        rate: float | None = None,
        origins: Sequence[str] = (),
        stall: float = STALL,
        watch: Callable[[Pose, float], None] | None = None,
    ) -> None:
        self.model, self.host, self.port, self.characters = model, host, port, characters
        self.rate, self.stall, self.watch = rate or model.fps, stall, watch
        ClientSession(model, characters)  # refuses now what it would refuse every client
        self._origins = [None, LOCAL, *map(Origin, origins)]
        self._clients: list[ClientSession] = []
        self._server: Server | None = None

    async def __aenter__(self) -> Self:
        try:
            self._server = await serve(
                self._client,
                self.host,
                self.port,
                origins=self._origins,
                logger=log,
                compression=None,
                max_size=MAX_BYTES,
                max_queue=16,
                write_limit=BUFFER,
                ping_interval=PING,
                ping_timeout=PING,
                close_timeout=1,
                create_connection=Connection,
            )
        except OSError as fault:
            raise OutputError(f"cannot listen on {self.host}:{self.port}: {fault.strerror or fault}") from fault
        self.port = next(iter(self._server.sockets)).getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        assert self._server is not None
        self._server.close()
        await self._server.wait_closed()

    async def _client(self, connection: ServerConnection) -> None:
        """All of one client, until it goes or is dropped."""
        if len(self._clients) >= MAX_CLIENTS or self._figures() + self.characters > MAX_FIGURES:
            await connection.close(
                BUSY, f"there are {len(self._clients)} clients already, of {self._figures()} figures"
            )
            return
        _bound(connection)
        client = ClientSession(self.model, self.characters)
        self._clients.append(client)
        try:
            await connection.send(protocol.hello(self.model))
            reason = await self._until_fault(connection, client)
        except ConnectionClosed:
            return
        finally:
            self._clients.remove(client)
        if isinstance(reason, MotetError):
            log.warning("dropped a client: %s", reason)
            await self._drop(connection, reason)

    def _figures(self) -> int:
        return sum(client.session.characters for client in self._clients)

    async def _until_fault(self, connection: ServerConnection, client: ClientSession) -> BaseException | None:
        """Tick and listen side by side; why one of the two came to an end."""
        both = [asyncio.create_task(run(connection, client)) for run in (self._listen, self._tick)]
        try:
            done, _ = await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in both:
                task.cancel()
            await asyncio.gather(*both, return_exceptions=True)
        faults = [task.exception() for task in done]
        for fault in faults:
            if fault and not isinstance(fault, MotetError | ConnectionClosed):
                raise fault
        return next((fault for fault in faults if isinstance(fault, MotetError)), None)

    async def _listen(self, connection: ServerConnection, client: ClientSession) -> None:
        tick, count = 0, 0
        async for text in connection:
            tick, count = client.ticks, (count + 1 if tick == client.ticks else 1)
            if count > MAX_MESSAGES:
                raise ProtocolError(f"more than {MAX_MESSAGES} messages between two frames")
            notes = client.handle(text)
            if self._figures() > MAX_FIGURES:
                raise ProtocolError(f"all clients together may have {MAX_FIGURES} figures")
            for said in notes:
                await self._send(connection, protocol.note(said))

    async def _tick(self, connection: ServerConnection, client: ClientSession) -> None:
        clock = asyncio.get_running_loop().time
        due = clock()
        while True:
            pose = client.tick()
            if self.watch and client is self._clients[0]:
                self.watch(pose, client.ticks / self.model.fps)
            await self._send(connection, client.frame(pose))
            due = max(due + 1 / self.rate, clock() - 0.1)  # what is late is not made up for
            await asyncio.sleep(due - clock())

    async def _send(self, connection: ServerConnection, text: str) -> None:
        try:
            async with asyncio.timeout(self.stall):
                await connection.send(text)
        except TimeoutError:
            raise ProtocolError(f"took no frames for {self.stall:g} s") from None

    async def _drop(self, connection: ServerConnection, reason: MotetError) -> None:
        """Say why, as far as the client still listens, and close."""
        said = str(reason).encode()[:120].decode(errors="ignore")  # a frame that closes has room for 123 bytes
        try:
            async with asyncio.timeout(self.stall):
                await connection.send(protocol.error(reason))
                await connection.close(REFUSED, said)
        except (TimeoutError, ConnectionClosed):
            connection.transport.abort()


def _bound(connection: ServerConnection) -> None:
    """Let the system hold no more for a client than BUFFER."""
    raw = connection.transport.get_extra_info("socket")
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)


def run_server(server: LiveServer, ready: Callable[[], None] = lambda: None) -> None:
    """Run a server until Ctrl-C; ``ready`` is called when it listens. OutputError where it cannot listen."""
    logging.getLogger("asyncio").setLevel(logging.ERROR)  # it warns at each byte for a client that is gone

    async def running() -> None:
        async with server:
            ready()
            await asyncio.Event().wait()

    try:
        asyncio.run(running())
    except KeyboardInterrupt:
        return
