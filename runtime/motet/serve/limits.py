"""What a server takes and gives at most, and the gate that every request passes: too large, too many, too slow."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from motet.errors import quoted
from motet.files import Json
from motet.live.protocol import LOCAL


@dataclass(frozen=True)
class Limits:
    """What a server allows.

    body_bytes: of a request. all_bytes: of the bodies of all requests at once. requests: answered or waiting at once.
    seconds: until a request is answered, and in which a client takes a part of the answer. motion_seconds: of a motion
    that is given or asked for. fps: of an answer. text_bytes: of a body that is JSON, or a field of a form. batch:
    requests that share a call of a model. connections, connections_of_address: at once, in all and of one address.
    head_seconds: until the head of a request has arrived. body_bytes_a_second: which a body brings at least, in as many
    seconds.
    """

    body_bytes: int = 32 << 20
    all_bytes: int = 256 << 20
    requests: int = 256
    seconds: float = 60.0
    motion_seconds: float = 300.0
    fps: float = 240.0
    text_bytes: int = 1 << 16
    batch: int = 32
    connections: int = 1000
    connections_of_address: int = 250
    head_seconds: float = 10.0
    body_bytes_a_second: int = 1000


def refusal(status: int, message: str, kind: str = "RequestError", **headers: str) -> JSONResponse:
    """An answer that says in a sentence why there is no other."""
    printable = message.encode(errors="backslashreplace").decode()  # names in files may be no characters
    return JSONResponse({"error": printable, "type": kind}, status, headers)


LOCAL_HOSTS = ("localhost", "127.0.0.1", "::1")
"""The names of this machine for itself."""


class Visitors:
    """Middleware that refuses with 403 what pages of other sites make a browser ask, and requests for another host.

    origins: of pages that may ask, beside pages of the server itself and of this machine. hosts: names that the server
    may be asked by; None for any. A server of this machine alone is asked by :data:`LOCAL_HOSTS`, so that a site whose
    name is made to lead to this machine is not taken for the server's own.
    """

    def __init__(self, app: ASGIApp, origins: Sequence[str], hosts: Sequence[str] | None) -> None:
        self.app = app
        self.origins = frozenset(origins)
        self.hosts = hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] == "http" and (reason := self.reason(Headers(scope=scope))):
            await refusal(403, reason)(scope, receive, send)
        else:
            await self.app(scope, receive, send)

    def reason(self, headers: Headers) -> str:
        """Why a request with these headers is refused; "" if it is not."""
        host = headers.get("host", "")
        if self.hosts is not None and _without_port(host) not in self.hosts:
            return f"the host {quoted(host)} is not served here: expected {', '.join(self.hosts)}"
        origin = headers.get("origin")
        if origin is None or origin in self.origins or LOCAL.fullmatch(origin):
            return ""
        of_the_server = origin.partition("://")[2] == host
        return "" if of_the_server else f"pages of {quoted(origin)} may not ask: name it with --origin"


def _without_port(host: str) -> str | None:
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:  # no address of IPv6
        return None


class Gate:
    """Middleware that refuses with 413 what is too large, before it is read where its length is declared, and with 503
    what is too much at once; and that leaves clients who do not take their answer."""

    def __init__(self, app: ASGIApp, limits: Limits) -> None:
        self.app = app
        self.limits = limits
        self.requests = self.held = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] != "http" or scope["path"] == "/health":
            await self.app(scope, receive, send)
        elif declared(scope) > self.limits.body_bytes:
            await refusal(413, self._too_large(), Connection="close")(scope, receive, send)
        elif self.requests >= self.limits.requests:
            message = f"{self.requests} requests are being answered already: try again later"
            await refusal(503, message, **{"Retry-After": "1", "Connection": "close"})(scope, receive, send)
        else:
            await self._passed(scope, receive, send)

    async def _passed(self, scope: Scope, receive: Receive, send: Send) -> None:
        held = 0
        begun = False  # whether the answer is

        async def counted() -> Message:
            nonlocal held
            message = await receive()
            size = len(message.get("body", b""))
            held = held + size
            self.held = self.held + size
            if held > self.limits.body_bytes:
                raise HTTPException(413, self._too_large(), {"Connection": "close"})
            if self.held > self.limits.all_bytes:
                reason = f"the files of all requests exceed {self.limits.all_bytes} bytes: try again later"
                raise HTTPException(503, reason, {"Retry-After": "1", "Connection": "close"})
            return message

        async def timed(message: Message) -> None:
            nonlocal begun
            begun = True
            try:
                async with asyncio.timeout(self.limits.seconds):
                    await send(message)
            except TimeoutError:
                raise ClientDisconnect from None

        self.requests += 1
        try:
            await self.app(scope, counted, timed)
        except ClientDisconnect:
            pass  # nobody is there to be told
        except asyncio.CancelledError:  # the server ends, and has waited for long enough
            if not begun:
                await refusal(503, "the server is stopping", Connection="close")(scope, receive, send)
        finally:
            self.requests = self.requests - 1
            self.held = self.held - held

    def _too_large(self) -> str:
        return f"the request is too large: expected at most {self.limits.body_bytes} bytes"


def declared(scope: Json | Scope) -> int:
    """The length that a request states of its body; 0 where it states none."""
    lengths = [value for name, value in scope["headers"] if name == b"content-length"]
    return int(lengths[0]) if lengths and lengths[0].isdigit() else 0
