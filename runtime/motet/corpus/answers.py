"""What a verb answers of each of many motions, one by one or batch by batch, wherever that runs.

A :class:`Verb` is what goes to other processes and machines: it loads its model once in each.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar, cast

import numpy as np

from motet.bundle.bundle import Bundle
from motet.bundle.graph import SessionOptions
from motet.corpus import checked
from motet.corpus.checked import Checked
from motet.corpus.sources import Source, opened
from motet.errors import MotetError, TravelWarning, UnitError, collected, each_once
from motet.files import Json
from motet.models.describe import DescribeModel
from motet.models.load import load_as
from motet.motion.motion import Motion
from motet.motion.skeleton import Names

Kind = TypeVar("Kind")
_Window = tuple["Answer", float, float, Motion]


@dataclass
class Answer:
    """What was found of a motion: rows ready for :func:`to_json`, or an error that names it; and the warnings.

    fps: its frame rate, None where it was not read. hash: SHA-256 of its file, in hex, where that was asked for.
    """

    source: Source
    rows: list[Any] = field(default_factory=list)
    error: str = ""
    warned: Names = ()
    fps: float | None = None
    hash: str = ""

    @property
    def about(self) -> Json:
        """What rows begin with: the motion, and whether it is a clip in place, which was given a path."""
        return {"input": str(self.source), "in_place": bool(self.warned)}

    @contextmanager
    def tried(self) -> Iterator[None]:
        """What is done for this motion; motet's own errors end only that, and are kept with the warnings."""
        with collected(TravelWarning) as notes:
            try:
                yield
            except MotetError as error:
                self.error = named(self.source, error)
        self.warned = tuple(each_once(notes))


def named(source: object, error: MotetError) -> str:
    """What an error says, with the motion that it is about."""
    hint = " (--unit-in)" if isinstance(error, UnitError) else ""
    text = str(error).removeprefix(f"{getattr(source, 'path', None)}: ")
    return f"{text}{hint}" if str(source) in text else f"{source}: {text}{hint}"


def to_json(row: Any) -> str:
    """A row as JSON on one line."""
    return json.dumps(row, default=lambda value: value.tolist() if isinstance(value, np.ndarray) else value.to_json())


@dataclass(frozen=True)
class Verb:
    """Answers batches of motions: one :class:`Answer` each, the same as alone.

    reading: options of :func:`motet.read`.
    """

    reading: Mapping[str, Any]

    @property
    def most(self) -> int:
        """Motions that are answered at once."""
        return 1

    def __call__(self, sources: Sequence[Source]) -> list[Answer]:
        """The answers, in order."""
        return [self.alone(source) for source in sources]

    def alone(self, source: Source) -> Answer:
        """The answer of one motion."""
        answer = Answer(source)
        with answer.tried():
            answer.rows = self.rows(answer)
        return answer

    def rows(self, answer: Answer) -> list[Any]:
        """What is found of one motion, where each is answered by itself."""
        raise NotImplementedError

    def read(self, answer: Answer) -> Motion:
        """The motion that an answer is about."""
        motion = answer.source.read(**self.reading)
        answer.fps = motion.fps
        return motion

    def about(self) -> Json:
        """What its answers depend on but the motions, for JSON."""
        return {"verb": type(self).__name__, "reading": {k: str(v) for k, v in self.reading.items() if v}}


@dataclass(frozen=True)
class Hashed(Verb):
    """Another verb's answers, with the hashes of the files."""

    verb: Verb

    @property
    def most(self) -> int:
        """That of the verb."""
        return self.verb.most

    def __call__(self, sources: Sequence[Source]) -> list[Answer]:
        """The answers, in order."""
        answers = self.verb(sources)
        for answer in answers:
            answer.hash = answer.source.hash()
        return answers


@dataclass(frozen=True)
class OfModel(Verb, Generic[Kind]):
    """A verb of a model, which each process loads once. bundle: its name or path."""

    bundle: str = ""
    session: SessionOptions = field(default_factory=SessionOptions)
    MODEL: ClassVar[Any]

    @property
    def most(self) -> int:
        """Motions that are answered at once."""
        return 64

    @cached_property
    def model(self) -> Kind:
        """The model."""
        return cast(Kind, load_as(self.MODEL, self.bundle, self.session))

    def __getstate__(self) -> Json:
        return {name: value for name, value in vars(self).items() if name != "model"}

    def about(self) -> Json:
        """Also the bundle's identity."""
        return {**super().about(), "bundle": Bundle.open(self.bundle).manifest.identity}


@dataclass(frozen=True)
class Describe(OfModel[DescribeModel]):
    """Ranked sentences for each window of at most 30 s. settings: of :meth:`motet.DescribeModel.describe`."""

    bundle: str = "describe"
    settings: Mapping[str, Any] = field(default_factory=dict)
    MODEL = DescribeModel

    def __call__(self, sources: Sequence[Source]) -> list[Answer]:
        """The answers, in order; a row for each window, with input, in_place, start, stop and hypotheses."""
        answers = list(map(Answer, sources))
        windows = []
        for answer in answers:
            with answer.tried():
                cut = self.model.windows(self.read(answer))
                windows += [(answer, start, part.duration, self.model.prepared(part)) for start, part in cut]
            if len(windows) >= self.most:  # long motions have many, which must not all be in memory
                self._say(windows)
                windows.clear()
        self._say(windows)
        return answers

    def _say(self, windows: Sequence[_Window]) -> None:
        """Describe windows, each a row of its answer."""
        hypotheses = self.model.describe([part for *_, part in windows], **self.settings)
        for (answer, start, seconds, _), descriptions in zip(windows, hypotheses, strict=True):
            row = {**answer.about, "start": start, "stop": start + seconds}
            answer.rows.append({**row, "hypotheses": [description.to_json() for description in descriptions]})

    def about(self) -> Json:
        """Also the settings."""
        return {**super().about(), "settings": dict(self.settings)}


@dataclass(frozen=True)
class Timeline(OfModel[DescribeModel]):
    """A sentence for each part of a motion of any length: rows with input, in_place, start, stop and the sentence."""

    bundle: str = "describe"
    MODEL = DescribeModel

    @property
    def most(self) -> int:
        """One, whose windows are many."""
        return 1

    def rows(self, answer: Answer) -> list[Any]:
        """A row for each part."""
        return [part.to_json() for part in self.model.timeline(self.read(answer))]

    def alone(self, source: Source) -> Answer:
        """The answer of one motion."""
        answer = super().alone(source)
        answer.rows = [{**answer.about, **row} for row in answer.rows]
        return answer


@dataclass(frozen=True)
class Embed(OfModel[DescribeModel]):
    """The context vector of each motion: a row with input, in_place and vector (C,) float32."""

    bundle: str = "describe"
    MODEL = DescribeModel

    def __call__(self, sources: Sequence[Source]) -> list[Answer]:
        """The answers, in order."""
        answers = list(map(Answer, sources))
        motions = []
        for answer in answers:
            with answer.tried():
                motions.append((answer, self.model.prepared(self.read(answer))))
        for (answer, _), vector in zip(motions, self.model.embed([motion for _, motion in motions]), strict=True):
            answer.rows = [{**answer.about, "vector": vector}]
        return answers


@dataclass(frozen=True)
class Check(Verb):
    """What a motion file holds: a row, which is :class:`motet.Checked`."""

    def rows(self, answer: Answer) -> list[Any]:
        """The one row."""
        return [look(answer.source, self.reading)]


def look(source: Source, reading: Mapping[str, Any]) -> Checked:
    """:func:`motet.check` of a source, whose file may be in a zip."""
    with opened(source.path) as file:
        row = checked.check(file, clip=source.clip, figure=source.figure, **reading)
    return row if file == source.path else replace(row, file=str(source.path))
