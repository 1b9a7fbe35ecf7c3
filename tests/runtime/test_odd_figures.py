"""Files that are not as they should be, as other makers write them: each fault is put into a good figure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gltf_files import read_document, write_clips, write_document
from test_retarget import SKELETONS, angles_between, dancing, limbless, skeleton_file

from motet.errors import FormatError, MotionError
from motet.figures.humanoid.bones import HUMANOID
from motet.figures.humanoid.retarget import SURE_OF_JOINTS, from_humanoid, to_humanoid
from motet.formats import read_motion
from motet.formats.text import with_names
from motet.motion.kinematics import global_transforms, motion_of, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, product
from motet.motion.skeleton import Joint, Skeleton


def apart(one: Motion, other: Motion, but: tuple[str, ...] = ("!",)) -> float:
    """The largest angle in degrees between the rotations in the world of two motions of the humanoid, but of some."""
    angles = np.degrees(angles_between(global_transforms(one)[0], global_transforms(other)[0]))
    kept = [i for i, name in enumerate(HUMANOID.names) if not name.endswith(but)]
    return float(angles[:, kept].max())


def renamed(motion: Motion, **names: str) -> Motion:
    """The motion with other words in its joints' names."""
    found = list(skeleton_of(motion).names)
    for old, new in names.items():
        found = [name.replace(old, new) for name in found]
    return with_names(motion, found)


def nameless(motion: Motion) -> Motion:
    return with_names(motion, [f"b{i}{'_end' * n.endswith('_end')}" for i, n in enumerate(skeleton_of(motion).names)])


def posed(height: float, **turns: tuple[float, float, float]) -> Motion:
    """Some frames of the humanoid in one pose: bone -> degrees about x, y and z; "Foot" is both feet."""
    motion = dancing(4)
    values = np.zeros_like(motion.values)
    values[:, 1] = height
    for bone, angles in turns.items():
        sides = ("left", "right") if bone[0].isupper() else ("",)
        for side in sides:
            for axis, angle in zip("xyz", angles, strict=True):
                mirrored = side == "right" and axis != "x"
                values[:, motion.channels.index(f"{side}{bone}.r{axis}")] = -angle if mirrored else angle
    values[2] += 0.5  # no two frames are quite the same
    return replace(motion, values=values)


ON_THE_FLOOR = {
    "crawls": posed(
        0.4, hips=(80, 0, 0), UpperLeg=(-80, 0, 0), LowerLeg=(90, 0, 0), Foot=(60, 0, 0), UpperArm=(0, -80, 0)
    ),
    "kneels": posed(0.3, UpperLeg=(-70, 0, 0), LowerLeg=(140, 0, 0), Foot=(50, 0, 0), UpperArm=(0, 0, -80)),
    "lies": posed(0.1, hips=(-90, 0, 0), UpperArm=(0, 0, -80)),
    "meditates": posed(0.1, UpperLeg=(-95, 40, 20), LowerLeg=(125, 0, 0), Foot=(0, 0, 30), UpperArm=(0, 0, -70)),
    "sits up": posed(0.1, hips=(-50, 0, 0), spine=(40, 0, 0), UpperLeg=(-60, 0, 0), LowerLeg=(110, 0, 0)),
    "sits folded": posed(0.1, hips=(60, 0, 0), spine=(30, 0, 0), UpperLeg=(-150, 0, 0), LowerLeg=(10, 0, 0)),
}


@pytest.mark.parametrize("pose", ON_THE_FLOOR)
@pytest.mark.parametrize("named", [True, False])
def test_people_on_the_floor_come_in(pose: str, named: bool) -> None:
    motion = from_humanoid(ON_THE_FLOOR[pose], skeleton_file("mixamo"))
    found = to_humanoid(motion if named else nameless(motion))
    # a hand's direction is that of all its fingers where nothing tells the thumb
    assert apart(found.motion, ON_THE_FLOOR[pose], ("!",) if named else ("Hand", "Hand_end")) < 1e-3


def test_one_who_sits_all_through_a_file_of_a_skeleton_that_rests_in_no_bodys_pose_is_no_beast() -> None:
    motion = from_humanoid(ON_THE_FLOOR["sits folded"], skeleton_file("lafan1"))
    assert apart(to_humanoid(motion).motion, ON_THE_FLOOR["sits folded"]) < 1e-3


def beast(upright: bool) -> Motion:
    """Hind legs of six bones and fore legs of four that zigzag, a tail, and a trunk along the ground or upright."""
    rise, reach = (0.6, 0.2) if upright else (0.05, 0.3)
    joints = [Joint("root", -1, (0.0, 1.0, 0.0))]
    for name in ("back1", "back2", "back3"):
        joints.append(Joint(name, len(joints) - 1, (0.0, rise / 3, reach)))
    joints += [
        Joint("neck", 3, (0.0, 0.3, 0.2)),
        Joint("skull", 4, (0.0, 0.1, 0.1)),
        Joint("snout", 5, (0.0, 0.0, 0.2)),
    ]
    joints += [
        Joint("tail1", 0, (0.0, 0.0, -0.3)),
        Joint("tail2", 7, (0.0, -0.1, -0.4)),
        Joint("tail3", 8, (0.0, -0.1, -0.4)),
    ]
    hind = [
        (0.18, 0.0, -0.34),
        (0.08, -0.35, 0.28),
        (0.03, -0.2, -0.25),
        (0.02, -0.24, 0.11),
        (0.01, -0.11, 0.04),
        (0.0, -0.01, 0.13),
        (0.0, 0.0, 0.13),
    ]
    fore = [(0.15, 0.1, -0.2), (0.1, -0.25, 0.2), (0.1, -0.2, 0.0), (0.02, -0.12, 0.05), (0.0, -0.02, 0.1)]
    for side, sign in (("_l", 1), ("_r", -1)):
        for limb, start, offsets in (("hind", 0, hind), ("fore", 3, fore)):
            joints.append(Joint(f"{limb}0{side}", start, (0.07 * sign, 0.0, 0.1)))
            for i, (x, y, z) in enumerate(offsets, start=1):
                joints.append(Joint(f"{limb}{i}{side}", len(joints) - 1, (sign * x, y, z)))
    return Motion(np.zeros((5, 0)), (), (), 30.0, Skeleton(tuple(joints), 1.0))


@pytest.mark.parametrize("upright", [True, False])
def test_beasts_have_more_bones_in_a_leg_than_people(upright: bool) -> None:
    with pytest.raises(MotionError, match="a human's bones are straight"):
        to_humanoid(beast(upright))


def test_where_half_of_the_names_are_known_the_tree_tells_the_rest() -> None:
    motion = from_humanoid(dancing(20), skeleton_file("mixamo"))
    found = to_humanoid(renamed(motion, Hips="Center", Spine="Abdomen"))
    assert found.convention == "by the tree"
    assert apart(found.motion, to_humanoid(motion).motion) < 1e-3


def test_where_neither_tells_the_names_that_are_missing_are_named() -> None:
    arms = Skeleton(tuple(joint for joint in skeleton_of(skeleton_file("mixamo")).joints[:1]))
    joints = [
        Joint(f"{side}{part}", 0, (0.1, 0.2, 0.0))
        for side in ("Left", "Right")
        for part in ("Arm", "Leg", "Foot", "UpLeg")
    ]
    with pytest.raises(MotionError, match="no joint was found for spine, leftLowerArm"):
        to_humanoid(Motion(np.zeros((1, 0)), (), (), 30.0, Skeleton((*arms.joints, *joints))))


def test_a_neck_may_hang_beside_the_end_of_the_back() -> None:
    """The arms on Chest2, the neck on Chest."""
    motion = skeleton_file("mixamo")
    skeleton = skeleton_of(motion)
    chest, end = (skeleton.index(f"mixamorig:{name}") for name in ("Spine1", "Spine2"))
    offset = np.add(skeleton.offsets[end], skeleton.offsets[skeleton.index("mixamorig:Neck")])
    joints = [replace(j, parent=chest, offset=tuple(offset)) if j.name.endswith("Neck") else j for j in skeleton.joints]
    found = to_humanoid(replace(motion, skeleton=Skeleton(tuple(joints))))
    assert found.convention == "Mixamo"
    assert found.joints["neck"] == ("mixamorig:Neck",)


def test_an_arm_may_end_in_the_wrist() -> None:
    """Forearms without a hand, whose tips are more than a hand's length away."""
    plain = Joint("hips", -1, (0.0, 0.9, 0.0))
    joints = [plain, Joint("back", 0, (0.0, 0.2, 0.0)), Joint("chest", 1, (0.0, 0.2, 0.0))]
    for side, x in (("l", 1), ("r", -1)):
        leg = [(f"{side}_a", 0, (0.1 * x, 0.0, 0.0)), (f"{side}_b", -1, (0.0, -0.42, 0.0))]
        leg += [(f"{side}_c", -1, (0.0, -0.42, 0.0)), (f"{side}_d", -1, (0.0, -0.05, 0.15))]
        arm = [(f"{side}_e", 2, (0.05 * x, 0.1, 0.0)), (f"{side}_f", -1, (0.12 * x, 0.0, 0.0))]
        arm += [(f"{side}_g", -1, (0.3 * x, 0.0, 0.0)), (f"{side}_g_end", -1, (0.3 * x, 0.0, 0.0))]
        for name, parent, offset in leg + arm:
            joints.append(Joint(name, len(joints) - 1 if parent < 0 else parent, offset))
    found = to_humanoid(Motion(np.zeros((2, 0)), (), (), 30.0, Skeleton(tuple(joints), 1.0)))
    assert found.joints["leftLowerArm"] == ("l_g",)
    assert "leftHand" not in found.joints


def lying_world(motion: Motion, turn: Array) -> Motion:
    """The frames of a motion in a world that is turned about, the skeleton's rest as it was."""
    skeleton = skeleton_of(motion)
    rotations, places = global_transforms(motion)
    return motion_of(skeleton, product(turn, rotations), {0: places[:, 0] @ turn.T}, motion.fps)


Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@pytest.mark.parametrize("name", ["mixamo", "rokoko"])
def test_frames_with_z_up_on_a_rest_pose_with_y_up_are_turned_upright(name: str) -> None:
    motion = from_humanoid(dancing(), skeleton_file(name))
    found = to_humanoid(lying_world(motion, Z_UP))
    assert found.notes[-1] == "turned upright: the frames stand along z, the rest pose along y"
    assert apart(found.motion, to_humanoid(motion).motion) < 1e-3
    path, expected = (global_transforms(m)[1][:, 0] for m in (found.motion, to_humanoid(motion).motion))
    np.testing.assert_allclose(path - path[0], expected - expected[0], atol=1e-6)


def test_one_who_lies_or_falls_is_not_turned_upright() -> None:
    lies = to_humanoid(from_humanoid(ON_THE_FLOOR["lies"], skeleton_file("mixamo")))
    assert apart(lies.motion, ON_THE_FLOOR["lies"]) < 1e-3
    assert "lies along z in most frames" in lies.notes[-1]
    walk = dancing(30, turns=0.0)
    values = np.concatenate([walk.values, np.repeat(lies.motion.values[:1], 60, axis=0)])
    values[30:, :3] = [walk.values[-1, 0], 0.1, walk.values[-1, 2]]
    falls = replace(walk, values=values)
    assert apart(to_humanoid(from_humanoid(falls, skeleton_file("mixamo"))).motion, falls) < 1e-3


def test_a_pelvis_that_is_turned_below_its_joint_is_turned_as_the_legs_lie() -> None:
    """The turn is in the joints of the legs and of the back that hang on the hips, these stand still."""
    like = skeleton_file("mixamo")
    skeleton = skeleton_of(like)
    dance = dancing()
    motion = from_humanoid(dance, like)
    rotations = global_transforms(motion)[0]
    limbs = skeleton.children[0]
    carriers = [Joint(f"{skeleton.names[k]}Joint", 0, (0.0, 0.0, 0.0)) for k in limbs]
    joints = [skeleton.joints[0], *carriers]
    for i, joint in enumerate(skeleton.joints[1:], start=1):
        joints.append(replace(joint, parent=joint.parent + len(carriers) if joint.parent else 1 + limbs.index(i)))
    still = np.broadcast_to(np.eye(3), rotations[:, :1].shape)
    turned = np.concatenate([still, *[rotations[:, :1]] * len(carriers), rotations[:, 1:]], axis=1)
    places = global_transforms(motion)[1][:, 0]
    found = to_humanoid(motion_of(Skeleton(tuple(joints), skeleton.metres_per_unit), turned, {0: places}, motion.fps))
    assert any("the pelvis is turned as they lie" in note for note in found.notes)
    hips = HUMANOID.index("hips")
    left, expected = (global_transforms(m)[0][:, hips, :, 0] for m in (found.motion, dance))
    assert np.degrees(np.arccos(np.clip(np.sum(left * expected, axis=-1), -1, 1))).max() < 0.01
    others = tuple(name for name in HUMANOID.names if "Arm" not in name and "Leg" not in name)
    assert apart(found.motion, dance, others) < 1e-3


def resting_in_its_start(path: Path) -> Path:
    """The file with each node at rest as the first key of its track has it."""
    document, binary = read_document(path)
    animation = document["animations"][0]
    for channel in animation["channels"]:
        accessor = document["accessors"][animation["samplers"][channel["sampler"]]["output"]]
        start = document["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
        first = np.frombuffer(binary, "<f4", int(accessor["type"][-1]), start)
        document["nodes"][channel["target"]["node"]][channel["target"]["path"]] = first.tolist()
    del document["buffers"]
    return write_document(path.with_name("start.glb"), document, binary)


def test_a_rest_pose_out_of_a_motion_is_said_and_taken_from_another_file(tmp_path: Path) -> None:
    dance = dancing(40)
    motion = from_humanoid(dance, skeleton_file("mixamo")).with_unit(0.01).scaled(1.0)
    stands = write_clips(tmp_path / "stands.glb", [("Dance", motion)])
    lies = resting_in_its_start(write_clips(tmp_path / "a.glb", [("Dance", motion)], skin=False))
    guessed = to_humanoid(read_motion(lies))
    assert "the rest pose is out of a motion" in guessed.notes[0]
    assert guessed.confidence < SURE_OF_JOINTS
    given = to_humanoid(read_motion(lies, rest=stands))
    assert (given.confidence, given.notes) == (1.0, ())
    assert apart(given.motion, dance) < 0.01
    np.testing.assert_allclose(
        global_transforms(given.motion)[1], global_transforms(to_humanoid(motion).motion)[1], atol=1e-4
    )


def test_the_first_frame_of_a_clip_can_be_the_rest_pose(tmp_path: Path) -> None:
    motion = from_humanoid(dancing(40), skeleton_file("mixamo")).with_unit(0.01).scaled(1.0)
    stance = skeleton_file("mixamo").with_unit(0.01).scaled(1.0)
    lies = resting_in_its_start(write_clips(tmp_path / "a.glb", [("Dance", motion)], skin=False))
    poses = write_clips(tmp_path / "poses.glb", [("Dance", motion), ("T-Pose", stance)])
    given = to_humanoid(read_motion(lies, rest=f"{poses}#T-Pose"))
    assert apart(given.motion, to_humanoid(motion).motion) < 0.01


def test_a_rest_pose_is_taken_from_a_file_of_these_joints_alone(tmp_path: Path) -> None:
    motion = from_humanoid(dancing(5), skeleton_file("mixamo")).with_unit(0.01).scaled(1.0)
    path = write_clips(tmp_path / "a.glb", [("Dance", motion)])
    with pytest.raises(FormatError, match="shares no joint name with this figure"):
        read_motion(path, rest=write_clips(tmp_path / "b.glb", [("Dance", nameless(motion))]))
    with pytest.raises(FormatError, match="a rest pose must come from"):
        read_motion(path, rest=SKELETONS / "mixamo.bvh")
    with pytest.raises(FormatError, match="no such file"):
        read_motion(path, rest=tmp_path / "none.glb")
    with pytest.raises(FormatError, match="'rest' is an option for"):
        read_motion(SKELETONS / "mixamo.bvh", rest=path)


@pytest.mark.parametrize("spare", [("ribs", "tip"), ("leftEye", "Thumb1")])
def test_a_known_rest_pose_is_not_forced_on_other_figures_of_the_same_names(spare: tuple[str, str]) -> None:
    """The humanoid, which rests in a straight T-pose, by names of CMU's figure of 43 joints: with joints that it lacks,
    and with none."""
    names = {"hips": "hip", "spine": "abdomen", "chest": spare[0], "upperChest": "chest"}
    parts = {"UpperLeg": "Thigh", "LowerLeg": "Shin", "Foot": "Foot", "Toes": spare[1], "Shoulder": "Collar"}
    parts |= {"UpperArm": "Shldr", "LowerArm": "ForeArm", "Hand": "Hand"}
    names |= {f"{side}{old}": f"{side[0]}{new}" for side in ("left", "right") for old, new in parts.items()}
    dance = dancing(9)
    found = to_humanoid(with_names(dance, [names.get(name, name) for name in HUMANOID.names]))
    assert found.convention == "CMU in BVH, 43 joints (Poser, DAZ)"
    assert apart(found.motion, dance, ("spine", "hest", "neck", "Toes", "_end")) < 1e-3
    assert not any("made up for" in note for note in found.notes)


def test_a_foot_in_line_with_the_shin_has_no_direction() -> None:
    """As in the first example files of Biovision: the tip of the ankle lies straight below."""
    like = limbless(skeleton_file("mixamo"), "mixamorig:LeftToeBase", "mixamorig:RightToeBase")
    skeleton = skeleton_of(like)
    feet = [f"mixamorig:{side}Foot" for side in ("Left", "Right")]
    tips = [Joint(f"{foot}_end", skeleton.index(foot), (0.0, -8.0, 0.0)) for foot in feet]
    motion = replace(like, skeleton=Skeleton((*skeleton.joints, *tips)))
    found = to_humanoid(motion)
    assert found.confidence > 0.9
    assert found.figure.fitted.up is not None
    turned = global_transforms(found.motion)[0]
    for side in ("left", "right"):
        foot, shin = (turned[:, HUMANOID.index(f"{side}{part}")] for part in ("Foot", "LowerLeg"))
        np.testing.assert_allclose(foot, shin, atol=1e-9)
