import time

import numpy as np
import pytest
from figures import walker

from motet.errors import FormatError
from motet.formats import bvh, read_motion, write_motion
from motet.motion.kinematics import positions, with_channels
from motet.motion.motion import Motion
from motet.motion.rotations import axis_to_rotmat
from motet.motion.skeleton import Joint, Skeleton

SIX = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"

PLAIN = f"""HIERARCHY
ROOT Hips
{{
  OFFSET 0 0 0
  {SIX}
  JOINT Chest
  {{
    OFFSET 0 5 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {{
      OFFSET 0 3 0
    }}
  }}
}}
MOTION
Frames: 2
Frame Time: 0.033333
1 2 3 10 20 30 40 50 60
4 5 6 11 21 31 41 51 61
"""

END = "}\nMOTION\nFrames: 1\nFrame Time: 0.1\n"

CHEST = "CHANNELS 3 Zrotation Xrotation Yrotation\n    End"


@pytest.fixture
def read(tmp_path):
    def read(text, **options):
        path = tmp_path / "a.bvh"
        path.write_bytes(text.encode())
        return bvh.read(path, **options)

    return read


def turn(axis, degrees):
    return axis_to_rotmat(axis, np.radians(float(degrees)))


def test_a_plain_file(read):
    motion = read(PLAIN)
    assert motion.skeleton.names == ("Hips", "Chest", "Chest_end")
    assert motion.channels[:6] == ("Hips.tx", "Hips.ty", "Hips.tz", "Hips.rz", "Hips.rx", "Hips.ry")
    assert motion.units == ("length",) * 3 + ("deg",) * 6
    assert motion.values.tolist() == [[1, 2, 3, 10, 20, 30, 40, 50, 60], [4, 5, 6, 11, 21, 31, 41, 51, 61]]
    assert motion.fps == 30
    assert motion.skeleton.metres_per_unit is None
    hips = turn("z", 10) @ turn("x", 20) @ turn("y", 30)
    chest = hips @ turn("z", 40) @ turn("x", 50) @ turn("y", 60)
    places = [np.array([1.0, 2, 3])]
    places.append(places[0] + hips @ [0, 5, 0])
    places.append(places[1] + chest @ [0, 3, 0])
    np.testing.assert_allclose(positions(motion)[0], places, atol=1e-12)


ODDITIES = {
    "line endings of Windows": PLAIN.replace("\n", "\r\n"),
    "line endings of old Macs": PLAIN.replace("\n", "\r"),
    "a byte order mark": "\ufeff" + PLAIN,
    "tabs": PLAIN.replace("  ", "\t").replace(" ", "\t").replace("End\tSite", "End Site"),
    "blank lines": PLAIN.replace("\n", "\n\n") + "\n\n  \n",
    "no last line ending": PLAIN.rstrip("\n"),
    "braces on the same line": PLAIN.replace("\n{", " {").replace("\n  {", " {").replace("\n    {", "{"),
    "closing braces on the same line": PLAIN.replace("\n    }\n  }\n}", " } } }"),
    "end site in lower case": PLAIN.replace("End Site", "End site"),
    "end site in upper case": PLAIN.replace("End Site", "END SITE"),
    "an end site with a name": PLAIN.replace("End Site", "End Head"),
    "keywords in lower case": PLAIN.replace("CHANNELS", "channels")
    .replace("JOINT", "Joint")
    .replace("MOTION", "Motion"),
    "channels in lower case": PLAIN.replace("rotation", "Rotation").replace("Xposition", "xposition"),
    "exponents": PLAIN.replace("1 2 3 10", "1e0 +2.0E+00 30e-1 10."),
    "frames over several lines": PLAIN.replace("3 10 20", "3\n10 20"),
    "no blank after the colon": PLAIN.replace("Frames: 2", "Frames:2").replace("Time: ", "Time:\t"),
}


@pytest.mark.parametrize("name", ODDITIES)
def test_oddities_that_change_nothing(read, name):
    plain, odd = read(PLAIN), read(ODDITIES[name])
    assert odd.skeleton == plain.skeleton
    assert odd.channels == plain.channels
    np.testing.assert_array_equal(odd.values, plain.values)
    assert odd.fps == plain.fps


def test_euler_orders_are_each_joints_own(read):
    motion = read(PLAIN.replace(CHEST, CHEST.replace("Zrotation Xrotation Yrotation", "Yrotation Zrotation Xrotation")))
    assert [joint.order for joint in motion.skeleton.joints[:2]] == ["zxy", "yzx"]


def test_rotation_before_position(read):
    swapped = "CHANNELS 6 Zrotation Xrotation Yrotation Xposition Yposition Zposition"
    motion = read(PLAIN.replace(SIX, swapped))
    assert motion.select(("Hips.tx", "Hips.rz")).values[0].tolist() == [10, 1]


def test_six_channels_on_a_joint_replace_its_offset(read):
    text = PLAIN.replace(CHEST, f"{SIX}\n    End").replace("40 50 60", "0 7 0 40 50 60").replace("41 51", "0 8 0 41 51")
    chest = positions(read(text))[:, 1] - positions(read(text))[:, 0]
    np.testing.assert_allclose(np.linalg.norm(chest, axis=1), [7, 8])


def test_a_root_offset_is_replaced_where_the_root_has_a_position(read):
    moved = PLAIN.replace("OFFSET 0 0 0", "OFFSET 100 0 0")
    np.testing.assert_array_equal(positions(read(moved)), positions(read(PLAIN)))
    fixed = moved.replace(SIX, "CHANNELS 3 Zrotation Xrotation Yrotation")
    fixed = fixed.replace("1 2 3 10", "10").replace("4 5 6 11", "11")
    assert positions(read(fixed))[0, 0].tolist() == [100, 0, 0]


def test_joints_with_one_channel_and_with_none(read):
    one = read(
        PLAIN.replace(CHEST, "CHANNELS 1 Xrotation\n    End").replace("40 50 60", "50").replace("41 51 61", "51")
    )
    assert one.channels[-1] == "Chest.rx"
    assert one.skeleton.joints[1].order == "zyx"
    none = read(PLAIN.replace(CHEST, "CHANNELS 0\n    End").replace("40 50 60", "").replace("41 51 61", ""))
    assert none.values.shape == (2, 6)
    without = read(PLAIN.replace(CHEST, "End").replace("40 50 60", "").replace("41 51 61", ""))
    assert without.channels == none.channels


def test_no_channels_at_all(read):
    text = PLAIN.replace(SIX, "CHANNELS 0").replace(CHEST, "CHANNELS 0\n    End")
    motion = read(text[: text.index("1 2 3")])
    assert motion.values.shape == (2, 0)
    assert len(positions(motion)) == 2
    with pytest.raises(FormatError, match="and has no channels"):
        read(text[: text.index("1 2 3")].replace("Frames: 2", "Frames: 1" + "0" * 14))


def test_no_frames(read):
    motion = read(PLAIN[: PLAIN.index("1 2 3")].replace("Frames: 2", "Frames: 0"))
    assert motion.values.shape == (0, 9)
    assert positions(motion).shape == (0, 3, 3)


@pytest.mark.parametrize(
    ("root", "chest", "names"),
    [
        ("mixamorig:Hips", "Bip01 L Chest", ("mixamorig:Hips", "Bip01 L Chest", "Bip01 L Chest_end")),
        ("Hips", "Hips", ("Hips", "Hips_2", "Hips_2_end")),
    ],
)
def test_names_are_kept_and_equal_ones_told_apart(read, root, chest, names):
    motion = read(PLAIN.replace("ROOT Hips", f"ROOT {root}").replace("JOINT Chest", f"JOINT {chest}"))
    assert motion.skeleton.names == names
    assert motion.channels[-1] == f"{names[1]}.ry"


@pytest.mark.parametrize(
    ("time", "fps"),
    [
        (".0083333", 120),
        ("0.0333", 30),
        ("0.04", 25),
        ("8.3333e-03", 120),
        ("0.033366700033366704", 29.97),
        ("0.01666667", 60),
        ("2", 0.5),
        ("0.03", 1 / 0.03),
        ("0.017", 1 / 0.017),
        ("0.033", 30),
        ("0.0167", 60),
        ("0.1", 10),
    ],
)
def test_a_frame_time_is_a_whole_rate_as_far_as_it_tells(read, time, fps):
    assert read(PLAIN.replace("0.033333", time)).fps == pytest.approx(fps, rel=1e-12)


def test_fewer_frames_than_declared(read):
    text = PLAIN.replace("Frames: 2", "Frames: 5")
    with pytest.raises(FormatError, match="declares 5 frames but holds 2"):
        read(text)
    assert len(read(text, partial=True)) == 2


def test_more_frames_than_declared_are_taken_and_said(read, caplog):
    motion = read(PLAIN.replace("Frames: 2", "Frames: 1"))
    np.testing.assert_array_equal(motion.values, read(PLAIN).values)
    assert [record.message.partition(": ")[2] for record in caplog.records] == [
        "it declares 1 frames but holds 2: read them all"
    ]


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("31 41 51 61", "31 41", 20, "a frame has 9 values, this line has 7"),
        ("31 41 51 61", "31 41 51 6x", 20, "'6x' is not a finite number"),
        ("31 41 51 61", "31 41 51 nan", 20, "'nan' is not a finite number"),
        ("OFFSET 0 5 0", "OFFSET 0 5", 8, "three numbers, not 2"),
        ("CHANNELS 3 Z", "CHANNELS 4 Z", 9, "that many different channels"),
        ("Xrotation Yrotation\n    End", "Xrotation Zrotation\n    End", 9, "that many different channels"),
        ("Xposition", "Xscale", 5, "'Xscale': expected one of"),
        ("0.033333", "0", 18, "frame time 0 s is out of range"),
        ("0.033333", "fast", 18, "'fast' is not a finite number"),
        ("0.033333", "0,033333", 18, "'0,033333' is not a finite number: decimals are written with a point"),
        ("Frames: 2", "Frames: two", 17, "'Frames: N'"),
        ("0.033333", "1e-320", 18, "frame rate inf is out of range"),
        ("0.033333", "1e9", 18, "frame rate 1e-09 is out of range"),
        ("Frames: 2", "Frames: ²", 17, "'Frames: N'"),
        ("Frames: 2", "Frames: " + "9" * 5000, 17, "'Frames: 9999"),
        ("    OFFSET 0 5 0\n", "", 6, "joint 'Chest' has no OFFSET"),
        ("      OFFSET 0 3 0\n", "", 10, "joint 'Chest_end' has no OFFSET"),
        ("MOTION", "JOINT Other\n{\n}\nMOTION", 16, "expected trees of joints"),
        ("  OFFSET 0 5 0\n", "  SIZE 0 5 0\n", 8, "'SIZE 0 5 0' does not belong here"),
        ("\n}\nMOTION", "\nMOTION", 15, "'MOTION' does not belong here"),
        ("  JOINT Chest\n", "", 6, "'{' does not belong here"),
    ],
)
def test_faults_are_named_with_file_and_line(read, tmp_path, old, new, line, words):
    assert old in PLAIN
    with pytest.raises(FormatError, match=words) as error:
        read(PLAIN.replace(old, new, 1))
    assert (error.value.path, error.value.line) == (tmp_path / "a.bvh", line)


@pytest.mark.parametrize("text", ["", "MOTION", "hello", PLAIN[:150], PLAIN[: PLAIN.index("Frames")]])
def test_what_is_no_whole_file_is_refused(read, text):
    with pytest.raises(FormatError):
        read(text)


def test_a_file_that_breaks_off_gives_its_whole_frames_when_asked_to(read):
    broken, whole = PLAIN.rsplit(" ", 1)[0], read(PLAIN)
    with pytest.raises(FormatError, match="truncated"):
        read(broken)
    assert read(broken, partial=True).values.tolist() == whole.values[:1].tolist()


def test_partial_does_not_excuse_a_broken_frame_before_the_last(read):
    with pytest.raises(FormatError, match="truncated"):
        read(f"{PLAIN.rsplit(' ', 1)[0]}\n{PLAIN.rstrip().rsplit(chr(10), 1)[1]}\n", partial=True)


def test_many_joints_of_one_name_and_long_chains(read, tmp_path):
    started, node = time.process_time(), "JOINT a\n{\nOFFSET 0 1 0\nCHANNELS 0\n"
    wide = read("HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 0\n" + (node + "}\n") * 5000 + END)
    assert wide.skeleton.names[:3] == ("a", "a_2", "a_3")
    joints = [Joint("a", -1, (0, 0, 0)), *(Joint(f"a{i}", i, (0, 1, 0)) for i in range(2000))]
    chain = Motion(np.ones((1, 1)), ("a7.rx",), ("deg",), 30, Skeleton(tuple(joints)))
    write_motion(tmp_path / "chain.bvh", chain)
    assert (tmp_path / "chain.bvh").stat().st_size < 2_000_000
    assert same_positions(chain, read_motion(tmp_path / "chain.bvh"), chain.skeleton.names) < 1e-9
    assert time.process_time() - started < 10


def same_positions(one, other, names=None):
    places = positions(other)[:, [other.skeleton.index(name) for name in names or one.skeleton.names]]
    return np.abs(places - positions(one)).max() / one.skeleton.height


def test_any_skeleton_is_written_with_one_order_and_gives_the_same_positions(tmp_path):
    motion = walker(fps=29.97)
    write_motion(tmp_path / "w.bvh", motion)
    text = (tmp_path / "w.bvh").read_text()
    assert text.count("CHANNELS 6") == 1
    assert text.count("CHANNELS 3 Zrotation Yrotation Xrotation") == 8
    assert text.count("End Site") == 5
    again = read_motion(tmp_path / "w.bvh")
    assert same_positions(motion, again) < 1e-9
    assert again.fps == pytest.approx(29.97, rel=1e-12)
    # the hips turn by more than half a turn: angles go on
    assert np.abs(np.diff(again.values, axis=0)).max() < 60


@pytest.mark.parametrize("name", ["02_06", "09_07", "39_14"])
def test_amc_to_bvh_to_bvh(clips, tmp_path, name):
    motion = read_motion(clips / f"{name}.amc")
    write_motion(tmp_path / "a.bvh", motion)
    first = read_motion(tmp_path / "a.bvh")
    assert same_positions(motion, first) < 1e-4
    # joints that have the file's order and no axis of their own come through as they are
    columns = tuple(f"root.{kind}" for kind in ("tx", "ty", "tz", "rx", "ry", "rz"))
    np.testing.assert_array_equal(first.select(columns).values, motion.select(columns).values)
    write_motion(tmp_path / "b.bvh", first)
    assert (tmp_path / "b.bvh").read_bytes() == (tmp_path / "a.bvh").read_bytes()


def test_a_motion_from_bvh_as_amc_and_back(tmp_path):
    write_motion(tmp_path / "a.bvh", walker())
    first = read_motion(tmp_path / "a.bvh")
    write_motion(tmp_path / "b.amc", first)
    names = ("root", *first.skeleton.names[1:])
    assert same_positions(first, read_motion(tmp_path / "b.amc"), names) < 1e-9


def test_a_translation_that_stays_becomes_the_offset_and_one_that_moves_stays(tmp_path):
    motion = walker()
    still = with_channels(motion, ("head.ty",), np.full((len(motion), 1), 0.5), ("length",))
    write_motion(tmp_path / "s.bvh", still)
    assert (tmp_path / "s.bvh").read_text().count("CHANNELS 6") == 1
    assert same_positions(still, read_motion(tmp_path / "s.bvh")) < 1e-9
    moving = with_channels(motion, ("head.ty",), np.linspace(0.3, 0.5, len(motion))[:, None], ("length",))
    write_motion(tmp_path / "m.bvh", moving)
    assert (tmp_path / "m.bvh").read_text().count("CHANNELS 6") == 2
    assert same_positions(moving, read_motion(tmp_path / "m.bvh")) < 1e-9


def test_angles_alone_are_written_at_the_origin(tmp_path):
    motion = walker()
    angles = motion.select(motion.channels[3:])
    write_motion(tmp_path / "a.bvh", angles)
    assert not read_motion(tmp_path / "a.bvh").values[:, :3].any()


def test_names_become_plain_and_different(tmp_path):
    joints = (Joint("a:b", -1, (0, 0, 0)), Joint("a b", 0, (0, 1, 0)), Joint("a b_end", 1, (0, 1, 0)))
    motion = Motion(np.ones((1, 2)), ("a:b.rx", "a b.rx"), ("deg",) * 2, 30, Skeleton(joints))
    write_motion(tmp_path / "n.bvh", motion)
    again = read_motion(tmp_path / "n.bvh")
    assert again.skeleton.names == ("a_b", "a_b_2", "a_b_2_end")
    assert same_positions(motion, again, again.skeleton.names) == 0


def test_what_the_format_cannot_hold_is_refused_by_name(tmp_path):
    motion = walker()
    odd = with_channels(motion, ("hips.vx", "hips.ry"), np.zeros((len(motion), 2)), ("m/s", "deg/s"))
    with pytest.raises(FormatError, match=r"hips\.vx \[m/s\], hips\.ry \[deg/s\]"):
        write_motion(tmp_path / "o.bvh", odd)
    assert not list(tmp_path.iterdir())


def test_other_peoples_files_come_through_bvh_and_amc(cmu, tmp_path):
    files = sorted((cmu / "bvh").glob("*.bvh"))
    assert len(files) == 13
    for path in files:
        motion = bvh.read(path)
        write_motion(tmp_path / "a.bvh", motion)
        assert same_positions(motion, read_motion(tmp_path / "a.bvh")) < 1e-6
        write_motion(tmp_path / "a.amc", motion)
        names = ("root", *motion.skeleton.names[1:])
        assert same_positions(motion, read_motion(tmp_path / "a.amc"), names) < 1e-6


def test_numbers_in_any_notation_and_between_any_blanks(tmp_path):
    path, values = tmp_path / "a.bvh", ["1.5", "-2e-1", "3" + "0" * 40, "0." + "1" * 50]
    for blank in (" ", "\t", "\u00a0"):
        write_motion(path, walker(frames=1))
        head = path.read_text().partition("MOTION")[0]
        width = head.count("position") + head.count("rotation")
        row = [values[n % 4] for n in range(width)]
        path.write_text(f"{head}MOTION\nFrames: 2\nFrame Time: 0.1\n{blank.join(row)}\n{blank.join(row)}\n")
        np.testing.assert_array_equal(read_motion(path).values, [[float(word) for word in row]] * 2)
