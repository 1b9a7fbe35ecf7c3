import math
import time

import numpy as np
import pytest
from figures import walker

from motet.errors import FormatError
from motet.formats import amc, bvh, read_motion, write_motion
from motet.formats.asf import CMU_METRES
from motet.motion.kinematics import local_rotations, positions, with_channels
from motet.motion.motion import Motion
from motet.motion.rotations import axis_to_rotmat
from motet.motion.skeleton import Joint, Skeleton

ASF = """
:version 1.10
:name odd
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
  begin here or end there: free text
:root
  order TX TY TZ RZ RX RY
  axis XYZ
  position 1 2 3
  orientation 0 0 0
:bonedata
  begin
    id 1
    name hip      # the first
    direction 1 0 0
    length 2
    axis 0 0 0 XYZ
  end
  begin
    id 2
    name leg
    direction 0 -1 0
    length 4
    axis 10 20 30 ZXY
    dof rz rx
    limits (-10 10)
           (-20 20)
  end
:hierarchy
  begin
    root hip
    hip leg
  end
"""

AMC = """#!OML:ASF
:FULLY-SPECIFIED
:DEGREES
1
leg 5 6
root 1 2 3 10 20 30
2
leg 7 8
root 4 5 6 40 50 60
"""


@pytest.fixture
def pair(tmp_path):
    def make(amc_text=AMC, asf_text=ASF, name="a.amc"):
        (tmp_path / "a.asf").write_text(asf_text)
        (tmp_path / name).write_text(amc_text)
        return tmp_path / name

    return make


def turn(axis, degrees):
    return axis_to_rotmat(axis, np.radians(float(degrees)))


def test_channels_in_the_files_order_and_rotations_in_the_skeletons(pair):
    motion = read_motion(pair())
    assert motion.channels == ("leg.rz", "leg.rx", *(f"root.{kind}" for kind in ("tx", "ty", "tz", "rz", "rx", "ry")))
    assert motion.units == ("deg", "deg", "length", "length", "length", "deg", "deg", "deg")
    assert motion.values.tolist() == [[5, 6, 1, 2, 3, 10, 20, 30], [7, 8, 4, 5, 6, 40, 50, 60]]
    assert motion.fps == 120
    assert motion.skeleton.names == ("root", "hip", "leg", "leg_end")
    assert motion.skeleton.metres_per_unit == CMU_METRES
    # the first letter turns first, so it stands rightmost in the product
    frame = turn("y", 30) @ turn("x", 20) @ turn("z", 10)
    rotations = local_rotations(motion)
    np.testing.assert_allclose(rotations[0, 0], turn("y", 30) @ turn("x", 20) @ turn("z", 10), atol=1e-12)
    np.testing.assert_allclose(rotations[0, 2], frame @ turn("x", 6) @ turn("z", 5) @ frame.T, atol=1e-12)
    root = np.array([1.0, 2, 3])
    leg = root + rotations[0, 0] @ [2, 0, 0]
    tip = leg + rotations[0, 0] @ rotations[0, 2] @ [0, -4, 0]
    np.testing.assert_allclose(positions(motion)[0], [root, root, leg, tip], atol=1e-12)


def test_radians_in_both_files(pair):
    degrees = read_motion(pair())
    asf = ASF.replace("angle deg", "angle rad").replace(
        "10 20 30 ZXY", " ".join(map(str, np.radians([10, 20, 30]))) + " ZXY"
    )
    lines = AMC.replace(":DEGREES", ":RADIANS").split("\n")
    for i, line in enumerate(lines):
        words = line.split()
        if len(words) > 1 and words[0] in ("leg", "root"):
            keep = 4 if words[0] == "root" else 1
            lines[i] = " ".join(words[:keep] + [repr(math.radians(float(word))) for word in words[keep:]])
    radians = read_motion(pair("\n".join(lines), asf))
    assert radians.units[0] == "rad"
    np.testing.assert_allclose(positions(radians), positions(degrees), atol=1e-12)
    without = read_motion(pair("\n".join(lines).replace(":RADIANS\n", ""), asf))
    assert without.units[0] == "rad"


def test_unknown_length_units_stay_unknown(pair):
    assert read_motion(pair(asf_text=ASF.replace("length 0.45", "length 1.0"))).skeleton.metres_per_unit is None


def test_line_endings_comments_and_blank_lines_do_not_matter(pair):
    plain = read_motion(pair())
    odd = AMC.replace("\n", "\r\n").replace("leg 7 8", "  leg 7 8  # a comment\r\n")
    assert read_motion(pair(odd)).values.tolist() == plain.values.tolist()


def test_a_file_without_frames_has_the_skeletons_channels(pair):
    motion = read_motion(pair(":DEGREES\n"))
    assert motion.values.shape == (0, 8)


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("leg 7 8", "leg 7", 8, "needs 2 values, not 1"),
        ("leg 7 8", "leg 7 eight", 8, "'eight' is not a finite number"),
        ("leg 7 8", "leg 7 nan", 8, "'nan' is not a finite number"),
        ("leg 7 8", "leg 7 1_0", 8, "'1_0' is not a finite number"),
        ("leg 7 8", "arm 7 8", 8, "expected bone 'leg', as in the first frame, not 'arm'"),
        ("leg 5 6", "arm 5 6", 5, "'arm' has no degrees of freedom"),
        ("leg 5 6", "hip 5 6", 5, "'hip' has no degrees of freedom"),
        ("leg 5 6", "leg 5 6\nleg 5 6", 6, "appears twice"),
        ("root 4 5 6 40 50 60\n", "", 8, "truncated frame: bone 'root' is missing"),
        ("root 4 5 6 40 50 60", "root 4 5 6 40 50 60\nleg 1 2", 10, "expected a frame number, as in the first frame"),
        ("1\nleg", "leg", 4, "expected a frame number alone on its line"),
    ],
)
def test_faults_are_named_with_file_and_line(pair, old, new, line, words):
    path = pair(AMC.replace(old, new))
    with pytest.raises(FormatError, match=words) as error:
        read_motion(path)
    assert (error.value.path, error.value.line) == (path, line)


@pytest.mark.parametrize(
    ("said", "options", "fps"),
    [
        ("", {}, 120),
        ("", {"fps": 60}, 60),
        ("# fps 50\n", {}, 50),
        (":SAMPLES-PER-SECOND 60\n", {}, 60),
        (":SAMPLES-PER-SECOND x\n", {}, "line 1: 'x' is not a finite number"),
        ("# fps 50\n", {"fps": 50}, 50),
        ("# fps 50\n", {"fps": 60}, "but 60 was given"),
        ("# fps 0\n", {}, "line 1: frame rate 0 is out of range"),
        ("", {"fps": 0}, "frame rate 0 is out of range"),
        ("", {"fps": -1.0}, "frame rate -1 is out of range"),
        ("", {"fps": 1e9}, r"frame rate 1e\+09 is out of range"),
    ],
)
def test_the_frame_rate_is_the_comments_or_the_callers(pair, said, options, fps):
    path = pair(said + AMC)
    if isinstance(fps, str):
        with pytest.raises(FormatError, match=fps):
            read_motion(path, **options)
    else:
        assert read_motion(path, **options).fps == fps


@pytest.mark.parametrize("broken", ["2\n", "2\nleg 7", "2\nleg 7 8\nroot 1 2 3 4", "2\nleg 7 -"])
def test_a_file_that_breaks_off_gives_its_whole_frames_when_asked_to(pair, broken):
    path = pair(AMC[: AMC.index("2\nleg")] + broken)
    with pytest.raises(FormatError):
        amc.read(path)
    assert amc.read(path, partial=True).values.tolist() == [[5, 6, 1, 2, 3, 10, 20, 30]]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("hip leg", "hip arm", "'arm', which is not in :bonedata"),
        ("root hip", "root hip leg", "has two parents"),
        ("10 20 30 ZXY", "10 20 30", "three angles and their order"),
        ("direction 0 -1 0", "direction 0 -1", "three numbers"),
        ("dof rz rx", "dof rz tx", "at most once"),
        ("name leg", "name hip", "must be unique and not empty"),
        ("    direction 1 0 0\n", "", "has no direction"),
        ("    length 4\n    axis 10 20 30 ZXY\n", "", "has no length or axis"),
        ("direction 1 0 0\n    length 2", "direction 1e308 0 0\n    length 1e9", "'inf' is not a finite number"),
        ("    root hip\n", "", "does not reach bone 'hip'"),
        ("    hip leg\n", "", "does not reach bone 'leg'"),
        ("    root hip\n    hip leg\n", "    hip leg\n    leg hip\n", "does not reach bone"),
        ("angle deg", "angle gon", "expected deg or rad"),
        (":hierarchy", ":tree", "needs the sections"),
    ],
)
def test_faults_of_the_skeleton_are_named(pair, old, new, words):
    with pytest.raises(FormatError, match=words) as error:
        read_motion(pair(asf_text=ASF.replace(old, new)))
    assert error.value.path.name == "a.asf"


def test_the_skeleton_is_found_by_stem_subject_or_alone(tmp_path):
    motion = walker(3)
    (tmp_path / "amc").mkdir()
    (tmp_path / "asf").mkdir()
    path = tmp_path / "amc" / "7_03.amc"
    amc.write(path, motion)
    skeleton = path.with_suffix(".asf")
    for place in (tmp_path / "amc" / "7.asf", tmp_path / "asf" / "7.ASF", tmp_path / "amc" / "other.asf"):
        skeleton.replace(place)
        assert len(amc.read(path)) == 3
        place.replace(skeleton)
    for name in ("other.asf", "another.asf"):
        (tmp_path / "amc" / name).write_bytes(skeleton.read_bytes())
    skeleton.unlink()
    with pytest.raises(FormatError, match=r"expected 7_03\.asf or 7\.asf, or a single \.asf"):
        amc.read(path)
    assert len(amc.read(path, asf=tmp_path / "amc" / "other.asf")) == 3


@pytest.mark.parametrize("name", ["02_06", "09_07", "39_14"])
def test_amc_to_amc_is_exact(clips, tmp_path, name):
    motion = read_motion(clips / f"{name}.amc")
    write_motion(tmp_path / "b.amc", motion)
    again = read_motion(tmp_path / "b.amc")
    np.testing.assert_array_equal(again.values, motion.values)
    assert (again.channels, again.units, again.fps) == (motion.channels, motion.units, motion.fps)
    assert again.skeleton.names == motion.skeleton.names
    assert [(j.order, j.axis) for j in again.skeleton.joints] == [(j.order, j.axis) for j in motion.skeleton.joints]
    np.testing.assert_allclose(again.skeleton.offsets, motion.skeleton.offsets, atol=1e-14)


def test_any_skeleton_gives_the_same_positions_after_writing(tmp_path):
    motion = walker(fps=29.97, metres_per_unit=None)
    write_motion(tmp_path / "w.amc", motion)
    again = read_motion(tmp_path / "w.amc")
    names = ["root", *motion.skeleton.names[1:]]
    places = positions(again)[:, [again.skeleton.index(name) for name in names]]
    np.testing.assert_allclose(places, positions(motion), atol=1e-12)
    assert again.fps == 29.97


def test_a_known_unit_of_length_stays_known(tmp_path):
    motion = walker(metres_per_unit=0.01)
    write_motion(tmp_path / "w.amc", motion)
    again = read_motion(tmp_path / "w.amc")
    places = positions(again.scaled(0.01))[:, again.skeleton.index("head")]
    np.testing.assert_allclose(places, positions(motion)[:, motion.skeleton.index("head")], atol=1e-9)


def test_names_that_asf_cannot_hold_are_changed(tmp_path):
    joints = (
        Joint("Hips", -1, (0, 0, 0)),
        Joint("root", 0, (1, 0, 0)),
        Joint("left arm", 1, (1, 0, 0)),
        Joint("left_arm", 1, (0, 1, 0)),
        Joint("12", 0, (0, 0, 1)),
    )
    channels = tuple(f"{joint.name}.rx" for joint in joints)
    write_motion(tmp_path / "n.amc", Motion(np.ones((2, 5)), channels, ("deg",) * 5, 30, Skeleton(joints)))
    again = read_motion(tmp_path / "n.amc")
    assert again.channels == ("root.rx", "root_2.rx", "left_arm.rx", "left_arm_2.rx", "_12.rx")


def test_what_the_format_cannot_hold_is_refused_and_nothing_is_written(tmp_path):
    motion, path = walker(), tmp_path / "w.amc"
    frames = np.arange(len(motion))[:, None]
    for odd, words in (
        (with_channels(motion, ("hips.vx",), frames, ("m/s",)), "hips.vx"),
        (with_channels(motion, ("left_leg.tx",), frames, ("length",)), "only the root can move .* left_leg"),
    ):
        with pytest.raises(FormatError, match=words):
            write_motion(path, odd)
    assert not list(tmp_path.iterdir())


BROKEN_OFF = {"07_12": 244}
"""Trials that end within a frame, with the number of their whole frames."""


def test_every_shared_trial_is_read(cmu):
    started, frames = time.process_time(), 0
    files = sorted((cmu / "amc").glob("*.amc"))
    assert len(files) == 258
    for path in files:
        asf = cmu / "asf" / "35.asf" if path.stem == "39_14" else None
        if path.stem in BROKEN_OFF:
            with pytest.raises(FormatError, match="truncated"):
                amc.read(path)
        motion = amc.read(path, asf=asf, partial=path.stem in BROKEN_OFF)
        assert motion.values.shape[1] == 62
        assert len(motion) == BROKEN_OFF.get(path.stem, len(motion))
        height = np.ptp(positions(motion[:: max(1, len(motion) - 1)])[..., 1], axis=1)
        assert (height > 0.4 * motion.skeleton.height).all()
        frames += len(motion)
    assert frames == 343497
    assert time.process_time() - started < 60


SAME_JOINTS = {
    "Hips": "root",
    **{f"{side[0]}HipJoint": f"{side[0].lower()}hipjoint" for side in ("Left", "Right")},
    **{
        f"{side}{theirs}": f"{side[0].lower()}{ours}"
        for side in ("Left", "Right")
        for theirs, ours in (
            ("UpLeg", "femur"),
            ("Leg", "tibia"),
            ("Foot", "foot"),
            ("ToeBase", "toes"),
            ("ToeBase_end", "toes_end"),
            ("Shoulder", "clavicle"),
            ("Arm", "humerus"),
            ("ForeArm", "radius"),
            ("Hand", "wrist"),
            ("FingerBase", "hand"),
            ("HandIndex1", "fingers"),
            ("HandIndex1_end", "fingers_end"),
        )
    },
    **{f"{side}Thumb{end}": f"{side.lower()}thumb{end}" for side in "LR" for end in ("", "_end")},
    **{"LowerBack": "lowerback", "Spine": "upperback", "Spine1": "thorax", "Neck": "lowerneck", "Neck1": "upperneck"},
    **{"Head": "head", "Head_end": "head_end"},
}

ON_ONE_PLACE = {"lowerneck", "lclavicle", "rclavicle", "lhand", "lthumb", "rhand", "rthumb"}
"""Where several bones begin at the end of a bone, as at thorax and wrists, that conversion lets them begin at its
beginning: these joints have no offset there. All else is the same to the five decimals it writes."""


def test_positions_agree_with_other_peoples_conversion(cmu):
    trials = [path for path in sorted((cmu / "bvh").glob("*.bvh")) if path.stem != "11_01"]
    assert len(trials) == 12
    for path in trials:
        # the first frame is a T-pose, and 07_12 has another one
        theirs = bvh.read(path)[2 if path.stem == "07_12" else 1 :]
        ours = amc.read(cmu / "amc" / f"{path.stem}.amc", partial=path.stem in BROKEN_OFF)
        assert theirs.fps == ours.fps
        assert len(ours) == BROKEN_OFF.get(path.stem, len(theirs))
        joints = tuple(
            Joint(j.name, j.parent, (0.0, 0.0, 0.0) if j.name in ON_ONE_PLACE else j.offset, j.order, j.axis)
            for j in ours.skeleton.joints
        )
        without = Motion(ours.values, ours.channels, ours.units, ours.fps, Skeleton(joints))
        order = [without.skeleton.index(SAME_JOINTS[name]) for name in theirs.skeleton.names]
        assert sorted(order) == list(range(38))
        difference = positions(without)[:, order] - positions(theirs[: len(ours)])
        assert np.abs(difference).max() < 1e-5 * ours.skeleton.height


def test_the_root_turns_as_in_the_second_conversion(cmu):
    theirs = bvh.read(cmu / "bvh" / "11_01.bvh")[1:]
    ours = amc.read(cmu / "amc" / "11_01.amc")
    columns = ("root.rx", "root.ry", "root.rz")
    hips = tuple(name.replace("root", theirs.skeleton.names[0]) for name in columns)
    np.testing.assert_allclose(theirs.select(hips).values, ours.select(columns).values, atol=1e-3)
