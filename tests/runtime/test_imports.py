"""What an import brings along: modules are counted, since seconds differ from machine to machine."""

import ast
import importlib
import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import motet
from motet.cli import COMMANDS
from motet.models.load import KINDS

COUNTED = """
import json, sys
sys.argv = ["motet", *{arguments!r}]
try:
    {code}
except SystemExit:
    pass
print(json.dumps(sorted(sys.modules)))
"""


def modules_after(code: str, *arguments: str) -> set[str]:
    """The modules of a new process that has run some code."""
    program = COUNTED.format(code=code, arguments=list(arguments))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


def rooms(modules: set[str]) -> set[str]:
    """The rooms of motet that are among modules: "steering" of "motet.steering.step"."""
    return {name.split(".")[1] for name in modules if name.startswith("motet.")}


def test_an_import_of_motet_waits_for_nothing() -> None:
    modules = modules_after("import motet")
    assert {name for name in modules if name.startswith("motet")} == {"motet", "motet.lazy"}
    assert not {"numpy", "onnxruntime", "click"} & modules


@pytest.mark.parametrize("arguments", [["--version"], ["--help"], ["describ"]])
def test_the_command_line_alone_imports_no_command(arguments: list[str]) -> None:
    modules = modules_after("from motet.cli import main; main()", *arguments)
    assert rooms(modules) == {"cli", "errors", "lazy"}
    assert not {"numpy", "onnxruntime"} & modules


MODELS = {"generate", "composition", "papers", "live", "serve"}
"""Rooms that few commands need."""


@pytest.mark.parametrize(
    ("command", "most", "without"),
    [
        ("describe", 75, {*MODELS, "steering", "search", "predict", "draw"}),
        ("search", 80, {*MODELS, "steering", "predict", "draw"}),
        ("check", 80, {*MODELS, "steering", "search", "predict"}),
        ("fill", 80, {*MODELS, "steering", "search"}),
        ("bundle", 70, {*MODELS, "steering", "search", "predict", "draw"}),
        ("generate", 125, {"search", "predict", "papers", "live", "serve"}),
    ],
)
def test_a_command_imports_what_it_needs(command: str, most: int, without: set[str]) -> None:
    modules = modules_after("from motet.cli import main; main()", command, "--help")
    assert len([name for name in modules if name.startswith("motet")]) <= most
    assert rooms(modules) & without == set()
    assert "onnxruntime" not in modules


def test_onnx_runtime_is_imported_when_a_graph_is_made() -> None:
    before = modules_after("import motet; motet.SessionOptions(2); motet.load('describe')")
    after = modules_after("import motet; motet.load('describe').ready()")
    assert "onnxruntime" not in before
    assert "onnxruntime" in after
    assert not {"steering", "generate", "composition", "search", "predict", "papers"} & rooms(after)


def test_each_command_is_in_a_module_that_imports_alone() -> None:
    for name, (module, _, _) in COMMANDS.items():
        if module.startswith("motet."):
            assert getattr(import_module(module), name).callback is not None, name


@pytest.mark.parametrize("package", ["motet", "motet.motion"])
def test_lazy_names_are_those_that_type_checkers_see(package: str) -> None:
    module = import_module(package)
    typed = {}
    for node in ast.walk(ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                typed[alias.asname or alias.name] = getattr(import_module(str(node.module)), alias.name, None)
    assert set(module.__all__) <= typed.keys()
    for name in module.__all__:
        assert getattr(module, name) is typed[name], name
        assert name in dir(module)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = module.nothing


def test_the_room_of_composition_leaves_the_name_of_the_verb_free() -> None:
    after = modules_after("import motet.composition.plans, motet; assert callable(motet.compose)")
    assert "motet.composition.compose" in after


def test_modules_are_attributes_without_an_import_of_their_own() -> None:
    assert motet.errors.MotetError is motet.MotetError
    assert importlib.import_module("motet.formats") is motet.formats


def test_kinds_of_models_are_known_by_verb_and_loop() -> None:
    for verb, by_loop in KINDS.items():
        loops = set()
        for place in by_loop.values():
            module, _, name = place.rpartition(".")
            kind = getattr(import_module(f"motet.{module}"), name)
            assert verb == kind.VERB
            loops |= kind.LOOPS.keys()
        assert loops == by_loop.keys()
