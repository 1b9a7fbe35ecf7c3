"""The server as an ASGI application of Starlette, and run by uvicorn: both come with the extra ``serve``."""

import asyncio
import signal
import socket
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from importlib.metadata import version

from motet.bundle.bundle import Bundle
from motet.bundle.graph import SessionOptions
from motet.errors import BundleError, MotetError, OutputError
from motet.files import Json
from motet.generate.model import CodesModel
from motet.models.base import BundleModel
from motet.models.describe import DescribeModel
from motet.models.load import load_as
from motet.predict.fill import FillModel
from motet.predict.model import PredictModel
from motet.steering.model import SteerModel

try:
    import python_multipart  # noqa: F401  which Starlette needs for forms
    import uvicorn
    import websockets  # noqa: F401  which live figures need
    from starlette.applications import Starlette
    from starlette.exceptions import HTTPException
    from starlette.middleware import Middleware
    from starlette.middleware.cors import CORSMiddleware
    from starlette.routing import Mount
except ImportError as error:
    remedy = "install the extra with  pip install 'motet[serve]'"
    raise ImportError(f"motet.serve.application needs {error.name}: {remedy}") from error

from motet.serve.answers import Answers
from motet.serve.endpoints import UNDERSTOOD, broken, fault, refused, routes
from motet.serve.limits import Gate, Limits, Visitors
from motet.serve.live import LiveDoor
from motet.serve.protocol import OPTIONS, quieter

MODEL_OF_VERB: dict[str, type[BundleModel]] = {
    "generate": CodesModel,
    "describe": DescribeModel,
    "predict": PredictModel,
    "control": SteerModel,
}
"""What a server needs a bundle of, by verb, which is the default bundle's name."""


def app(
    bundles: Sequence[str] = (),
    *,
    origins: Sequence[str] = (),
    hosts: Sequence[str] | None = None,
    limits: Limits | None = None,
    session: SessionOptions | None = None,
    mmcp: bool = False,
) -> Starlette:
    """The ASGI application of ``motet serve``, for any server: ``uvicorn --factory motet.serve.application:app``.

    bundles: names or paths of bundles that take the place of "generate", "describe", "predict" and "control".
    origins: of web pages that may call it (CORS) and steer figures, beside its own and those of this machine; others
    are refused. hosts: the names that it may be called by, without ports; by default any. limits: by default those of
    :class:`Limits`. session: how graphs run. mmcp: speak the Motion Model Context Protocol, too, at /mmcp
    (:mod:`motet.serve.mmcp`).
    BundleError for a bundle that cannot be used; ImportError with the remedy where the extra mmcp is missing.
    """
    models = _models(bundles, MODEL_OF_VERB | ({"fill": FillModel} if mmcp else {}), session)
    doors = _mmcp(models["generate"], models.pop("fill"), models["control"]) if mmcp else []
    live = LiveDoor(models.pop("control"), origins)
    answers = Answers(**models, limits=limits or Limits())

    @asynccontextmanager
    async def running(_: Starlette) -> AsyncIterator[None]:
        yield
        await live.close()
        answers.close()

    # from outside to inside: who may ask, pages of other sites, and how much at once
    cors = Middleware(CORSMiddleware, allow_origins=origins, allow_methods=["*"], expose_headers=[UNDERSTOOD])
    application = Starlette(
        routes=[*routes(answers, version("motet")), *doors],
        middleware=[
            Middleware(Visitors, origins=origins, hosts=hosts),
            *([cors] if origins else []),
            Middleware(Gate, limits=answers.limits),
        ],
        exception_handlers={MotetError: fault, HTTPException: refused, Exception: broken},
        lifespan=running,
    )
    application.state.limits = answers.limits
    application.state.live = live
    return application


def _models(bundles: Sequence[str], kinds: Mapping[str, type[BundleModel]], session: SessionOptions | None) -> Json:
    """A model of each kind by its verb, which is also the default bundle's name."""
    names = {verb: verb for verb in kinds} | {Bundle.open(name).manifest.verb: name for name in bundles}
    if others := sorted(names.keys() - kinds.keys()):
        raise BundleError(f"bundle {names[others[0]]} is for {others[0]!r}; a server takes {', '.join(kinds)}")
    return {verb: load_as(kind, names[verb], session).ready() for verb, kind in kinds.items()}


def _mmcp(model: CodesModel, fill: FillModel, steer: SteerModel) -> list[Mount]:
    from motet.serve.mmcp import mmcp_app

    return [Mount("/mmcp", mmcp_app(model, fill, steer))]


def run(
    application: Starlette,
    host: str = "127.0.0.1",
    port: int = 8000,
    *,
    ready: Callable[[int], object] = lambda port: None,
) -> None:
    """Run an application until Ctrl-C or SIGTERM; requests that are being answered then have 30 seconds.

    ready: called with the port when it listens, of use where ``port`` is 0, for a free one. OutputError where it cannot
    listen.
    """
    config = uvicorn.Config(
        application,
        log_config=None,
        log_level="warning",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=30,
        **OPTIONS,
    )
    with (
        listening(host, port) as place,
        quieter("asyncio", "uvicorn.error", "motet.serve.endpoints", "motet.live.server"),
    ):
        ready(place.getsockname()[1])
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            asyncio.run(uvicorn.Server(config).serve([place]))
        except KeyboardInterrupt:  # which uvicorn raises again when it is done
            return
        finally:
            signal.signal(signal.SIGTERM, before)


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens; OutputError where it cannot."""
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        return socket.create_server((host, port), family=family, backlog=1024)
    except OSError as error:
        raise OutputError(f"cannot listen on {host}:{port}: {error.strerror or error}") from error
