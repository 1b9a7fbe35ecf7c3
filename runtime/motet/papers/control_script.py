"""Scripts of the thesis' net: what a figure does, and for how long; segments follow each other, separated by commas.

``walk 3s`` holds a label, ``walk>run 5s`` goes from one to the other linearly, ``walk*.3+run*.7 2s`` mixes labels (a
weight is between 0 and 1; labels that are not named have 0).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.errors import ControlError, ScriptError, quoted
from motet.models.control import LONGEST_SCRIPT

TOKEN = re.compile(
    r"\s*+(?:(?P<number>\d++\.?\d*+|\.\d++)(?![\w.])|(?P<seconds>\d++\.?\d*+s|\.\d++s)\b"
    r"|(?P<label>[^\W\d][\w-]*+)|(?P<sign>[,>+*])|(?P<end>\Z))"
)


@dataclass(frozen=True)
class Segment:
    """The weights of labels at its start and at its end, and seconds."""

    start: dict[str, float]
    stop: dict[str, float]
    seconds: float

    @property
    def caption(self) -> str:
        """What a viewer shows: ``walk`` or ``walk > run``."""
        names = [" + ".join(weights) for weights in (self.start, self.stop)]
        return names[0] if self.start == self.stop else " > ".join(names)


def parse_segments(script: str, labels: Sequence[str]) -> list[Segment]:
    """Parse a script of segments over known labels; ScriptError marks the place of an error."""
    parser = _Tokens(script, labels)
    segments = [parser.segment()]
    while parser.accept("end") is None:
        parser.expect("sign", ",", "a comma between segments")
        segments.append(parser.segment())
    if sum(segment.seconds for segment in segments) > LONGEST_SCRIPT:
        raise parser.fail(f"a script lasts at most {LONGEST_SCRIPT:g} s")
    return segments


class _Tokens:
    """A recursive descent over the tokens of one script."""

    def __init__(self, script: str, labels: Sequence[str]) -> None:
        self.script = script
        self.labels = labels
        self.position = 0

    def segment(self) -> Segment:
        start = self.mix()
        stop = self.mix() if self.accept("sign", ">") else start
        before = self.position
        seconds = float(self.expect("seconds", None, "a duration in seconds").removesuffix("s"))
        if not 0 < seconds <= LONGEST_SCRIPT:
            raise self.fail(f"a duration must be more than 0 and at most {LONGEST_SCRIPT:g} s", before)
        return Segment(start, stop, seconds)

    def mix(self) -> dict[str, float]:
        weights: dict[str, float] = {}
        while not weights or self.accept("sign", "+"):
            before = self.position
            label = self.expect("label", None, "the name of a control")
            if label not in self.labels:
                known = ", ".join(self.labels)
                raise self.fail(f"unknown control {quoted(label)}; expected one of {known}", before)
            if label in weights:
                raise self.fail(f"{quoted(label)} appears twice in one mix", before)
            weights[label] = 1.0
            if self.accept("sign", "*"):
                before = self.position
                weights[label] = float(self.expect("number", None, "a weight between 0 and 1"))
                if weights[label] > 1:
                    raise self.fail("a weight is between 0 and 1", before)
        return weights

    def accept(self, kind: str, text: str | None = None) -> str | None:
        """The next token if it is of that kind (and text), else None."""
        match = TOKEN.match(self.script, self.position)
        if match is None or match.lastgroup != kind or (text is not None and match[kind] != text):
            return None
        self.position = match.end()
        return match[kind]

    def expect(self, kind: str, text: str | None, wanted: str) -> str:
        token = self.accept(kind, text)
        if token is None:
            raise self.fail(f'the script needs {wanted} here, such as "walk 3s, walk>run 5s"')
        return token

    def fail(self, reason: str, position: int | None = None, most: int = 200) -> ScriptError:
        """An error at the next token; of a long script at most so many characters around it."""
        rest = self.script[self.position if position is None else position :]
        place = len(self.script) - len(rest.lstrip())
        if len(self.script) <= most:
            return ScriptError(self.script, place, reason)
        start = max(0, place - most // 2)
        return ScriptError(self.script[start : start + most], place - start, f"{reason} (at character {place})")


def control_track(segments: Sequence[Segment], labels: Sequence[str], fps: float) -> NDArray[np.float32]:
    """The control values (T, labels) float32 of segments, frame by frame; no frame is lost to rounding. ControlError
    for a script of less than one frame."""
    ends = np.round(np.cumsum([segment.seconds for segment in segments]) * fps).astype(int)
    if not ends[-1]:
        raise ControlError(f"the script lasts less than one frame at {fps:g} fps")
    track = []
    for segment, count in zip(segments, np.diff(ends, prepend=0), strict=True):
        start = np.array([segment.start.get(label, 0.0) for label in labels])
        stop = np.array([segment.stop.get(label, 0.0) for label in labels])
        # the last frame of a ramp is its end, and a segment that holds is the same throughout
        share = (np.arange(1, count + 1) / max(1, count))[:, None]
        track.append(start + share * (stop - start))
    return np.concatenate(track, dtype=np.float32)
