"""The description of a server for programs (OpenAPI 3.1), and for people as a page."""

from html import escape

from motet.draw.page import source
from motet.files import Json
from motet.serve.content import MEDIA
from motet.serve.request import MOST_TEXTS, Parameter
from motet.serve.routes import DOORS, FILE_PARAMETERS, Door

JSON_TYPES: dict[str, Json] = {
    "text": {"type": "string"},
    "number": {"type": "number"},
    "whole": {"type": "integer"},
    "flag": {"type": "boolean"},
    "texts": {"type": "array", "items": {"type": "string"}, "minItems": 1, "maxItems": MOST_TEXTS},
    "numbers": {"type": "array", "items": {"type": "number"}, "minItems": 1, "maxItems": MOST_TEXTS},
}
REFUSALS = {
    "400": "What is asked cannot be: an error of motet, by its sentence.",
    "413": "The request is too large.",
    "503": "Too much is asked at once: try again later.",
    "504": "There was no answer in time.",
}


def schema(parameter: Parameter) -> Json:
    """The JSON schema of a setting."""
    entry = {**JSON_TYPES[parameter.kind], "description": parameter.help}
    return {**entry, "enum": list(parameter.choices)} if parameter.choices else entry


def described(version: str) -> Json:
    """The OpenAPI document."""
    error = {"type": "object", "properties": {"error": {"type": "string"}, "type": {"type": "string"}}}
    health = {"summary": "Whether it runs, its version, and what it does.", "responses": {"200": {"description": "OK"}}}
    paths = {}
    for door in DOORS:
        paths[door.path] = {method.lower(): _operation(door, method) for method in door.methods}
    return {
        "openapi": "3.1.0",
        "info": {"title": "motet", "version": version, "description": "Motions from sentences, and back."},
        "paths": {**paths, "/health": {"get": health}},
        "components": {"schemas": {"Error": error}},
    }


def _operation(door: Door, method: str) -> Json:
    media = ["application/x-ndjson" if door.name == "stream" else "application/json"]
    if door.formats:
        media = list(dict.fromkeys(MEDIA.values()))
    fault = {"application/json": {"schema": {"$ref": "#/components/schemas/Error"}}}
    operation: Json = {
        "operationId": door.name if method == "POST" else f"{door.name}_get",
        "summary": door.help,
        "parameters": [
            {"name": name, "in": "query", "schema": schema(parameter)} for name, parameter in door.parameters.items()
        ],
        "responses": {
            "200": {"description": "The answer.", "content": {kind: {} for kind in media}},
            **{status: {"description": meaning, "content": fault} for status, meaning in REFUSALS.items()},
        },
    }
    # the format is a part of the address
    if door.formats:
        form = {"type": "string", "enum": list(MEDIA)}
        operation["parameters"].insert(0, {"name": "format", "in": "path", "required": True, "schema": form})
    if method == "POST":
        operation["requestBody"] = {"content": _bodies(door)}
    return operation


def _bodies(door: Door) -> Json:
    settings = {name: schema(parameter) for name, parameter in door.parameters.items()}
    binary = {"type": "string", "contentMediaType": "application/octet-stream"}
    files = {name: {**binary, "description": FILE_PARAMETERS[name]} for name in door.files}
    both = {"multipart/form-data": {"schema": {"type": "object", "properties": {**settings, **files}}}}
    if "file" in door.files:
        return {**both, "application/octet-stream": {"schema": {}}}
    return {"application/json": {"schema": {"type": "object", "properties": settings}}, **both}


def manual(version: str) -> str:
    """The same for people, as HTML."""
    parts = "".join(map(_section, DOORS))
    page = source("motet.serve", "manual.html").replace("{{VERSION}}", escape(version))
    return page.replace("{{DOORS}}", parts).replace("{{STYLE}}", source("motet.draw", "page.css"))


def _section(door: Door) -> str:
    form = f"<p>Formats: {', '.join(MEDIA)}.</p>" if door.formats else ""
    settings = "".join(
        _row(name, parameter.kind, parameter.help, parameter.choices) for name, parameter in door.parameters.items()
    )
    files = "".join(_row(name, "file", FILE_PARAMETERS[name], ()) for name in door.files)
    title = f"{' or '.join(door.methods)} <code>{escape(door.path)}</code>"
    return f"<h2>{title}</h2><p>{escape(door.help)}</p>{form}<table>{settings}{files}</table>"


def _row(name: str, kind: str, help_text: str, choices: tuple[str, ...]) -> str:
    more = f" One of {', '.join(choices)}." if choices else ""
    return f"<tr><th><code>{escape(name)}</code></th><td>{kind}</td><td>{escape(help_text + more)}</td></tr>"
