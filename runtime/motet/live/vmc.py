"""Poses as messages of the Virtual Motion Capture protocol (https://protocol.vmc.info), which avatars' programs take.

The protocol is Open Sound Control over UDP, with the axes of Unity: left-handed, y up, a figure faces z and has its
left at -x. So x and the turns about y and z change their signs. It needs the library python-osc, of the extra ``live``.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

import numpy as np

from motet.bundle.graph import Floats
from motet.errors import OutputError
from motet.figures.humanoid import BONES, HUMANOID
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.scripts import parse_orders

try:
    from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
    from pythonosc.osc_message_builder import build_msg
    from pythonosc.udp_client import UDPClient
except ImportError as error:
    raise ImportError("motet.live.vmc needs python-osc: install the extra with  pip install 'motet[live]'") from error

Message = tuple[str, list[str | int | float]]
"""An address and its values."""

BONE_OFFSETS = HUMANOID.offsets[[HUMANOID.index(bone) for bone in BONES]].astype(np.float32)
"""Where the bones are (J, 3) in their parents' frames; that of the hips depends on the pose."""


def messages(pose: Pose, seconds: float) -> list[Message]:
    """The messages of the first character of a pose: that there is one, the time, the root, and the bones."""
    root: list[str | int | float] = ["root", *_place(pose.place[0]), *_turn(pose.heading[0])]
    messages_of_pose: list[Message] = [
        ("/VMC/Ext/OK", [1]),
        ("/VMC/Ext/T", [float(seconds)]),
        ("/VMC/Ext/Root/Pos", root),
    ]
    places = [np.array([0, pose.height[0], 0], dtype=np.float32), *BONE_OFFSETS[1:]]  # the hips are the first bone
    for bone, place, quat in zip(BONES, places, pose.rotations[0], strict=True):
        name = bone[0].upper() + bone[1:]  # as Unity calls it (HumanBodyBones)
        messages_of_pose.append(("/VMC/Ext/Bone/Pos", [name, *_place(place), *_turn(quat)]))
    return messages_of_pose


def _place(place: Floats) -> list[float]:
    x, y, z = place.tolist()
    return [-x, y, z]


def _turn(quat: Floats) -> list[float]:
    x, y, z, w = quat.tolist()
    return [x, -y, -z, w]


class Sender:
    """Sends poses to a host and port. OutputError where the host has no address, or nothing can be sent to it."""

    def __init__(self, host: str, port: int) -> None:
        self.place = f"{host}:{port}"
        with self._named():
            self._client = UDPClient(host, port)

    def send(self, pose: Pose, seconds: float) -> None:
        """Send the messages of a pose at a time, 14 in a datagram, so that it has less than 1,400 bytes."""
        pose_messages = messages(pose, seconds)
        with self._named():
            for start in range(0, len(pose_messages), 14):
                bundle = OscBundleBuilder(IMMEDIATELY)
                for address, values in pose_messages[start : start + 14]:
                    bundle.add_content(build_msg(address, values))
                self._client.send(bundle.build())

    @contextmanager
    def _named(self) -> Iterator[None]:
        try:
            yield
        except BlockingIOError:
            return  # the system has no room for more now: this pose is lost, as datagrams are
        except OSError as error:
            raise OutputError(f"cannot send to {self.place}: {error.strerror or error}") from error


def run_script(
    model: SteerModel,
    script: str,
    send: Callable[[Pose, float], None],
    *,
    repeats: int | None = None,
    rate: float | None = None,
) -> None:
    """Let a figure follow a script (:mod:`motet.steering.scripts`) again and again, until Ctrl-C; each pose is sent
    with its time in seconds.

    repeats: how often, for ever by default. rate: ticks a second, by default the model's. ScriptError for a script that
    does not parse.
    """
    orders = parse_orders(script, model.gaits)
    session = model.start(orders[0].gait)
    start = time.monotonic()
    ticks = 0
    for _ in count() if repeats is None else range(repeats):
        for pose in session.follow(orders):
            ticks += 1
            send(pose, ticks / model.fps)
            time.sleep(max(0.0, start + ticks / (rate or model.fps) - time.monotonic()))
