"""Figures that are steered live, on the same port: the protocol of ``motet live`` at ``/live``."""

from collections.abc import Sequence

from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState
from websockets.exceptions import ConnectionClosedError

from motet.live.server import LOCAL, LiveClients
from motet.models.steer import SteerModel


class LiveDoor:
    """The clients of live figures at an address of the application, who come from programs, from pages of this machine
    or of ``origins``."""

    def __init__(self, model: SteerModel, origins: Sequence[str]) -> None:
        self._clients, self._origins = LiveClients(model), origins

    async def open(self, socket: WebSocket) -> None:
        """All of one client; 403 for a page of another origin."""
        origin = socket.headers.get("origin")
        if origin is None or origin in self._origins or LOCAL.fullmatch(origin):
            await socket.accept()
            await self._clients.client(_Connection(socket))
        else:
            await socket.close()


class _Connection:
    """A websocket of Starlette as :class:`motet.live.server.Wire`."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket

    async def send(self, text: str) -> None:
        try:
            await self._socket.send_text(text)
        except (WebSocketDisconnect, RuntimeError):  # closed by the client; already closed
            raise ConnectionClosedError(None, None) from None

    async def recv(self) -> str | bytes:
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            raise ConnectionClosedError(None, None)
        found: str | bytes = message["bytes"] if message.get("text") is None else message["text"]
        return found

    async def close(self, code: int, reason: str) -> None:
        if self._socket.application_state is not WebSocketState.DISCONNECTED:
            await self._socket.close(code, reason)

    def abort(self) -> None:
        """Nothing: the connection is closed when its client's task ends."""
