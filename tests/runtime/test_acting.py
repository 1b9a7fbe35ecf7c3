"""Acts of steered figures: begun and left without a leap, by the whole body or the upper body, each by itself."""

import numpy as np
import pytest
from numpy.typing import NDArray

import motet
from motet.errors import ControlError, MotionError, ScriptError, TextError
from motet.figures.humanoid import BONES, HUMANOID
from motet.motion.motion import Motion
from motet.motion.rotations import quat_product
from motet.steering.action_layer import UPPER
from motet.steering.acts import WIDTH, Act, ActSettings
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.scripts import parse_orders
from motet.steering.sentence_acts import SaidActs
from motet.steering.session import SteerSession

pytestmark = pytest.mark.numeric


@pytest.fixture(scope="module")
def model() -> SteerModel:
    return motet.load("control")


def frames_of(frames: int = 45, turn: float = 1.0, ahead: float = 0.5, lift: float = 1.2) -> NDArray[np.float32]:
    """An act: an arm is lifted and let down again, while the figure goes ahead and turns to the left."""
    part = np.linspace(0, 1, frames)
    rows = np.zeros((frames, WIDTH))
    rows[:, 3 : 4 * len(BONES) : 4] = 1
    half = lift * np.sin(np.pi * part) / 2
    arm = 4 * BONES.index("leftUpperArm")
    rows[:, arm + 2], rows[:, arm + 3] = np.sin(half), np.cos(half)
    rows[:, -3], rows[:, -2], rows[:, -1] = ahead * part, turn * part, 0.95
    return rows.astype(np.float32)


def act_of(model: SteerModel, name: str = "lift", **made: float) -> Act:
    return Act.of(name, frames_of(**made), model.fps, model.settings(ActSettings))  # type: ignore[arg-type]


def ticks(session: SteerSession, count: int) -> list[Pose]:
    return [session.tick() for _ in range(count)]


def walking(model: SteerModel, **settings: object) -> SteerSession:
    session = model.start(hold_feet=False, **settings)  # type: ignore[arg-type]
    session.control(gait="walk", speed=1.3)
    ticks(session, 40)
    return session


def same_turns(a: NDArray[np.floating], b: NDArray[np.floating], within: float) -> bool:
    return bool(np.abs(np.abs((a * b).sum(axis=-1)) - 1).max() < within)


def test_a_figure_that_stands_acts_with_its_whole_body_and_stands_on_from_there(model: SteerModel) -> None:
    session, act = model.start(hold_feet=False, places=[1.0, 2.0, 90.0]), act_of(model)
    ticks(session, 10)
    session.act(act)
    assert session.acting == [("lift", 44 / 30)]
    poses, left = [], []
    while session.acting[0]:
        left.append(session.acting[0][1])
        poses += ticks(session, 1)
    entry = round(act.height.size - 1 - left[1] * model.fps)
    assert 1 <= entry <= 15
    assert left[1:] == sorted(left[1:], reverse=True)
    last = poses[-2]
    assert same_turns(last.rotations[0], act.rotations[-1], 1e-4)
    assert last.height[0] == pytest.approx(0.95, abs=1e-3)
    # its own way, from the frame at which it is entered, less what it takes to be as fast
    went, turned = last.ground[0] - [1, 2, np.pi / 2], act.ground[-1] - act.ground[entry - 1]
    assert np.abs(went[2] - turned[2]) < 0.15
    assert np.hypot(*went[:2]) == pytest.approx(turned[1], abs=0.1)
    ticks(session, 60)
    assert np.degrees(session.tick().ground[0, 2]) == pytest.approx(np.degrees(last.ground[0, 2]), abs=6)


def test_while_a_figure_walks_its_upper_body_acts_and_its_legs_go_on(model: SteerModel) -> None:
    session, plain, act = walking(model), walking(model), act_of(model)
    session.act(act)
    frame = 0
    for step in range(90):
        acted, walked = session.tick(), plain.tick()
        assert np.array_equal(acted.ground, walked.ground)
        assert np.array_equal(acted.height, walked.height)
        assert np.array_equal(acted.rotations[0, ~UPPER], walked.rotations[0, ~UPPER])
        playing = session._state.actions.playing[0]
        if playing and step > 25:
            frame = playing.frame
            arms = UPPER & (np.array(BONES) != "spine")
            assert same_turns(acted.rotations[0, arms], act.rotations[frame, arms], 1e-4)
            seen = quat_product(acted.rotations[0, 0], acted.rotations[0, BONES.index("spine")])
            wanted = quat_product(act.rotations[frame, 0], act.rotations[frame, BONES.index("spine")])
            assert same_turns(seen, wanted, 1e-4)
    assert frame == len(act) - 1
    assert same_turns(session.tick().rotations[0], plain.tick().rotations[0], 1e-4)


def test_legs_go_as_soon_as_they_are_told_to_unless_the_whole_body_was_asked_for(model: SteerModel) -> None:
    for upper, stays in ((None, False), (False, True)):
        session = model.start()
        session.act(act_of(model, frames=90, ahead=0.0), upper=upper)
        ticks(session, 20)
        assert session._state.actions.whole.all()
        session.control(gait="walk", speed=1.3)
        ticks(session, 2)
        assert session._state.actions.whole.all() == stays
        assert session.acting[0] is not None
        if not stays:
            ticks(session, 30)
            assert np.hypot(*session._state.playback.spring[0, :2]) > 1


def test_acts_ten_times_a_second_do_not_leap(model: SteerModel) -> None:
    rng, count = np.random.default_rng(0), 8
    acts = [act_of(model, frames=f, turn=t, lift=v) for f, t, v in ((30, 2.0, 1.5), (60, -1.0, -1.0), (40, 0.0, 2.0))]
    session = model.start(characters=count)
    poses = ticks(session, 2)
    for tick in range(240):
        if tick % 3 == 0:
            ids = rng.permutation(count)[:4]
            session.act([acts[i] for i in rng.integers(3, size=4)], ids=ids, upper=[None, True, False][tick % 9 // 3])
        if tick % 40 == 0:
            session.control(
                gait="walk", speed=np.where(rng.random(count) < 0.5, 0, 1.3), direction=rng.uniform(-180, 180, count)
            )
        poses.append(session.tick())
    places = np.stack([pose.positions() for pose in poses])
    assert np.linalg.norm(np.diff(places, axis=0), axis=3).max() < 0.3  # of a hand; in recordings of gaits .47
    assert np.linalg.norm(np.diff(places, n=2, axis=0), axis=3).max() < 0.2


def test_an_act_is_broken_off_without_a_leap(model: SteerModel) -> None:
    session = model.start(characters=2, hold_feet=False)
    session.act(None)  # nothing is done yet
    (*_, standing) = ticks(session, 10)
    session.act(act_of(model, lift=2.5), upper=False)
    ticks(session, 20)
    session.act(None, ids=[1])
    assert [one and one[0] for one in session.acting] == ["lift", None]
    before, *after = ticks(session, 30)
    places = np.array([pose.positions()[1] for pose in (before, *after)])
    assert np.linalg.norm(np.diff(places, axis=0), axis=-1).max() < 0.16  # metres; hands of recorded people go 0.3
    assert [one and one[0] for one in session.acting] == [None, None]
    elbow = HUMANOID.index("leftLowerArm")
    hangs, lifted = standing.positions()[1, elbow, 1], np.array([pose.positions()[:, elbow, 1] for pose in after])
    assert lifted[:, 0].max() > hangs + 0.3  # the other one's
    assert abs(lifted[-1, 1] - hangs) < 0.05


def test_a_snapshot_has_acts(model: SteerModel) -> None:
    session = model.start()
    ticks(session, 5)
    session.act(act_of(model))
    ticks(session, 8)
    session.act(act_of(model, "again", turn=-1.0))
    snapshot, doing = session.snapshot(), session.acting
    first = ticks(session, 60)
    session.restore(snapshot)
    assert session.acting == doing == [("again", 44 / 30)]
    for pose, again in zip(first, ticks(session, 60), strict=True):
        assert np.array_equal(pose.rotations, again.rotations)
        assert np.array_equal(pose.ground, again.ground)


def test_a_motion_is_an_act_without_its_rest(model: SteerModel) -> None:
    motion = model.run("stop 1s, walk 2s, stop 3s")
    act = model.act_of(motion, "walks")
    assert 45 < len(act) < len(motion) - 20
    assert same_turns(model.act_of(motion).rotations[-1], act.rotations[-1], 1e-6)
    again = Act.of("walks", act.numbers, model.fps, model.settings(ActSettings))
    assert np.allclose(again.ground, act.ground, atol=1e-5)
    assert same_turns(again.rotations, act.rotations, 1e-6)
    session = model.start()
    session.act(motion, upper=False)
    went = ticks(session, len(act))[-1].ground[0]
    assert np.hypot(*went[:2]) > 1.5


def test_what_cannot_be_acted_is_refused_and_changes_nothing(model: SteerModel) -> None:
    session, how = model.start(characters=2), model.settings(ActSettings)
    for ids in (2, -1, [0, 5], 0.5, "left", [[0]]):
        with pytest.raises(ControlError, match="ids must be numbers of characters from 0 to 1"):
            session.act(act_of(model), ids=ids)
    with pytest.raises(ControlError, match="3 acts do not fit 2 characters"):
        session.act([act_of(model)] * 3)
    with pytest.raises(MotionError):
        session.act(Motion(np.zeros((30, 1)), ("box.tx",), ("m",), 30.0))
    for numbers in (frames_of()[:2], frames_of()[:, 1:], frames_of() * np.float32(np.nan), frames_of() * 1e6):
        with pytest.raises(ControlError):
            Act.of("wrong", np.asarray(numbers, np.float32), model.fps, how)
    with pytest.raises(ControlError):
        session.act(model.run("walk 1s")[:2])
    assert session.acting == [None, None]


def test_putting_a_figure_elsewhere_ends_its_act(model: SteerModel) -> None:
    session = model.start()
    session.act(act_of(model))
    ticks(session, 5)
    session.put([5.0, 5.0, 0.0])
    assert session.acting == [None]
    assert np.abs(session.tick().ground[0, :2] - 5).max() < 0.05


def happened(poses: list[Pose]) -> list[tuple[int, str, int, str]]:
    """Beginnings and ends of acts: which pose, what, whose and the act's name."""
    return [(at, *event) for at, pose in enumerate(poses) for event in pose.events if event.kind.startswith("act")]


def test_beginnings_and_ends_of_acts_are_told_once(model: SteerModel) -> None:
    session, lift, wave = model.start(characters=2), act_of(model), act_of(model, "wave", lift=0.8)
    session.act([lift, wave], ids=[0, 1])
    assert happened(ticks(session, 1)) == [(0, "act begun", 0, "lift"), (0, "act begun", 1, "wave")]
    session.act(lift, ids=0)  # in its own place
    session.act(None, ids=1)
    told = [(0, "act ended", 0, "lift"), (0, "act begun", 0, "lift"), (0, "act ended", 1, "wave")]
    assert happened(ticks(session, 10)) == told
    left = session.acting[0]
    assert left
    assert happened(ticks(session, 60)) == [(round(left[1] * model.fps), "act ended", 0, "lift")]
    session.act(None)
    assert not happened(ticks(session, 5))
    session.act(wave, ids=1)
    ticks(session, 5)
    session.put([3, 2, 10])
    assert happened(ticks(session, 5)) == [(0, "act ended", 1, "wave")]


def test_no_event_is_lost_where_a_figure_is_put_elsewhere(model: SteerModel) -> None:
    session, lift = model.start(), act_of(model)
    session.act(lift)
    poses = [session.advance(1 / 60) for _ in range(3)]
    while session.acting[0]:
        poses.append(session.advance(1 / 60))
    assert [kind for _, kind, _, _ in happened(poses)] == ["act begun"]  # its end is to be shown next
    session.put([3, 2, 10])
    before = session.snapshot()
    for _ in range(2):
        after = [session.advance(1 / 60) for _ in range(5)]
        assert happened(after) == [(0, "act ended", 0, "lift")]
        session.restore(before)


@pytest.fixture(scope="module")
def said(model: SteerModel) -> SaidActs:
    return SaidActs(model, motet.load("generate"))


def test_a_sentence_is_acted_and_made_once(model: SteerModel, said: SaidActs) -> None:
    session = model.start(characters=2, words=said)
    session.act(["wave", "kick"])
    assert [one and one[0] for one in session.acting] == ["wave", "kick"]
    assert said.act("wave") is said.act("wave")
    assert 20 < len(said.act("wave")) <= 3 * model.fps
    hand = HUMANOID.index("leftHand"), HUMANOID.index("rightHand")
    highest = max(pose.positions()[0, list(hand), 1].max() for pose in ticks(session, 90))
    assert highest > model.start().tick().positions()[0, list(hand), 1].max() + 0.2


@pytest.mark.parametrize(("speed", "gone"), [(0.0, 0.3), (1.3, 1.0)])
def test_a_gait_that_goes_nowhere_is_done_once_and_the_figure_goes_on(
    model: SteerModel, speed: float, gone: float
) -> None:
    session = model.start()
    session.control(speed=speed)
    ticks(session, 60)
    session.act("jump")
    poses = ticks(session, 120)
    happens = [(at, event.kind) for at, pose in enumerate(poses) for event in pose.events]
    (begun, _), (left, _), (landed, _), (over, _) = (
        next((at, kind) for at, kind in happens if kind == wanted)
        for wanted in ("act begun", "take-off", "landing", "act ended")
    )
    assert begun <= left <= 0.6 * model.fps <= landed < over
    assert [kind for _, kind in happens].count("take-off") == 1
    assert session.acting == [None]
    end = np.stack([pose.ground[0, :2] for pose in poses[-16:]])
    assert np.linalg.norm(end[-1] - end[0]) / 0.5 == pytest.approx(speed, abs=0.15)
    way = np.linalg.norm(poses[over].ground[0, :2] - poses[begun].ground[0, :2])
    assert way < gone if speed == 0 else way > gone
    toes = [HUMANOID.index("leftToes"), HUMANOID.index("rightToes")]
    assert max(pose.positions()[0, toes, 1].min() for pose in poses) > 0.2


def test_who_walks_waves_with_the_arms_alone_and_kicks_with_the_whole_body(model: SteerModel, said: SaidActs) -> None:
    assert [said.act(one).legs for one in ("wave", "point", "drink")] == [False] * 3
    assert [said.act(one).legs for one in ("kick", "jump", "squat", "cartwheel", "turn around")] == [True] * 5
    session, alone = model.start(characters=2, words=said), model.start(characters=2)
    for one in (session, alone):
        one.control(speed=1.3)
        ticks(one, 60)
    session.act(["wave", "kick"])
    acted, plain = ticks(session, 20)[-1], ticks(alone, 20)[-1]
    legs = [BONES.index(bone) for bone in ("leftUpperLeg", "leftLowerLeg", "rightUpperLeg", "rightLowerLeg")]
    same = np.abs(acted.rotations[:, legs] - plain.rotations[:, legs]).max(axis=(1, 2)) < 1e-6
    assert same.tolist() == [True, False]
    session.control(speed=1.2)  # who kicks ends the kick first
    assert session.tick().ground[0, 1] > acted.ground[0, 1]
    assert session.acting[1] is not None


@pytest.mark.parametrize("sentence", ["xyzzy", "a dragon", "", "   "])
def test_a_sentence_that_is_not_known_is_refused_and_nothing_moves(
    model: SteerModel, said: SaidActs, sentence: str
) -> None:
    session, plain = model.start(words=said), model.start()
    with pytest.raises(TextError):
        session.act(sentence)
    assert session.acting == [None]
    assert np.array_equal(session.tick().rotations, plain.tick().rotations)


def test_scripts_have_acts(model: SteerModel, said: SaidActs) -> None:
    orders = parse_orders("walk 2s, act 'sit down' 1.5s, act wave", model.gaits)
    assert [(order.act, order.seconds) for order in orders] == [(None, 2.0), ("sit down", 1.5), ("wave", 3.0)]
    for script in ("act", "act 3s", "act ''"):
        with pytest.raises(ScriptError):
            parse_orders(script, model.gaits)
    acted, plain = model.run("walk 1s, act 'wave' 2s", words=said), model.run("walk 3s")
    assert len(acted) == len(plain) == 90
    assert np.allclose(acted.values[:30], plain.values[:30])
    assert not np.allclose(acted.values[30:], plain.values[30:], atol=1)
