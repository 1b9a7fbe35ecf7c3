"""A server that is asked too much, left, or told to stop: a real one, and its parts."""

import asyncio
import http.client
import importlib
import json
import logging
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Awaitable, Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import pytest
from command_line import run

from motet.errors import TextError

pytest.importorskip("starlette", reason="the extra serve is not installed")
pytest.importorskip("uvicorn", reason="the extra serve is not installed")
import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.routing import Mount, Route
from starlette.types import Message
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from motet.live.server import LIMITS
from motet.serve.application import listening
from motet.serve.batches import Batcher
from motet.serve.endpoints import HEADER_BYTES, endpoint, in_a_header, refused
from motet.serve.limits import Gate, Limits
from motet.serve.protocol import OPTIONS, BoundedProtocol, most_connections, quieter
from motet.serve.routes import DOORS

WALK = "/generate.npz?text=a+person+strolls+along&seconds=1&seed="


class Process:
    """A server of a process of its own."""

    def __init__(self) -> None:
        command = [sys.executable, "-m", "motet", "serve", "--port", "0", "--timeout", "300"]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        self.port = int(self.process.stderr.readline().split(";")[0].rpartition(":")[2])

    def get(self, address: str) -> tuple[int, bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=300)
        connection.request("GET", address)
        answer = connection.getresponse()
        return answer.status, answer.read()

    def health(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.get("/health")[1])
        return found


@pytest.fixture(scope="module")
def server() -> Iterator[Process]:
    found = Process()
    yield found
    found.process.terminate()
    out = found.process.communicate(timeout=300)[1]
    assert (found.process.returncode, out.splitlines()[-1]) == (0, "stopped")
    assert "Traceback" not in out


def test_a_hundred_at_once_get_what_each_gets_alone(server: Process) -> None:
    with ThreadPoolExecutor(100) as clients:
        answers = list(clients.map(lambda i: server.get(WALK + str(i % 7)), range(100)))
    alone = [server.get(WALK + str(i)) for i in range(7)]
    assert [answer == alone[i % 7] for i, answer in enumerate(answers)] == [True] * 100
    assert len({content for _, content in alone}) == 7


def test_clients_that_leave(server: Process) -> None:
    for address in ("/stream?text=a+person+walks&seconds=200", "/generate.bvh?text=a+person+walks&seconds=200"):
        with socket.create_connection(("127.0.0.1", server.port)) as raw:
            raw.sendall(f"GET {address} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            if address.startswith("/stream"):
                assert raw.recv(1 << 12).startswith(b"HTTP/1.1 200")
    with socket.create_connection(("127.0.0.1", server.port)) as raw:  # within its body
        raw.sendall(b"POST /describe?format=bvh HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\nHIERARCHY")
    assert server.get(WALK + "1")[0] == 200
    assert server.health()["waiting"] == 0


def test_a_body_of_a_gigabyte_is_refused_before_it_is_sent(server: Process) -> None:
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as raw:
        raw.sendall(
            f"POST /describe?format=bvh HTTP/1.1\r\nHost: localhost\r\nContent-Length: {10**9}\r\n\r\n".encode()
        )
        head, _, body = raw.recv(1 << 12).partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 413")
        assert json.loads(body or raw.recv(1 << 12))["error"].startswith("the request is too large: expected at most")


def test_figures_are_steered_beside_it(server: Process) -> None:
    address = f"ws://127.0.0.1:{server.port}/live"
    with connect(address) as first:
        assert json.loads(first.recv())["type"] == "hello"
        first.send(json.dumps({"type": "control", "gait": "walk", "speed": 1.2}))
        frames = [json.loads(first.recv()) for _ in range(20)]
        assert [frame["tick"] for frame in frames] == list(range(1, 21))
        assert frames[-1]["heard"] == 1
        first.send("[")
        while json.loads(said := str(first.recv()))["type"] != "error":
            pass
        assert "must be JSON" in said
    with connect(address, origin="http://localhost:3000") as page:  # type: ignore[arg-type]
        assert json.loads(page.recv())["type"] == "hello"


def send_pings(connection: ClientConnection, count: int) -> None:
    for _ in range(count):
        connection.ping()


def receive_all(connection: ClientConnection) -> None:
    while True:
        connection.recv()


def test_figures_have_the_limits_of_the_live_server(server: Process) -> None:
    """One who sends pings without end is cut off, and one who is dropped is gone, as by ``motet live``."""
    address = f"ws://127.0.0.1:{server.port}/live"
    with connect(address) as flooder, connect(address) as other:
        assert json.loads(flooder.recv())["type"] == "hello"
        assert json.loads(other.recv())["type"] == "hello"
        with pytest.raises((ConnectionClosed, OSError)):
            send_pings(flooder, 100_000)
        assert server.health()["status"] == "ok"
        assert json.loads(other.recv())["type"] == "frame"
    with connect(address) as large:
        large.send("x" * (LIMITS.message_bytes + 1))
        with pytest.raises(ConnectionClosed) as closed:
            receive_all(large)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1009  # message too big
    for foreign in ("https://elsewhere.example", "http://localhost.evil.example", "null"):
        with pytest.raises(Exception, match="403"):
            connect(address, origin=foreign)  # type: ignore[arg-type]


def raw_answer(server: Process, request: bytes) -> bytes:
    """All that comes back for the bytes of a request, until the server closes."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=60) as raw:
        raw.sendall(request)
        answer = b""
        while piece := raw.recv(1 << 16):
            answer += piece
    return answer


FOREIGN = {
    "another host": (b"Host: evil.example\r\n", b"the host 'evil.example' is not served here"),
    "no host that can be read": (b"Host: [::\r\n", b"is not served here"),
    "a page of another site": (
        b"Host: localhost\r\nOrigin: http://evil.example\r\n",
        b"pages of 'http://evil.example'",
    ),
    "a page of a name that begins alike": (
        b"Host: localhost\r\nOrigin: http://localhost.evil.example\r\n",
        b"may not ask",
    ),
    "a page that was opened as a file": (b"Host: localhost\r\nOrigin: null\r\n", b"pages of 'null' may not ask"),
}


@pytest.mark.parametrize(("headers", "reason"), FOREIGN.values(), ids=FOREIGN)
def test_pages_of_other_sites_do_not_put_the_models_to_work(server: Process, headers: bytes, reason: bytes) -> None:
    body = b'{"text": "a person walks"}'
    for line in (b"GET /health HTTP/1.1", b"POST /generate.bvh HTTP/1.1\r\nContent-Length: %d" % len(body)):
        answer = raw_answer(server, line + b"\r\n" + headers + b"Connection: close\r\n\r\n" + body)
        assert answer.startswith(b"HTTP/1.1 403")
        assert reason in answer


@pytest.mark.parametrize("origin", ["http://localhost:3000", "http://127.0.0.1", "http://[::1]:5173"])
def test_pages_of_this_machine_ask(server: Process, origin: str) -> None:
    request = f"GET /health HTTP/1.1\r\nHost: localhost\r\nOrigin: {origin}\r\nConnection: close\r\n\r\n"
    assert raw_answer(server, request.encode()).startswith(b"HTTP/1.1 200")


def test_a_head_without_end_is_refused(server: Process) -> None:
    lines = b"GET /health HTTP/1.1\r\nHost: localhost\r\n" + b"X: y\r\n" * 20_000
    with suppress(OSError):  # it was closed while the rest was sent
        assert raw_answer(server, lines).startswith(b"HTTP/1.1 400")
    assert server.health()["status"] == "ok"


async def served(
    application: Starlette, scenario: Callable[[uvicorn.Server, int], Awaitable[Any]], **settings: Any
) -> Any:
    """What comes of a scenario with a server in this process and its port."""
    server = uvicorn.Server(uvicorn.Config(application, log_config=None, lifespan="off", **settings, **OPTIONS))
    with listening("127.0.0.1", 0) as place:
        task = asyncio.create_task(server.serve([place]))
        while not server.started:
            await asyncio.sleep(0.001)
        try:
            return await scenario(server, place.getsockname()[1])
        finally:
            server.should_exit = True
            await task


def bounded(scenario: Callable[[int], Awaitable[None]], live: object = None, **limits: Any) -> None:
    """Runs a scenario with the port of a server whose only application says its path."""

    async def application(scope: Any, receive: Any, send: Any) -> None:
        while (await receive()).get("more_body"):
            pass
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
        await send({"type": "http.response.body", "body": b"ok"})

    starlette = Starlette(routes=[Mount("/", application)])
    starlette.state.limits = Limits(**limits)
    starlette.state.live = live
    asyncio.run(served(starlette, lambda _, port: scenario(port), timeout_keep_alive=1))


HALF = b"GET / HTTP/1.1\r\nHost: localhost\r\n"


def test_half_a_head_and_a_slow_body_are_cut_off() -> None:
    async def scenario(port: int) -> None:
        begun = [HALF, b"", b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 1000000\r\n\r\nx", HALF + b"\r\n" + HALF]
        for data in begun:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(data)
            with suppress(ConnectionResetError):
                await reader.read()  # until the server closes
            writer.close()

    bounded(scenario, head_seconds=0.05)


def test_a_body_that_arrives_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = list[int]()  # each time that a limit is over in which a head would have had to arrive
    late = BoundedProtocol._late

    def counted(self: BoundedProtocol) -> None:
        watched.append(self.arrived)
        late(self)

    async def scenario(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"POST / HTTP/1.1\r\nHost: x\r\nConnection: close\r\nTransfer-Encoding: chunked\r\n\r\n")
        while len(watched) < 3:
            writer.write(b"2\r\nxx\r\n")
            await writer.drain()  # ConnectionResetError where it was cut off
            await asyncio.sleep(0.01)
        writer.write(b"0\r\n\r\n")
        assert (await reader.read()).startswith(b"HTTP/1.1 200")
        writer.close()

    monkeypatch.setattr(BoundedProtocol, "_late", counted)
    bounded(scenario, head_seconds=0.05, body_bytes_a_second=0)


def test_a_connection_that_was_handed_over_is_not_cut_off() -> None:
    class Door:
        """Greets who comes."""

        def take(self, transport: asyncio.Transport, head: bytes) -> None:
            self.before = transport.get_protocol()
            transport.set_protocol(asyncio.Protocol())
            transport.write(b"hello")
            assert b"upgrade: websocket" in head

    door = Door()

    async def scenario(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        upgrade = b"Connection: Upgrade\r\nUpgrade: websocket\r\n\r\n"
        writer.write(b"GET /live HTTP/1.1\r\nHost: localhost\r\n" + upgrade)
        assert await reader.readexactly(5) == b"hello"
        assert isinstance(door.before, BoundedProtocol)
        assert door.before.timer is None  # nothing waits to cut it off
        writer.close()

    bounded(scenario, live=door)


@pytest.mark.parametrize("limits", [{"connections": 5}, {"connections_of_address": 5}])
def test_who_waits_longest_gives_way_to_a_newcomer(limits: dict[str, int]) -> None:
    async def scenario(port: int) -> None:
        halves = []
        for _ in range(20):
            halves.append(await asyncio.open_connection("127.0.0.1", port))
            halves[-1][1].write(HALF)
            await halves[-1][1].drain()
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(HALF + b"Connection: close\r\n\r\n")
        assert (await reader.read()).startswith(b"HTTP/1.1 200")
        writer.close()
        newest, half = halves[-1]
        half.write(b"Connection: close\r\n\r\n")
        assert (await newest.read()).startswith(b"HTTP/1.1 200")
        half.close()
        for first, half in halves[:16]:
            with suppress(ConnectionResetError):
                assert await first.read() == b""
            half.close()

    bounded(scenario, **limits)


def test_connections_are_fewer_than_the_files_of_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    resource = pytest.importorskip("resource", reason="no limits of files there")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (256, 1024))
    assert most_connections(Limits()) == 156
    assert most_connections(Limits(connections=50)) == 50


def test_what_is_said_of_clients_fills_no_disk(caplog: pytest.LogCaptureFixture) -> None:
    logger = logging.getLogger("motet.tests.seldom")
    with quieter(logger.name):
        for number in range(1000):
            logger.warning("client %d", number)
    assert 20 <= len(caplog.messages) <= 40  # a minute may end between
    assert sum("more of this minute is left out" in message for message in caplog.messages) in (1, 2)


def test_the_header_of_what_was_understood_is_short() -> None:
    rows = [{"text": f"a person walks {number}", "nearest": ["x" * 200]} for number in range(60)]
    assert json.loads(in_a_header(rows[:3])) == rows[:3]
    shown = json.loads(in_a_header(rows))
    assert shown == [*rows[:10], {"more": 50}]
    long = [{"text": "\u0416" * 1000, "nearest": []}] * 9
    assert json.loads(in_a_header(long)) == [{"more": 9}]
    assert max(len(in_a_header(each)) for each in (rows, long)) <= HEADER_BYTES


def test_two_servers_on_a_port(server: Process) -> None:
    result = run("serve", "--port", server.port)
    assert (result.exit_code, result.stdout) == (2, "")
    assert f"cannot listen on 127.0.0.1:{server.port}: Address already in use" in result.stderr


def test_a_request_that_runs_is_answered_before_the_end() -> None:
    server = Process()
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=300)
    connection.request("GET", "/stream?text=a+person+walks&seconds=20")
    answer = connection.getresponse()
    lines = [answer.readline()]
    server.process.send_signal(signal.SIGINT)
    lines += answer.readlines()
    assert sum(len(json.loads(line)["rotations"]) for line in lines[1:]) == 20 * 30
    assert server.process.wait(300) == 0


@pytest.mark.parametrize("begun", [False, True])
def test_who_still_waits_at_the_end_is_told(begun: bool, caplog: pytest.LogCaptureFixture) -> None:
    """Without a traceback, as no fault has happened."""
    waits = asyncio.Event()

    async def stuck(scope: Any, receive: Any, send: Any) -> None:
        if begun:
            await send({"type": "http.response.start", "status": 200, "headers": []})
        waits.set()
        await asyncio.Event().wait()

    async def stopped(server: uvicorn.Server, port: int) -> bytes:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(HALF + b"\r\n")
        await waits.wait()
        server.should_exit = True
        answer = await reader.read()
        writer.close()
        return answer

    application = Starlette(routes=[Mount("/", stuck)], middleware=[Middleware(Gate, limits=Limits())])
    application.state.limits = Limits()
    application.state.live = None
    answer = asyncio.run(served(application, stopped, timeout_graceful_shutdown=0))
    assert answer.startswith(b"HTTP/1.1 200" if begun else b"HTTP/1.1 503")
    assert begun or b"the server is stopping" in answer
    assert [record for record in caplog.records if record.exc_info] == []


def test_the_extra_is_named_where_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "starlette.applications", None)
    with pytest.raises(ImportError, match=r"pip install 'motet\[serve\]'"):
        importlib.reload(importlib.import_module("motet.serve.application"))


def test_a_bundle_of_another_verb() -> None:
    said = "bundle search is for 'search'; a server takes generate, describe, predict, control"
    assert said in run("serve", "--bundle", "search").stderr


def test_those_who_wait_share_a_call() -> None:
    calls: list[tuple[str, list[int]]] = []
    begun = threading.Event()
    left = threading.Event()

    def call(key: str, items: list[int]) -> Sequence[int]:
        calls.append((key, items))
        begun.set()
        assert left.wait(60)
        if 13 in items:
            raise TextError("thirteen")
        return [10 * item for item in items]

    async def scenario() -> list[object]:
        batcher = Batcher(call, pool, batch=4)
        asked = [asyncio.ensure_future(batcher(key, item)) for key, item in zip("aabaaaab", range(8), strict=True)]
        await asyncio.to_thread(begun.wait, 60)
        asked[3].cancel()  # it leaves within its call
        asked[7].cancel()  # and it before
        left.set()
        found = await asyncio.gather(*asked, return_exceptions=True)
        return [*found, *await asyncio.gather(batcher("a", 12), batcher("a", 13), return_exceptions=True)]

    with ThreadPoolExecutor(1) as pool:
        found = asyncio.run(scenario())
    assert found[:3] + found[4:7] + found[8:9] == [0, 10, 20, 40, 50, 60, 120]
    assert isinstance(found[3], asyncio.CancelledError)
    assert isinstance(found[7], asyncio.CancelledError)
    assert str(found[9]) == "thirteen"
    assert calls[:3] == [("a", [0, 1, 3, 4]), ("b", [2]), ("a", [5, 6])]
    assert calls[3:] == [("a", [12, 13]), ("a", [12]), ("a", [13])]


def gated(limits: Limits, parts: list[bytes], clients: int = 1, wait: float = 0.0) -> list[list[Message]]:
    """What a gate sends to clients that come at once, before an application that reads all."""

    async def application(scope: Any, receive: Any, send: Any) -> None:
        try:
            while (await receive()).get("more_body"):
                await asyncio.sleep(wait)
            await send({"type": "http.response.start", "status": 200})
        except HTTPException as error:
            await send({"type": "http.response.start", "status": error.status_code})

    async def client(gate: Gate) -> list[Message]:
        left, sent = iter(parts), list[Message]()

        async def receive() -> Message:
            part = next(left, None)
            return {"type": "http.request", "body": part or b"", "more_body": part is not None}

        async def send(message: Message) -> None:
            sent.append(message)

        await gate({"type": "http", "path": "/describe", "headers": []}, receive, send)
        return sent

    async def all_at_once() -> list[list[Message]]:
        gate = Gate(application, limits)
        found = list(await asyncio.gather(*(client(gate) for _ in range(clients))))
        assert (gate.requests, gate.held) == (0, 0)
        return found

    return asyncio.run(all_at_once())


@pytest.mark.parametrize(
    ("limits", "clients", "statuses"),
    [
        (Limits(), 3, [200, 200, 200]),
        (Limits(body_bytes=250), 1, [413]),
        (Limits(all_bytes=850), 3, [200, 200, 503]),
        (Limits(requests=2), 3, [200, 200, 503]),
    ],
)
def test_too_large_and_too_much_at_once(limits: Limits, clients: int, statuses: list[int]) -> None:
    answers = gated(limits, [b"x" * 100] * 3, clients, wait=0.01)
    assert [answer[0]["status"] for answer in answers] == statuses


class NeverDone:
    """Answers that are never there, and whether the work on one has begun and was dropped."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.begun = asyncio.Event()
        self.dropped = asyncio.Event()

    async def generate(self, *_: object) -> None:
        self.begun.set()
        try:
            await asyncio.Event().wait()
        finally:
            self.dropped.set()


GENERATE = next(door for door in DOORS if door.name == "generate")


def test_no_answer_in_time() -> None:
    from starlette.testclient import TestClient

    pytest.importorskip("httpx2", reason="Starlette's test client needs it")
    answers: Any = NeverDone(Limits(seconds=0.05))
    route = Route(GENERATE.path, endpoint(GENERATE, answers))
    with TestClient(Starlette(routes=[route], exception_handlers={HTTPException: refused})) as client:
        answer = client.get("/generate.csv", params={"text": "a person walks"})
    assert (answer.status_code, answer.json()["error"]) == (504, "there was no answer within 0.05 s")


def test_work_for_a_client_that_leaves_is_dropped() -> None:
    async def running() -> None:
        answers: Any = NeverDone(Limits())

        body: list[Message] = [{"type": "http.request"}]

        async def leave() -> Message:
            if body:
                return body.pop()
            await answers.begun.wait()
            return {"type": "http.disconnect"}

        scope = {"type": "http", "method": "GET", "headers": [], "query_string": b"text=walk"}
        request = Request({**scope, "path": "/generate.csv", "path_params": {"format": "csv"}}, leave)
        async with asyncio.timeout(50):  # less than until an answer must be there
            with pytest.raises(ClientDisconnect):
                await endpoint(GENERATE, answers)(request)
            await answers.dropped.wait()

    asyncio.run(running())


def test_a_client_that_takes_no_part_of_its_answer_is_left() -> None:
    async def application(scope: Any, receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200})

    async def never(_: object = None) -> Any:
        await asyncio.Event().wait()

    async def running() -> None:
        gate = Gate(application, Limits(seconds=0.01))
        async with asyncio.timeout(30) as waiting:
            await gate({"type": "http", "path": "/describe", "headers": []}, never, never)
        assert not waiting.expired()
        assert (gate.requests, gate.held) == (0, 0)

    asyncio.run(running())
