"""What a request asks: its settings, by the names of the command line, from the address, a form or JSON; its files."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import PurePath
from typing import Any, Literal

from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException
from starlette.requests import Request

from motet.errors import quoted
from motet.files import Json
from motet.live.protocol import from_json as json_value
from motet.serve.limits import Limits
from motet.serve.uploads import RequestError, Upload
from motet.settings import is_number

LONGEST_TEXT = 1000
MOST_TEXTS = 100

Kind = Literal["text", "texts", "number", "numbers", "whole", "flag"]

KIND_NAMES = {
    "text": "a text",
    "texts": "a text or a list of texts",
    "number": "a number",
    "numbers": "a number or a list of numbers",
    "whole": "a whole number",
    "flag": "true or false",
}
FLAGS = {"true": True, "1": True, "on": True, "false": False, "0": False, "off": False}


@dataclass(frozen=True)
class Parameter:
    """A setting of requests. choices: all values of a text, where they are few."""

    kind: Kind
    help: str
    choices: tuple[str, ...] = ()

    def from_text(self, name: str, texts: Sequence[str]) -> Any:
        """The value of a setting from the texts of an address or a form; RequestError like :meth:`checked`."""
        if self.kind in ("text", "texts"):
            return self.checked(name, texts[-1] if self.kind == "text" else list(texts))
        values = [FLAGS.get(text.lower()) if self.kind == "flag" else _number(text) for text in texts]
        return self.checked(name, values if self.kind == "numbers" and len(values) > 1 else values[-1])

    def checked(self, name: str, value: Any) -> Any:
        """A value of JSON, one text or number as a list where several may be; RequestError for another type."""
        many = self.kind in ("texts", "numbers") and isinstance(value, list)
        if not all(map(self._fits, value if many else [value])) or (many and not 0 < len(value) <= MOST_TEXTS):
            wanted = f"one of {', '.join(self.choices)}" if self.choices else KIND_NAMES[self.kind]
            raise RequestError(f"{name}: expected {wanted}, not {quoted(json.dumps(value))}")
        return [value] if self.kind == "texts" and not many else value

    def _fits(self, value: Any) -> bool:
        if self.kind == "flag":
            return isinstance(value, bool)
        if self.kind in ("text", "texts"):  # lone surrogates are no characters
            fits = (
                isinstance(value, str)
                and len(value) <= LONGEST_TEXT
                and not any("\ud800" <= c <= "\udfff" for c in value)
            )
            return fits and (not self.choices or value in self.choices)
        return is_number(value) and (self.kind != "whole" or isinstance(value, int))


@dataclass(frozen=True)
class RequestData:
    """A request: settings by name as far as they are given, and files by name."""

    settings: Mapping[str, Any]
    files: Mapping[str, Upload] = field(default_factory=dict)

    def some(self, *names: str) -> dict[str, Any]:
        """The settings of these names that are given."""
        return {name: self.settings[name] for name in names if name in self.settings}


async def read_request(
    request: Request, parameters: Mapping[str, Parameter], files: Sequence[str], limits: Limits
) -> RequestData:
    """What a request asks; RequestError for anything that is not among the parameters and files.

    The body is a JSON object, a form, or the bytes of the file called "file", whose type is in "format".
    """
    settings = from_texts(request.query_params.multi_items(), parameters)
    uploads: dict[str, Upload] = {}
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind == "multipart/form-data" or (kind == "application/x-www-form-urlencoded" and "file" not in files):
        texts, uploads = await _form(request, files, limits)
        settings |= from_texts(texts, parameters)
    elif body := await request.body():
        if kind == "application/json" or "file" not in files:
            settings |= from_json(body, parameters, limits)
        else:
            uploads["file"] = Upload(body, "file")
    if "file" in uploads and "format" in settings:
        uploads["file"].name = f"{PurePath(uploads['file'].name).stem}.{settings.pop('format')}"
    return RequestData(settings, uploads)


async def _form(
    request: Request, files: Sequence[str], limits: Limits
) -> tuple[list[tuple[str, str]], dict[str, Upload]]:
    """The texts of a form, by name, and its files."""
    texts = []
    uploads: dict[str, Upload] = {}
    async with request.form(max_files=len(files), max_fields=200, max_part_size=limits.text_bytes) as form:
        for name, part in form.multi_items():
            if isinstance(part, str):
                texts.append((name, part))
            else:
                uploads[name] = await _upload(name, part, files)
    return texts, uploads


def from_texts(pairs: Iterable[tuple[str, str]], parameters: Mapping[str, Parameter]) -> Json:
    """Settings from names and texts, without those that are left empty; RequestError like :func:`from_json`."""
    texts_of: dict[str, list[str]] = {}
    for name, text in pairs:
        if text or name == "text":
            texts_of.setdefault(name, []).append(text)
    return {name: _known(name, parameters).from_text(name, texts) for name, texts in texts_of.items()}


def from_json(body: bytes, parameters: Mapping[str, Parameter], limits: Limits) -> Json:
    """Settings from a JSON object, without those that are null; RequestError for an unknown or mistyped one."""
    if len(body) > limits.text_bytes:
        raise HTTPException(413, f"the JSON is too large: expected at most {limits.text_bytes} bytes")
    try:
        document = json_value(body)
    except ValueError as fault:
        raise RequestError(f"the body must be JSON: {fault}") from fault
    if not isinstance(document, dict):
        raise RequestError(f"the body must be a JSON object, not {quoted(json.dumps(document))}")
    return {
        name: _known(name, parameters).checked(name, value) for name, value in document.items() if value is not None
    }


def _known(name: str, parameters: Mapping[str, Parameter]) -> Parameter:
    if name in parameters:
        return parameters[name]
    near = get_close_matches(name, parameters, 1)
    hint = f"did you mean {near[0]!r}?" if near else f"expected one of {', '.join(parameters)}"
    raise RequestError(f"{quoted(name)} is unknown: {hint}")


def _number(text: str) -> float | str:
    """The number that a text is, whole where it is written so; else the text."""
    for read in (int, float):
        try:
            return read(text)
        except ValueError:
            continue
    return text


async def _upload(name: str, part: UploadFile, files: Sequence[str]) -> Upload:
    if name not in files:
        raise RequestError(f"{quoted(name)} is no file that is asked for: expected {' or '.join(files) or 'none'}")
    return Upload(await part.read(), part.filename or "file")
