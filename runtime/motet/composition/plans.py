"""Plans of compositions: prompts, places, facings and poses at their times, as moments, a JSON file, or a script.

A script's moments are separated by semicolons or lines: ``0s a person walks; 3s at 0 3 facing 90 a person waves;
4.5s pose kick.bvh@1.2; 6s``. Each is a time, then, in this order and each optional: ``at`` with x and z in metres,
``facing`` with degrees, ``pose`` with a motion file and, after @, the seconds of its key frame; then a prompt.
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

from motet.errors import FormatError, MotetError, ScriptError, SettingError, quoted
from motet.formats import read_motion
from motet.motion.motion import Motion, motions_of
from motet.settings import is_number

LONGEST_COMPOSITION = 600.0
"""Seconds of a composition."""


SHORTEST_PROMPT = 0.3
"""Seconds of a prompt."""

MOMENT_SECONDS = 0.1 - 1e-9
"""Seconds from one moment to the next."""

SIGNED_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
PART = re.compile(
    rf"(?P<at>{SIGNED_NUMBER})s?(?!\S)(?:\s+at\s+(?P<x>{SIGNED_NUMBER})\s+(?P<z>{SIGNED_NUMBER})(?!\S))?"
    rf"(?:\s+facing\s+(?P<facing>{SIGNED_NUMBER})(?!\S))?"
    rf"(?:\s+pose\s+(?P<pose>\S+?)(?:@(?P<pose_at>{SIGNED_NUMBER}))?(?!\S))?(?:\s+(?P<text>.+))?",
    re.DOTALL,
)

Reader = Callable[[Path], Motion]
"""Reads a motion file."""


@dataclass(frozen=True)
class Moment:
    """A time of a plan, and the prompt, place, facing and pose that belong to it. SettingError for a wrong value."""

    at: float
    """Seconds. The first moment's place and facing are the start; the last moment is the end."""

    text: str | None = None
    """A prompt, shown from here to the next one."""

    place: tuple[float, float] | None = None
    """x and z of the hips in metres; the figure's left is +x when it faces 0."""

    facing: float | None = None
    """Degrees from +z to the left, 90 along x."""

    pose: Motion | None = None
    """A motion of any human figure, one frame of which is met, wherever the figure is then."""

    pose_at: float = 0.0
    """Seconds of that frame in the motion."""

    def __post_init__(self) -> None:
        if self.pose is not None:
            motions_of([self.pose])
        place = self.place
        motion = self.pose
        # each field is of its type and within its range
        if not (is_number(self.at) and 0 <= self.at <= LONGEST_COMPOSITION):
            raise SettingError(f"at must be 0 to {LONGEST_COMPOSITION:g} s, not {self.at!r}")
        if self.text is not None and not (isinstance(self.text, str) and self.text.strip()):
            raise SettingError("text must be a prompt")
        if place is not None and not (isinstance(place, Sequence) and len(place) == 2 and all(map(_near, place))):
            raise SettingError(f"place must be x and z in metres, not {place!r}")
        if self.facing is not None and not _near(self.facing):
            raise SettingError(f"facing must be degrees, not {self.facing!r}")
        if motion is not None and not (is_number(self.pose_at) and 0 <= self.pose_at * motion.fps < len(motion)):
            raise SettingError(f"pose_at must be within the motion's {motion.duration:g} s, not {self.pose_at!r}")


def _near(value: object) -> bool:
    return is_number(value) and abs(float(value)) <= 1000.0  # type: ignore[arg-type]  # a number it is


def read_plan(path: str | Path, read: Reader = read_motion) -> list[Moment]:
    """The moments of a JSON file: a list of objects whose keys are those of :class:`Moment`.

    "pose" names a motion file, relative to the plan's folder; ``read`` reads it. FormatError with the number of the
    wrong moment.
    """
    path = Path(path)
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FormatError(path, error.strerror or "cannot be read") from error
    except (ValueError, RecursionError) as error:
        raise FormatError(path, f"is no JSON: {error}", getattr(error, "lineno", None)) from error
    if not isinstance(rows, list):
        raise FormatError(path, 'a plan is a list of moments, such as [{"at": 0, "text": "a person walks"}, {"at": 3}]')
    moments = []
    for number, row in enumerate(rows, start=1):
        try:
            moments.append(_moment(row, lambda name: read(path.parent / name)))
        except MotetError as error:
            raise FormatError(path, f"moment {number}: {error}") from error
    return moments


def _moment(row: Any, read: Callable[[str], Motion]) -> Moment:
    known = [field.name for field in fields(Moment)]
    if not isinstance(row, Mapping) or "at" not in row:
        raise SettingError(f'a moment is an object with its time, such as {{"at": 3}}, not {quoted(repr(row))}')
    if unknown := [key for key in row if key not in known]:
        raise SettingError(f"unknown key {quoted(unknown[0])}; expected {', '.join(known)}")
    if not isinstance(pose := row.get("pose"), str | None):
        raise SettingError(f"pose must be the path of a motion file, not {pose!r}")
    return Moment(**{**row, "pose": None if pose is None else read(pose)})


def parse_plan(script: str, read: Reader = read_motion) -> list[Moment]:
    """The moments of a script; ScriptError marks the place of an error. ``read`` reads the files of poses."""
    moments = []
    start = 0
    for part in re.split(r"[;\n]", script):
        match = PART.fullmatch(part.strip())
        if not match or re.match(r"(at|facing|pose)\b", match["text"] or ""):
            where = "expected a time, then at X Z, facing DEGREES, pose FILE@SECONDS, a prompt, in this order"
            raise ScriptError(script, start, f'{where}, such as "3s at 0 3 facing 90 a person waves"')
        # what the part says, in its own types
        numbers = {key: float(match[key]) for key in ("at", "facing", "pose_at") if match[key]}
        place = (float(match["x"]), float(match["z"])) if match["x"] else None
        pose = read(Path(match["pose"])) if match["pose"] else None
        try:
            moments.append(Moment(text=match["text"], place=place, pose=pose, **numbers))
        except SettingError as error:
            raise ScriptError(script, start, str(error)) from error
        start += len(part) + 1
    return moments


def time_line(moments: Sequence[Moment]) -> list[Moment]:
    """The moments, if they are in order; SettingError says which is not."""
    line = list(moments)
    if len(line) < 2 or line[0].at or line[0].text is None:
        raise SettingError("a plan begins with a prompt at 0 s, and its last moment is its end")
    for number, (before, moment) in enumerate(pairwise(line), start=2):
        if moment.at - before.at < MOMENT_SECONDS:
            raise SettingError(
                f"moment {number} is at {moment.at:g} s, the one before it at {before.at:g} s: times must rise"
            )
        if moment is not line[-1] and moment == Moment(moment.at):
            raise SettingError(f"moment {number}, at {moment.at:g} s, asks for nothing")
    _check_prompts(line)
    return line


def _check_prompts(line: Sequence[Moment]) -> None:
    end = line[-1]
    if end.text is not None:
        raise SettingError(f"the last moment is the end: {quoted(end.text)} needs a later one")
    prompts = [moment for moment in line if moment.text is not None]
    for prompt, following in pairwise([*prompts, end]):
        seconds = following.at - prompt.at
        if seconds < SHORTEST_PROMPT:
            raise SettingError(f"{quoted(str(prompt.text))} has {seconds:.2g} s: a prompt needs {SHORTEST_PROMPT:g}")
