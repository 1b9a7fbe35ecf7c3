"""The reference of the Python interface, from signatures and docstrings: a page of the site (mkdocs.yml), and what
``python docs/reference/api.py`` prints."""

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from typing import Any, is_typeddict

import motet
import motet.motion

HEAD = """# The Python interface

All public names of `motet`, then those of `motet.motion`, in the order of the alphabet. This page is made from
docstrings; [architecture.md](architecture.md) has the conventions.
"""


def page() -> str:
    """The text of the page, in Markdown."""
    geometry = [name for name in motet.motion.__all__ if name not in motet.__all__]
    first: dict[Any, str] = {}
    parts = [HEAD]
    for module, names in ((motet, motet.__all__), (motet.motion, geometry)):
        parts += [f"## {module.__name__}\n", *(entry(name, getattr(module, name), first) for name in names)]
    return "\n".join(parts)


def entry(name: str, member: Any, first: dict[Any, str]) -> str:
    """A public name: a class with its public methods and properties, a function, a module or a constant.

    first: the class under which each member of a private base is described, which this adds to.
    """
    if inspect.isclass(member):
        code = "\n".join([f"class {name}", *fields(member)])
        return f"### {name}\n\n{described(code, member)}{field_notes(member)}{''.join(members(member, first))}"
    if inspect.isfunction(member):
        return f"### {name}\n\n{described(signature(member, name), member)}"
    text = prose(inspect.getdoc(member)) if inspect.ismodule(member) else f"A {type(member).__name__}."
    return f"### {name}\n\n{text}\n"


def fields(kind: type) -> Iterator[str]:
    """The public fields of a dataclass or of a typed dictionary, as they are written; those of its base, too."""
    for base in map(ast.unparse, tree(kind).bases if is_typeddict(kind) else ()):
        yield from fields(vars(inspect.getmodule(kind))[base]) if base != "TypedDict" else ()
    for node in tree(kind).body:
        text = ast.unparse(node)
        if isinstance(node, ast.AnnAssign) and not text.startswith("_") and "ClassVar" not in text:
            yield f"    {text}"


def field_notes(kind: type) -> str:
    """A list of the public fields that have a docstring below them."""
    lines = []
    body = tree(kind).body
    for node, below in pairwise(body):
        is_docstring = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
        is_field = isinstance(node, ast.AnnAssign) and "ClassVar" not in ast.unparse(node.annotation)
        if is_field and is_docstring and not node.target.id.startswith("_"):
            lines.append(f"{node.target.id}: {inspect.cleandoc(below.value.value)}")
    return prose("\n".join(lines)) + "\n" if lines else ""


def members(kind: type, first: dict[Any, str]) -> Iterator[str]:
    """What a class gives its users, but for what it has from another class of this page; what several have from a
    private base is described once."""
    elsewhere: dict[str, list[str]] = {}
    for name, member in inspect.getmembers_static(kind):
        owner = next(base for base in kind.__mro__ if name in vars(base))
        if name.startswith("_") or not owner.__module__.startswith("motet") or (owner is not kind and public(owner)):
            continue
        place = first.setdefault((owner, name), kind.__name__)
        if place != kind.__name__:
            elsewhere.setdefault(place, []).append(f"`{name}`")
            continue
        if isinstance(member, property | cached_property):
            getter = member.fget if isinstance(member, property) else member.func
            yield described(f"{kind.__name__}.{name}: {ast.unparse(tree(getter).returns)}", getter)
        elif inspect.isroutine(member):
            call = getattr(member, "__func__", member)
            if not (call.__doc__ or "").startswith("See :"):  # what it overrides is described
                yield described(signature(call, f"{kind.__name__}.{name}"), call)
    for place, names in elsewhere.items():
        yield f"As of `{place}`: {', '.join(names)}.\n\n"


def public(kind: type) -> bool:
    """Whether a class is on this page."""
    return getattr(motet, kind.__name__, None) is kind


def described(code: str, member: Any) -> str:
    """Code with its docstring; "py", as blocks of "python" in the docs are run."""
    return f"```py\n{code}\n```\n{prose(inspect.getdoc(member))}\n"


def tree(member: Any) -> Any:
    """The definition of a class or function as it is written."""
    return ast.parse(textwrap.dedent(inspect.getsource(member))).body[0]


def signature(call: Any, name: str) -> str:
    """The name and parameters of a function, a line for each where one line is too long."""
    node = tree(call)
    node.args.args = [parameter for parameter in node.args.args if parameter.arg not in ("self", "cls")]
    text = f"{name}({ast.unparse(node.args)}) -> {ast.unparse(node.returns)}"
    return text if len(text) <= 110 else re.sub(r", (?=(\*\*?)?\w+:|\*,)", ",\n    ", text.replace("(", "(\n    ", 1))


def prose(text: str | None) -> str:
    """A docstring as Markdown: roles as code, and parameters as a list."""
    plain = re.sub(r":\w+:`[~.]?([^`]+)`", r"`\1`", text or "").replace("``", "`")
    listed = re.sub(r"^((?:\w+, )*\w+): ", r"* `\1`: ", plain, flags=re.MULTILINE)
    return re.sub(r"(?<!\n)\n(?=\* `)", "\n", listed) + "\n"


if __name__ == "__main__":
    print(page())
