"""Every message of docs/reference/live-protocol.md is sent, and answered as the page says; and the clients in
examples/ say nothing else."""

import asyncio
import json
import re
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

import motet
from motet.live.protocol import KEYS, parsed
from motet.steering.events import Happening

pytest.importorskip("websockets", reason="the extra live is not installed")
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from motet.live.server import LiveServer

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/reference/live-protocol.md").read_text()
CLIENTS = {name: (ROOT / "examples" / name).read_text() for name in ("unity/MotetFigure.cs", "godot/motet_figure.gd")}

Message = dict[str, Any]
Tell = Callable[..., Awaitable[Message]]
"""Sends a message, and gives the frame so many ticks after the one that obeys it."""


def of_the_server() -> dict[str, Message]:
    """The messages that the page shows of the server, without what it leaves out."""
    text = PAGE[PAGE.index("**The server sends**") : PAGE.index("* `gaits`")]
    shown = re.findall(r"^ {4}(\{.*?\})\n(?= {4}\{|\n)", text, flags=re.DOTALL | re.MULTILINE)
    messages = [json.loads(re.sub(r",\s*\.\.\.", "", one)) for one in shown]
    return {one["type"]: one for one in messages}


def of_a_client() -> list[Message]:
    """The messages that the page's table says a client may send."""
    return [json.loads(one) for one in re.findall(r"^\| `(\{.*?\})` \|", PAGE, flags=re.MULTILINE)]


def with_server(scenario: Callable[[Tell, Message], Awaitable[None]]) -> None:
    """Run what a client says beside a server that is five times as fast as life."""

    async def both() -> None:
        server = LiveServer(motet.load("control"), port=0, rate=150, words=motet.load("generate"))
        async with server, connect(f"ws://127.0.0.1:{server.port}", max_queue=None) as client, asyncio.timeout(60):
            count = 0

            async def tell(message: Message, ticks: int = 60) -> Message:
                nonlocal count
                count += 1
                await client.send(json.dumps(message))
                obeyed: int | None = None
                while True:
                    said: Message = json.loads(await client.recv())
                    if said["type"] == "frame" and said["heard"] == count:
                        obeyed = said["tick"] if obeyed is None else obeyed
                        if said["tick"] >= obeyed + ticks:
                            return said

            await scenario(tell, json.loads(await client.recv()))

    asyncio.run(both())


def going(before: Message, after: Message) -> Any:
    """Mean velocity of the first character, m/s along x and z."""
    moved = np.subtract(after["characters"][0]["position"], before["characters"][0]["position"])
    return moved[[0, 2]] / (after["time"] - before["time"])


def test_every_message_of_the_page_does_what_it_says() -> None:
    run, velocity, _, start, put, push, go, look, act, _, reach = of_a_client()
    kinds = [message["type"] for message in (run, velocity, start, put, push, go, look, act, reach)]
    assert kinds == ["control", "control", "start", "put", "push", "go_to", "look_at", "act", "reach"]

    async def scenario(tell: Tell, hello: Message) -> None:
        shown = of_the_server()["hello"]
        assert hello.keys() == shown.keys()
        assert (hello["fps"], hello["gaits"]["walk"]) == (shown["fps"], shown["gaits"]["walk"])
        assert hello["bones"][:2] == shown["bones"]
        assert hello["joints"][0] == shown["joints"][0]

        await tell(run)
        first, second = await tell(run), await tell(run)
        np.testing.assert_allclose(going(first, second), [run["speed"], 0], atol=0.4)
        x, y, z, w = second["characters"][0]["rotation"]
        assert abs(np.degrees(2 * np.arctan2(y, w)) - run["facing"]) < 15
        np.testing.assert_allclose([x, z], 0, atol=1e-6)

        await tell(velocity)
        first, second = await tell(velocity), await tell(velocity)
        np.testing.assert_allclose(going(first, second), velocity["velocity"], atol=0.3)

        frame = await tell(start, 0)
        assert len(frame["characters"]) == start["characters"]
        places = [[one["position"][0], one["position"][2]] for one in frame["characters"]]
        np.testing.assert_allclose(places, np.array(start["places"])[:, :2], atol=0.3)
        assert np.shape(frame["characters"][0]["positions"]) == (len(hello["joints"]), 3)
        assert np.shape(frame["characters"][0]["rotations"]) == (len(hello["bones"]), 4)
        shown = of_the_server()["frame"]
        assert frame.keys() - {"events"} == shown.keys()
        assert frame["characters"][0].keys() == shown["characters"][0].keys() | {"positions"}

        frame = await tell(put, 0)
        for one in frame["characters"]:
            np.testing.assert_allclose([one["position"][0], one["position"][2]], put["places"][:2], atol=0.3)
        pushed = await tell(push, 3)
        assert pushed["characters"][0]["position"][0] > frame["characters"][0]["position"][0] + 0.01

        await tell(start)
        held = (await tell(reach))["characters"][0]["positions"]
        hand = held[[joint["name"] for joint in hello["joints"]].index("leftHand_end")]
        np.testing.assert_allclose(hand, reach["points"], atol=0.15)
        head = hello["bones"].index("head")
        ahead = (await tell({"type": "reach", "hand": "left"}))["characters"][0]["rotations"][head]
        aside = (await tell(look))["characters"][0]["rotations"][head]
        assert aside[1] > ahead[1] + 0.05  # to the left
        before, waving = await tell({"type": "look_at"}), await tell(act, 30)
        arms = [hello["bones"].index(f"{side}UpperArm") for side in ("left", "right")]
        turned = np.subtract(*(np.array(one["characters"][0]["rotations"])[arms] for one in (before, waving)))
        assert np.abs(turned).max() > 0.2
        await tell({"type": "act"})
        gone = (await tell(go, 240))["characters"][0]
        np.testing.assert_allclose(np.array(gone["position"])[[0, 2]], go["points"], atol=0.08)
        x, y, z, w = gone["rotation"]
        assert abs(np.degrees(2 * np.arctan2(y, w)) - go["facing"]) < 10

    with_server(scenario)


def test_the_sentence_of_the_page_is_done() -> None:
    (say,) = [message for message in of_a_client() if message["type"] == "say"]

    async def scenario(tell: Tell, hello: Message) -> None:
        # its first part: it walks
        first, second = await tell(say, 15), await tell({"type": "look_at"}, 15)
        assert np.hypot(*going(first, second)) > 0.3

    with_server(scenario)


def test_the_page_names_all_that_a_client_may_say() -> None:
    said: dict[str, set[str]] = {}
    for message in of_a_client():
        said.setdefault(message.pop("type"), set()).update(message)
    assert said == {kind: set(names) for kind, names in KEYS.items()}


def test_the_page_names_all_that_may_happen() -> None:
    (listed,) = re.findall(r'Kinds are (".*?")\.', PAGE.replace("\n", " "))
    assert re.findall(r'"(.*?)"', listed) == list(get_args(Happening))


def test_a_style_of_the_page_is_gone_in() -> None:
    _, velocity, style, *_ = of_a_client()
    assert style == {"type": "control", "style": "sad"}

    async def scenario(tell: Tell, hello: Message) -> None:
        assert hello["styles"][:2] == of_the_server()["hello"]["styles"]
        plain = await tell(velocity)
        sad = await tell(style)
        np.testing.assert_allclose(going(plain, sad), velocity["velocity"], atol=0.3)
        head = hello["bones"].index("head")
        down = [frame["characters"][0]["rotations"][head][0] for frame in (plain, sad)]
        assert down[1] > down[0] + 0.1

    with_server(scenario)


def test_a_note_and_an_error_are_as_the_page_says() -> None:
    async def scenario() -> list[Message]:
        server, said = LiveServer(motet.load("control"), port=0, rate=150), list[Message]()
        async with server, connect(f"ws://127.0.0.1:{server.port}", max_queue=None) as client, asyncio.timeout(20):
            for message in ({"type": "control", "gait": "walk", "speed": 9}, {"type": "control", "gait": "fly"}):
                await client.send(json.dumps(message))
            with suppress(ConnectionClosed):
                while True:
                    said += [one for one in (json.loads(await client.recv()),) if one["type"] not in ("hello", "frame")]
            assert client.close_code == 1008
            assert said[-1]["message"].startswith(client.close_reason or "-")
        return said

    note, error = asyncio.run(scenario())
    assert note.keys() == error.keys() == {"type", "message"}
    assert (note["type"], error["type"]) == ("note", "error")
    assert "fly" in error["message"]


def test_the_clients_in_examples_speak_the_protocol() -> None:
    """What they send is taken, and what they read is there."""
    hello, frame = (of_the_server()[kind] for kind in ("hello", "frame"))
    known = hello.keys() | frame.keys() | frame["characters"][0].keys() | hello["joints"][0].keys() | {"message"}
    sent = {
        "unity/MotetFigure.cs": r'\$"(\{\{.*?\}\})"',
        "godot/motet_figure.gd": r"stringify\((\{.*?\})\)",
    }
    read = {"unity/MotetFigure.cs": r'\["(\w+)"\]', "godot/motet_figure.gd": r"(?:message|hello|joint|figure)\.(\w+)"}
    for name, text in CLIENTS.items():
        (message,) = re.findall(sent[name], text)
        plain = message.replace("{{", "{").replace("}}", "}").replace('\\"', '"')
        kind, given = parsed(re.sub(r"\{-?\w+\}|stick\.\w", "1.5", plain))
        assert (kind, given) == ("control", {"velocity": [1.5, 1.5]})
        found = set(re.findall(read[name], text))
        assert {"position", "rotation", "rotations", "height", "bones", "joints"} <= found <= known
