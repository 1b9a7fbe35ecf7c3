import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from motet.errors import OutputError, TextError
from motet.figures.humanoid.bones import BONES, HUMANOID
from motet.steering.acts import Act, ActSettings
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.text.clauses import Shown

pytest.importorskip("websockets", reason="the extra live is not installed")
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from motet.live.protocol import CLIENT_FIGURES, LARGEST_COMMAND, ClientSession, sentences
from motet.live.server import LIMITS, LiveServer

Message = dict[str, Any]


def serving(model: SteerModel, scenario: Callable[[LiveServer], Coroutine[Any, Any, None]], **settings: Any) -> None:
    """Run a scenario beside a server on a free port, five times as fast as life."""

    async def both() -> None:
        async with LiveServer(model, port=0, **{"rate": 150, **settings}) as server, asyncio.timeout(20):
            await scenario(server)

    asyncio.run(both())


def client(server: LiveServer, **settings: Any) -> connect:
    """A client that takes every frame, whether the test asks for it or not."""
    return connect(f"ws://127.0.0.1:{server.port}", max_queue=None, **settings)


async def told(connection: ClientConnection, kind: str, **given: Any) -> None:
    await connection.send(json.dumps({"type": kind, **given}))


async def next_of(
    connection: ClientConnection, kind: str, wanted: Callable[[Message], bool] = lambda _: True
) -> Message:
    while True:
        message: Message = json.loads(await connection.recv())
        if message["type"] == kind and wanted(message):
            return message


async def frames(
    connection: ClientConnection, count: int, wanted: Callable[[Message], bool] = lambda _: True
) -> list[Message]:
    return [await next_of(connection, "frame", wanted) for _ in range(count)]


async def end_of(connection: ClientConnection) -> tuple[str, int | None, str]:
    """The last message to a client that is dropped, and the code and reason with which it is."""
    said = ""
    try:
        while True:
            message = json.loads(await connection.recv())
            said = message["message"] if message["type"] == "error" else said
    except ConnectionClosed:
        return said, connection.close_code, connection.close_reason or ""


def check_same(character: Message, pose: Pose, row: int = 0) -> None:
    for name, values in {
        "position": pose.place,
        "rotation": pose.heading,
        "height": pose.height,
        "rotations": pose.rotations,
        "contacts": pose.contacts,
    }.items():
        np.testing.assert_allclose(character[name], values[row], atol=1e-5, err_msg=name)


def test_frames_are_those_of_a_session(steer_model: SteerModel) -> None:
    async def scenario(server: LiveServer) -> None:
        async with client(server) as connection:
            hello = json.loads(await connection.recv())
            assert (hello["type"], hello["fps"], hello["bones"]) == ("hello", steer_model.fps, list(BONES))
            slowest, fastest = steer_model.speeds["walk"]
            assert hello["gaits"]["walk"] == [slowest, steer_model.usual["walk"], fastest]
            assert [joint["name"] for joint in hello["joints"]] == list(HUMANOID.names)
            before = await frames(connection, 3)
            await told(connection, "control", gait="run", speed=2.5, direction=90)
            after = await frames(connection, 40)
        session = steer_model.start()
        for number, frame in enumerate([*before, *after], start=1):
            assert (frame["tick"], frame["time"]) == (number, pytest.approx(number / 30, abs=1e-5))
            if frame["heard"] == 1:
                session.control(gait="run", speed=2.5, direction=90)
            check_same(frame["characters"][0], session.tick())
        assert after[-1]["heard"] == 1

    serving(steer_model, scenario)


def test_many_characters_placed_put_and_pushed(steer_model: SteerModel) -> None:
    async def scenario(server: LiveServer) -> None:
        async with client(server) as connection:
            places = [[0, 0, 0], [2, 0, 90]]
            await told(connection, "start", characters=2, places=places, positions=True, hold_feet=False)
            frame = await next_of(connection, "frame", lambda frame: frame["heard"] == 1)
            session = steer_model.start(characters=2, places=places, hold_feet=False)
            for _ in range(frame["tick"]):
                pose = session.tick()
            for row, character in enumerate(frame["characters"]):
                check_same(character, pose, row)
                np.testing.assert_allclose(character["positions"], pose.positions()[row], atol=1e-5)
            await told(connection, "put", places=[[5, 5, 0], [-5, 5, 0]])
            put = await next_of(connection, "frame", lambda frame: frame["heard"] == 2)
            assert [character["position"][0] for character in put["characters"]] == [
                pytest.approx(x, abs=0.3) for x in (5, -5)
            ]
            await told(connection, "push", velocity=[[4, 0], [0, 0]])
            await next_of(connection, "frame", lambda frame: frame["heard"] == 3)
            pushed = (await frames(connection, 30))[-1]["characters"]
            assert pushed[0]["position"][0] > 5.1

    serving(steer_model, scenario)


def test_points_are_gone_to_looked_at_and_reached_for_and_events_told(steer_model: SteerModel) -> None:
    live, session, happened = ClientSession(steer_model), steer_model.start(), list[Any]()

    def same_for(ticks: int, told: dict[str, dict[str, Any]]) -> None:
        for kind, given in told.items():
            assert live.handle(json.dumps({"type": kind, **given})) == []
            getattr(session, kind)(**{"points": None, **given})
        for _ in range(ticks):
            frame, pose = json.loads(live.frame(live.tick())), session.tick()
            check_same(frame["characters"][0], pose)
            assert frame.get("events") != []
            assert [(*event, "")[:3] for event in frame.get("events", ())] == list(map(tuple, pose.events))
            happened.extend(kind for kind, *_ in frame.get("events", ()))

    hand = {"hand": "left", "points": [0.4, 1.2, 1.8]}
    same_for(120, {"go_to": {"points": [0, 1.5], "facing": 30}, "look_at": {"points": [2, 1, 2]}, "reach": hand})
    assert session.arrived.all()
    assert {"left foot", "right foot", "arrived"} <= set(happened)
    same_for(20, {"look_at": {}, "reach": {"hand": "left"}, "go_to": {}})


class Said:
    """Makes one act, slowly; a sentence that it does not know is refused."""

    def __init__(self, model: SteerModel) -> None:
        raised = np.tile(np.float32([0, 0, 0, 1]), (40, len(BONES), 1))
        raised[:, BONES.index("leftUpperArm"), 2] = np.linspace(0, 1, 40)
        numbers = np.column_stack([raised.reshape(40, -1), np.zeros((40, 3), np.float32), np.full(40, 0.95)])
        self.made = Act.of("wave", numbers.astype(np.float32), model.fps, model.settings(ActSettings))

    def act(self, sentence: str) -> Act:
        return self.shown(sentence)[0]

    def shown(self, sentence: str, strict: bool = False) -> tuple[Act, Shown]:
        if sentence != "wave a kite":
            raise TextError(f"the model knows no word of {sentence!r}")
        time.sleep(0.05)
        return self.made, Shown("a person waves")


def test_acts_are_told_in_words_and_what_is_not_known_is_said(steer_model: SteerModel) -> None:
    async def scenario(server: LiveServer) -> None:
        server.words = cast(Any, Said(steer_model))
        async with client(server) as connection:
            await told(connection, "act", motion="fly to Mars")
            assert "knows no word of 'fly to Mars'" in (await next_of(connection, "note"))["message"]
            await told(connection, "act", motion="wave a kite", upper=True)
            seen = await frames(connection, 30, lambda frame: frame["heard"] == 2)
        session = steer_model.start()
        for _ in range(seen[0]["tick"] - 1):
            session.tick()
        session.act(Said(steer_model).made, upper=True)
        for frame in seen:
            check_same(frame["characters"][0], session.tick())
        assert session.acting[0] is not None
        assert ["act begun", 0, "wave"] in seen[0]["events"]

    serving(steer_model, scenario)


def test_a_client_ends_an_act(steer_model: SteerModel) -> None:
    one = ClientSession(steer_model, 2, cast(Any, Said(steer_model)))
    assert one.handle('{"type": "act", "motion": ["wave a kite", null]}') == []
    one.tick()
    assert [act and act[0] for act in one.session.acting] == ["wave", None]
    one.handle('{"type": "act"}')
    assert ["act ended", 0, "wave"] in json.loads(one.frame(one.tick()))["events"]
    one.handle('{"type": "start", "characters": 1}')
    one.handle('{"type": "act", "motion": "wave a kite"}')
    one.handle('{"type": "act"}')
    assert one.session.acting == [None]
    assert sentences('{"type": "act", "motion": ["wave", null, "bow"]}') == ["wave", "bow"]
    assert sentences('{"type": "put", "places": [0, 0, 0]}') == sentences('{"type": "act"}') == []
    (note,) = ClientSession(steer_model).handle('{"type": "act", "motion": "trapeze"}')
    assert note.startswith("'trapeze' is not known. Nearest: ")


def test_clients_do_not_touch_each_other(steer_model: SteerModel) -> None:
    async def scenario(server: LiveServer) -> None:
        async with client(server) as first, client(server) as second:
            await told(first, "control", gait="run", speed=3)
            assert (await frames(first, 60))[-1]["characters"][0]["position"][2] > 1
            assert abs((await frames(second, 60))[-1]["characters"][0]["position"][2]) < 0.3
            await second.send("rubbish")
            await end_of(second)
            assert len(await frames(first, 30)) == 30

    serving(steer_model, scenario)


def test_junk_is_told_why_and_dropped(steer_model: SteerModel) -> None:
    junk: list[tuple[str | bytes, str]] = [
        ("walk", "must be JSON"),
        ('{"type": "control", "speed": NaN}', "NaN is no number"),
        ('{"type": "control", "speed": 1e999}', "expected numbers up to 1e+06"),
        ('{"type": "control", "direction": 1e300}', "expected numbers up to 1e+06"),
        ('{"type": "control", "speed": "fast"}', "control, speed: expected numbers"),
        ('{"type": "control", "speed": true}', "control, speed: expected numbers"),
        ('{"type": "control", "speed": [1, 2]}', "speed needs a number or one for each of 1 characters"),
        ('{"type": "control", "velocity": [1, [2]]}', "a velocity needs x and z"),
        ('{"type": "control", "velocity": [[[1, 2]]]}', "control, velocity: expected numbers"),
        ('{"type": "control", "velocity": [1, 0], "speed": 1}', "not both"),
        ('{"type": "control", "gait": "swim"}', "unknown gait 'swim'; expected one of walk, run"),
        ('{"type": "control", "gait": 3}', "expected the name of a gait"),
        ('{"type": "control", "sped": 3}', "'sped' is unknown; expected one of gait, speed"),
        ('{"type": "dance"}', 'whose "type" is one of control, start, put, push'),
        ("[1, 2]", 'whose "type" is one of control, start, put, push'),
        ("[" * 5000, "must be JSON"),
        ('{"type": "push"}', "push: expected velocity"),
        ('{"type": "reach", "points": [0, 1, 0]}', "reach: expected hand"),
        ('{"type": "reach", "hand": "third"}', "reach, hand: expected left or right"),
        ('{"type": "act", "motion": ["wave", 3]}', "act, motion: expected a sentence, or a list of sentences and null"),
        ('{"type": "look_at", "points": [0, 1]}', "points need x, y and z"),
        ('{"type": "go_to", "points": "home"}', "go_to, points: expected numbers"),
        ('{"type": "put", "places": [1, 2]}', "places need x, z and facing"),
        ('{"type": "put", "places": [[1]]}', "places need x, z and facing"),
        ('{"type": "put", "places": [1000001, 0, 0]}', "put, places: expected numbers up to 1e+06"),
        ('{"type": "push", "velocity": [[1]]}', "a velocity needs x and z"),
        (
            f'{{"type": "start", "characters": {CLIENT_FIGURES + 1}}}',
            f"a whole number from 1 to {CLIENT_FIGURES}",
        ),
        ('{"type": "start", "positions": 1}', "start, positions: expected true or false"),
        (b"\x00\x01", "must be text, not binary"),
    ]

    async def scenario(server: LiveServer) -> None:
        for sent, fault in junk:
            async with client(server) as connection:
                await connection.send(sent)
                message, code, reason = await end_of(connection)
            assert fault in message
            assert (code, reason) == (1008, message.encode()[:120].decode())

    serving(steer_model, scenario)


def test_what_is_too_much(steer_model: SteerModel) -> None:
    async def scenario(server: LiveServer) -> None:
        async with client(server) as connection:
            await connection.send(" " * (LIMITS.message_bytes + 1))
            assert (await end_of(connection))[1] == 1009
        async with client(server) as connection:
            for _ in range(20 * LIMITS.messages):
                try:
                    await connection.send('{"type": "control"}')
                except ConnectionClosed:
                    break
            assert f"more than {LIMITS.messages} messages" in (await end_of(connection))[0]
        server.limits = replace(LIMITS, clients=1)
        async with client(server) as first, client(server) as second:
            assert (await end_of(second))[1:] == (1013, "there are 1 clients already, of 1 figures")
            assert len(await frames(first, 5)) == 5
        server.limits = replace(LIMITS, figures=3)
        async with client(server) as first, client(server) as second:
            await frames(second, 1)
            await told(first, "start", characters=2)
            async with client(server) as third:
                assert (await end_of(third))[1:] == (1013, "there are 2 clients already, of 3 figures")
            await told(first, "start", characters=3)
            assert (await end_of(first))[0] == "all clients together may have 3 figures"
            assert len(await frames(second, 5)) == 5
        with pytest.raises(InvalidStatus, match="403"):
            await client(server, origin="https://elsewhere.example")
        async with client(server, origin="http://localhost:8000") as connection:
            await frames(connection, 1)

    serving(steer_model, scenario)


def raw_client(server: LiveServer) -> socket.socket:
    """A client that does nothing by itself."""
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    raw.connect(("127.0.0.1", server.port))
    asked = "GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    raw.sendall(f"{asked}Sec-WebSocket-Key: {'A' * 22}==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode())
    return raw


@pytest.mark.parametrize("head", [b"\x89", b"\x8a", b"\x00"], ids=["pings", "pongs", "parts of messages"])
def test_a_flood_of_what_is_no_message_is_cut_off(
    steer_model: SteerModel, head: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    flood = head + b"\x80\0\0\0\0"

    async def scenario(server: LiveServer) -> None:
        async with client(server) as connection:
            raw = raw_client(server)
            raw.setblocking(False)
            while len(server._clients) < 2:
                await frames(connection, 1)
            text = b"" if head != b"\x00" else b"\x01\x80\0\0\0\0"  # a message begins
            await asyncio.get_running_loop().sock_sendall(raw, text + flood * LIMITS.controls)
            await frames(connection, 5)
            assert len(server._clients) == 2
            with suppress(OSError):
                await asyncio.get_running_loop().sock_sendall(raw, flood * 100_000)
            while len(server._clients) == 2:
                await frames(connection, 1)
            assert len(await frames(connection, 30)) == 30
            raw.close()

    serving(steer_model, scenario)
    said = [record.message for record in caplog.records if record.name == "motet.live.server"]
    assert said == [f"dropped a client: more than {LIMITS.controls} pings, pongs and parts of messages in a second"]


def test_a_client_that_answers_no_pings_is_dropped(steer_model: SteerModel) -> None:
    async def scenario(server: LiveServer) -> None:
        raw = raw_client(server)
        raw.setblocking(False)
        got = b"frames"
        async with asyncio.timeout(5):
            while got:  # it takes all, but says nothing
                got = await asyncio.get_running_loop().sock_recv(raw, 1 << 16)
        raw.close()

    serving(steer_model, scenario, limits=replace(LIMITS, ping=0.2))


def test_what_waits_for_a_client_is_bounded_and_not_packed(steer_model: SteerModel) -> None:
    async def scenario(server: LiveServer) -> None:
        async with client(server, compression="deflate") as connection:
            await frames(connection, 1)
            assert connection.protocol.extensions == []
            assert server._server is not None
            (own,) = server._server.connections
            bound = own.transport.get_extra_info("socket").getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF)
            assert bound in {LIMITS.buffer, 2 * LIMITS.buffer}  # Linux doubles what it is told

    serving(steer_model, scenario)


def test_late_frames_are_not_made_up_for(steer_model: SteerModel) -> None:
    stops = [1.0]

    def stop_once(pose: Pose, seconds: float) -> None:
        if seconds > 0.1 and stops:
            time.sleep(stops.pop())

    async def scenario(server: LiveServer) -> None:
        async with client(server) as connection:
            while stops:
                await frames(connection, 1)
            clock = asyncio.get_running_loop().time
            stop, count = clock() + 0.4, 0
            while clock() < stop:
                await frames(connection, 1)
                count += 1
            assert count <= 14  # eight in time, and a few of the last tenth of a second; 28 with those of the stop

    serving(steer_model, scenario, rate=20, watch=stop_once)


def test_a_client_that_stalls_is_dropped_and_others_go_on(steer_model: SteerModel) -> None:
    async def scenario(server: LiveServer) -> None:
        raw = raw_client(server)
        async with client(server) as connection:
            await frames(connection, 1)
            assert len(server._clients) == 2
            while len(server._clients) == 2:
                await frames(connection, 1)
            assert len(await frames(connection, 30)) == 30
        raw.close()

    serving(steer_model, scenario, characters=CLIENT_FIGURES, limits=replace(LIMITS, stall=0.2), rate=60)


def test_a_speed_out_of_range_is_noted(steer_model: SteerModel) -> None:
    async def scenario(server: LiveServer) -> None:
        async with client(server) as connection:
            await told(connection, "control", gait="walk", speed=LARGEST_COMMAND)
            note = await next_of(connection, "note")
            assert "'walk' allows 0 or 0.1-1.92 m/s in this direction, not 1e+06" in note["message"]
            await frames(connection, 2)

    serving(steer_model, scenario)


def test_who_watches_sees_the_first_client(steer_model: SteerModel) -> None:
    seen: list[tuple[float, Pose]] = []

    async def scenario(server: LiveServer) -> None:
        async with client(server) as first, client(server) as second:
            await told(second, "control", speed=1)
            theirs = await frames(first, 20)
            await frames(second, 5)
            for frame, (seconds, pose) in zip(theirs, seen, strict=False):
                assert frame["time"] == pytest.approx(seconds, abs=1e-5)
                check_same(frame["characters"][0], pose)

    serving(steer_model, scenario, watch=lambda pose, seconds: seen.append((seconds, pose)))
    assert len(seen) >= 20


def test_a_port_that_is_taken(steer_model: SteerModel) -> None:
    async def scenario(server: LiveServer) -> None:
        with pytest.raises(OutputError, match=rf"cannot listen on 127.0.0.1:{server.port}: .*in use"):
            async with LiveServer(steer_model, port=server.port):
                pass

    serving(steer_model, scenario)


def test_ctrl_c_ends_it(steer_model: SteerModel) -> None:
    assert steer_model._source is not None
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs of a shell ignore it, and their children
    command = [sys.executable, "-m", "motet", "live", "--port", "0", "--bundle", str(steer_model._source[0])]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ
    ) as process:
        assert process.stderr is not None
        listening = process.stderr.readline()
        port = int(listening.split(";")[0].rpartition(":")[2])

        async def visit() -> None:
            async with asyncio.timeout(20), connect(f"ws://127.0.0.1:{port}") as connection:
                await frames(connection, 2)
                process.send_signal(signal.SIGINT)
                await end_of(connection)
                assert connection.close_code == 1001

        try:
            asyncio.run(visit())
            out, err = process.communicate(timeout=10)
        finally:
            process.kill()
    assert (process.returncode, out, err) == (0, "", "stopped\n")
