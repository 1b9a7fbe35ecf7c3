"""``motet.motion`` is where geometry lives: without a model, and without ONNX Runtime."""

import subprocess
import sys

import motet.motion


def test_all_names_are_there_and_no_runtime_is_loaded_by_the_room() -> None:
    assert all(hasattr(motet.motion, name) for name in motet.motion.__all__)
    assert {"Motion", "Skeleton", "Joint", "positions", "mirror", "lay_root_path"} <= set(motet.motion.__all__)


def test_geometry_imports_nothing_that_is_built_on_it() -> None:
    code = (
        "import sys, types; sys.modules['motet'] = types.ModuleType('motet'); "
        f"sys.modules['motet'].__path__ = [{motet.__path__[0]!r}]; "
        "import motet.motion; all_names = [getattr(motet.motion, name) for name in motet.motion.__all__]; "
        "print([name for name in sys.modules if name.startswith('motet.') and name.split('.')[1] not in "
        "('motion', 'figures', 'errors', 'lazy')], 'onnxruntime' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[] False"
