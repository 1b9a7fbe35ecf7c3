"""How a story is drawn: parts one after another, in pieces as they come, or to a measure where a part has numbers."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, islice, pairwise
from typing import Any, NamedTuple

import numpy as np

from motet.bundle.graph import Floats
from motet.decode.loop import Ids, Noise
from motet.generate.codec import Codec, Context, StreamingDecoder
from motet.generate.codes import CodesSettings, Source, Writer, drawn_actions, drawn_steps
from motet.generate.motion_measures import Seen, enough, fitted, played, turn_to_make, turned
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.text.numeric_phrases import Kind, Quantities

LONGEST = 300.0
"""Seconds that a part with a number lasts at most."""

STRETCH = 20.0
"""Seconds, at most, of the stretches in which a part is made whose length comes first."""

SLOWEST: Mapping[Kind, float] = {"degrees": 20.0, "metres": 0.3, "steps": 0.5, "times": 0.1}
"""How much is done in a second at least, but for ten seconds: who does less is not drawn on."""


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a story: its sentence, what that asks for in numbers, its context (A,), seconds, 0 where it ends by
    itself, and how many times as fast as drawn it is played to last so long."""

    text: str
    asked: Quantities
    context: Floats
    seconds: float
    pace: float = 1.0

    @property
    def to_measure(self) -> bool:
        """Whether it is drawn until it has as much as was asked; a length alone is kept by the decoder."""
        return bool(self.asked.amounts.keys() - {"seconds"}) or self.pace != 1

    @property
    def exactly(self) -> bool:
        """Whether its length comes first."""
        told = self.asked.amounts.keys()
        return self.seconds > 0 and ("seconds" not in told or not told - {"seconds", "pace"})


def pace_of(part: Part, source: Source, codec: Codec) -> float:
    """How many times as fast as drawn a part is played: as its sentence says, or as shows its act in its seconds
    (:meth:`motet.generate.codes.Memory.paced`)."""
    if not part.exactly:
        return 1.0
    steps = codec.steps(part.seconds)
    return part.asked.amounts.get("pace") or source.memory.paced(int(part.context.argmax()), steps) / steps


class Piece(NamedTuple):
    """Frames (T, D) that become final, the number of the part drawn with them, its action, and by how many frames that
    part becomes longer. The first piece of a part comes before its frames."""

    number: int
    action: int
    frames: Array
    longer: int


@dataclass(frozen=True, eq=False)
class Teller:
    """Draws the parts of a story. settings: of the loop. seconds: of a motion's end that the next part continues."""

    source: Source
    codec: Codec
    contract: MotionContract
    noise: Sequence[Noise]
    settings: Mapping[str, Any]
    seconds: float

    def pieces(self, parts: Sequence[Part], context: Context | None) -> Iterator[Piece]:
        """The pieces of all parts. context: the end of the motion that they continue."""
        runs = [[*run] for alone, group in groupby(enumerate(parts), lambda one: one[1].to_measure)
                for run in ([[one] for one in group] if alone else [group])]  # fmt: skip
        for run in runs:
            tail = [] if context is None else [context.frames]
            for piece in self._pieces_of(run, context):
                yield piece
                tail = [np.concatenate([*tail, piece.frames])[-self._kept :]] if run is not runs[-1] else []
            if tail:
                frames = tail[0][len(tail[0]) % self.codec.field.hop :]
                context = Context(frames, self.codec.codes_of(frames))

    @property
    def _kept(self) -> int:
        return self.codec.steps(self.seconds) * self.codec.field.hop

    def _writer(self, context: Context | None) -> Writer:
        writer = Writer(self.source, self.noise, CodesSettings(**self.settings))
        if context is not None:
            writer.see(context.codes)
        return writer

    def _action(self, part: Part) -> Ids:
        return drawn_actions(self.source, part.context[None], self.noise, self.settings["certainty"])

    def _pieces_of(self, parts: Sequence[tuple[int, Part]], context: Context | None) -> Iterator[Piece]:
        number, part = parts[0]
        if not part.to_measure:
            return self._flowing(parts, context)
        return self._timed(number, part, context) if part.exactly else self._measured(number, part, context)

    def _flowing(self, parts: Sequence[tuple[int, Part]], context: Context | None) -> Iterator[Piece]:
        """Pieces of a step of codes of parts without numbers; then the remaining frames."""
        writer, decoder, fps = self._writer(context), StreamingDecoder(self.codec, context), self.contract.fps
        done, given, end, limit = 0, 0, 0.0, None
        for number, part in parts:
            action = self._action(part)
            yield Piece(number, int(action[0]), np.empty((0, len(self.contract.channels))), 0)
            end += part.seconds
            longest = self.codec.steps(end) - done if part.seconds else self.codec.steps(self.settings["max_seconds"])
            limit = max(1, round(end * fps)) if part.seconds else None
            for _, step in drawn_steps(writer, action, longest, exactly=part.seconds > 0):
                done += 1
                frames = decoder.push(step)[: None if limit is None else limit - given]
                given += len(frames)
                yield Piece(number, int(action[0]), frames, self.codec.field.hop)
            end = end if part.seconds else done * self.codec.seconds
        rest = decoder.finish()[: None if limit is None else limit - given]
        yield Piece(number, int(action[0]), rest, given + len(rest) - done * self.codec.field.hop)

    def _timed(self, number: int, part: Part, context: Context | None) -> Iterator[Piece]:
        """A part whose length comes first, stretch by stretch: each has its share of the turn and of the length."""
        action = self._action(part)
        steps = self.codec.steps(part.seconds * part.pace)
        drawn = drawn_steps(self._writer(context), action, steps, exactly=True, whole=True)
        decoder, asked, field = StreamingDecoder(self.codec, context), part.asked, self.codec.field
        length = max(1, round(part.seconds * self.contract.fps))
        edges = np.linspace(0, length, math.ceil(part.seconds / STRETCH) + 1).round().astype(int).tolist()
        rest = np.empty((0, len(self.contract.channels)))
        lead = rest  # the last frame before a stretch
        pushed, total = 0, 0.0
        for start, stop in pairwise(edges):
            # as many frames as drawn
            ends = stop == length
            until = steps if ends else min(steps, math.ceil(stop * part.pace / field.hop) + field.ahead + 1)
            codes = [row for _, step in islice(drawn, until - pushed) for row in step]
            pushed = until
            rest = np.concatenate([rest, decoder.push(np.array(codes)), *([decoder.finish()] if ends else [])])
            count = round(stop * part.pace) - round(start * part.pace)
            frames, rest = np.concatenate([lead, rest[:count]]), rest[count:]
            # turned by their share
            if "degrees" in asked.amounts:
                seen = Seen.of(self.contract, frames)
                total = total or turn_to_make(seen, asked)
                frames = turned(seen, frames, total * (stop - start) / length, begins=start == 0, ends=ends)
            # and played to their share of the length
            shown = played(frames, len(frames) / (len(lead) + stop - start))[len(lead) :]
            lead = frames[-1:]
            yield Piece(number, int(action[0]), shown, len(shown))

    def _measured(self, number: int, part: Part, context: Context | None) -> Iterator[Piece]:
        """The whole of a part: drawn again and again until it has as much as was asked, and fitted."""
        writer, action, codes = self._writer(context), self._action(part), np.empty((0, self.source.parts), np.int64)
        times = int(part.asked.amounts.get("times", 1))
        rounds = 1 if part.asked.act else times
        slow = sum(abs(part.asked.amounts.get(kind, 0)) / least for kind, least in SLOWEST.items())
        most, steps = self.codec.steps(min(LONGEST, 10 + slow)), self.codec.steps(self.settings["max_seconds"])
        steps, looked = self.codec.steps(part.seconds) if part.seconds else steps, 0
        while True:
            drawn = [step for _, step in drawn_steps(writer, action, steps, whole=True)]
            codes, rounds = np.concatenate([codes, *drawn]), rounds - 1
            over = len(codes) >= most
            if over or (rounds < 1 and len(codes) >= 1.2 * looked):  # a long one is not looked at after each draw
                frames, looked = self._decoded(codes, context), len(codes)
                seen = Seen.of(self.contract, frames)
                never = "times" in part.asked.amounts and 1 - rounds >= times and not seen.done(part.asked.act)
                if over or never or enough(seen, part.asked):
                    break
        frames = fitted(self.contract, frames, part.asked)
        yield Piece(number, int(action[0]), frames, len(frames))

    def _decoded(self, codes: Ids, context: Context | None) -> Array:
        decoder = StreamingDecoder(self.codec, context)
        return np.concatenate([decoder.push(codes), decoder.finish()])
