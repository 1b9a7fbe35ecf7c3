"""Styles of steered figures: held to the key poses that they are made of, laid over the same walk."""

from dataclasses import replace

import numpy as np
import pytest

import motet.keyed
from motet import ControlError, SteerModel, SteerSession
from motet.errors import ScriptError
from motet.figures.humanoid import HUMANOID
from motet.live.protocol import ClientSession
from motet.motion.kinematics import positions
from motet.motion.rotations import Array
from motet.steering.pose import Pose
from motet.steering.scripts import parse_orders
from motet.steering.styles import PACES, STYLE_NAMES, STYLES

HELD = {
    "old": "walk like an old person",
    "tiptoe": "walk on tiptoe",
    "proud": "walk proudly",
    "sad": "walk sadly",
    "angry": "walk angrily",
    "cold": "walk in the cold",
    "carrying": "carry something",
    "pushing": "push a cart",
}
"""Styles of one pose, and the acts by key poses that they come from."""

SOLE = HUMANOID.index("leftToes"), HUMANOID.index("rightToes")
ANKLES = HUMANOID.index("leftFoot"), HUMANOID.index("rightFoot")


def walking(model: SteerModel, *styles: str) -> SteerSession:
    """Figures that walk straight ahead, one in each style."""
    session = model.start(characters=len(styles), hold_feet=False)
    session.control(speed=1.2, style=styles)
    return session


def ticks(session: SteerSession, count: int) -> list[Pose]:
    return [session.tick() for _ in range(count)]


def joints(poses: list[Pose], figure: int) -> Array:
    """Places (T, J', 3) of the joints of a figure."""
    places: Array = np.stack([pose.positions()[figure] for pose in poses])
    return places


@pytest.mark.parametrize("name", HELD)
def test_a_style_is_its_key_pose_laid_over_the_walk(name: str, steer_model: SteerModel) -> None:
    session = walking(steer_model, "none", name)
    poses = ticks(session, 120)
    plain = steer_model.contract.motion(session.frames_of(poses)[0], plant=False)
    act = motet.keyed.ours()[HELD[name]]
    (key,) = act.keys
    held = replace(key, at=(0.0, 0.0), hold=(3.5, 3.5))
    keyed = replace(act, keys=(held,), repeat=None, speed=(1.0, 1.0), amplitude=(1.0, 1.0), mirrored=False)
    expected = keyed.motion(plain[: len(poses)], strict=False)
    # once the style has come: arms are those of one who stood, whose places for the hands sway otherwise
    apart = np.linalg.norm(joints(poses, 1)[45:100] - positions(expected)[45:100], axis=2)
    of_arms = np.array(["Arm" in joint or "Hand" in joint for joint in HUMANOID.names])
    assert apart[:, ~of_arms].max() < 0.01
    assert apart[:, of_arms].mean() < 0.08
    assert np.linalg.norm(joints(poses, 1) - joints(poses, 0), axis=2)[45:].mean() > 2 * apart.mean()


def test_who_goes_in_a_style_steps_where_others_do(steer_model: SteerModel) -> None:
    names = [name for name in STYLES if name not in {"tiptoe", "marching"}]
    poses = ticks(walking(steer_model, "none", *names), 90)
    plain = joints(poses, 0)[:, ANKLES]
    for figure, name in enumerate(names, start=1):
        ankles = joints(poses, figure)[:, ANKLES]
        # a leg that was straight bends softly
        assert np.linalg.norm(ankles - plain, axis=2).max() < 0.03, name


def test_heels_are_up_on_tiptoe_and_knees_in_marching(steer_model: SteerModel) -> None:
    poses = ticks(walking(steer_model, "none", "tiptoe", "marching"), 120)[40:]
    plain, tiptoe, marching = (joints(poses, figure) for figure in range(3))
    stands = np.stack([pose.contacts[1] > 0.9 for pose in poses])
    above_toes = (tiptoe[:, ANKLES, 1] - tiptoe[:, SOLE, 1])[stands]
    assert above_toes.min() > (plain[:, ANKLES, 1] - plain[:, SOLE, 1])[stands].min() + 0.04
    knees = HUMANOID.index("leftLowerLeg"), HUMANOID.index("rightLowerLeg")
    higher = marching[:, knees, 1].max(axis=0) - plain[:, knees, 1].max(axis=0)
    assert higher.min() > 0.1


def test_who_limps_leans_to_the_foot_that_stands(steer_model: SteerModel) -> None:
    poses = ticks(walking(steer_model, "limping"), 150)[60:]
    head = joints(poses, 0)[:, HUMANOID.index("head")]
    left = np.array([pose.contacts[0, 0] - pose.contacts[0, 1] for pose in poses])
    aside = head[:, 0] - np.array([pose.ground[0, 0] for pose in poses])  # faces z, so x is to the left
    lag = 4  # ticks in which the body follows
    assert np.corrcoef(aside[lag:], left[:-lag])[0, 1] > 0.7


def test_styles_come_change_and_go_softly_and_leave_nothing(steer_model: SteerModel) -> None:
    session = walking(steer_model, "none", "none")
    ticks(session, 30)
    poses = []
    for style in ("tray", "drunk", "none"):
        session.control(style=["none", style])
        assert session.styles == ["none", style]
        poses += ticks(session, 60)
    speeds = np.abs(np.diff(joints(poses, 1) - joints(poses, 0), axis=0)).max() * steer_model.fps
    assert 0.5 < speeds < 6
    np.testing.assert_array_equal(joints(poses[-5:], 1), joints(poses[-5:], 0))


def test_acts_go_before_styles(steer_model: SteerModel) -> None:
    session = walking(steer_model, "none", "old", "none")
    ticks(session, 45)
    session.act("wave", ids=[1, 2])
    plain, old, waving = (joints(ticks(session, 40), 0), *(joints(ticks(session, 1), at) for at in (1, 2)))
    head, hand = HUMANOID.index("head"), HUMANOID.index("rightHand")
    assert old[0, head, 1] < waving[0, head, 1] - 0.1
    assert waving[0, hand, 1] > plain[-1, hand, 1] + 0.3
    # the whole body shows the act alone
    session.act("bow", ids=[1, 2], upper=False)
    poses = ticks(session, 40)
    np.testing.assert_allclose(joints(poses[-1:], 1)[..., 1], joints(poses[-1:], 2)[..., 1], atol=0.01)


def test_every_door_knows_styles(steer_model: SteerModel) -> None:
    usual = steer_model.usual["walk"]
    limps = PACES[STYLE_NAMES.index("limping")]

    def speed(session: SteerSession) -> float:
        return float(np.hypot(*session.target[0, :2]))

    session = steer_model.start()
    # in a script, at its own pace where no speed is said
    session.run("walk 1s style limping, turn left 90")
    assert (session.styles, speed(session)) == (["limping"], pytest.approx(limps * usual))
    session.run("walk 1s")
    assert session.styles == ["none"]
    # in a sentence
    assert session.say("limp").caption == "walk (limping)"
    assert (session.styles, speed(session)) == (["limping"], pytest.approx(limps * usual))
    assert session.say("turn left").steps
    assert session.styles == ["limping"]
    session.say("walk normally")
    assert session.styles == ["none"]
    # in a message
    client = ClientSession(steer_model)
    client.handle('{"type": "control", "style": "sad", "speed": 1}')
    assert client.session.styles == ["sad"]


@pytest.mark.parametrize("style", ["swimming", 3, ["limping"], ["limping", None]])
def test_a_style_that_is_none_is_refused_and_changes_nothing(steer_model: SteerModel, style: object) -> None:
    session = steer_model.start(characters=2)
    with pytest.raises(ControlError, match=r"unknown style|1 styles do not fit 2"):
        session.control(speed=1.2, style=style)  # type: ignore[arg-type]
    assert session.styles == ["none", "none"]
    assert not session.target.any()


def test_a_script_marks_a_style_that_is_none() -> None:
    with pytest.raises(ScriptError, match="unknown style 'fast'; expected one of none, limping") as caught:
        parse_orders("walk 3s style fast", ("walk",))
    assert caught.value.position == 14
    with pytest.raises(ScriptError, match="takes seconds, speed and facing"):
        parse_orders("go to 1 2 style sad", ("walk",))
