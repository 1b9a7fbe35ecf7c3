from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from motet.errors import MotionError
from motet.figures.humanoid.bones import BONES, HUMANOID, T_POSE, sole_points
from motet.figures.humanoid.joint_tree import map_by_tree
from motet.figures.humanoid.retarget import Humanoid, from_humanoid, to_humanoid
from motet.formats import read_motion, write_motion
from motet.formats.text import with_names
from motet.motion.kinematics import global_transforms, motion_of, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Joint, Skeleton

SKELETONS = Path(__file__).parent / "skeletons"

CONVENTIONS = {
    "bandai-namco": "Bandai-Namco Research motion data",
    "biped": "3ds Max Biped",
    "character-creator": "Character Creator, iClone (Reallusion)",
    "daz": "DAZ Genesis",
    "kaykit": "KayKit",
    "lafan1": "LAFAN1 (Ubisoft)",
    "makehuman": "MakeHuman",
    "mixamo": "Mixamo",
    "perception-neuron": "Perception Neuron (Noitom)",
    "rigify": "Blender Rigify",
    "rokoko": "Rokoko",
    "soma": "SOMA, Kimodo (NVIDIA)",
    "smpl": "SMPL, SMPL-H, SMPL-X (AMASS)",
    "unity": "Unity Humanoid, VRM",
    "unreal": "Unreal mannequin; MakeHuman game engine rig",
    "xsens": "Xsens MVN",
    "xsens-bvh": "Xsens MVN in BVH, 100STYLE",
}
"""File of a skeleton -> the convention. Frame 0 is its T- or A-pose; in 1 the left hand is up, in 2 the right knee is
up and bent, in 3 both elbows are bent forwards."""


def skeleton_file(name: str) -> Motion:
    return read_motion(SKELETONS / f"{name}.bvh")


def places_of(humanoid: Humanoid) -> dict[str, Array]:
    """Joint -> positions (T, 3) seen from the hips of frame 0: x to the left, z to the front."""
    rotations, places = global_transforms(humanoid.motion)
    seen = (places - places[:1, :1]) @ rotations[0, 0]
    return {name: seen[:, i] for i, name in enumerate(HUMANOID.names)}


def dancing(frames: int = 90, turns: float = 1.0) -> Motion:
    """The humanoid moving all its joints by some 20 degrees while it turns about and walks along a line."""
    time = np.linspace(0, 1, frames)
    channels = [f"{HUMANOID.names[0]}.t{axis}" for axis in "xyz"]
    values = [time, 0.98 + 0.01 * np.sin(9 * time), -time]
    for i, bone in enumerate(BONES):
        for k, axis in enumerate("xyz"):
            channels.append(f"{bone}.r{axis}")
            values.append(20 * np.sin(2 * np.pi * (1 + (i + k) % 3) * time + i + 2 * k))
    values[channels.index("hips.ry")] = 360 * turns * time
    units = ("length",) * 3 + ("deg",) * (3 * len(BONES))
    return Motion(np.stack(values, axis=1), tuple(channels), units, 30.0, HUMANOID)


def angles_between(one: Array, other: Array) -> Array:
    """Angles in radians between rotations (..., 3, 3): from the sine of the half, which is exact for small ones."""
    half = np.linalg.norm(one - other, axis=(-2, -1)) / np.sqrt(8)
    return 2 * np.arcsin(np.clip(half, 0, 1))


def test_the_humanoid_stands_on_the_ground_in_a_t_pose() -> None:
    place = dict(zip(HUMANOID.names, T_POSE, strict=True))
    assert place["leftToes_end"][1] == pytest.approx(0.0)
    assert place["head_end"][1] == pytest.approx(1.70)
    assert place["leftHand"][0] > place["leftUpperArm"][0] > 0
    np.testing.assert_allclose(place["rightHand"] * [-1, 1, 1], place["leftHand"])
    still = np.broadcast_to(np.eye(3), (1, len(HUMANOID.names), 3, 3))
    np.testing.assert_allclose(sole_points(still, T_POSE[None])[..., 1], 0, atol=1e-12)


@pytest.mark.parametrize("name", CONVENTIONS)
def test_a_skeleton_is_recognised_and_its_left_hand_goes_up(name: str) -> None:
    humanoid = to_humanoid(skeleton_file(name))
    assert humanoid.convention == CONVENTIONS[name]
    assert humanoid.confidence > 0.9
    assert 0.7 < (humanoid.leg or 0) < 1.0
    assert 1.5 < (humanoid.height or 0) < 2.0
    place = places_of(humanoid)
    assert place["head"][0, 1] > 0.5
    assert place["leftFoot"][0, 1] < -0.8
    assert place["leftFoot"][0, 0] > 0.05 > -0.05 > place["rightFoot"][0, 0]
    assert place["leftToes"][0, 2] - place["leftFoot"][0, 2] > 0.08
    assert place["leftHand"][1, 1] > place["head"][1, 1] > place["rightHand"][1, 1]
    assert place["rightLowerLeg"][2, 2] > 0.25 > place["leftLowerLeg"][2, 2]
    assert place["rightFoot"][2, 2] < place["rightLowerLeg"][2, 2]
    for side in ("left", "right"):
        bent = place[f"{side}Hand"] - place[f"{side}LowerArm"]
        assert bent[3, 2] - bent[0, 2] > 0.1


def test_a_figure_is_as_tall_as_its_bones_are_long() -> None:
    found = to_humanoid(dancing(3))
    assert (found.unit, found.height) == (1.0, pytest.approx(1.70))
    small = to_humanoid(replace(dancing(3), skeleton=replace(HUMANOID, metres_per_unit=0.5)))
    assert (small.unit, small.height) == (0.5, pytest.approx(0.85))


@pytest.mark.parametrize("name", CONVENTIONS)
def test_frames_of_a_t_pose_come_out_as_one(name: str) -> None:
    rotations = global_transforms(to_humanoid(skeleton_file(name)).motion)[0]
    turned = rotations[0, 0].T @ rotations[0]
    trunk = [HUMANOID.index(bone) for bone in ("hips", "spine", "chest", "upperChest", "neck", "head")]
    np.testing.assert_allclose(turned[trunk], np.broadcast_to(np.eye(3), (len(trunk), 3, 3)), atol=1e-5)


@pytest.mark.parametrize("name", CONVENTIONS)
def test_there_and_back_keeps_rotations(name: str) -> None:
    like = skeleton_file(name)
    motion = dancing()
    out = from_humanoid(motion, like)
    assert out.skeleton is not None
    assert out.skeleton.names == (like.skeleton.names if like.skeleton else ())
    returned = to_humanoid(out)
    assert returned.convention == CONVENTIONS[name]
    before, after = global_transforms(motion)[0], global_transforms(returned.motion)[0]
    # where a back or neck has another number of joints, what lies between its ends is shared out anew
    there = [HUMANOID.index(bone) for bone in (*(returned.joints.keys() - {"spine", "neck"}), "upperChest")]
    assert angles_between(before[:, there], after[:, there]).max() < 1e-4


def test_a_round_trip_over_mixamo_of_other_proportions_is_exact() -> None:
    like = skeleton_file("mixamo")
    skeleton = like.skeleton
    assert skeleton is not None
    longer = [
        replace(joint, offset=tuple(k * x for k, x in zip((1.2, 0.8 + 0.05 * (i % 3), 1.1), joint.offset, strict=True)))
        for i, joint in enumerate(skeleton.joints)
    ]
    motion = dancing()
    returned = to_humanoid(from_humanoid(motion, Skeleton(tuple(longer)))).motion
    before, after = global_transforms(motion)[0], global_transforms(returned)[0]
    assert angles_between(before, after).max() < 1e-4


def test_a_whole_turn_does_not_flip() -> None:
    motion = from_humanoid(dancing(200, turns=1.5), skeleton_file("mixamo"))
    for moved in (motion, to_humanoid(motion).motion):
        angles = [i for i, unit in enumerate(moved.units) if unit == "deg"]
        assert np.abs(np.diff(moved.values[:, angles], axis=0)).max() < 20


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_feet_stay_on_the_ground_whatever_the_size(factor: float) -> None:
    like = skeleton_file("mixamo").with_unit(0.01).scaled(0.01 / factor)
    lifted = np.array(dancing().values)
    lifted[:, 1] += 0.3
    grounded = to_humanoid(from_humanoid(replace(dancing(), values=lifted), like).with_unit(0.01 / factor)).motion
    lowest = sole_points(*global_transforms(grounded))[..., 1].min(axis=1)
    assert abs(np.percentile(lowest, 5)) < 1e-6
    out = from_humanoid(grounded, like)
    places = global_transforms(out)[1]
    toes = [out.skeleton.index(f"mixamorig:{side}ToeBase_end") for side in ("Left", "Right")] if out.skeleton else []
    metres = places[:, toes, 1].min(axis=1) * 0.01 / factor
    assert abs(np.percentile(metres, 5)) < 0.01


def test_names_that_nobody_knows_are_found_by_the_tree() -> None:
    for name in ("mixamo", "rokoko", "perception-neuron", "xsens", "smpl", "biped", "unreal"):
        like = skeleton_file(name)
        assert like.skeleton is not None
        strange = [f"bone{i}" + ("_end" if n.endswith("_end") else "") for i, n in enumerate(like.skeleton.names)]
        humanoid = to_humanoid(with_names(like, strange))
        assert humanoid.convention == "by the tree"
        assert humanoid.confidence < 0.7
        known = to_humanoid(like)
        place, expected = places_of(humanoid), places_of(known)
        for bone in ("leftHand", "rightFoot", "leftLowerLeg", "rightLowerArm"):
            assert np.linalg.norm(place[bone] - expected[bone], axis=1).max() < 0.12, (name, bone)


def limbless(motion: Motion, *gone: str) -> Motion:
    """The motion without some joints and all that hangs on them."""
    skeleton = motion.skeleton
    assert skeleton is not None
    lost = {i for name in gone for i in skeleton.below(skeleton.index(name))}
    kept = [i for i in range(len(skeleton.joints)) if i not in lost]
    joints = [
        replace(skeleton.joints[i], parent=kept.index(p) if (p := skeleton.joints[i].parent) >= 0 else -1) for i in kept
    ]
    names = {joint.name for joint in joints}
    channels = tuple(channel for channel in motion.channels if channel.rpartition(".")[0] in names)
    return replace(motion.select(channels), skeleton=Skeleton(tuple(joints)))


def test_figures_that_are_no_humans_are_refused_with_the_reason() -> None:
    hand = [Joint("wrist", -1, (0.0, 1.0, 0.0))]
    for finger in range(5):
        for k in range(4):
            hand.append(Joint(f"f{finger}{k}", 0 if k == 0 else len(hand) - 1, (0.02 * (finger - 2), 0.04, 0.0)))
    with pytest.raises(MotionError, match="no human's"):
        to_humanoid(Motion(np.zeros((2, 0)), (), (), 30.0, Skeleton(tuple(hand))))
    arm = tuple(Joint(f"axis{i}", i - 1, (0.0, 0.3, 0.0)) for i in range(7))
    with pytest.raises(MotionError, match="no human's"):
        to_humanoid(Motion(np.zeros((2, 0)), (), (), 30.0, Skeleton(arm)))


def test_a_dog_is_refused() -> None:
    joints = [
        Joint("Root", -1, (0.0, 0.5, 0.0)),
        Joint("Back", 0, (0.0, 0.02, 0.3)),
        Joint("Front", 1, (0.0, 0.0, 0.3)),
    ]
    joints += [
        Joint("Neck", 2, (0.0, 0.15, 0.15)),
        Joint("Head", 3, (0.0, 0.1, 0.1)),
        Joint("Head_end", 4, (0.0, 0.0, 0.1)),
    ]
    for side, sign in (("Left", 1), ("Right", -1)):
        for start, where in (("Hind", 0), ("Fore", 2)):
            joints.append(Joint(f"{side}{start}1", where, (0.1 * sign, -0.05, 0.0)))
            for k, offset in enumerate([(0.0, -0.2, 0.0), (0.0, -0.2, 0.0), (0.0, -0.04, 0.08)], start=2):
                joints.append(Joint(f"{side}{start}{k}", len(joints) - 1, offset))
    dog = Motion(np.zeros((5, 0)), (), (), 30.0, Skeleton(tuple(joints), 1.0))
    with pytest.raises(MotionError, match="four legs"):
        to_humanoid(dog)


def test_a_motion_without_frames_is_refused() -> None:
    with pytest.raises(MotionError, match="no frames"):
        to_humanoid(skeleton_file("mixamo")[:0])


def test_what_a_figure_lacks_stays_at_rest() -> None:
    mixamo = skeleton_file("mixamo")
    gone = [f"mixamorig:{side}{part}" for side in ("Left", "Right") for part in ("Hand", "ToeBase")]
    rotations = global_transforms(to_humanoid(limbless(mixamo, *gone)).motion)[0]
    for bone, parent in (("leftHand", "leftLowerArm"), ("rightToes", "rightFoot")):
        np.testing.assert_allclose(rotations[:, HUMANOID.index(bone)], rotations[:, HUMANOID.index(parent)], atol=1e-9)


def test_only_the_humanoid_leaves_the_humanoid() -> None:
    with pytest.raises(MotionError, match="to_humanoid first"):
        from_humanoid(skeleton_file("mixamo"), skeleton_file("rokoko"))


def test_a_motion_on_another_skeleton_is_a_file_like_any_other(tmp_path: Path) -> None:
    out = from_humanoid(dancing(), skeleton_file("bandai-namco"))
    write_motion(tmp_path / "out.bvh", out)
    again = read_motion(tmp_path / "out.bvh")
    np.testing.assert_allclose(global_transforms(again)[1], global_transforms(out)[1], atol=1e-6)
    hips = again.skeleton.index("Hips") if again.skeleton else 0
    assert np.ptp(global_transforms(again)[1][:, hips, 0]) > 50


def test_the_tree_finds_joints_with_and_without_sides_in_their_names() -> None:
    mixamo = skeleton_file("mixamo")
    skeleton = mixamo.skeleton
    assert skeleton is not None
    found = map_by_tree(mixamo)
    assert found.names(skeleton)["leftUpperArm"] == ("mixamorig:LeftArm",)
    assert found.names(skeleton)["spine"] == ("mixamorig:Spine", "mixamorig:Spine1", "mixamorig:Spine2")
    nameless = with_names(mixamo, [f"b{i}{'_end' * n.endswith('_end')}" for i, n in enumerate(skeleton.names)])
    assert dict(map_by_tree(nameless).joints) == dict(found.joints)


@pytest.mark.parametrize("name", ["lafan1", "bandai-namco"])
def test_axes_of_a_convention_are_not_forced_on_another_skeleton_of_the_same_names(name: str) -> None:
    """The same figure with the axes of every joint turned about: what the table says does not hold any more."""
    like = skeleton_file(name)
    skeleton = skeleton_of(like)
    walked = from_humanoid(dancing(), like)
    rotations, places = global_transforms(walked)
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    offsets = [tuple(joint.offset if i == 0 else turn.T @ joint.offset) for i, joint in enumerate(skeleton.joints)]
    joints = [replace(joint, offset=offset) for joint, offset in zip(skeleton.joints, offsets, strict=True)]
    hips = skeleton.index("Hips")
    above = places[:, hips] - places[:, skeleton.joints[hips].parent] if hips else places[:, 0]
    moved = {hips: above @ turn if hips else above}
    other = motion_of(Skeleton(tuple(joints)), rotations @ turn, moved, 30.0)
    humanoid = to_humanoid(other)
    assert humanoid.confidence < 0.9
    assert "found from the frames" in humanoid.notes[0]
    known = to_humanoid(walked)
    apart = np.linalg.norm(global_transforms(humanoid.motion)[1] - global_transforms(known.motion)[1], axis=-1)
    limbs = [HUMANOID.index(bone) for bone in ("leftFoot", "rightLowerLeg", "leftHand", "rightLowerArm")]
    assert apart[:, limbs].mean() < 0.1
