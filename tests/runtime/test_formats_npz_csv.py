import io
import pickle

import numpy as np
import pytest
from figures import walker

from motet.errors import FormatError
from motet.formats import csv, npz, read_motion, write_motion
from motet.motion.motion import Motion

AWKWARD = Motion(
    [[1 / 3, -0.0, 1e-300], [1e300, 0.1, 2.0]], ("a,b.rx", 'say "hi".tx', "c [1].vx"), ("rad", "m", "m/s"), 29.97
)


def same(one, other):
    np.testing.assert_array_equal(one.values, other.values)
    return (one.channels, one.units, one.fps) == (other.channels, other.units, other.fps)


@pytest.mark.parametrize("motion", [walker(), walker()[:0], walker(metres_per_unit=None), AWKWARD])
def test_npz_gives_back_everything(tmp_path, motion):
    write_motion(tmp_path / "a.npz", motion)
    again = read_motion(tmp_path / "a.npz")
    assert same(again, motion)
    assert again.skeleton == motion.skeleton


def savez(**arrays):
    content = io.BytesIO()
    np.savez(content, **arrays)
    return content.getvalue()


def with_byte(content, place, value):
    """A zip with another byte in the directory's entry of its first file."""
    place += content.index(b"PK\1\2")
    return content[:place] + bytes([value]) + content[place + 1 :]


def with_size(content, size):
    """A zip whose directory announces so many bytes of its first file, unpacked."""
    place = content.index(b"PK\1\2") + 24
    return content[:place] + size.to_bytes(4, "little") + content[place + 4 :]


WHOLE = {
    "values": np.zeros((2, 1)),
    "channels": np.array(["a"]),
    "units": np.array(["deg"]),
    "fps": 30.0,
    "skeleton": "",
}

BAD_NPZ = {
    "nothing": b"",
    "text": b"hello",
    "a pickle": pickle.dumps([1, 2, 3]),
    "a lone array": b"\x93NUMPY",
    "a broken zip": savez(**WHOLE)[:-30],
    "damaged arrays": savez(**WHOLE).replace(b"\x93NUMPY", b"\x93NAMPY"),
    "another npz": savez(x=np.zeros(3)),
    "an object array": savez(**{**WHOLE, "channels": np.array([{}], dtype=object)}),
    "one channel too few": savez(**{**WHOLE, "values": np.zeros((2, 2))}),
    "no number": savez(**{**WHOLE, "values": np.array([[np.nan], [0.0]])}),
    "no frame rate": savez(**{**WHOLE, "fps": np.zeros(3)}),
    "a broken skeleton": savez(**{**WHOLE, "skeleton": "{"}),
    "no skeleton": savez(**{**WHOLE, "skeleton": "{}"}),
    "complex numbers": savez(**{**WHOLE, "values": np.zeros((2, 1), complex)}),
    "text for values": savez(**{**WHOLE, "values": np.array([["1"], ["2"]])}),
    "a deep skeleton": savez(**{**WHOLE, "skeleton": "[" * 100_000}),
    "an unknown method": with_byte(savez(**WHOLE), 10, 99),
    "an encrypted array": with_byte(savez(**WHOLE), 8, 1),
    "a newer version": with_byte(savez(**WHOLE), 6, 0xFF),
    "a name that is not the UTF-8 that it is said to be": with_byte(with_byte(savez(**WHOLE), 9, 8), 46, 0xFF),
    "a shape of 10^14 rows": savez(**WHOLE).replace(
        b"'shape': (2, 1), }" + b" " * 13, b"'shape': (200000000000000, 1), }"
    ),
    "no character": savez(**{**WHOLE, "channels": np.array([0x200061], np.uint32).view("U1")}),
    "half a character": savez(**{**WHOLE, "channels": np.array([0xD800], np.uint32).view("U1")}),
    "a flat list": savez(**{**WHOLE, "values": np.zeros(2)}),
}


@pytest.mark.parametrize("name", BAD_NPZ)
def test_npz_refuses_what_is_no_motion(tmp_path, name):
    path = tmp_path / "b.npz"
    path.write_bytes(BAD_NPZ[name])
    with pytest.raises(FormatError) as error:
        npz.read(path)
    assert error.value.path == path


@pytest.mark.parametrize(
    ("arrays", "said"),
    [
        (
            ("posed_joints", "local_rot_mats", "root_positions"),
            "Kimodo's npz, which has no skeleton: convert it to BVH",
        ),
        (("fps", "joint_pos", "body_pos_w", "body_quat_w"), "a robot's motion"),
        (("fps", "root_pos", "root_rot", "dof_pos"), "the motor angles of a robot"),
    ],
)
def test_npz_of_other_programs_is_called_what_it_is(tmp_path, arrays, said):
    path = tmp_path / "b.npz"
    path.write_bytes(savez(**{name: np.zeros((3, 3)) for name in arrays}))
    with pytest.raises(FormatError, match=said):
        npz.read(path)


def test_an_array_that_would_not_fit_into_memory_is_not_unpacked(tmp_path):
    path = tmp_path / "b.npz"
    path.write_bytes(with_size(savez(**WHOLE), 2**29 + 1))
    with pytest.raises(FormatError, match="has 536870913 bytes: expected at most 536870912"):
        npz.read(path)


@pytest.mark.parametrize("motion", [walker(), walker()[:0], AWKWARD])
def test_csv_gives_back_the_values_and_no_skeleton(tmp_path, motion):
    write_motion(tmp_path / "a.csv", motion)
    again = read_motion(tmp_path / "a.csv")
    assert same(again, motion)
    assert again.skeleton is None


def test_csv_reads_as_a_table(tmp_path):
    write_motion(tmp_path / "a.csv", Motion([[1.5, 2.0], [3.0, 4.0]], ("a.rx", "a.ty"), ("deg", "m"), 4))
    expected = "# motet motion, fps 4.0\ntime,a.rx [deg],a.ty [m]\n0.0,1.5,2.0\n0.25,3.0,4.0\n"
    assert (tmp_path / "a.csv").read_text() == expected


def test_csv_from_elsewhere_has_its_rate_in_its_times(tmp_path):
    path = tmp_path / "b.csv"
    path.write_text("time,a.rx [deg]\r\n0,1\r\n0.02,2\r\n0.04,3\r\n")
    motion = csv.read(path)
    assert motion.fps == pytest.approx(50)
    assert motion.values.ravel().tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("", None, "the header must be"),
        ("Format Version,1.23,Take Name,Take\n", None, "this is a table of Motive"),
        ("time;a.rx [deg]\n0,0;1,5\n", None, "separated by semicolons"),
        ("# motet motion, fps 30\n0,1\n", None, "the header must be"),
        ("time,a.rx\n0,1\n", None, "the header must be"),
        ("a,b\n0,one\n", None, "the header must be"),  # before rows are read
        ("# motet motion, fps 30\ntime,a.rx [deg]\n0,1\n1\n", 4, "expected 2 values, not 1"),
        ("# motet motion, fps 30\ntime,a.rx [deg]\n0,one\n", 3, "'one' is not a finite number"),
        ("# motet motion, fps 30\ntime,a.rx [deg]\n0,inf\n", 3, "'inf' is not a finite number"),
        ("# motet motion, fps fast\ntime,a.rx [deg]\n0,1\n", 1, "'fast' is not a finite number"),
        ("# motet motion, fps -1\ntime,a.rx [deg]\n0,1\n", 1, "frame rate -1 is out of range"),
        ("# motet motion, fps 30\ntime,a.rx [gon]\n0,1\n", None, "one unit per channel"),
        ("# motet motion, fps 30\ntime,a.rx [deg],a.rx [deg]\n0,1,2\n", None, "must be unique"),
        ("# motet motion, fps 0\ntime,a.rx [deg]\n0,1\n", 1, "frame rate 0 is out of range"),
        (f"time,a.rx [deg]\n0,{'1' * 200_000}\n", 2, "not a table: field larger"),
        ("time,a.rx [deg]\n-1e308,1\n1e308,1\n", None, "frame rate 0 is out of range"),
        ("time,a.rx [deg]\n0,1\n", None, "evenly spaced"),
        ("time,a.rx [deg]\n0,1\n1,1\n5,1\n", None, "evenly spaced"),
        ("time,a.rx [deg]\n1,1\n0,1\n", None, "evenly spaced"),
    ],
)
def test_csv_names_what_is_wrong(tmp_path, text, line, words):
    path = tmp_path / "c.csv"
    path.write_text(text)
    with pytest.raises(FormatError, match=words) as error:
        read_motion(path)
    assert (error.value.path, error.value.line) == (path, line)
