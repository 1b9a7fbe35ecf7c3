"""Answers over HTTP are those of the command line, and what cannot be answered says why."""

import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run

import motet
from motet.errors import quoted
from motet.motion.kinematics import positions
from motet.motion.rotations import quat_to_rotmat

pytest.importorskip("starlette", reason="the extra serve is not installed")
pytest.importorskip("httpx2", reason="Starlette's test client needs it")
from starlette.applications import Starlette
from starlette.testclient import TestClient

from motet.serve.application import app
from motet.serve.content import MEDIA
from motet.serve.limits import Limits
from motet.serve.routes import DOORS

ORIGIN = "https://pages.example"
SKELETONS = Path(__file__).parent / "skeletons"


@pytest.fixture(scope="module")
def application() -> Starlette:
    return app(origins=[ORIGIN], limits=Limits(motion_seconds=40, body_bytes=1 << 22))


@pytest.fixture(scope="module")
def client(application: Starlette) -> Iterator[TestClient]:
    with TestClient(application, raise_server_exceptions=False) as found:
        yield found


@pytest.fixture(scope="module")
def walk(clips: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("walk") / "walk.bvh"
    motet.write(path, motet.read(clips / "39_14.amc"))
    return path


def commanded(out: Path, *words: object) -> bytes:
    """What a command writes to a file."""
    result = run(*words, "-o", out)
    assert result.exit_code == 0, result.stderr
    return out.read_bytes()


@pytest.mark.parametrize(
    ("form", "asked", "words"),
    [
        ("bvh", {"text": "a person walks"}, ["a person walks"]),
        ("bvh", {"text": "a person jumps", "seed": 5, "seconds": 2}, ["a person jumps", "--seed", 5, "--seconds", 2]),
        ("vrma", {"text": "someone waves", "temperature": 0.5, "top_p": 0.9, "max_seconds": 3},
         ["someone waves", "--temperature", 0.5, "--top-p", 0.9, "--max-seconds", 3]),
        ("glb", {"text": "he runs", "like": "mixamo", "fps": 60, "in_place": True},
         ["he runs", "--like", "mixamo", "--fps", 60, "--in-place"]),
        ("bvh", {"text": "a person walks and then jumps", "max_seconds": 3},
         ["a person walks and then jumps", "--max-seconds", 3]),
        ("npz", {"text": "a person walks", "loop": True, "no_plant": True}, ["a person walks", "--loop", "--no-plant"]),
        ("csv", {"text": ["a person walks", "a person sits"], "story": True, "stand": "end", "max_seconds": 4},
         ["a person walks", "a person sits", "--story", "--stand", "end", "--max-seconds", 4]),
    ],
)  # fmt: skip
def test_generate_gives_what_the_command_writes(
    client: TestClient, tmp_path: Path, form: str, asked: dict[str, Any], words: list[Any]
) -> None:
    wanted = commanded(tmp_path / f"motion.{form}", "generate", *words)
    by_address = client.get(f"/generate.{form}", params=asked)
    by_json = client.post(f"/generate.{form}", json=asked)
    by_form = client.post(f"/generate.{form}", data=asked)
    assert [answer.content == wanted for answer in (by_address, by_json, by_form)] == [True, True, True]
    assert by_json.headers["content-type"] == MEDIA[form]


def test_files_that_come_along(client: TestClient, tmp_path: Path, walk: Path) -> None:
    avatar = tmp_path / "avatar.glb"
    motet.write(avatar, motet.read(SKELETONS / "mixamo.bvh", unit="cm"))
    for name, extension in (("onto", "glb"), ("like", "bvh"), ("after", "bvh")):
        given = walk if name == "after" else avatar
        words = ["a person waves", "--seconds", 1, f"--{name}", given]
        wanted = commanded(tmp_path / f"motion.{extension}", "generate", *words)
        with given.open("rb") as file:
            told = {"text": "a person waves", "seconds": 1}
            answer = client.post(f"/generate.{extension}", data=told, files={name: file})
        assert (name, answer.content == wanted) == (name, True)


def test_json_holds_the_motion(client: TestClient) -> None:
    said = client.get("/generate.json", params={"text": "a person walks", "seconds": 1}).json()
    own = motet.load("generate").generate("a person walks", seconds=1)[0].motion
    local = quat_to_rotmat(np.array(said["rotations"]))
    turns, places = local.copy(), np.array([[joint["offset"] for joint in said["joints"]]] * len(local))
    for name, moved in said["translations"].items():
        places[:, [joint["name"] for joint in said["joints"]].index(name)] = moved
    for i, joint in enumerate(said["joints"]):
        if (above := joint["parent"]) >= 0:
            places[:, i] = places[:, above] + np.einsum("tij,tj->ti", turns[:, above], places[:, i])
            turns[:, i] = turns[:, above] @ turns[:, i]
    assert np.abs(places - positions(own)).max() < 1e-4
    assert (said["fps"], said["seconds"]) == (own.fps, own.duration)


def test_how_a_sentence_was_understood(client: TestClient) -> None:
    model, text = motet.load("generate"), "a person solves riddles on a unicycle é"
    found = model.understood(text)
    answer = client.get("/generate.json", params={"text": text, "seconds": 1})
    (own,) = answer.json()["understood"]
    assert own == json.loads(answer.headers["motet-understood"])[0]
    assert own == {
        "text": text,
        "confidence": found.confidence,
        "nearest": list(found.nearest),
        "confident": found.confident,
        "action": found.nearest[0],
        "lacking": ["solved"],
    }
    assert not found.confident
    with pytest.raises(motet.TextError) as refused:
        model.generate(text, strict=True)
    answer = client.get("/generate.bvh", params={"text": text, "strict": "on"})
    assert (answer.status_code, answer.json()) == (400, {"error": str(refused.value), "type": "TextError"})


def test_describe_says_what_the_command_says(client: TestClient, walk: Path) -> None:
    wanted = json.loads(run("describe", "--json", "--beams", 3, walk).stdout)
    timeline = json.loads(run("describe", "--json", "--timeline", walk).stdout)
    with walk.open("rb") as file:
        by_form = client.post("/describe", data={"beams": 3}, files={"file": file}).json()
    by_body = client.post("/describe", params={"beams": 3, "format": "bvh"}, content=walk.read_bytes()).json()
    parts = client.post("/describe", params={"timeline": 1, "format": "bvh"}, content=walk.read_bytes()).json()

    def named(rows: list[dict[str, Any]], name: str) -> list[dict[str, Any]]:
        return [{**row, "input": name} for row in rows]

    assert by_form == named(wanted, "walk.bvh")
    assert by_body == named(wanted, "file.bvh")
    assert parts == named(timeline, "file.bvh")
    assert len(parts) > 0


def test_predict_gives_what_the_command_writes(client: TestClient, tmp_path: Path, walk: Path) -> None:
    for words, asked in (([], {}), (["--seconds", 3, "--append", "--seed", 4], {"seconds": 3, "append": 1, "seed": 4})):
        wanted = commanded(tmp_path / "next.bvh", "predict", walk, *words)
        with walk.open("rb") as file:
            assert client.post("/predict.bvh", data=asked, files={"file": file}).content == wanted


def test_a_stream_gives_frames_as_they_are_drawn(client: TestClient) -> None:
    texts = ["a person walks", "a person jumps"]
    first, *lines = map(json.loads, client.get("/stream", params={"text": texts, "seconds": 2}).iter_lines())
    pieces = list(motet.load("generate").stream(texts, seconds=2))
    assert [one["name"] for one in first["joints"]] == list(pieces[0].skeleton.names)
    assert [len(line["rotations"]) for line in lines] == list(map(len, pieces))
    hips = np.concatenate([line["translations"]["hips"] for line in lines])
    assert np.abs(hips - np.concatenate([positions(piece)[:, 0] for piece in pieces])).max() < 1e-5


@pytest.mark.parametrize(
    ("method", "address", "given", "status", "said"),
    [
        ("GET", "/generate.bvh", {}, 400, "text: is missing"),
        ("GET", "/generate.bvh", {"params": {"text": ""}}, 400, "has no words"),
        ("GET", "/generate.bvh", {"params": {"txt": "a"}}, 400, "did you mean 'text'?"),
        ("GET", "/generate.bvh", {"params": {"text": ["a man runs", "he stops"]}}, 400, "with story=true"),
        ("GET", "/generate.bvh", {"params": {"text": "he runs", "seed": "x"}}, 400, "seed: expected a whole number"),
        ("GET", "/generate.bvh", {"params": {"text": "he runs", "seed": "-1"}}, 400, "expected a seed of 0 or more"),
        ("GET", "/generate.bvh", {"params": {"text": "he runs", "fps": "nan"}}, 400, "fps: expected a number"),
        ("GET", "/generate.bvh", {"params": {"text": "he runs", "fps": "1e6"}}, 400, "at most 240"),
        ("GET", "/generate.bvh", {"params": {"text": "he runs", "seconds": "41"}}, 400, "at most 40 s"),
        ("GET", "/generate.bvh", {"params": {"text": "he runs", "seconds": "0"}}, 400, "seconds must be more than 0"),
        ("GET", "/generate.bvh", {"params": {"text": "he runs", "like": "/etc/passwd"}}, 400, "like: expected one of"),
        ("GET", "/generate.bvh", {"params": {"text": "he " * 400}}, 400, "text: expected a text or a list"),
        ("GET", "/generate.vrm", {"params": {"text": "he runs"}}, 400, "give the file of one as 'onto'"),
        ("GET", "/generate.exe", {"params": {"text": "he runs"}}, 404, "there is no format 'exe'"),
        ("GET", "/stream", {"params": {"text": "xyzzy"}}, 400, "knows no word of 'xyzzy'"),
        ("POST", "/generate.bvh", {"content": b"["}, 400, "the body must be JSON"),
        ("POST", "/generate.bvh", {"content": b"[" * 5000}, 400, "the body must be JSON"),
        ("POST", "/generate.bvh", {"content": b"[1]"}, 400, "must be a JSON object"),
        ("POST", "/generate.bvh", {"content": b'{"text": "he runs", "seconds": NaN}'}, 400, "NaN is no number"),
        ("POST", "/generate.bvh", {"content": b'{"text": "\\ud800"}'}, 400, "text: expected a text"),
        ("POST", "/generate.bvh", {"content": b'{"text": {"a": 1}}'}, 400, "text: expected a text"),
        ("POST", "/generate.bvh", {"content": b'{"text": []}'}, 400, "text: expected a text"),
        ("POST", "/generate.bvh", {"content": b'{"text": "a", "strict": 1}'}, 400, "strict: expected true or false"),
        ("POST", "/generate.bvh", {"content": b'{"text": "a", "seed": 1.5}'}, 400, "seed: expected a whole number"),
        ("POST", "/generate.bvh", {"content": b" " * 70_000 + b"{}"}, 413, "the JSON is too large"),
        ("POST", "/generate.bvh", {"content": b"{}", "headers": {"content-length": "9" * 18}}, 413, "at most"),
        ("POST", "/describe", {}, 400, "there is no file"),
        ("POST", "/describe", {"content": b"x"}, 400, "cannot read files of type ''"),
        ("POST", "/describe?format=amc", {"content": b"x"}, 400, "format: expected one of bvh"),
        ("POST", "/describe?format=bvh", {"content": b"x"}, 400, "file.bvh"),
        ("POST", "/describe?format=npz", {"content": b"PK\3\4"}, 400, "file.npz"),
        ("POST", "/describe", {"files": {"files": b"x"}}, 400, "'files' is no file that is asked for"),
        ("POST", "/predict.bvh", {"files": {"file": b"x" * (5 << 20)}}, 413, "expected at most 4194304 bytes"),
        ("GET", "/describe", {}, 405, "Method Not Allowed"),
        ("GET", "/none", {}, 404, "Not Found"),
    ],
)  # fmt: skip
def test_refusals(client: TestClient, method: str, address: str, given: Any, status: int, said: str) -> None:
    answer = client.request(method, address, **given)
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/json")
    assert said in answer.json()["error"]


def test_no_file_of_the_machine_is_read(client: TestClient, tmp_path: Path) -> None:
    secret = tmp_path / "secret.bin"
    secret.write_bytes(b"top secret" * 100)
    motet.write(tmp_path / "own.glb", motet.read(SKELETONS / "mixamo.bvh", unit="cm"))
    for uri in (secret.as_uri(), str(secret), "secret.bin", "../" * 20 + str(secret)[1:]):
        document = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": 1000, "uri": uri}], "nodes": [{}]}
        content = json.dumps(document).encode()
        for name in (f"{tmp_path}/a.gltf", "a.gltf", f"..\\{tmp_path}\\a.gltf", str(secret), f"{tmp_path}/own.glb#x"):
            for field, address in (("file", "/describe"), ("onto", "/generate.glb"), ("after", "/generate.bvh")):
                told = {} if field == "file" else {"text": "he runs"}
                answer = client.post(address, data=told, files={field: (name, content)})
                assert answer.status_code == 400, (name, uri, field)
                error = answer.json()["error"].replace(quoted(uri), "")  # errors quote the beginning of a long one
                assert "secret" not in error.replace("secret.bin: ", "")
                assert str(tmp_path) not in error


def test_an_error_that_quotes_what_is_no_character_is_sent(client: TestClient) -> None:
    document = {"asset": {"version": "2.0"}, "nodes": [{}], "skins": [{"joints": ["\ud800"]}]}
    answer = client.post("/describe", files={"file": ("a.gltf", json.dumps(document).encode())})
    assert (answer.status_code, answer.json()["type"]) == (400, "FormatError")
    assert "\\ud800" in answer.json()["error"]


def test_no_answer_shows_a_traceback(client: TestClient, walk: Path) -> None:
    """Mutated files and settings: 200 or a sentence."""
    draw, content = random.Random(0), walk.read_bytes()[:20_000]
    junk = ["", "0", "-1", "1e400", "9" * 400, "\0", "a\ud7ff", "../../x", "true", "[]", "%00", "é" * 50]
    for _ in range(150):
        door = draw.choice(DOORS)
        asked = {name: draw.choice(junk) for name in draw.sample([*door.parameters], 2)}
        place, files = draw.randrange(len(content)), {}
        if "file" in door.files:
            broken = content[:place] + draw.randbytes(draw.randrange(9)) + content[place + draw.randrange(9) :]
            files = {"file": (draw.choice(["a.bvh", "a.glb", "a.npz", "a.xml", "a.vrma", "a", "\0"]), broken)}
        form = draw.choice([*MEDIA])
        answer = client.post(door.path.format(format=form), data=asked, files=files)
        assert answer.status_code in (200, 400), (door.path, asked, answer.text)
        assert answer.status_code == 200 or answer.json()["error"]
        assert b"Traceback" not in answer.content


def test_pages_and_openapi(client: TestClient) -> None:
    document, health = client.get("/openapi.json").json(), client.get("/health").json()
    assert document["info"]["version"] == health["version"] == motet.__version__
    assert health["status"] == "ok"
    manual = client.get("/docs").text
    for door in DOORS:
        known = {one["name"] for one in document["paths"][door.path]["post"]["parameters"]}
        assert {*door.parameters} <= known
        assert all(f"<code>{name}</code>" in manual for name in (*door.parameters, *door.files))
    for page in ("/", "/docs"):
        answer = client.get(page)
        assert "://" not in answer.text, "a page needs no other address"
        assert "{{" not in answer.text
        assert "default-src 'none'" in answer.headers["content-security-policy"]


@pytest.mark.parametrize(("verb", "more"), [("generate", {"text"}), ("describe", {"format"}), ("predict", {"format"})])
def test_settings_are_named_as_on_the_command_line(verb: str, more: set[str]) -> None:
    shown = run(verb, "--help").stdout
    (door,) = [door for door in DOORS if door.name == verb]
    names = {*door.parameters, *door.files} - more - {"file"}
    assert [name for name in sorted(names) if f"--{name.replace('_', '-')} " not in shown] == []


def test_pages_of_other_origins(client: TestClient) -> None:
    allowed = client.get("/health", headers={"origin": ORIGIN}).headers
    assert (allowed["access-control-allow-origin"], allowed["access-control-expose-headers"]) == (
        ORIGIN,
        "Motet-Understood",
    )
    assert (
        "access-control-allow-origin" not in client.get("/health", headers={"origin": "https://else.example"}).headers
    )
