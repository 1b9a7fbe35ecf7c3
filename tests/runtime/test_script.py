import time

import numpy as np
import pytest

from motet.errors import ControlError, ScriptError
from motet.models.control import captions
from motet.papers.control_script import Segment, control_track, parse_segments

LABELS = ("walk", "run", "bend_over")


def test_a_script_is_its_segments() -> None:
    assert parse_segments(" walk 3s,walk>run 1.5s , bend_over .5s", LABELS) == [
        Segment({"walk": 1.0}, {"walk": 1.0}, 3.0),
        Segment({"walk": 1.0}, {"run": 1.0}, 1.5),
        Segment({"bend_over": 1.0}, {"bend_over": 1.0}, 0.5),
    ]


def test_labels_mix_with_weights() -> None:
    (segment,) = parse_segments("walk*.3+run*0.7 2s", LABELS)
    assert segment.start == {"walk": 0.3, "run": 0.7} == segment.stop


@pytest.mark.parametrize(
    ("script", "position", "reason"),
    [
        ("", 0, "name of a control"),
        ("walk 3s,", 8, "name of a control"),
        ("walk 3", 5, "duration in seconds"),
        ("walk 3s run 3s", 8, "comma"),
        ("walk 3s, fly 1s", 9, "unknown control 'fly'; expected one of walk, run, bend_over"),
        ("walk 0s", 5, "more than 0"),
        ("walk 99999s", 5, "at most 3600"),
        ("walk 3000s, run 601s", 20, "at most 3600"),
        ("walk -3s", 5, "duration"),
        ("walk*2 3s", 5, "between 0 and 1"),
        ("walk+walk 3s", 5, "twice"),
        ("walk>3s", 5, "name of a control"),
        ("walk\n3s; run 3s", 7, "comma"),
    ],
)
def test_an_error_shows_the_place(script: str, position: int, reason: str) -> None:
    with pytest.raises(ScriptError, match=reason) as caught:
        parse_segments(script, LABELS)
    assert caught.value.position == position
    assert str(caught.value).splitlines()[-1] == "  " + " " * position + "^"


def test_a_track_holds_ramps_and_loses_no_frame() -> None:
    segments = parse_segments("walk 0.1s, walk>run 0.25s, run .33s, run .33s, run .33s", LABELS)
    track = control_track(segments, LABELS, fps=40)
    assert track.dtype == np.float32
    assert len(track) == round(1.34 * 40)
    np.testing.assert_array_equal(track[:4], [[1, 0, 0]] * 4)
    np.testing.assert_allclose(track[4:14, 1], np.arange(1, 11) / 10, rtol=1e-6)
    np.testing.assert_allclose(track.sum(axis=1), 1, rtol=1e-6)


def test_a_segment_shorter_than_half_a_frame_is_empty_and_such_a_script_is_refused() -> None:
    assert len(control_track(parse_segments("walk>run .001s, run 1s", LABELS), LABELS, 40)) == 40
    with pytest.raises(ControlError, match="less than one frame at 40 fps"):
        control_track(parse_segments("walk .001s", LABELS), LABELS, 40)


@pytest.mark.parametrize(
    "script", ["walk " + "9" * 300_000 + "x", "walk" + "-" * 300_000, "walk 0.01s," * 30_000 + "x"]
)
def test_long_scripts_are_read_in_no_time_and_refused_in_few_words(script: str) -> None:
    started = time.process_time()
    with pytest.raises(ScriptError) as caught:
        parse_segments(script, LABELS)
    assert time.process_time() - started < 2
    assert len(str(caught.value)) < 1000


def test_captions_come_with_their_starts() -> None:
    segments = parse_segments("walk 3s, walk>run 2s, walk*.5+run*.5 1s", LABELS)
    assert captions(segments) == [(0.0, "walk"), (3.0, "walk > run"), (5.0, "walk + run")]
