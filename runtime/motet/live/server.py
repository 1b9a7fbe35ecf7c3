"""A server of live figures: every client has figures of its own, steers them, and gets their poses many times a second.

It needs the library websockets, which the extra ``live`` installs. What is said is in :mod:`motet.live.protocol`.
"""

import asyncio
import logging
import socket
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Self

from motet.errors import MotetError, OutputError, TextError, TextWarning, collected
from motet.generate.base import GenerateModel
from motet.live import protocol
from motet.live.protocol import LOCAL, ClientSession, ProtocolError
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.sentence_acts import SaidActs

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


@dataclass(frozen=True)
class Limits:
    """What a server allows its clients.

    message_bytes: of a message. clients, figures: of all together; about as many figures as one core moves 30 times a
    second. messages: of a client between two ticks. controls: frames of a client in a second that are no messages:
    pings, pongs, and parts of messages. ping: seconds after which a client is pinged, and in which it has to answer.
    buffer: bytes that wait for a client, in this process and again in the system; then it has ``stall`` seconds to take
    some.
    """

    message_bytes: int = 1 << 14
    clients: int = 32
    figures: int = 64
    messages: int = 50
    controls: int = 50
    ping: float = 5
    buffer: int = 1 << 16
    stall: float = 2.0


LIMITS = Limits()


class Connection(ServerConnection):
    """One that is cut off where its client sends too many frames that are no messages: they are answered unread."""

    controls = 0
    since = 0.0

    def data_received(self, data: bytes) -> None:
        """See the class: only so many bytes are looked at before others have their turn."""
        for start in range(0, len(data), 1 << 12):
            if not self.transport.is_closing():
                super().data_received(data[start : start + (1 << 12)])

    def abort(self) -> None:
        """Close it at once."""
        self.transport.abort()

    def process_event(self, event: Event) -> None:
        """See the class."""
        super().process_event(event)
        if not isinstance(event, Frame) or event.opcode in (Opcode.TEXT, Opcode.BINARY):
            return
        now = self.loop.time()
        self.controls, self.since = (self.controls + 1, self.since) if now < self.since + 1 else (1, now)
        if self.controls > LIMITS.controls and not self.transport.is_closing():
            reason = "dropped a client: more than %d pings, pongs and parts of messages in a second"
            log.warning(reason, LIMITS.controls)
            self.transport.abort()


def connection_options(limits: Limits) -> dict[str, Any]:
    """The settings of :class:`Connection`."""
    return {
        "max_queue": 16,
        "write_limit": limits.buffer,
        "ping_interval": limits.ping,
        "ping_timeout": limits.ping,
        "close_timeout": 1,
    }


class LiveClients:
    """The clients of a server, whichever way they come: :meth:`client` is all of one.

    characters: that a client has at first. rate: ticks a second, by default the model's, which is life's speed. watch:
    called with each pose of the client that is here the longest. words: makes the acts that clients tell in sentences;
    without it these are refused. ControlError for a number of characters that a client
    cannot have.
    """

    def __init__(
        self,
        model: SteerModel,
        characters: int = 1,
        rate: float | None = None,
        watch: Callable[[Pose, float], None] | None = None,
        limits: Limits = LIMITS,
        words: GenerateModel | None = None,
    ) -> None:
        self.model = model
        self.characters = characters
        self.words = None if words is None else SaidActs(model, words)
        self.rate = rate or model.fps
        self.watch = watch
        self.limits = limits
        ClientSession(model, characters)  # refuses now what it would refuse every client
        self._clients: list[ClientSession] = []

    async def connected(self, connection: Connection) -> None:
        """All of one client of a connection that is open."""
        # the system holds no more for a client than this, either
        connection.transport.get_extra_info("socket").setsockopt(
            socket.SOL_SOCKET, socket.SO_SNDBUF, self.limits.buffer
        )
        await self.client(connection)

    async def client(self, connection: Connection) -> None:
        """All of one client, until it goes or is dropped: ticks and its messages, side by side."""
        if len(self._clients) >= self.limits.clients or self._figures() + self.characters > self.limits.figures:
            reason = f"there are {len(self._clients)} clients already, of {self._figures()} figures"
            await connection.close(1013, reason)  # try again later
            return
        client = ClientSession(self.model, self.characters, self.words)
        fault = None
        self._clients.append(client)
        try:
            await connection.send(protocol.hello(self.model))
            async with asyncio.TaskGroup() as both:
                both.create_task(self._listen(connection, client))
                both.create_task(self._tick(connection, client))
        except* ConnectionClosed:
            pass
        except* MotetError as faults:
            fault = faults.exceptions[0]
        finally:
            self._clients.remove(client)
        if fault is not None:
            log.warning("dropped a client: %s", fault)
            await self._drop(connection, str(fault))

    def _figures(self) -> int:
        return sum(client.session.characters for client in self._clients)

    async def _listen(self, connection: Connection, client: ClientSession) -> None:
        tick = 0
        count = 0
        while True:
            text = await connection.recv()
            count = count + 1 if tick == client.ticks else 1
            tick = client.ticks
            if count > self.limits.messages:
                raise ProtocolError(f"more than {self.limits.messages} messages between two frames")
            await self._made(text)
            notes = client.handle(text)
            if self._figures() > self.limits.figures:
                raise ProtocolError(f"all clients together may have {self.limits.figures} figures")
            for note in notes:
                await self._send(connection, protocol.message("note", message=note))

    async def _made(self, text: str | bytes) -> None:
        """Make the acts that a message tells, in a thread: the figures of all go on meanwhile."""
        if (words := self.words) is None:
            return
        for sentence in protocol.sentences(text):
            if self.model.act_said(sentence) is not None:
                continue
            with suppress(TextError), collected(TextWarning):  # of which the client is told
                await asyncio.to_thread(words.act, sentence)

    async def _tick(self, connection: Connection, client: ClientSession) -> None:
        clock = asyncio.get_running_loop().time
        due = clock()
        while True:
            pose = client.tick()
            if self.watch and client is self._clients[0]:
                self.watch(pose, client.ticks / self.model.fps)
            await self._send(connection, client.frame(pose))
            due = max(due + 1 / self.rate, clock() - 0.1)  # what is late is not made up for
            await asyncio.sleep(due - clock())

    async def _send(self, connection: Connection, text: str) -> None:
        try:
            async with asyncio.timeout(self.limits.stall):
                await connection.send(text)
        except TimeoutError:
            raise ProtocolError(f"took no frames for {self.limits.stall:g} s") from None

    async def _drop(self, connection: Connection, reason: str) -> None:
        """Say why, as far as the client still listens, and close: it broke a rule (1008)."""
        short = reason.encode()[:120].decode(errors="ignore")  # a frame that closes has room for 123 bytes
        try:
            async with asyncio.timeout(self.limits.stall):
                await connection.send(protocol.message("error", message=reason))
                await connection.close(1008, short)
        except (TimeoutError, ConnectionClosed):
            connection.abort()


class LiveServer(LiveClients):
    """Listens while it is entered (``async with``).

    origins: of further web pages that may connect, such as "null" (a page that was opened as a file). Others like
    :class:`LiveClients`. OutputError where it cannot listen.
    """

    def __init__(  # noqa: PLR0913  settings, each of which has a default
        self,
        model: SteerModel,
        host: str = "127.0.0.1",
        port: int = 8765,
        *,
        characters: int = 1,
        rate: float | None = None,
        origins: Sequence[str] = (),
        watch: Callable[[Pose, float], None] | None = None,
        limits: Limits = LIMITS,
        words: GenerateModel | None = None,
    ) -> None:
        super().__init__(model, characters, rate, watch, limits, words)
        self.host = host
        self.port = port
        self._origins = [None, LOCAL, *map(Origin, origins)]
        self._server: Server | None = None

    async def __aenter__(self) -> Self:
        try:
            self._server = await serve(
                self._connected,
                self.host,
                self.port,
                origins=self._origins,
                logger=log,
                compression=None,
                max_size=self.limits.message_bytes,
                create_connection=Connection,
                **connection_options(self.limits),
            )
        except OSError as fault:
            raise OutputError(f"cannot listen on {self.host}:{self.port}: {fault.strerror or fault}") from fault
        self.port = next(iter(self._server.sockets)).getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        assert self._server is not None
        self._server.close()
        await self._server.wait_closed()

    async def _connected(self, connection: ServerConnection) -> None:
        assert isinstance(connection, Connection)
        await self.connected(connection)


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
