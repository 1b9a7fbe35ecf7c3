import json
import re
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from figures import walker
from test_retarget import SKELETONS

from motet.draw import page as html
from motet.draw.figure import Body, figure_of
from motet.draw.skinned import person
from motet.errors import MotionError
from motet.figures.humanoid import HUMANOID, to_humanoid
from motet.formats import read_motion, write_motion
from motet.motion.kinematics import global_transforms, positions
from motet.motion.motion import Motion
from motet.motion.rotations import product, quat_to_rotmat, rotated
from motet.motion.skeleton import Joint, Skeleton


def person_moving():
    """A motion of a person on another skeleton than the humanoid."""
    return read_motion(SKELETONS / "mixamo.bvh")


def data_of(path):
    text = path.read_text(encoding="utf-8")
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)[1])


def array_of(text, kind, *shape):
    return np.frombuffer(b64decode(text), kind).reshape(*shape)


def frames_of(figure):
    """What a page does with a figure's data: rotations and places of its joints in the world."""
    frames, joints = figure["frames"], len(figure["parents"])
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (frames, joints, 1))
    turns[:, figure["turning"]] = array_of(figure["turns"], "<i2", frames, len(figure["turning"]), 4) / 32767
    places = np.tile(np.array(figure["offsets"]), (frames, 1, 1))
    moved = array_of(figure["moves"], "<i2", frames, len(figure["moving"]), 3)
    places[:, figure["moving"]] = moved * figure["step"]
    places[:, 0] = array_of(figure["root"], "<f4", frames, 3)
    turned = quat_to_rotmat(turns / np.linalg.norm(turns, axis=-1, keepdims=True))
    for joint, parent in list(enumerate(figure["parents"]))[1:]:
        places[:, joint] = places[:, parent] + rotated(turned[:, parent], places[:, joint])
        turned[:, joint] = product(turned[:, parent], turned[:, joint])
    return turned, places


def expected(motion):
    return positions(motion) / motion.skeleton.height


@pytest.mark.parametrize("scale", [1.0, 39.37])
def test_page_holds_the_joints_of_no_person_in_heights(tmp_path, scale):
    motion = walker(scale=scale)
    write_motion(tmp_path / "walk.html", motion)
    data = data_of(tmp_path / "walk.html")
    (figure,), (body,) = data["figures"], data["bodies"]
    assert (figure["fps"], figure["frames"], figure["moving"]) == (40.0, 40, [])
    turned, places = frames_of(figure)
    assert np.abs(places - expected(motion)).max() < 3e-4
    assert np.abs(turned - global_transforms(motion)[0]).max() < 3e-4
    assert "coarse" not in body


def test_page_holds_a_person_on_the_humanoid(tmp_path):
    motion = to_humanoid(person_moving()).motion
    write_motion(tmp_path / "walk.html", motion)
    data = data_of(tmp_path / "walk.html")
    turned, places = frames_of(data["figures"][0])
    assert np.abs(places - positions(motion) / Body(HUMANOID).height).max() < 3e-4
    assert np.abs(turned - global_transforms(motion)[0]).max() < 3e-4
    assert data["figures"][0]["scales"] == np.ones((27, 3)).tolist()
    corners = array_of(data["bodies"][0]["places"], "<i2", -1, 3) * data["bodies"][0]["step"]
    assert np.abs(corners - person().places).max() < 2e-5
    sizes, mesh = [], data["bodies"][0]
    while mesh:
        sizes.append(len(mesh["triangles"]))
        mesh = mesh.get("coarse")
    assert sizes == sorted(sizes, reverse=True)
    assert len(sizes) == 3


def test_page_needs_no_other_file(tmp_path):
    html.write(tmp_path / "walk.html", walker(), title='a <b> & "c" {{DATA}} </script>')
    text = (tmp_path / "walk.html").read_text(encoding="utf-8")
    assert not re.search(r"https?:|//[a-z]+\.|@import|url\(|\ssrc=", text)
    assert "<title>a &lt;b&gt; &amp; &quot;c&quot; {{DATA}} &lt;/script&gt;</title>" in text
    assert text.count("</script>") == 2
    assert "made with motet" in text


def test_a_minute_is_small(tmp_path):
    html.write(tmp_path / "long.html", walker(frames=2400))
    assert (tmp_path / "long.html").stat().st_size < 400_000


def test_joint_that_moves_far_takes_a_larger_step(tmp_path):
    skeleton = Skeleton((Joint("root", -1, (0, 0, 0)), Joint("a", 0, (0, 1, 0)), Joint("kite", 1, (0, 1, 0))))
    motion = Motion([[0.0, 30.0], [0.0, -40.0]], ("root.ty", "kite.ty"), ("length", "length"), 10, skeleton)
    html.write(tmp_path / "kite.html", motion)
    (figure,) = data_of(tmp_path / "kite.html")["figures"]
    assert figure["step"] == pytest.approx(20 / 32767, rel=1e-3)
    lifted = expected(motion) + np.array([0, 19.5, 0])
    assert np.abs(frames_of(figure)[1] - lifted).max() < 0.6 * figure["step"]


def test_captions_and_many(tmp_path):
    html.write(tmp_path / "one.html", walker(), [(0, "walk"), (0.5, "walk > run 40 %")], "title")
    assert data_of(tmp_path / "one.html")["figures"][0]["captions"] == [[0, "walk"], [0.5, "walk > run 40 %"]]
    html.write_many(tmp_path / "two.html", [walker(), walker(20, 10)], ["first", "</script>"])
    data = data_of(tmp_path / "two.html")
    assert [(f["name"], f["frames"], f["fps"], f["body"]) for f in data["figures"]] == [
        ("first", 40, 40, 0),
        ("</script>", 20, 10, 1),
    ]
    html.write_many(tmp_path / "people.html", [person_moving(), to_humanoid(person_moving()).motion], ["one", "other"])
    data = data_of(tmp_path / "people.html")
    assert [figure["body"] for figure in data["figures"]] == [0, 0]
    assert len(data["bodies"]) == 1
    html.write_many(tmp_path / "bare.html", [person_moving(), person_moving()], ["bones", "body"], bare=["bones"])
    assert ["coarse" in body for body in data_of(tmp_path / "bare.html")["bodies"]] == [False, True]
    with pytest.raises(MotionError, match="must not decrease"):
        html.write(tmp_path / "bad.html", walker(), [(1.0, "b"), (0.0, "a")])
    with pytest.raises(MotionError, match="must not decrease"):
        html.write(tmp_path / "bad.html", walker(), [(float("nan"), "b")])
    with pytest.raises(MotionError, match="a name for each"):
        html.write_many(tmp_path / "bad.html", [walker()], [])
    assert not (tmp_path / "bad.html").exists()


def test_what_is_too_far_to_show_is_refused(tmp_path):
    with pytest.raises(MotionError, match="too far to show"):
        html.write(tmp_path / "bad.html", replace(walker(), values=walker().values + 1e200))
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_the_page_plays_in_a_browser(tmp_path):
    html.write_many(tmp_path / "walk.html", [person_moving(), walker()], ["a person", "none"])
    with Browser(tmp_path / "profile") as page:
        page.open(tmp_path / "walk.html", ready="typeof state === 'object' && state.time > 0.1")
        page.key(" ", " ", down=True)
        page.value("setTheme(true)")
        yaw, at = page.value("[view.yaw, state.time]")
        page.key("KeyD", "d", down=True)
        assert page.value("[view.yaw, state.time]") == [yaw + 5, at]
        assert min(page.coloured()) > 200
        page.value(LOSE)  # as browsers do when the graphics card is needed elsewhere
        assert page.value("stage.begin().width") == 0
        page.value(REGAIN)
        assert min(page.coloured()) > 200
        assert page.errors == []


LOSE = """new Promise((done) => {
  stage.canvas.addEventListener("webglcontextlost", () => done(), { once: true });
  window.extension = stage.gl.getExtension("WEBGL_lose_context");
  extension.loseContext();
})"""
REGAIN = """new Promise((done) => {
  stage.canvas.addEventListener("webglcontextrestored", () => done(), { once: true });
  extension.restoreContext();
})"""


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_a_browser_without_webgl_says_so(tmp_path):
    html.write(tmp_path / "walk.html", walker())
    text = (tmp_path / "walk.html").read_text(encoding="utf-8")
    stand_in = "<script>HTMLCanvasElement.prototype.getContext = () => null;</script><script type"
    (tmp_path / "walk.html").write_text(text.replace("<script type", stand_in, 1), encoding="utf-8")
    with Browser(tmp_path / "profile") as page:
        page.open(tmp_path / "walk.html", ready="typeof state === 'object' && state.time > 0.1")
        assert "no WebGL 2" in page.value("document.querySelector('[role=alert]').textContent")
        assert page.errors == []


def test_ground():
    near = walker()
    assert figure_of(near).points[:, :14] == pytest.approx(expected(near))
    values = np.array(near.values)
    values[:, 1] += 5
    assert figure_of(replace(near, values=values)).points[..., 1].min() == pytest.approx(0)
    still = near.select(near.channels[3:])
    assert figure_of(still).points[:, :14, 1].min() == pytest.approx(0)


def test_a_joint_that_stays_above_the_hips_is_not_drawn():
    motion = walker()
    below = [replace(joint, parent=joint.parent + 1) for joint in motion.skeleton.joints]
    joints = (Joint("joint_Root", -1, (0, 0, 0)), *below)
    deeper = replace(motion, skeleton=Skeleton(joints, motion.skeleton.metres_per_unit))
    one, other = figure_of(motion), figure_of(deeper)
    np.testing.assert_allclose(other.points, one.points, atol=1e-12)
    assert (other.body.bones, other.heading) == (one.body.bones, one.heading)


def test_heading_is_where_the_figure_faces():
    motion = walker(frames=1)
    values = np.zeros((1, len(motion.channels)))
    assert figure_of(replace(motion, values=values)).heading == pytest.approx(0)
    values[0, motion.channels.index("hips.ry")] = 90
    assert figure_of(replace(motion, values=values)).heading == pytest.approx(np.pi / 2)


def test_body_gets_thinner_towards_its_tips():
    body = Body(walker().skeleton)
    names = (*body.skeleton.names, "jaw", "crown")
    bones = {(names[bone.start], names[bone.end]): bone for bone in body.bones}
    assert ("head", "head_end") not in bones
    assert {bones[pair].side for pair in [("hips", "left_leg"), ("left_arm", "hips"), ("jaw", "crown")]} == {"middle"}
    thigh, shin = bones["left_leg", "left_shin"], bones["left_shin", "left_shin_end"]
    assert thigh.start_radius > thigh.end_radius == shin.start_radius > shin.end_radius > 0
    assert (thigh.side, bones["right_shin", "right_shin_end"].side) == ("left", "right")


def test_skeleton_without_extent_is_a_dot(tmp_path):
    point = Motion([[0.0], [1.0]], ("a.tx",), ("length",), 10, Skeleton((Joint("a", -1, (0, 0, 0)),)))
    html.write(tmp_path / "dot.html", point)
    data = data_of(tmp_path / "dot.html")
    assert len(data["figures"][0]["parents"]) == 1
    corners = array_of(data["bodies"][0]["places"], "<i2", -1, 3) * data["bodies"][0]["step"]
    assert np.linalg.norm(corners, axis=1).max() == pytest.approx(0.07, abs=0.01)


def test_shoulders_of_a_motion_capture_skeleton_belong_to_the_trunk():
    places = {"root": -1, "thorax": 0, "neck": 1, "lclavicle": 1, "lhumerus": 3, "lhumerus_end": 4, "rclavicle": 1}
    offsets = [(0, 0, 0), (0, 0.2, 0), (0, 0.2, 0), (0, 0.2, 0), (0.2, 0, 0), (0.5, 0, 0), (0, 0.2, 0)]
    joints = [Joint(name, parent, offset) for (name, parent), offset in zip(places.items(), offsets, strict=True)]
    more = [Joint("rhumerus", 6, (-0.2, 0, 0)), Joint("rhumerus_end", 7, (-0.5, 0, 0))]
    bones = [(bone.start, bone.end, bone.side) for bone in Body(Skeleton((*joints, *more))).bones[:-1]]
    left = [(3, 4, "middle"), (4, 0, "middle"), (4, 5, "left")]
    right = [(6, 7, "middle"), (7, 0, "middle"), (7, 8, "right")]
    assert bones == [(0, 1, "middle"), (1, 2, "middle"), *left, *right]


def test_a_figure_whose_rest_pose_is_no_body_is_as_high_as_it_stands():
    for name in ("lafan1", "mixamo"):
        motion = read_motion(SKELETONS / f"{name}.bvh")
        stands = np.ptp(positions(motion)[0, :, 1])  # the first frame is a T-pose
        assert Body(motion.skeleton).height == pytest.approx(stands, rel=0.2)
    assert Body(walker().skeleton).height == walker().skeleton.height
    arm = Skeleton((Joint("root", -1, (0, 0, 0)), Joint("arm", 0, (0, 3, 0)), Joint("arm_end", 1, (0, 2, 0))))
    assert Body(arm).height == 5
    assert Body(Skeleton((Joint("root", -1, (5, 0, 0)),))).height == 1
