"""Drawing a story: one request after another, in pieces as they come, or to a measure where a request has numbers."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import Any, NamedTuple

import numpy as np

from motet.bundle.graph import Floats
from motet.decode.loop import Ids, Noise
from motet.generate.codec import Codec, Context, StreamingDecoder
from motet.generate.codes import CodesSettings, Source, Writer, drawn_actions, drawn_steps
from motet.generate.keyed_acts import LOW_HIPS, STAYS, WALKED_SECONDS, NamedAct
from motet.generate.motion_measures import Seen, enough, fitted, played, turn_to_make, turned
from motet.keyed.shipped import shipped
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.text.numeric_phrases import Kind, Quantities

KEPT = -1
"""The action of a piece in which a figure stays as it is."""

LONGEST_REQUEST = 300.0
"""Seconds that a request with a number lasts at most."""

STRETCH_SECONDS = 20.0
"""Seconds, at most, of the stretches in which a request is drawn whose length comes first."""

LEAST_PROGRESS: Mapping[Kind, float] = {"degrees": 20.0, "metres": 0.3, "steps": 0.5, "times": 0.1}
"""Least progress per second, after ten seconds of grace: a motion that is slower is not continued."""


@dataclass(frozen=True, eq=False)
class Request:
    """A text to be shown, as :class:`motet.generate.model.CodesModel` reads it once for generate, story and stream."""

    text: str
    """A sentence, or a part of one."""

    quantities: Quantities
    """The numbers in the text, and the text that is shown."""

    context: Floats
    """(A,) log-probabilities of actions."""

    seconds: float
    """Its length, 0 where it ends by itself."""

    pace: float = 1.0
    """Factor by which it is played faster than drawn, to last as long."""

    keyed: NamedAct | None = None
    """The act by key poses that is laid over the text that is shown."""

    rests: float = 0.0
    """Metres of the hips below which nothing is to be done (:data:`motet.generate.keyed_acts.RESTS`)."""

    @property
    def to_measure(self) -> bool:
        """Whether it is drawn until its numbers are reached; a length alone is kept by the decoder."""
        return bool(self.quantities.amounts.keys() - {"seconds"}) or self.pace != 1 or self.keyed is not None

    @property
    def is_alone(self) -> bool:
        """Whether it is not drawn together with its neighbours: its numbers, or the pose before it, say how."""
        return self.to_measure or self.rests > 0

    @property
    def exactly(self) -> bool:
        """Whether its length comes first."""
        kinds = self.quantities.amounts.keys()
        return self.seconds > 0 and ("seconds" not in kinds or not kinds - {"seconds", "pace"})


def pace_of(request: Request, source: Source, codec: Codec) -> float:
    """The factor by which a request is played faster than drawn: as its text says, or as shows its act in its seconds
    (:meth:`motet.generate.memory.Memory.paced`)."""
    if not request.exactly:
        return 1.0
    if "pace" in request.quantities.amounts:
        return request.quantities.amounts["pace"]
    steps = codec.steps(request.seconds)
    return source.memory.paced(int(request.context.argmax()), steps) / steps


class Piece(NamedTuple):
    """Frames of a story that become final. The first piece of a request comes before its frames."""

    number: int
    """Of the request that was drawn with them."""

    action: int
    frames: Array
    """(T, D)."""

    longer: int
    """Frames by which the passage of that request becomes longer."""


@dataclass(eq=False)
class Limited:
    """The frames of a run that are shown, up to a limit."""

    limit: int | None = None
    """Frames of the run by the end of the request."""

    count: int = 0
    """Frames shown so far."""

    def next(self, frames: Array) -> Array:
        """The frames (T, D) that are within the limit."""
        if self.limit is not None:
            frames = frames[: self.limit - self.count]
        self.count += len(frames)
        return frames


@dataclass(eq=False)
class OnDemand:
    """Draws and decodes no more steps than the frames that are called for need."""

    decoder: StreamingDecoder
    drawn: Iterator[tuple[Ids, Ids]]
    """As of :func:`motet.generate.codes.drawn_steps`."""

    steps: int
    """How many there are."""

    waiting: Array
    """Frames (T, D) that are decoded and not called for yet."""

    pushed: int = 0
    """Steps that the decoder has."""

    def next(self, until: float, count: int, ends: bool) -> Array:
        """The next ``count`` frames, up to the frame ``until``; all steps are decoded where the motion ends."""
        field = self.decoder.codec.field
        needed = self.steps if ends else min(self.steps, math.ceil(until / field.hop) + field.ahead + 1)
        codes: list[Ids] = []
        for _, step in islice(self.drawn, needed - self.pushed):
            codes += list(step)
        self.pushed = needed
        decoded = [self.waiting, self.decoder.push(np.array(codes))]
        if ends:
            decoded.append(self.decoder.finish())
        frames = np.concatenate(decoded)
        self.waiting = frames[count:]
        return frames[:count]


@dataclass(frozen=True, eq=False)
class Teller:
    """Draws the requests of a story."""

    source: Source
    codec: Codec
    contract: MotionContract
    noise: Sequence[Noise]
    settings: Mapping[str, Any]
    """Settings of the loop."""

    seconds: float
    """The length of a motion's end that the next request continues."""

    together: int = 1
    """Steps that are decoded at once: 1 gives each frame as soon as it is final, more take less time in all."""

    def pieces(self, requests: Sequence[Request], context: Context | None) -> Iterator[Piece]:
        """The pieces of all requests. context: the end of the motion that they continue."""
        runs = _runs(requests)
        for run in runs:
            tail = [] if context is None else [context.frames]
            for piece in self._pieces_of(run, context):
                yield piece
                tail = [np.concatenate([*tail, piece.frames])[-self._kept :]] if run is not runs[-1] else []
            # less than a step is too little to be continued
            if tail and len(tail[0]) >= self.codec.field.hop:
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

    def _action(self, request: Request) -> Ids:
        return drawn_actions(self.source, request.context[None], self.noise, self.settings["certainty"])

    def _pieces_of(self, run: Sequence[tuple[int, Request]], context: Context | None) -> Iterator[Piece]:
        number, request = run[0]
        if self._is_below(request.rests, context):
            kept = self._keyed(number, request, NamedAct(shipped(STAYS), STAYS), context)
            return (piece._replace(action=KEPT) for piece in kept)
        if not request.to_measure:
            return self._flowing(run, context)
        if request.keyed is not None:
            return self._keyed(number, request, request.keyed, context)
        if request.exactly:
            return self._timed(number, request, context)
        return self._measured(number, request, context)

    def _flowing(self, run: Sequence[tuple[int, Request]], context: Context | None) -> Iterator[Piece]:
        """Pieces of the steps that are decoded at once, of requests without numbers; then the remaining frames."""
        writer = self._writer(context)
        decoder = StreamingDecoder(self.codec, context)
        hop = self.codec.field.hop
        shown = Limited()
        steps_drawn = 0
        end = 0.0  # seconds at which a request is to end
        number = action = 0
        for number, request in run:
            actions = self._action(request)
            action = int(actions[0])
            yield Piece(number, action, self._no_frames, 0)

            # Lengths count from the start of the run, so that rounding errors do not add up.
            end += request.seconds
            exactly = request.seconds > 0
            longest = self.codec.steps(end) - steps_drawn if exactly else self.codec.steps(self.settings["max_seconds"])
            shown.limit = max(1, round(end * self.contract.fps)) if exactly else None
            for codes in _grouped(drawn_steps(writer, actions, longest, exactly=exactly), self.together):
                steps_drawn += len(codes)
                yield Piece(number, action, shown.next(decoder.push(codes)), hop * len(codes))
            if not exactly:
                end = steps_drawn * self.codec.seconds
        # What the decoder held back, as nothing follows; its steps have been counted in full.
        last = shown.next(decoder.finish())
        yield Piece(number, action, last, shown.count - steps_drawn * hop)

    def _timed(self, number: int, request: Request, context: Context | None) -> Iterator[Piece]:
        """A request whose length comes first, stretch by stretch: each has its share of the turn and of the length."""
        actions = self._action(request)
        steps = self.codec.steps(request.seconds * request.pace)
        drawn = drawn_steps(self._writer(context), actions, steps, exactly=True)
        decoder = OnDemand(StreamingDecoder(self.codec, context), drawn, steps, self._no_frames)
        length = max(1, round(request.seconds * self.contract.fps))
        edges = np.linspace(0, length, math.ceil(request.seconds / STRETCH_SECONDS) + 1).round().astype(int).tolist()
        lead = self._no_frames  # the last frame before a stretch
        degrees = 0.0
        for start, stop in pairwise(edges):
            # As many frames as are played in the stretch.
            count = round(stop * request.pace) - round(start * request.pace)
            frames = np.concatenate([lead, decoder.next(stop * request.pace, count, stop == length)])
            # Turned by its share of the turn, to the side that the first stretch turns to.
            if "degrees" in request.quantities.amounts:
                seen = Seen.of(self.contract, frames)
                degrees = degrees or turn_to_make(seen, request.quantities)
                share = degrees * (stop - start) / length
                frames = turned(seen, frames, share, begins=start == 0, ends=stop == length)
            # And played to its share of the length.
            shown = played(frames, len(frames) / (len(lead) + stop - start))[len(lead) :]
            lead = frames[-1:]
            yield Piece(number, int(actions[0]), shown, len(shown))

    def _keyed(self, number: int, request: Request, act: NamedAct, context: Context | None) -> Iterator[Piece]:
        """An act by key poses, over a figure that stands, or does what the act is laid over, as long."""
        seed = int(self.noise[0].random((1,), np.float32)[0] * 1e7)
        act = act.lasting(request.seconds, seed)
        # as many steps as the act has, or more; what lasts longer than it may is begun, and cut off
        seconds = act.act.seconds(seed)
        limit = seconds if act.times else min(seconds, self.settings["max_seconds"])
        length = request.seconds or (max(limit, WALKED_SECONDS) if act.legs or act.below else limit)
        last = max(1, round(length * self.contract.fps))
        steps = self.codec.steps(max(seconds, length) * act.pace) + 1
        action = self._action(request)
        frames = self._below(act, action, steps, context)
        shown = act.laid_over(frames, self.contract, seed)[:last]
        yield Piece(number, int(action[0]), shown, len(shown))

    def _below(self, act: NamedAct, action: Ids, steps: int, context: Context | None) -> Array:
        """What an act is laid over: as many steps of an action, or the last frame of who sits, kneels or lies."""
        frames = played(self._decoded(self._drawn(action, steps, context), context), act.pace)
        if context is None or not act.leaves("hips") or not self._is_below(LOW_HIPS, context):
            return frames
        held = np.repeat(context.frames[-1:], len(frames), axis=0)
        held[:, : self._height] = 0
        return held

    @property
    def _height(self) -> int:
        """The channel of the height of the hips, after those of how they move."""
        return self.contract.channels.index("root.height")

    def _is_below(self, height: float, context: Context | None) -> bool:
        """Whether the figure's hips are below a height in metres."""
        return context is not None and bool(context.frames[-1, self._height] < height)

    def _drawn(self, action: Ids, steps: int, context: Context | None) -> Ids:
        """As many steps of an action (N, P)."""
        drawn = drawn_steps(self._writer(context), action, steps, exactly=True)
        return np.concatenate([step for _, step in drawn])

    def _decoded(self, codes: Ids, context: Context | None) -> Array:
        """All frames of codes."""
        decoder = StreamingDecoder(self.codec, context)
        return np.concatenate([decoder.push(codes), decoder.finish()])

    @property
    def _no_frames(self) -> Array:
        return np.empty((0, len(self.contract.channels)))

    def _measured(self, number: int, request: Request, context: Context | None) -> Iterator[Piece]:
        """The whole of a request: drawn again and again until its numbers are reached, and fitted to them."""
        quantities = request.quantities
        actions = self._action(request)
        most = self._most_steps(quantities)
        times = int(quantities.amounts.get("times", 1))
        least_rounds = 1 if quantities.act else times
        steps_measured = 0
        for rounds, codes in enumerate(self._again(request, actions, context), start=1):
            # A long motion is not decoded and measured after each draw.
            over = len(codes) >= most
            if not over and (rounds < least_rounds or len(codes) < 1.2 * steps_measured):
                continue
            steps_measured = len(codes)
            frames = self._decoded(codes, context)
            # It ends with what is requested, or where as many draws have never shown the act.
            seen = Seen.of(self.contract, frames)
            shows_act = bool(quantities.act and seen.done(quantities.act))
            in_vain = "times" in quantities.amounts and rounds - least_rounds >= times - 1 and not shows_act
            if over or in_vain or enough(seen, quantities):
                break
        frames = fitted(self.contract, frames, quantities)
        yield Piece(number, int(actions[0]), frames, len(frames))

    def _again(self, request: Request, actions: Ids, context: Context | None) -> Iterator[Ids]:
        """The codes (N, P) of an action drawn once, twice, and so on without end."""
        writer = self._writer(context)
        steps = self.codec.steps(request.seconds or self.settings["max_seconds"])
        codes = np.empty((0, self.source.parts), np.int64)
        while True:
            drawn = [step for _, step in drawn_steps(writer, actions, steps, whole=True)]
            codes = np.concatenate([codes, *drawn])
            yield codes

    def _most_steps(self, quantities: Quantities) -> int:
        """Steps after which a motion is not continued, by the slowest progress towards its numbers."""
        seconds = sum(abs(quantities.amounts.get(kind, 0)) / slowest for kind, slowest in LEAST_PROGRESS.items())
        return self.codec.steps(min(LONGEST_REQUEST, 10 + seconds))


def _grouped(drawn: Iterator[tuple[Ids, Ids]], count: int) -> Iterator[Ids]:
    """The codes (count, P) of so many steps that one row draws, and those (N, P) that are left in the end."""
    while steps := [step for _, step in islice(drawn, count)]:
        yield np.concatenate(steps)


def _runs(requests: Sequence[Request]) -> list[list[tuple[int, Request]]]:
    """Numbered requests in groups that are drawn together: one with numbers alone, others with their neighbours."""
    runs: list[list[tuple[int, Request]]] = []
    for numbered in enumerate(requests):
        _, request = numbered
        if not runs or request.is_alone or runs[-1][-1][1].is_alone:
            runs.append([])
        runs[-1].append(numbered)
    return runs
