"""The tree keeps its shape: functions, files and rooms stay small, and imports run one way."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = {"motet": ROOT / "runtime", "motet_export": ROOT / "export", "motet_train": ROOT / "train"}
LARGE_FUNCTION = 250
"""Nodes of the syntax tree, which no layout of lines can change, above which a function counts as large."""

MOST_LARGE_FUNCTIONS = 75
"""Of the whole tree, as many as there were when this measure was introduced; only ever lowered."""

BANNED = frozenset({"found", "one", "own", "told", "said", "given", "asked", "how", "who", "those"})
"""Words that do not say which quantity a name stands for."""

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

SPINE = (
    *("lazy", "errors", "settings", "files", "jobs", "motion", "figures", "representation", "bundle", "text", "decode"),
    "models",
)
"""The floors of the runtime that all rooms stand on: each imports those before it and no other. The shared wings
figures, representation and text stand between them, as they need no model and every model needs them."""

WINGS = ("steering", "generate", "composition", "predict", "search", "papers", "keyed", "formats", "draw")
"""Rooms by subject: each imports the spine, and another wing only where EDGES says why."""

DOORS = ("corpus", "live", "serve", "bench", "cli")
"""How the runtime is used: they import the spine and all wings, and no wing imports them."""

EDGES = {
    ("composition", "formats"): "a plan names files of poses",
    ("composition", "steering"): "between places a figure is steered",
    ("formats", "draw"): "a .glb has the body that pages draw",
    ("composition", "generate"): "prompts are drawn as a story",
    ("generate", "formats"): "Generated.write is public",
    ("generate", "keyed"): "a sentence may name an act by key poses",
    ("papers", "generate"): "the mixture of Plappert et al. is one more model that generates",
    ("predict", "generate"): "PredictModel.predict goes on after its horizon with a generate model",
    ("steering", "formats"): "a figure is made of a folder of files",
    ("search", "formats"): "an index is made of a folder of files",
    ("serve", "live"): "figures are steered on the server's own port",
    ("cli", "bench"): "a command measures",
    ("cli", "corpus"): "commands go over many files",
    ("cli", "live"): "a command writes live pages, and serves them",
}
"""Imports between wings, and between doors, each with its reason; fewer are better."""

FACES = ("motet", "motet.motion", "motet.models.load", "motet.__main__")
"""Modules that import any room: the public names, those of geometry, and the kinds of models by verb and loop."""

ONE_WAY = {
    "motet": ("motet_train", "motet_export", *HEAVY),
    "motet_train": ("motet_export",),
    "motet_train.data": (*PRODUCT[1:], "motet_train.papers", "motet_train.cli"),
    "motet_train.models": (*PRODUCT[2:], "motet_train.papers", "motet_train.cli"),
    "motet_train.evaluate": (*PRODUCT[3:], "motet_train.papers", "motet_train.cli"),
    "motet_train.recipes": ("motet_train.papers", "motet_train.cli"),
    "motet_train.papers": ("motet_train.cli",),
}
"""Package -> what its modules do not import when they are imported."""

CEILINGS = {
    "motet": 3_500,
    "motet.bench": 5_400,
    "motet.bundle": 11_500,
    "motet.cli": 17_300,
    "motet.composition": 7_700,
    "motet.corpus": 9_000,
    "motet.decode": 4_400,
    "motet.draw": 11_250,
    "motet.figures": 32_100,
    "motet.formats": 35_900,
    "motet.generate": 35_100,
    "motet.keyed": 10_000,
    "motet.live": 4_900,
    "motet.models": 10_300,
    "motet.motion": 16_450,
    "motet.papers": 7_500,
    "motet.predict": 5_400,
    "motet.representation": 9_350,
    "motet.search": 3_600,
    "motet.serve": 16_800,
    "motet.steering": 61_300,
    "motet.text": 6_300,
    "motet_export": 12_400,
    "motet_train": 9_300,
    "motet_train.cli": 8_400,
    "motet_train.data": 19_700,
    "motet_train.evaluate": 52_400,
    "motet_train.models": 24_700,
    "motet_train.papers": 39_500,
    "motet_train.recipes": 17_200,
}
"""Nodes of the syntax tree by room, docstrings left out: today's, rounded up to hundreds. Lowered whenever a room gets
smaller; raised only in a commit that says why."""


def room_of(name: str) -> str:
    """motet.steering.step is in motet.steering, motet_train.runs in motet_train."""
    top, *inner = name.split(".")
    is_folder = bool(inner) and (FOLDERS[top] / top / inner[0]).is_dir()
    return f"{top}.{inner[0]}" if is_folder else top


def nodes(tree: ast.AST) -> int:
    """Nodes of a syntax tree, docstrings left out."""
    count = 0
    for node in ast.walk(tree):
        is_docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        count += not (is_docstring and isinstance(node.value.value, str))
    return count


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


def may_import(room: str, other: str) -> bool:
    """Whether modules of a room of the runtime may import those of another."""
    if room == other:
        return True
    if room in SPINE:
        return other in SPINE[: SPINE.index(room)]
    if other in SPINE or (room, other) in EDGES:
        return True
    return room in DOORS and other in WINGS


def test_rooms_import_the_spine_and_no_other_room() -> None:
    wrong = []
    edges = set()
    for name in PATHS:
        if not within(name, "motet") or name in FACES:
            continue
        room = name.split(".")[1]
        for imported in sorted(imports(name)):
            if not within(imported, "motet") or imported in FACES:
                continue
            other = imported.split(".")[1]
            edges.add((room, other))
            if not may_import(room, other):
                wrong.append(f"{name} imports {imported}")
    assert wrong == []
    assert EDGES.keys() - edges == set(), "edges that nothing needs any more"
    assert {name.split(".")[1] for name in PATHS if within(name, "motet") and name not in FACES} == {
        *SPINE,
        *WINGS,
        *DOORS,
    }


def test_rooms_do_not_grow() -> None:
    sizes = dict.fromkeys(CEILINGS, 0)
    for name, tree in TREES.items():
        sizes[room_of(name)] += nodes(tree)
    assert [f"{room}: {size} nodes" for room, size in sizes.items() if size > CEILINGS[room]] == []


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


def test_code_is_plain() -> None:
    """No word of BANNED is a name, no ``a, b = x, y``, and no comprehension in another or over several loops."""
    banned = []
    tuples = []
    nested = []
    comprehensions = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            place = f"{module}, line {getattr(node, 'lineno', 0)}"
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id in BANNED:
                banned.append(f"{place}: {node.id}")
            elif isinstance(node, ast.arg) and node.arg in BANNED:
                banned.append(f"{place}: {node.arg}")
            elif isinstance(node, ast.Assign):
                is_double = isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple)
                tuples += [place] if is_double else []
            elif isinstance(node, comprehensions):
                has_inner = any(isinstance(inner, comprehensions) for inner in ast.walk(node) if inner is not node)
                nested += [place] if has_inner or len(node.generators) > 1 else []
    assert banned == []
    assert tuples == []
    assert nested == []


SHARED_NAMES = frozenset({"DEFAULT", "PAPER", "RECIPES", "LOOPS", "_PLACES"})
"""What each recipe, loop or package calls what a registry or :mod:`motet.lazy` reads of it."""


def test_a_constant_has_its_name_alone() -> None:
    """A name that stands for several values says too little."""
    modules = dict[str, list[str]]()
    for module, tree in TREES.items():
        for statement in tree.body:
            target = statement.targets[0] if isinstance(statement, ast.Assign) else getattr(statement, "target", None)
            if isinstance(target, ast.Name) and target.id.isupper() and len(target.id) > 1:
                modules.setdefault(target.id, []).append(module)
    assert {name: places for name, places in modules.items() if len(places) > 1 and name not in SHARED_NAMES} == {}


def test_imports_are_found() -> None:
    """What the other tests stand on."""
    assert "motet.errors" in imports("motet.files")
    assert "motet_train.data.archive" in imports("motet_train.data.corpus")
    assert not any(within(name, "motet_train") for name in imports("motet.cli"))
