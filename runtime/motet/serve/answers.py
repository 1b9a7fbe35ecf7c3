"""What models answer to requests, as the commands of the same names would."""

import asyncio
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial, wraps
from itertools import islice
from pathlib import PurePath
from typing import Any, ParamSpec, TypeVar, cast

from motet.draw.page import Captions
from motet.errors import TextWarning, TravelWarning, collected
from motet.figures.feet.treadmill import is_in_place
from motet.figures.humanoid import rig
from motet.files import Json
from motet.formats import ONTO, Character
from motet.generate.base import PLAYED, Generated, Story
from motet.generate.model import CodesModel
from motet.models.describe import DescribeModel, Description
from motet.motion.looping import looped
from motet.motion.motion import Motion, rest_motion
from motet.predict.model import PredictModel
from motet.serve.batches import Batcher
from motet.serve.content import MEDIA, Order, as_json, content_of, figure_of, frames_of
from motet.serve.limits import Limits
from motet.serve.readers import Readers
from motet.serve.request import RequestData
from motet.serve.uploads import Bounds, RequestError
from motet.text.clauses import Passage, Shown

T = TypeVar("T")
P = ParamSpec("P")
Key = frozenset[tuple[str, Any]]

MODEL = ("seed", "max_seconds", "temperature", "top_p", "strict", "whole")
"""Settings of ``motet generate`` that are its model's."""


@dataclass(frozen=True)
class Answer:
    """The content of an answer, and how well its sentences were understood, where it has some."""

    content: bytes
    media: str
    understood: list[Json] | None = None


class Answers:
    """Answers requests by three models. Errors are those of the models, RequestError, and FormatError for files.

    Models run and answers are written in one thread, one call after the other: while it writes the answers of a batch,
    the next one gathers. Motions are measured in two others. Files are read, and motions written on the characters in
    them, in processes.
    """

    def __init__(self, generate: CodesModel, describe: DescribeModel, predict: PredictModel, limits: Limits) -> None:
        self._writer = generate
        self._describer = describe
        self._predictor = predict
        self.limits = limits
        self._models = ThreadPoolExecutor(1, "models")
        self._threads = ThreadPoolExecutor(2, "requests")
        self._bounds = Bounds(limits.motion_seconds, 8 * limits.body_bytes)
        self._readers = Readers(limits.body_bytes, limits.seconds)
        self._generated = Batcher(unwarned(self._generate), self._models, limits.batch)
        self._described = Batcher(unwarned(self._describe), self._models, limits.batch)
        self._predicted = Batcher(unwarned(self._predict), self._models, limits.batch)

    def close(self) -> None:
        """End the processes, and the threads once what runs is done."""
        self._readers.close()
        for pool in (self._models, self._threads):
            pool.shutdown(cancel_futures=True)

    def state(self) -> Json:
        """What a look at the server's health shows: the models, and how many requests wait for them."""
        models = (self._writer, self._describer, self._predictor)
        waiting = len(self._generated) + len(self._described) + len(self._predicted)
        return {"models": {model.VERB: model.manifest.name for model in models}, "waiting": waiting}

    # ---- generate

    async def generate(self, data: RequestData, form: str) -> Answer:
        """The motion of a sentence, or of several as a story, in a format out of MEDIA."""
        texts, settings = await _in(self._threads, self._texts_and_settings, data, data.settings.get("story", False))
        character = await _in(self._threads, rig_of, data, form, self.limits)
        if data.settings.get("story") or {"stand", "after"} & {*data.settings, *data.files}:
            settings |= await self._after(data)
            result: Generated = await _in(self._models, partial(self._writer.story, texts, **settings))
        else:
            seed = settings.pop("seed", 0)
            result = await self._generated(frozenset(settings.items()), (texts[0], seed))
        motion, order = await _in(self._models, self._shown, result, texts, data, form)
        return await self._answer(motion, order, data, character)

    async def stream(self, data: RequestData) -> AsyncIterator[bytes]:
        """Lines of JSON: the figure, then frames as they are drawn; errors before the first."""
        texts, settings = await _in(self._threads, self._texts_and_settings, data, True)
        settings |= await self._after(data)
        pieces = await _in(self._models, partial(self._writer.stream, texts, **settings))
        parts = []
        for text in texts:
            parts += self._parts(text, data)
        understood = await _in(self._models, lambda: [self._read_as(part) for part in parts])
        piece = await _in(self._models, next, pieces, None)

        async def lines() -> AsyncIterator[bytes]:
            nonlocal piece
            if piece is not None:
                yield as_json({"understood": understood, **figure_of(piece)}) + b"\n"
            while piece is not None:
                yield await _in(self._threads, lambda shown: as_json(frames_of(shown)) + b"\n", piece)
                piece = await _in(self._models, next, pieces, None)

        return lines()

    def _texts_and_settings(self, data: RequestData, story: bool) -> tuple[list[str], dict[str, Any]]:
        """The sentences and the settings of the model; RequestError where there is none, or too much."""
        texts: list[str] = data.settings.get("text", [])
        settings = data.some(*MODEL, "seconds", "stand")
        if not texts:
            raise RequestError("text: is missing: expected a sentence, such as 'a person walks'")
        if len(texts) > 1 and not story:
            raise RequestError(
                f"text: {len(texts)} sentences become one motion with story=true; else ask for each alone"
            )
        seconds = settings.get("seconds")
        each = seconds if isinstance(seconds, list) else [seconds] * len(texts)
        if len(each) != len(texts):
            raise RequestError(f"seconds: expected a number, or one for each of {len(texts)} texts, not {len(each)}")
        self._check_length(self._longest(texts, each, data))
        return texts, {**settings, "seconds": each[0] if len(texts) == 1 else seconds}

    def _longest(self, texts: list[str], seconds: list[float | None], data: RequestData) -> float:
        """How many seconds the texts may become, each of a length or None."""
        longest_part = data.settings.get("max_seconds", self._writer.defaults["max_seconds"])
        longest = 0.0
        for text, length in zip(texts, seconds, strict=True):
            longest += len(self._parts(text, data)) * longest_part if length is None else length
        return longest

    def _check_length(self, seconds: float) -> None:
        if seconds > self.limits.motion_seconds:
            most = f"this server gives at most {self.limits.motion_seconds:g} s"
            raise RequestError(f"seconds, max_seconds: up to {seconds:g} s of motion are asked for: {most}")

    async def _after(self, data: RequestData) -> dict[str, Motion]:
        after = data.files.get("after")
        return {} if after is None else {"after": await self._readers.motion(after, self._bounds, {})}

    def _generate(self, key: Key, requests: list[tuple[str, int]]) -> list[Generated]:
        texts, seeds = zip(*requests, strict=True)
        return [row[0] for row in self._writer.generate(list(texts), seed=list(seeds), **cast(Any, dict(key)))]

    def _parts(self, text: str, data: RequestData) -> list[str]:
        """What a text asks for one after another."""
        return [text] if data.settings.get("whole") else self._writer.parts(text)

    def _read_as(self, text: str, shown: Shown | Generated | Passage | None = None) -> Json:
        """How a sentence was understood: as what it is shown, or will likely be."""
        shown = shown or self._writer.likeliest(text)
        known = asdict(self._writer.understood(text))
        return {"text": text, **known, "action": shown.action, "lacking": list(shown.lacking)}

    def _shown(self, result: Generated, texts: list[str], data: RequestData, form: str) -> tuple[Motion, Order]:
        """What was drawn, and how it is to be given, like ``motet generate`` writes it."""
        motion = result.playable(data.settings.get("fps", PLAYED), not data.settings.get("no_plant", False))
        motion = looped(motion) if data.settings.get("loop") else motion
        shown = result.passages if isinstance(result, Story) else ()
        passages = [asdict(passage) for passage in shown]
        captions = [(passage.start, passage.text) for passage in shown] or None
        understood = [self._read_as(passage.text, passage) for passage in shown] or [self._read_as(texts[0], result)]
        details = {"understood": understood, "unknown": result.unknown, "passages": passages}
        return motion, order_of(data, form, " / ".join(texts), captions, details)

    async def _answer(self, motion: Motion, order: Order, data: RequestData, character: Character | None) -> Answer:
        """A motion as it is ordered, on the character of a file in a process of its own."""
        file = data.files.get("onto") or data.files.get("like")
        if file is None:
            content = await _in(self._models, content_of, motion, order, character)
        else:
            content = await self._readers.content(motion, order, file)
        return Answer(content, MEDIA[order.form], order.details.get("understood"))

    # ---- describe

    async def describe(self, data: RequestData) -> Answer:
        """What ``motet describe --json`` says of a file."""
        motion = await self._uploaded_motion(data)
        about = {"input": data.files["file"].name, "in_place": await _in(self._threads, is_in_place, motion)}
        if not data.settings.get("timeline"):
            rows = await self._windows_described(motion, data)
        elif data.some("beams", "draws"):
            raise RequestError("timeline gives one sentence for each part: it goes with neither beams nor draws")
        else:
            rows = [part.to_json() for part in await _in(self._models, self._describer.timeline, motion)]
        return Answer(as_json([{**about, **row} for row in rows]), MEDIA["json"])

    async def _windows_described(self, motion: Motion, data: RequestData) -> list[Json]:
        """The start, stop and sentences of each window of a motion."""
        windows = await _in(self._threads, self._describer.windows, motion)
        settings = data.some("beams", "draws", "seed")
        if settings.get("draws") == 0:  # none drawn: beam search
            settings = {**settings, "draws": None, "decoding": "beam"}
        descriptions = await self._described(frozenset(settings.items()), [window for _, window in windows])
        rows = []
        for (start, part), row in zip(windows, descriptions, strict=True):
            hypotheses = [hypothesis.to_json() for hypothesis in row]
            rows.append({"start": start, "stop": start + part.duration, "hypotheses": hypotheses})
        return rows

    def _describe(self, key: Key, files: list[list[Motion]]) -> list[list[list[Description]]]:
        all_windows = []
        for windows in files:
            all_windows += windows
        descriptions = iter(self._describer.describe(all_windows, **cast(Any, dict(key))))
        return [list(islice(descriptions, len(windows))) for windows in files]

    async def _uploaded_motion(self, data: RequestData) -> Motion:
        """The motion of the file of a request."""
        if "file" not in data.files:
            raise RequestError(
                "there is no file: send its bytes as the body, and its type as format, or a form's 'file'"
            )
        options = {**data.some("clip", "figure", "partial"), "unit": data.settings.get("unit_in")}
        return await self._readers.motion(data.files["file"], self._bounds, options)

    # ---- predict

    async def predict(self, data: RequestData, form: str) -> Answer:
        """How the motion of a file goes on, like ``motet predict`` writes it."""
        motion = await self._uploaded_motion(data)
        model = self._predictor
        character = await _in(self._threads, rig_of, data, form, self.limits)
        count = model.count(**data.some("seconds", "frames"))
        self._check_length(count / model.fps)
        key = frozenset({"frames": count, **data.some("append")}.items())
        result = await self._predicted(key, (motion, data.settings.get("seed", 0)))
        order = order_of(data, form, PurePath(data.files["file"].name).stem)
        return await self._answer(result, order, data, character)

    def _predict(self, key: Key, requests: list[tuple[Motion, int]]) -> list[Motion]:
        motions, seeds = zip(*requests, strict=True)
        options = {**dict(key), "seed": list(seeds), "beyond": self._writer}
        return self._predictor.predict(list(motions), **cast(Any, options))


def rig_of(data: RequestData, form: str, limits: Limits) -> Character | None:
    """The rig "like" that a motion is to be put on. RequestError where that, or a file "like" or "onto", does not go
    with the format, or the frame rate is out of range."""
    like = data.files.get("like") or data.settings.get("like")
    onto = data.files.get("onto")
    if not 0 < data.settings.get("fps", 1.0) <= limits.fps:
        raise RequestError(f"fps: expected more than 0 and at most {limits.fps:g}, not {data.settings['fps']:g}")
    if like and onto:
        raise RequestError("'like' gives only the motion, 'onto' the character with it: give one of the two")
    if onto is None and form == "vrm":
        raise RequestError("a .vrm is an avatar: give the file of one as 'onto', or ask for .vrma")
    if onto is not None and f".{form}" not in ONTO:
        raise RequestError(f"'onto' gives the character itself: ask for {' or '.join(ONTO)}, not .{form}")
    return Character(rest_motion(rig(like))) if isinstance(like, str) else None


def order_of(
    data: RequestData, form: str, title: str, captions: Captions | None = None, details: Json | None = None
) -> Order:
    """What a request orders."""
    settings = data.settings
    options = {"fps": settings.get("fps"), "in_place": settings.get("in_place", False), "onto": "onto" in data.files}
    return Order(form, title, **options, captions=captions, details=details or {})


async def _in(pool: ThreadPoolExecutor, call: Callable[..., T], *arguments: Any) -> T:
    """What a call gives, made in a thread of a pool."""
    return await asyncio.get_running_loop().run_in_executor(pool, unwarned(call), *arguments)


def unwarned(call: Callable[P, T]) -> Callable[P, T]:
    """A call of which nothing is warned: the answers say what was not understood."""

    @wraps(call)
    def without_warnings(*arguments: P.args, **settings: P.kwargs) -> T:
        with collected(TextWarning, TravelWarning):
            return call(*arguments, **settings)

    return without_warnings
