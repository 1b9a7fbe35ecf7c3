"""The tree keeps its shape: functions and files stay small, and imports run one way."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = {"motet": ROOT / "runtime", "motet_export": ROOT / "export", "motet_train": ROOT / "train"}
LARGE_FUNCTION = 250
"""Nodes of the syntax tree, which no layout of lines can change, above which a function counts as large."""

MOST_LARGE_FUNCTIONS = 370
"""Of the whole tree, as many as there were when this measure was introduced; only ever lowered."""

LONGEST_FILE = 800
"""Lines: a file is one idea, however long up to this."""

PATHS = {
    ".".join(path.relative_to(folder).with_suffix("").parts).removesuffix(".__init__"): path
    for package, folder in FOLDERS.items()
    for path in sorted((folder / package).rglob("*.py"))
}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in PATHS.items()}
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef

HEAVY = ("torch", "onnx", "onnxscript", "scipy", "sklearn", "matplotlib", "sacrebleu", "tensorboard")
PRODUCT = ("motet_train.data", "motet_train.models", "motet_train.evaluate", "motet_train.recipes")
"""The rooms of training from the ground up; :mod:`motet_train.runs` names the nets of papers for all."""

ONE_WAY = {
    "motet": ("motet_train", "motet_export", *HEAVY),
    "motet.motion": ("motet.representation", "motet.bundle", "motet.decode", "motet.models", "motet.formats"),
    "motet.representation": ("motet.bundle", "motet.decode", "motet.models", "motet.formats", "motet.draw"),
    "motet.bundle": ("motet.models", "motet.formats", "motet.draw", "motet.cli"),
    "motet.decode": ("motet.representation", "motet.models", "motet.formats", "motet.draw", "motet.cli"),
    "motet.formats": ("motet.bundle", "motet.decode", "motet.models", "motet.cli"),
    "motet.draw": ("motet.bundle", "motet.decode", "motet.models", "motet.formats", "motet.cli"),
    "motet.models": ("motet.corpus", "motet.live", "motet.serve", "motet.cli"),
    "motet.corpus": ("motet.live", "motet.serve", "motet.cli"),
    "motet.live": ("motet.serve", "motet.cli"),
    "motet.serve": ("motet.cli",),
    "motet_train": ("motet_export",),
    "motet_train.data": (*PRODUCT[1:], "motet_train.papers", "motet_train.cli"),
    "motet_train.models": (*PRODUCT[2:], "motet_train.papers", "motet_train.cli"),
    "motet_train.evaluate": (*PRODUCT[3:], "motet_train.papers", "motet_train.cli"),
    "motet_train.recipes": ("motet_train.papers", "motet_train.cli"),
    "motet_train.papers": ("motet_train.cli",),
}
"""Package -> what its modules do not import when they are imported."""


def within(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


def imports(name: str) -> set[str]:
    """What a module imports when it is imported: not in its functions, and not for type checkers alone."""
    found: set[str] = set()
    pending: list[ast.AST] = [TREES[name]]
    while pending:
        node = pending.pop()
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            whole = {f"{node.module}.{alias.name}" for alias in node.names} & PATHS.keys()
            found |= whole or {str(node.module)}
        elif not isinstance(node, FUNCTIONS) and not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node)):
            pending += ast.iter_child_nodes(node)
    return found


@pytest.mark.parametrize("package", ONE_WAY)
def test_imports_run_one_way(package: str) -> None:
    wrong = [
        f"{name} imports {other}"
        for name in PATHS
        if within(name, package)
        for other in sorted(imports(name))
        if any(within(other, room) for room in ONE_WAY[package])
    ]
    assert wrong == []


@pytest.mark.parametrize(
    ("rooms", "without"),
    [
        (("motet", "motet.cli"), (*HEAVY, "PIL", "tqdm", "websockets", "pythonosc", "starlette", "uvicorn")),
        (("motet_train.recipes", "motet_train.cli.train"), (*HEAVY[1:], "PIL")),
    ],
)
def test_what_an_import_brings_along(rooms: tuple[str, ...], without: tuple[str, ...]) -> None:
    """The runtime is light, and training needs neither the exporter nor what evaluation and pictures need."""
    pending = [name for name in PATHS if name in rooms or name.startswith(rooms[1:])]
    by = dict.fromkeys(pending, "")
    while pending:
        name = pending.pop()
        new = imports(name) - by.keys()
        by |= dict.fromkeys(new, name)
        pending += new & PATHS.keys()
    assert {"numpy", "click"} <= by.keys()
    assert [f"{by[name]} imports {name}" for name in by if any(within(name, package) for package in without)] == []


def test_functions_and_files_are_small() -> None:
    large_functions = []
    for name, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, FUNCTIONS) and sum(1 for _ in ast.walk(node)) > LARGE_FUNCTION:
                large_functions.append(f"{name}.{node.name}")
    assert len(large_functions) <= MOST_LARGE_FUNCTIONS, large_functions

    lines = {name: len(path.read_text(encoding="utf-8").splitlines()) for name, path in PATHS.items()}
    assert [f"{name}: {count} lines" for name, count in lines.items() if count > LONGEST_FILE] == []


def test_imports_are_found() -> None:
    """What the other tests stand on."""
    assert "motet.errors" in imports("motet.files")
    assert "motet_train.data.archive" in imports("motet_train.data.corpus")
    assert not any(within(name, "motet_train") for name in imports("motet.cli"))
