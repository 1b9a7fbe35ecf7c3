"""What answers requests: from a request to an answer of models, to pages, and to errors as JSON."""

import asyncio
import json
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from typing import TypeVar

from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from motet.draw.page import source
from motet.errors import BundleError, MotetError, OutputError
from motet.files import Json
from motet.serve.answers import Answer, Answers
from motet.serve.content import MEDIA
from motet.serve.limits import Limits, refusal
from motet.serve.openapi import described, manual
from motet.serve.request import RequestData, read_request
from motet.serve.routes import DOORS, Door
from motet.serve.uploads import TAKES

T = TypeVar("T")
Endpoint = Callable[[Request], Awaitable[Response]]

log = logging.getLogger(__name__)

UNDERSTOOD = "Motet-Understood"
"""The header of an answer with JSON: of each sentence its confidence, and what the model knows that is near."""


HEADER_BYTES = 3000
"""Of it: proxies allow 4 KB for all headers together, some clients 8 or 16."""

PAGE = {
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-src 'self'",
    "X-Content-Type-Options": "nosniff",
}


def routes(answers: Answers, version: str) -> list[Route]:
    """All addresses but that of live figures."""
    document = described(version)
    start = source("motet.serve", "page.html")
    start = start.replace("{{STYLE}}", source("motet.draw", "page.css")).replace("{{TAKES}}", ",".join(TAKES))

    async def health(_: Request) -> Response:
        return JSONResponse({"status": "ok", "version": version, **answers.state()})

    async def openapi(_: Request) -> Response:
        return JSONResponse(document)

    async def page(_: Request) -> Response:
        return HTMLResponse(start, headers=PAGE)

    async def docs(_: Request) -> Response:
        return HTMLResponse(manual(version), headers=PAGE)

    others = {"/": page, "/docs": docs, "/openapi.json": openapi, "/health": health}
    doors = [Route(door.path, endpoint(door, answers), methods=list(door.methods)) for door in DOORS]
    return [*doors, *(Route(path, function) for path, function in others.items())]


def endpoint(door: Door, answers: Answers) -> Endpoint:
    """What answers requests to an address."""
    limits = answers.limits

    async def answered(request: Request) -> Response:
        try:
            async with asyncio.timeout(limits.seconds):
                data = await read_request(request, door.parameters, door.files, limits)
                return await while_there(request, _answer(door, answers, data, request))
        except TimeoutError:
            raise HTTPException(504, f"there was no answer within {limits.seconds:g} s") from None

    return answered


async def _answer(door: Door, answers: Answers, data: RequestData, request: Request) -> Response:
    if door.name == "stream":
        lines = await answers.stream(data)
        return StreamingResponse(_to_the_end(lines, answers.limits), media_type="application/x-ndjson")
    if door.name == "describe":
        return _response(await answers.describe(data), "description.json")
    form = request.path_params["format"]
    if form not in MEDIA:
        raise HTTPException(404, f"there is no format {form!r}: expected one of {', '.join(MEDIA)}")
    made = await (answers.generate if door.name == "generate" else answers.predict)(data, form)
    return _response(made, f"motion.{form}")


def _response(answer: Answer, name: str) -> Response:
    shown = name.endswith((".html", ".json"))
    headers = {"X-Content-Type-Options": "nosniff"}
    headers |= {} if shown else {"Content-Disposition": f'attachment; filename="{name}"'}
    headers |= {} if answer.understood is None else {UNDERSTOOD: in_a_header(answer.understood)}
    return Response(answer.content, headers=headers, media_type=answer.media)


def in_a_header(understood: Sequence[Json]) -> str:
    """JSON of what was understood of sentences, short enough for the headers of any client: of the first of them, and
    how many more there are. The answer as JSON has all."""
    count = min(len(understood), 10)
    while True:
        more = [] if count == len(understood) else [{"more": len(understood) - count}]
        text = json.dumps([*understood[:count], *more])
        if len(text) <= HEADER_BYTES or not count:
            return text
        count -= 1


async def _to_the_end(lines: AsyncIterator[bytes], limits: Limits) -> AsyncIterator[bytes]:
    """The lines of a stream; one that fails ends with the error."""
    try:
        while True:
            async with asyncio.timeout(limits.seconds):
                line = await anext(lines, None)
            if line is None:
                return
            yield line
    except (MotetError, TimeoutError) as error:
        message = str(error) or f"there were no frames within {limits.seconds:g} s"
        yield json.dumps({"error": message, "type": type(error).__name__}).encode() + b"\n"


async def while_there(request: Request, work: Awaitable[T]) -> T:
    """What is worked out for a client, whose request is read; ClientDisconnect as soon as it leaves."""
    working = asyncio.ensure_future(work)
    leaving = asyncio.ensure_future(request.receive())
    try:
        await asyncio.wait({working, leaving}, return_when=asyncio.FIRST_COMPLETED)
        if not working.done():
            raise ClientDisconnect
        return working.result()
    finally:
        working.cancel()
        leaving.cancel()


async def fault(_: Request, error: Exception) -> Response:
    """One of motet's errors, by its sentence: 400, or 500 where it is none of the client's."""
    inner = isinstance(error, BundleError | OutputError)
    if inner:
        log.error("%s", error)
    return refusal(500 if inner else 400, str(error), type(error).__name__)


async def refused(_: Request, error: Exception) -> Response:
    """What Starlette refuses, such as an unknown address."""
    assert isinstance(error, HTTPException)
    return refusal(error.status_code, error.detail, **error.headers or {})


async def broken(_: Request, __: Exception) -> Response:
    """A fault of the server: no more is said of it than that."""
    return refusal(500, "the server is at fault; its log says more", "Error")
