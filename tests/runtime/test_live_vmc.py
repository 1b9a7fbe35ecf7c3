import socket
from typing import Any

import numpy as np
import pytest

from motet.errors import OutputError, ScriptError
from motet.figures.humanoid.bones import BONES, HUMANOID
from motet.motion.rotations import quat_to_rotmat
from motet.steering.model import SteerModel
from motet.steering.pose import Pose

pytest.importorskip("pythonosc", reason="the extra live is not installed")
from pythonosc.osc_packet import OscPacket

from motet.live.vmc import Sender, run_script

MIRROR = np.diag([-1.0, 1.0, 1.0])
"""From our axes to Unity's, and back."""


def received(model: SteerModel, script: str, **settings: Any) -> tuple[list[tuple[str, list[Any]]], list[Pose]]:
    """What comes of a script on a socket, and the poses that were sent."""
    poses: list[Pose] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5)
        sender = Sender("127.0.0.1", receiver.getsockname()[1])
        found: list[tuple[str, list[Any]]] = []

        def send(pose: Pose, seconds: float) -> None:
            sender.send(pose, seconds)
            poses.append(pose)
            for _ in range(2):
                data = receiver.recv(4096)
                assert len(data) < 1400  # a datagram in one piece
                found.extend((part.message.address, list(part.message.params)) for part in OscPacket(data).messages)

        run_script(model, script, send, rate=1e6, **settings)
    return found, poses


def test_messages_decode_to_the_pose(steer_model: SteerModel) -> None:
    found, poses = received(steer_model, "walk 1s, turn left 90 .5s, run .5s", repeats=2)
    count = 3 + len(BONES)
    assert (len(poses), len(found)) == (120, 120 * count)
    for number, pose in enumerate(poses):
        said = found[number * count : (number + 1) * count]
        assert said[0] == ("/VMC/Ext/OK", [1])
        assert said[1] == ("/VMC/Ext/T", [pytest.approx((number + 1) / 30)])
        assert {address for address, _ in said[3:]} == {"/VMC/Ext/Bone/Pos"}
        np.testing.assert_allclose(places_of(said[2], said[3:]), pose.positions()[0], atol=1e-5)
    assert np.hypot(*poses[-1].ground[0, :2]) > 1


def places_of(root: tuple[str, list[Any]], bones: list[tuple[str, list[Any]]]) -> np.ndarray[Any, np.dtype[Any]]:
    """Where joints are in our world, by Unity's forward kinematics; the tips lie as the humanoid has them."""
    assert (root[0], root[1][0]) == ("/VMC/Ext/Root/Pos", "root")
    local = {name: (np.array(rest[:3]), quat_to_rotmat(np.array(rest[3:]))) for _, (name, *rest) in bones}
    assert {"Hips", "LeftUpperLeg", "RightToes", "UpperChest", "LeftShoulder", "Head"} <= local.keys()
    above = np.array(root[1][1:4]), quat_to_rotmat(np.array(root[1][4:]))
    places, turned = [], []
    for joint in HUMANOID.joints:
        name = joint.name[0].upper() + joint.name[1:]
        place, turn = local.get(name, (MIRROR @ joint.offset, np.eye(3)))
        start, frame = above if joint.parent < 0 else (places[joint.parent], turned[joint.parent])
        places.append(start + frame @ place)
        turned.append(frame @ turn)
    return np.array(places) @ MIRROR


def test_the_left_is_at_minus_x(steer_model: SteerModel) -> None:
    found, _ = received(steer_model, "walk .1s", repeats=1)
    bones = {params[0]: params[1:4] for address, params in found if address.endswith("Bone/Pos")}
    assert bones["LeftUpperArm"][0] < 0 < bones["RightUpperArm"][0]


def test_a_pose_for_which_the_system_has_no_room_is_lost(
    steer_model: SteerModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    sender = Sender("127.0.0.1", 39539)

    def full(_: object) -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(sender._client, "send", full)
    sender.send(steer_model.start().tick(), 0.0)


def test_what_cannot_be_sent(steer_model: SteerModel) -> None:
    with pytest.raises(OutputError, match="cannot send to no such place:39539"):
        Sender("no such place", 39539)
    with pytest.raises(ScriptError, match="unknown order 'swim'"):
        run_script(steer_model, "swim 3s", lambda *_: None)
