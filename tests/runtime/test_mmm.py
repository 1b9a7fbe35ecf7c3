import time
from pathlib import Path

import numpy as np
import pytest
from memory import traced

from motet.errors import FormatError
from motet.formats import mmm, read_motion

FRAME = """      <MotionFrame>
        <Timestep>{time}</Timestep>
        <RootPosition>{place}</RootPosition>
        <RootRotation>0.1 0.2 0.3</RootRotation>
        <JointPosition>{angles} </JointPosition>
        <JointVelocity>0 0 </JointVelocity>
      </MotionFrame>
"""


def xml(*frames: str, joints: tuple[str, ...] = ("LKx_joint", "RKx_joint"), name: str = "first") -> str:
    order = "".join(f"<Joint name='{joint}'/>" for joint in joints)
    motion = f"  <Motion name='{name}'>\n    <JointOrder>{order}</JointOrder>\n    <MotionFrames>\n"
    return f"<?xml version='1.0'?>\n<MMM>\n{motion}{''.join(frames)}    </MotionFrames>\n  </Motion>\n</MMM>\n"


def frame(time: float, angles: str = "0.5 -0.25", place: str = "1000 2000 900") -> str:
    return FRAME.format(time=time, angles=angles, place=place)


def write(folder: Path, text: str) -> Path:
    path = folder / "00001_mmm.xml"
    path.write_text(text)
    return path


def test_angles_come_in_the_files_order_in_radians(tmp_path: Path) -> None:
    motion = read_motion(write(tmp_path, xml(frame(0), frame(0.01, "0.75 1e-3"), frame(0.02))))
    assert motion.fps == 100
    assert motion.channels[6:] == ("LKx_joint", "RKx_joint")
    assert motion.units[6:] == ("rad", "rad")
    np.testing.assert_array_equal(motion.values[:, 6:], [[0.5, -0.25], [0.75, 0.001], [0.5, -0.25]])
    assert motion.skeleton is None


def test_the_root_is_turned_to_y_up_and_metres(tmp_path: Path) -> None:
    motion = read_motion(write(tmp_path, xml(frame(0), frame(0.01))))
    assert motion.units[:6] == ("m",) * 3 + ("rad",) * 3
    # MMM: 2 m along y, where figures face, 1 m to their right, 0.9 m high; roll 0.1, pitch 0.2, yaw 0.3
    np.testing.assert_allclose(motion.values[0, :6], [-1, 0.9, 2, -0.1, 0.3, 0.2])


def test_only_the_first_motion_is_read(tmp_path: Path) -> None:
    first, second = xml(frame(0), frame(0.01)), xml(frame(0, "9 9"), frame(0.5, "9 9"), name="second")
    both = first.replace("</MMM>\n", second[second.index("  <Motion ") :])
    motion = read_motion(write(tmp_path, both))
    assert motion.fps == 100
    assert motion.values[:, 6:].max() == 0.5


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (xml(frame(0), frame(0.01)).replace("</JointPosition>", "</Joint>", 1), r"00001_mmm\.xml, line 10: .* XML"),
        (xml(frame(0), frame(0.01))[:-300], r", line \d+: not XML, or truncated"),
        ("no xml at all", ", line 1: not XML, or truncated"),
        (xml(frame(0)).replace("'1.0'", "'1.0' encoding='foo'"), ", line 1: unknown encoding"),
        (xml(frame(0)).replace("'1.0'", "'1.0' encoding='shift_jis'"), ", line 1: unknown encoding"),
        (xml(frame(0), "<JointOrder/>", frame(0.01)), "one JointOrder"),
        (xml(frame(0), frame(1e-9)), "frame rate 1e.09 is out of range"),
        (xml(frame(-1e308), frame(1e308)), "frame rate 0 is out of range"),
        ("<MMM><Model/></MMM>", "expected a Motion with JointOrder"),
        (xml(), "expected a Motion with JointOrder and MotionFrames"),
        (xml(frame(0), frame(0.01, "1 2 3")), "frame 1: JointPosition needs 2 values, not 3"),
        (xml(frame(0), frame(0.01, "1 nan")), "frame 1: JointPosition: 'nan' is not a finite number"),
        (xml(frame(0), frame(0.01, place="1 2")), "frame 1: RootPosition needs 3 values"),
        (xml(frame(0)), "cannot tell the frame rate from a single frame"),
        (xml(frame(0), frame(0.01), frame(0.02), frame(0.04), frame(0.05)), "frame 3: the time steps are uneven"),
        (xml(frame(0), frame(0)), "time steps are uneven"),
        (xml(frame(0), frame(0.01), joints=("a", "a")), "must be unique and not empty"),
    ],
)
def test_what_is_no_motion_is_refused_with_its_place(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(FormatError, match=reason):
        read_motion(write(tmp_path, text))


def test_an_attribute_of_20_megabytes_takes_no_time(tmp_path: Path) -> None:
    started = time.process_time()
    motion = read_motion(write(tmp_path, xml(frame(0), frame(0.01), name="n" * 5_000_000)))
    assert len(motion) == 2
    assert time.process_time() - started < 10


def test_elements_inside_each_other_are_bounded(tmp_path: Path) -> None:
    for depth, reason in ((64, "truncated"), (65, "over 64 elements inside each other")):
        with pytest.raises(FormatError, match=reason):
            read_motion(write(tmp_path, "<a>" * depth))


def test_elements_before_a_frame_are_bounded_and_those_of_all_frames_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mmm, "MAX_ELEMENTS", 50)
    assert len(read_motion(write(tmp_path, xml(*(frame(i / 100) for i in range(30)))))) == 30
    for more in ("<b/>" * 50, f"<MotionFrame>{'<b/>' * 50}</MotionFrame>"):
        with pytest.raises(FormatError, match="over 50 elements before a frame"):
            read_motion(write(tmp_path, xml(frame(0), more, frame(0.01))))


def test_frames_that_were_read_are_dropped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mmm, "PIECE", 2**14)
    path = write(tmp_path, xml(*(frame(i / 100) for i in range(1_000))))
    # all elements at once take several times as much
    assert traced(lambda: read_motion(path)) < 3 * path.stat().st_size
