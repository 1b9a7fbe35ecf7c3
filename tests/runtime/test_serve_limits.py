"""A server that is asked too much, left, or told to stop: a real one, and its parts."""

import asyncio
import http.client
import importlib
import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from command_line import run

from motet.errors import TextError

pytest.importorskip("starlette", reason="the extra serve is not installed")
pytest.importorskip("uvicorn", reason="the extra serve is not installed")
from starlette.exceptions import HTTPException
from starlette.types import Message
from websockets.sync.client import connect

from motet.serve.batches import Batcher
from motet.serve.limits import Gate, Limits

WALK = "/generate.npz?text=a+person+walks&seconds=1&seed="


class Process:
    """A server of a process of its own."""

    def __init__(self) -> None:
        command = [sys.executable, "-m", "motet", "serve", "--port", "0", "--timeout", "30"]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        self.port = int(self.process.stderr.readline().split(";")[0].rpartition(":")[2])

    def get(self, address: str) -> tuple[int, bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
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
    out = found.process.communicate(timeout=30)[1]
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
            raw.sendall(f"GET {address} HTTP/1.1\r\nHost: x\r\n\r\n".encode())
            if address.startswith("/stream"):
                assert raw.recv(1 << 12).startswith(b"HTTP/1.1 200")
    with socket.create_connection(("127.0.0.1", server.port)) as raw:  # within its body
        raw.sendall(b"POST /describe?format=bvh HTTP/1.1\r\nHost: x\r\nContent-Length: 1000\r\n\r\nHIERARCHY")
    assert server.get(WALK + "1")[0] == 200
    assert server.health()["waiting"] == 0


def test_a_body_of_a_gigabyte_is_refused_before_it_is_sent(server: Process) -> None:
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as raw:
        raw.sendall(f"POST /describe?format=bvh HTTP/1.1\r\nHost: x\r\nContent-Length: {10**9}\r\n\r\n".encode())
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
    with pytest.raises(Exception, match="403"):
        connect(address, origin="https://elsewhere.example")  # type: ignore[arg-type]
    with connect(address, origin="http://localhost:3000") as page:  # type: ignore[arg-type]
        assert json.loads(page.recv())["type"] == "hello"


def test_two_servers_on_a_port(server: Process) -> None:
    result = run("serve", "--port", server.port)
    assert (result.exit_code, result.stdout) == (2, "")
    assert f"cannot listen on 127.0.0.1:{server.port}: Address already in use" in result.stderr


def test_a_request_that_runs_is_answered_before_the_end() -> None:
    server, answers = Process(), list[tuple[int, bytes]]()
    asked = threading.Thread(target=lambda: answers.append(server.get("/generate.csv?text=a+person+walks&seconds=20")))
    assert server.health()["status"] == "ok"
    asked.start()
    time.sleep(0.5)
    server.process.send_signal(signal.SIGINT)
    asked.join(30)
    assert server.process.wait(30) == 0
    assert [status for status, _ in answers] == [200]


def test_the_extra_is_named_where_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motet.cli.missing", lambda extra: ["starlette"] if extra == "serve" else [])
    assert "needs starlette: install the extra with  pip install 'motet[serve]'" in run("serve").stderr
    monkeypatch.setitem(sys.modules, "starlette.applications", None)
    with pytest.raises(ImportError, match=r"pip install 'motet\[serve\]'"):
        importlib.reload(importlib.import_module("motet.serve.application"))


def test_a_bundle_of_another_verb() -> None:
    said = "bundle search is for 'search'; a server takes generate, describe, predict, control"
    assert said in run("serve", "--bundle", "search").stderr


def test_those_who_wait_share_a_call() -> None:
    calls: list[tuple[str, list[int]]] = []

    def call(key: str, items: list[int]) -> Sequence[int]:
        calls.append((key, items))
        time.sleep(0.02)
        if 13 in items:
            raise TextError("thirteen")
        return [10 * item for item in items]

    async def scenario() -> list[object]:
        batcher = Batcher(call, pool, batch=4)
        asked = [asyncio.ensure_future(batcher(key, item)) for key, item in zip("aabaaaab", range(8), strict=True)]
        await asyncio.sleep(0.01)
        asked[3].cancel()  # it left before its call
        found = await asyncio.gather(*asked, return_exceptions=True)
        return [*found, *await asyncio.gather(batcher("a", 12), batcher("a", 13), return_exceptions=True)]

    with ThreadPoolExecutor(1) as pool:
        found = asyncio.run(scenario())
    assert found[:3] + found[4:9] == [0, 10, 20, 40, 50, 60, 70, 120]
    assert isinstance(found[3], asyncio.CancelledError)
    assert str(found[9]) == "thirteen"
    assert calls[:3] == [("a", [0, 1, 3, 4]), ("b", [2, 7]), ("a", [5, 6])]
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


def test_no_answer_in_time() -> None:
    from starlette.testclient import TestClient

    from motet.serve.application import app

    pytest.importorskip("httpx2", reason="Starlette's test client needs it")
    with TestClient(app(limits=Limits(seconds=0.05))) as client:
        answer = client.get("/generate.csv", params={"text": "a person walks", "seconds": 100})
    assert (answer.status_code, answer.json()["error"]) == (504, "there was no answer within 0.05 s")
