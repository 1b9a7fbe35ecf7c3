"""What a live page does by itself, with what is typed, clicked, touched, dropped and saved, in Chromium."""

import base64
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from small_character import character, packed

import motet
from motet.draw.body import human_mesh
from motet.figures.humanoid import HUMANOID, T_POSE
from motet.motion.rotations import Array, quat_to_rotmat
from motet.steering.model import SteerModel

TICKS = "(() => {{ for (let n = 0; n < {}; n++) motet.tick(motet.command()); return motet.figures[0].root; }})()"

DROP = """(async () => {{
  const file = new File([Uint8Array.from(atob({content}), (letter) => letter.charCodeAt(0))], {name});
  const data = new DataTransfer(), said = document.querySelector("#reply");
  data.items.add(file);
  said.textContent = "";
  window.dispatchEvent(new DragEvent("drop", {{ dataTransfer: data, cancelable: true }}));
  while (!said.textContent || said.textContent.startsWith("reading")) await new Promise((done) => setTimeout(done, 10));
  return said.textContent;
}})()"""

CAME = "new Promise((done) => setTimeout(() => requestAnimationFrame(done), 800))"
"""Until the camera has come after the figure."""

PIXEL = "R0lGODlhAQABAIAAAAAAAP///ywAAAAAAQABAAACAUwAOw=="
"""A GIF of one pixel."""

SAVED = """(async () => {{
  let saved = null;
  const create = URL.createObjectURL;
  URL.createObjectURL = (blob) => {{ saved = blob; return create(blob); }};
  HTMLAnchorElement.prototype.click = () => {{}};
  document.querySelector("#{}").onclick();
  const bytes = new Uint8Array(await saved.arrayBuffer());
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
}})()"""


WORN = """(() => {
  const pose = motet.figures[0].shown(1), { body, matrices } = motet.scene.looks(pose, 0), [part] = body.primitives;
  const { positions: places, joints, weights } = part, { inverseBind: bind } = body;
  const numbers = { matrices, bind, places, joints, weights };
  const found = Object.fromEntries(Object.entries(numbers).map(([name, values]) => [name, [...values]]));
  return { ...found, turned: pose.turned, at: pose.places };
})()"""
"""The numbers of an avatar and of the pose that it is in."""

COLOURED = """(() => {
  const { colours } = motet.scene.body;
  const { primitives } = motet.scene.looks(motet.figures[0].shown(1), 0).body;
  const same = (one, other) => one.every((x, n) => Math.abs(x / 255 - other[n]) < 1e-3);
  return primitives.filter(({ colour }) => colours.some((own) => same(own, colour))).length;
})()"""
"""How many parts of an avatar have colours of the usual body."""

BUSY = """(() => {
  const said = ["wave", "kick", "bow", "fly to the moon"], places = [];
  for (let n = 0; n < 120; n++) {
    if (n % 3 === 0) motet.obey(said[n / 3 % 4]);
    motet.tick(motet.command());
    places.push(motet.figures[0].shown(1).places);
  }
  return places;
})()"""
"""Places of joints, tick by tick, of a figure that is told something else ten times a second."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, steer_model: SteerModel) -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    folder = tmp_path_factory.mktemp("live")
    motet.write_live_page(folder / "live.html", steer_model)
    with Browser(folder / "profile", 844, 390) as browser:
        browser.open(folder / "live.html", ready="window.motet")
        browser.value("motet.state.pause = true")
        yield browser
        assert browser.errors == []


def typed(page: Browser, text: str) -> str:
    """What is answered to a sentence."""
    page.value(f"document.querySelector('#text').value = {json.dumps(text)}")
    page.value("document.querySelector('#say').requestSubmit()")
    answer: str = page.value("document.querySelector('#reply').textContent")
    return answer


def dropped(page: Browser, name: str, content: bytes) -> str:
    """What is answered to a file."""
    text = base64.b64encode(content).decode()
    answer: str = page.value(DROP.format(content=json.dumps(text), name=json.dumps(name)))
    return answer


def test_it_starts_by_itself_until_somebody_steers(page: Browser) -> None:
    places = np.array([page.value(TICKS.format(30))[:2] for _ in range(30)])
    assert np.ptp(places, axis=0).min() > 2
    assert np.abs(places).max() < 5
    page.key("KeyW", "w", down=True)
    page.value(TICKS.format(1))
    page.key("KeyW", "w", down=False)
    stood = page.value(TICKS.format(60))
    assert np.hypot(*np.subtract(page.value(TICKS.format(30)), stood)[:2]) < 0.2


def test_orders_are_typed(page: Browser) -> None:
    x, z, facing = page.value(TICKS.format(60))
    assert typed(page, "turn left and run") == "run turn left"
    at_x, at_z, turned = page.value(TICKS.format(60))
    assert np.cos(turned - facing - np.pi / 2) > 0.95
    assert np.hypot(at_x - x, at_z - z) > 2.5
    assert typed(page, "stop") == "stop"
    page.value(TICKS.format(90))


def test_acts_are_typed(page: Browser) -> None:
    hands = "motet.figures[0].shown(1).places.map((place) => place[1])"
    lowest = min(HUMANOID.index("leftHand"), HUMANOID.index("rightHand"))
    before = page.value(hands)
    assert typed(page, "kick") == "kick"
    acting = page.value("(motet.tick(motet.command()), motet.figures[0].acting)")
    assert 1 < acting["left"] < 6
    feet = [page.value(f"({TICKS.format(2)}, {hands})")[HUMANOID.index("rightFoot")] for _ in range(60)]
    assert max(feet) > before[lowest] * 0.5
    page.value(TICKS.format(150))
    assert page.value("motet.figures[0].acting") is None
    place = page.value("motet.figures[0].root")
    answer = typed(page, "juggle the moon")
    assert answer.startswith("? 'juggle the moon' is not known. Nearest: ")
    assert page.value("motet.figures[0].acting") is None
    assert np.allclose(place[:2], page.value(TICKS.format(30))[:2], atol=0.1)
    typed(page, "walk")
    assert typed(page, "wave") == "wave"
    page.value(TICKS.format(1))
    assert page.value("motet.pilot !== null && motet.figures[0].acting !== null")  # it waves as it walks
    typed(page, "stop")
    page.value(TICKS.format(200))


def test_what_the_page_offers_to_type_works(page: Browser) -> None:
    typed(page, "stop")
    page.value(TICKS.format(90))
    offered = page.value("[...document.querySelectorAll('#known option')].map((option) => option.value)")
    offered += page.value("document.querySelector('#text').placeholder").split(", ")
    assert len(offered) > 200
    answers = page.value(f"{json.dumps(offered)}.map((text) => motet.words.read(text).steps.length)")
    assert [text for text, steps in zip(offered, answers, strict=True) if not steps] == []


def test_keys_and_orders_break_an_act_off(page: Browser) -> None:
    for start in ("stop", "walk"):
        typed(page, start)
        page.value(TICKS.format(60))
        typed(page, "kick")
        page.value(TICKS.format(20))
        assert page.value("motet.figures[0].acting")
        if start == "stop":
            typed(page, "walk")
        else:
            page.value("document.querySelector('#canvas').focus()")
            page.key("KeyW", "w", down=True)
        place = page.value(TICKS.format(20))
        assert page.value("motet.figures[0].acting") is None
        assert np.hypot(*np.subtract(page.value(TICKS.format(60)), place)[:2]) > 1.0
        page.key("KeyW", "w", down=False)


def test_acts_ten_times_a_second_do_not_leap(page: Browser) -> None:
    typed(page, "stop")
    page.value(TICKS.format(90))
    places = np.array(page.value(BUSY))
    moved = np.linalg.norm(np.diff(places, axis=0), axis=2)
    assert moved.max() < 0.3  # of a hand; in recordings of gaits .47
    assert moved[90:].max(axis=1).min() > 0  # it does not freeze either
    typed(page, "stop")
    page.value(TICKS.format(200))


def test_a_click_sends_it_there_and_a_drag_does_not(page: Browser) -> None:
    page.value(CAME)
    page.mouse("mousePressed", 600, 160)
    page.mouse("mouseMoved", 640, 160)
    page.mouse("mouseReleased", 640, 160)
    assert page.value("motet.pilot?.goal ?? null") is None
    page.value(CAME)
    page.mouse("mousePressed", 600, 160)
    page.mouse("mouseReleased", 600, 160)
    goal = page.value("motet.pilot.goal")
    assert np.hypot(*np.subtract(page.value("motet.figures[0].root")[:2], goal)) > 0.5
    for _ in range(60):
        page.value(TICKS.format(30))
        if page.value("motet.pilot === null"):
            break
    assert np.hypot(*np.subtract(page.value(TICKS.format(60))[:2], goal)) < 0.08


def test_a_phone_held_sideways_has_all_and_does_not_scroll(page: Browser) -> None:
    height, wide, canvas = page.value(
        "[document.documentElement.scrollHeight - innerHeight, document.documentElement.scrollWidth - innerWidth,"
        " document.querySelector('#canvas').clientHeight / innerHeight]"
    )
    assert (height, wide) == (0, 0)
    assert canvas > 0.75
    page.value("document.querySelector('#more').open = true")
    sizes = page.value(
        "[...document.querySelectorAll('button, select, summary, input')].filter((one) => one.offsetParent)"
        ".map((one) => [one.offsetWidth, one.offsetHeight])"
    )
    assert len(sizes) > 15
    assert np.min(sizes) >= 44
    page.value("document.querySelector('#more').open = false")


def test_a_dropped_motion_is_told_and_done(page: Browser, tmp_path: Path) -> None:
    (walk,) = motet.load("generate").generate("a person is walking forward", 1, seconds=3)
    walk.write(tmp_path / "walk.bvh")
    answer = dropped(page, "walk.bvh", (tmp_path / "walk.bvh").read_bytes())
    assert answer.startswith("walk.bvh: a figure of")
    assert "3.0 s at 30 frames a second" in answer
    assert "It goes" in answer
    before = page.value("motet.figures[0].root")
    assert page.value("(motet.tick(motet.command()), motet.figures[0].acting)")["left"] > 1.5
    assert np.hypot(*np.subtract(page.value(TICKS.format(90)), before)[:2]) > 1


def test_an_avatar_has_its_colours_and_pictures(page: Browser, tmp_path: Path) -> None:
    content = character(tmp_path / "small.glb").read_bytes()
    length = int.from_bytes(content[12:16], "little")
    document = json.loads(content[20 : 20 + length])
    material = document["materials"][0]
    material["pbrMetallicRoughness"]["baseColorFactor"] = [0.5, 0.2, 0.0, 1.0]
    material |= {"alphaMode": "MASK", "doubleSided": True}
    document["images"] = [{"uri": f"data:image/gif;base64,{PIXEL}", "mimeType": "image/gif"}]
    assert "small.glb is who moves now" in dropped(page, "small.glb", packed(document, content[28 + length :]))
    found = page.value("""(({ colour, cut, twoSided, image }) => [colour, cut, twoSided, [image.width, image.height]])(
      [...motet.scene.painter.bodies].pop().primitives[0])""")
    linear = np.array([0.5, 0.2, 0.0])
    assert found[0] == pytest.approx([*linear ** (1 / 2.2), 1])
    assert found[1:] == [0.5, True, [1, 1]]


def test_a_dropped_avatar_is_who_moves(page: Browser, tmp_path: Path) -> None:
    (still,) = motet.load("generate").generate("the person holds a quiet upright pose", 1, seconds=1)
    still.write(tmp_path / "someone.glb")  # with a body
    assert "someone.glb is who moves now" in dropped(page, "someone.glb", (tmp_path / "someone.glb").read_bytes())
    page.value(TICKS.format(60))
    looks = "(() => {{ const pose = motet.figures[0].shown(1), drawn = motet.scene.looks(pose, 0); return {}; }})()"
    matrices = np.array(page.value(looks.format("[...drawn.matrices]"))).reshape(-1, 4, 4)
    places = np.array(page.value(looks.format("pose.places")))
    rest = HUMANOID.rest_positions + HUMANOID.offsets[0]
    moved = np.einsum("jba,jb->ja", matrices, np.column_stack([rest, np.ones(len(rest))]))[:, :3]
    np.testing.assert_allclose(moved, places, atol=0.02)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("notes.txt", b"hello", "notes.txt cannot be used: it is neither a motion"),
        ("cut.bvh", b"HIERARCHY\nROOT a\n{\n", "cut.bvh cannot be used: not a BVH file, or cut short"),
        ("dog.bvh", b"HIERARCHY\nROOT dog\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\n"
            b"End Site\n{\nOFFSET 0 1 0\n}\n}\n"
            b"MOTION\nFrames: 3\nFrame Time: 0.1\n" + 3 * b"0 0 0\n", "only human figures move here"),
        ("cut.glb", b"glTF\2\0\0\0\0\0\0\0", "cut.glb cannot be used: cut short"),
        ("no.vrm", json.dumps({"asset": {"version": "2.0"}, "meshes": [{"primitives": []}], "nodes": [{"mesh": 0}],
            "extensions": {"VRMC_vrm": {"humanoid": {"humanBones": {}}}}}).encode(), "this VRM file has no humanoid"),
    ],
)  # fmt: skip
def test_what_is_no_motion_and_no_avatar_is_named(page: Browser, name: str, content: bytes, said: str) -> None:
    place = page.value("motet.figures[0].root")
    assert said in dropped(page, name, content)
    assert page.value("motet.figures[0].root") == place


def saved(page: Browser, kind: str) -> bytes:
    return base64.b64decode(page.value(SAVED.format(kind)))


def worn_and_usual(page: Browser) -> tuple[Array, Array]:
    """Where corners of the avatar are in metres, and those of motet's body in the same pose."""
    found = {name: np.array(values) for name, values in page.value(WORN).items()}
    matrices, bind = (np.swapaxes(found[name].reshape(-1, 4, 4), 1, 2) for name in ("matrices", "bind"))
    rows = np.einsum("vk,vkij->vij", found["weights"].reshape(-1, 4), (matrices @ bind)[found["joints"].reshape(-1, 4)])
    places = np.column_stack([found["places"].reshape(-1, 3), np.ones(len(rows))])
    turns = quat_to_rotmat(found["turned"])
    usual = human_mesh().carried(turns, found["at"] - np.einsum("jab,jb->ja", turns, T_POSE))
    return np.einsum("vij,vj->vi", rows, places)[:, :3], usual


def test_what_was_done_is_saved(page: Browser, tmp_path: Path) -> None:
    typed(page, "walk")
    ended: Any = page.value(TICKS.format(300))
    (tmp_path / "out.vrma").write_bytes(saved(page, "vrma"))
    motion = motet.read(tmp_path / "out.vrma")
    assert len(motion) == 8 * 30
    hips = [motion.values[-1, motion.channels.index(f"hips.t{axis}")] for axis in "xz"]
    np.testing.assert_allclose(hips, ended[:2], atol=0.15)  # hips sway beside the root
    (tmp_path / "out.glb").write_bytes(saved(page, "glb"))
    again = motet.read(tmp_path / "out.glb")
    assert again.channels == motion.channels
    np.testing.assert_allclose(again.values, motion.values, atol=1e-6)
    assert "out.glb is who moves now" in dropped(page, "out.glb", (tmp_path / "out.glb").read_bytes())
    np.testing.assert_allclose(*worn_and_usual(page), atol=2e-3)
    assert page.value(COLOURED) == 3
    image = pytest.importorskip("PIL.Image", reason="the extra plot is not installed")
    page.value("motet.scene.painter.quality = 5")  # as on a slow machine
    page.value("motet.state.pause = false")
    page.value(CAME)
    page.value("motet.state.pause = true")
    with image.open(io.BytesIO(saved(page, "gif"))) as picture:
        assert (picture.size, picture.n_frames, picture.info["duration"]) == ((320, 320), 80, 100)
        for at in (0, 79):
            picture.seek(at)
            assert np.ptp(np.asarray(picture.convert("L"))[100:220, 100:220]) > 60  # somebody is in it


def test_steps_are_done_in_turn_and_sides_are_kept(page: Browser) -> None:
    typed(page, "stop")
    page.value(TICKS.format(90))
    assert typed(page, "walk, then stop, then wave with your left hand") == "walk, then stop, then wave (left)"
    x, z, _ = page.value("motet.figures[0].root")
    at_x, at_z, _ = page.value(TICKS.format(100))
    assert np.hypot(at_x - x, at_z - z) > 2
    place = "motet.figures[0].shown(1).places"
    hands = [HUMANOID.index(f"{side}Hand") for side in ("left", "right")]
    heights = [page.value(f"({TICKS.format(4)}, {place}.map((at) => at[1]))") for _ in range(30)]
    left, right = np.array(heights)[:, hands].max(axis=0)
    assert left > 1.4 > right
    assert page.value("motet.saying") is None
    typed(page, "walk in a circle")
    roots = np.array([page.value(TICKS.format(10)) for _ in range(24)])
    assert np.ptp(np.unwrap(roots[6:, 2])) > 4
    assert np.ptp(roots[6:, :2], axis=0).max() < 5
    typed(page, "stop")
    page.value(TICKS.format(90))


def test_it_comes_towards_the_camera(page: Browser) -> None:
    x, z, _ = page.value(TICKS.format(1))
    yaw = np.radians(page.value("motet.view.yaw"))
    assert typed(page, "come here") == "come here"
    at_x, at_z, facing = page.value(TICKS.format(200))
    assert (at_x - x) * np.sin(yaw) + (at_z - z) * np.cos(yaw) == pytest.approx(2.5, abs=0.15)
    assert np.cos(facing - yaw) > 0.9
    assert page.value("motet.pilot") is None
