from collections import Counter

import numpy as np
import pytest
from figures import walker
from test_retarget import SKELETONS

from motet.draw.body import BODY, LEFT_PART, RIGHT_PART, human_mesh
from motet.draw.figure import Body, figure_of
from motet.draw.mesh import loft, normals_of, ring, smooth_weights, smoothed
from motet.draw.skinned import person, skinned
from motet.figures.humanoid import HUMANOID, T_POSE, to_humanoid
from motet.formats import read_motion
from motet.motion.kinematics import positions


def edges_of(triangles):
    return Counter((one, other) for a, b, c in triangles.tolist() for one, other in ((a, b), (b, c), (c, a)))


def volume(places, triangles):
    a, b, c = places[triangles.T]
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def turned_about_z(degrees):
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])


def bent(mesh, bends):
    """Corners of the body in its T-pose but for some joints, each turned in its parent."""
    turns, places = np.tile(np.eye(3), (len(T_POSE), 1, 1)), T_POSE.copy()
    for at, joint in enumerate(HUMANOID.joints):
        if joint.parent >= 0:
            turns[at] = turns[joint.parent] @ bends.get(joint.name, np.eye(3))
            places[at] = places[joint.parent] + turns[joint.parent] @ (T_POSE[at] - T_POSE[joint.parent])
    return mesh.carried(turns, places - np.einsum("jab,jb->ja", turns, T_POSE))


@pytest.mark.parametrize(("level", "most"), [(0, 5200), (1, 1300), (2, 300)])
def test_the_body_is_closed_and_carried_whole(level, most):
    mesh = human_mesh(level)
    assert 0.9 * most < len(mesh.triangles) <= most
    edges = edges_of(mesh.triangles)
    assert all(count == 1 and edges[b, a] == 1 for (a, b), count in edges.items())
    assert set(mesh.triangles.reshape(-1).tolist()) == set(range(len(mesh.places)))
    assert mesh.weights.min() >= 0
    np.testing.assert_allclose(mesh.weights.sum(axis=1), 1)
    assert mesh.joints.max() < len(HUMANOID.joints)
    assert set(mesh.parts.tolist()) == {BODY, LEFT_PART, RIGHT_PART}
    assert mesh.shares.min() >= 0
    assert (mesh.shares.sum(axis=1) == 255).all()
    np.testing.assert_allclose(mesh.shares / 255, mesh.weights, atol=0.005)
    assert volume(mesh.places, mesh.triangles) == pytest.approx(0.065, abs=0.016)  # cubic metres, as a slim adult
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1)


def test_the_body_stands_on_the_ground_around_its_joints():
    places = human_mesh().places
    low, high = places.min(axis=0), places.max(axis=0)
    assert low == pytest.approx([-0.87, 0, -0.12], abs=0.015)
    assert high == pytest.approx([0.87, 1.75, 0.21], abs=0.015)
    np.testing.assert_allclose(np.sort(places[:, 0]), np.sort(-places[:, 0]), atol=1e-12)  # both sides are alike


@pytest.mark.parametrize("slope", [0, 20, 40])
def test_shoulders_go_on_from_the_neck(slope):
    """From the front the outline falls from neck to arm without a notch or a cliff, also if collar bones slope."""
    mesh = human_mesh()
    corners = bent(mesh, {"leftShoulder": turned_about_z(-slope), "leftUpperArm": turned_about_z(slope - 80)})
    left = [HUMANOID.index(name) for name in ("upperChest", "neck", "leftShoulder", "leftUpperArm")]
    is_left = (mesh.weights * np.isin(mesh.joints, left)).sum(axis=1) > 0.5
    own = mesh.triangles[is_left[mesh.triangles].all(axis=1)]
    shares = np.array([(a, b, 8 - a - b) for a in range(9) for b in range(9 - a)]) / 8
    x, height, _ = np.einsum("pk,tki->itp", shares, corners[own]).reshape(3, -1)
    outline = [height[(x > at) & (x < at + 0.01)].max() for at in np.arange(0.07, 0.2, 0.01)]
    assert np.diff(outline).max() < 0.006
    assert np.diff(outline).min() > -0.03


def test_a_loft_of_a_square_is_a_box():
    flat = ring(4)
    rings = np.array([[[x, y, height] for x, y in flat] for height in (0.0, 3.0)])
    places, triangles = loft(rings)
    assert volume(places, triangles) == pytest.approx(2 * 3)
    assert len(triangles) == 12
    assert np.sign(normals_of(places, triangles)[:, 2]).tolist() == [-1] * 4 + [1] * 4


def test_ring_is_on_its_superellipse():
    for power in (2.0, 2.5):
        assert (np.abs(ring(12, power)) ** power).sum(axis=1) == pytest.approx(np.ones(12))


def test_rings_between_rings_follow_a_cubic():
    at = np.arange(7.0)
    between = smoothed((at**3 - 4 * at**2)[:, None, None] * np.ones((1, 3, 3)))[:, 0, 0]
    middles = at[1:-2] + 0.5  # all but the first and the last
    np.testing.assert_allclose(between[::2], at**3 - 4 * at**2)
    np.testing.assert_allclose(between[3:-2:2], middles**3 - 4 * middles**2)


def test_weights_even_out_as_by_a_matrix():
    rings, joints = np.arange(24).reshape(6, 4), np.repeat([0, 0, 0, 2, 2, 1], 4)
    step = np.zeros((24, 24))
    for r, c in np.ndindex(6, 4):
        near = [(r, (c + 1) % 4), (r, (c - 1) % 4), *((row, c) for row in (r - 1, r + 1) if 0 <= row < 6)]
        for place in near:
            step[rings[r, c], rings[place]] = 0.5 / len(near)
        step[rings[r, c], rings[r, c]] = 0.5
    wanted = np.linalg.matrix_power(step, 3) @ np.eye(3)[joints]
    carriers, weights = smooth_weights(joints, [rings], 3)
    np.testing.assert_allclose(np.einsum("vk,vkj->vj", weights, np.eye(3)[carriers]), wanted, atol=1e-12)


@pytest.mark.parametrize(("bone", "axis", "least"), [("LowerLeg", 0, 0.9), ("UpperLeg", 0, 0.85), ("LowerArm", 1, 0.9)])
def test_a_body_keeps_its_volume_where_it_bends(bone, axis, least):
    mesh = human_mesh()
    bend = np.roll(np.roll(turned_about_z(90), axis + 1, axis=0), axis + 1, axis=1)
    corners = bent(mesh, {f"left{bone}": bend})
    assert least < volume(corners, mesh.triangles) / volume(mesh.places, mesh.triangles) < 1.1


def test_a_person_at_rest_is_the_mesh_itself():
    figure = skinned(to_humanoid(read_motion(SKELETONS / "mixamo.bvh")).motion)
    turns, places = np.tile(np.eye(3), (len(HUMANOID.joints), 1, 1)), T_POSE / Body(HUMANOID).height
    np.testing.assert_allclose(figure.corners(turns, places), person().places, atol=1e-12)


def test_limbs_are_as_long_as_those_of_the_figure():
    """The joints that the mesh is carried by lie where those of the file are, but for the trunk's bend."""
    motion = read_motion(SKELETONS / "mixamo.bvh")
    figure, names = skinned(motion), motion.skeleton.names
    own = positions(motion) * 0.82 / to_humanoid(motion).figure.fitted.leg / Body(HUMANOID).height
    shown = figure.frames()[1]
    for bone, end, one, other in (
        ("leftUpperLeg", "leftLowerLeg", "LeftUpLeg", "LeftLeg"),
        ("rightLowerLeg", "rightFoot", "RightLeg", "RightFoot"),
        ("leftUpperArm", "leftLowerArm", "LeftArm", "LeftForeArm"),
        ("rightLowerArm", "rightHand", "RightForeArm", "RightHand"),
        ("leftUpperArm", "rightUpperArm", "LeftArm", "RightArm"),
    ):
        ends = [next(i for i, name in enumerate(names) if name.rpartition(":")[2] == part) for part in (one, other)]
        wanted = np.linalg.norm(own[0, ends[0]] - own[0, ends[1]])
        found = shown[0, HUMANOID.index(bone)] - shown[0, HUMANOID.index(end)]
        assert np.linalg.norm(found) == pytest.approx(wanted, rel=0.05), bone
    scaled = figure.corners(*(values[0] for values in figure.frames()))
    assert scaled[:, 1].min() == pytest.approx(0, abs=0.03)
    assert np.isfinite(scaled).all()


def test_what_is_no_person_has_round_bones_around_its_own():
    motion = walker()
    figure, points = skinned(motion), figure_of(motion)
    turns, places = figure.frames()
    corners = figure.corners(turns[20], places[20])
    edges = edges_of(figure.mesh.triangles)
    assert all(edges[b, a] == 1 for a, b in edges)
    for bone in points.body.bones:  # corners lie around each bone's ends
        away = np.linalg.norm(corners - points.points[20, bone.end], axis=1)
        assert away.min() < 1.05 * bone.end_radius
