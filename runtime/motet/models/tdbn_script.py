"""Control scripts: what a figure does, and for how long.

A script is a list of segments separated by commas. ``walk 3s`` holds a label, ``walk>run 5s`` goes from one to
the other linearly, ``walk*.3+run*.7 2s`` mixes labels (a weight is between 0 and 1; labels that are not
named have 0).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.errors import ControlError, ScriptError, quoted

_TOKEN = re.compile(
    r"\s*+(?:(?P<number>\d++\.?\d*+|\.\d++)(?![\w.])|(?P<seconds>\d++\.?\d*+s|\.\d++s)\b"
    r"|(?P<label>[^\W\d][\w-]*+)|(?P<sign>[,>+*]))"
)

_END = re.compile(r"\s*+\Z")

Weights = dict[str, float]

SHOWN = 200
"""Characters of a long script that an error shows around the place."""

MAX_SECONDS = 3600.0
"""A script is laid out in memory before it runs; longer ones are for a loop over ``TdbnSession.step``."""


@dataclass(frozen=True)
class Segment:
    """One part of a script: the weights of labels at its start and at its end, and seconds."""

    start: Weights
    stop: Weights
    seconds: float

    @property
    def caption(self) -> str:
        """What a viewer shows: ``walk`` or ``walk > run``."""
        names = [" + ".join(weights) for weights in (self.start, self.stop)]
        return names[0] if self.start == self.stop else " > ".join(names)


def parse_script(script: str, labels: Sequence[str]) -> list[Segment]:
    """Parse a script over known labels; ScriptError marks the place of an error."""
    parser = _Parser(script, labels)
    segments = [parser.segment()]
    while not parser.done():
        parser.expect("sign", ",", "a comma between segments")
        segments.append(parser.segment())
    if sum(segment.seconds for segment in segments) > MAX_SECONDS:
        raise parser.fail(f"a script lasts at most {MAX_SECONDS:g} s")
    return segments


def control_track(segments: Sequence[Segment], labels: Sequence[str], fps: float) -> NDArray[np.float32]:
    """The control values (T, labels) float32 of a script, frame by frame; no frame is lost to rounding.

    ControlError for a script of less than one frame.
    """
    ends = np.round(np.cumsum([segment.seconds for segment in segments]) * fps).astype(int)
    if not ends[-1]:
        raise ControlError(f"the script lasts less than one frame at {fps:g} fps")
    counts = np.diff(ends, prepend=0)
    return np.concatenate(
        [_ramp(s, labels, count) for s, count in zip(segments, counts, strict=True)], dtype=np.float32
    )


def starts_of(segments: Sequence[Segment]) -> list[tuple[float, str]]:
    """When each segment starts, in seconds, and its caption."""
    starts = np.cumsum([0.0, *(segment.seconds for segment in segments[:-1])])
    return [(float(start), segment.caption) for start, segment in zip(starts, segments, strict=True)]


def _ramp(segment: Segment, labels: Sequence[str], count: int) -> NDArray[np.float64]:
    start, stop = (np.array([weights.get(label, 0.0) for label in labels]) for weights in (segment.start, segment.stop))
    # the last frame of a ramp is its end, and a segment that holds is the same throughout
    share = (np.arange(1, count + 1) / count)[:, None] if count else np.zeros((0, 1))
    track: NDArray[np.float64] = start + share * (stop - start)
    return track


class _Parser:
    """A recursive descent over the tokens of one script."""

    def __init__(self, script: str, labels: Sequence[str]) -> None:
        self.script, self.labels, self.position = script, labels, 0

    def done(self) -> bool:
        return _END.match(self.script, self.position) is not None

    def fail(self, reason: str) -> ScriptError:
        rest = self.script[self.position :]
        position = self.position + len(rest) - len(rest.lstrip())
        if len(self.script) <= SHOWN:
            return ScriptError(self.script, position, reason)
        start = max(0, position - SHOWN // 2)
        return ScriptError(self.script[start : start + SHOWN], position - start, f"{reason} (at character {position})")

    def accept(self, kind: str, text: str | None = None) -> str | None:
        """The next token if it is of that kind (and text), else None."""
        match = _TOKEN.match(self.script, self.position)
        if match is None or match.lastgroup != kind or (text is not None and match[kind] != text):
            return None
        self.position = match.end()
        return match[kind]

    def expect(self, kind: str, text: str | None, wanted: str) -> str:
        token = self.accept(kind, text)
        if token is None:
            raise self.fail(f'the script needs {wanted} here, such as "walk 3s, walk>run 5s"')
        return token

    def segment(self) -> Segment:
        start = self.mix()
        stop = self.mix() if self.accept("sign", ">") else start
        before = self.position
        seconds = float(self.expect("seconds", None, "a duration in seconds").removesuffix("s"))
        if not 0 < seconds <= MAX_SECONDS:
            self.position = before
            raise self.fail(f"a duration must be more than 0 and at most {MAX_SECONDS:g} s")
        return Segment(start, stop, seconds)

    def mix(self) -> Weights:
        weights = dict([self.weight()])
        while self.accept("sign", "+"):
            before = self.position
            label, weight = self.weight()
            if label in weights:
                self.position = before
                raise self.fail(f"{quoted(label)} appears twice in one mix")
            weights[label] = weight
        return weights

    def weight(self) -> tuple[str, float]:
        before = self.position
        label = self.expect("label", None, "the name of a control")
        if label not in self.labels:
            self.position = before
            raise self.fail(f"unknown control {quoted(label)}; expected one of {', '.join(self.labels)}")
        if not self.accept("sign", "*"):
            return label, 1.0
        before = self.position
        weight = float(self.expect("number", None, "a weight between 0 and 1"))
        if weight > 1:
            self.position = before
            raise self.fail("a weight is between 0 and 1")
        return label, weight
