"""Numbers that both languages use are written once: src/generated.ts of runtime/web is made of Python's."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from motet.generate import codec

WEB = Path(__file__).parents[2] / "runtime/web"


@pytest.fixture(scope="module")
def generate() -> ModuleType:
    spec = spec_from_file_location("generate", WEB / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_numbers_in_javascript_are_pythons(generate: ModuleType) -> None:
    text = (WEB / "src/generated.ts").read_text("utf-8")
    assert text == generate.typescript(), "run python runtime/web/generate.py"


def test_a_number_that_python_has_not_is_refused(generate: ModuleType) -> None:
    with pytest.raises(AttributeError, match="has no REACH_NOT, which src uses"):
        list(generate.constants_of(codec, {"RADIAN_METRES", "REACH_NOT"}))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (2.0, "2"),
        (1e-9, "1e-09"),
        (True, "true"),
        (None, "null"),
        ('a "word"', '"a \\"word\\""'),
        ((0.1, (1, 2)), "[0.1, [1, 2]]"),
        (frozenset({"b", "a"}), '["a", "b"]'),
        ({"CMU's unit": 0.5, "inches": 2, 7: "graph"}, """{ "CMU's unit": 0.5, inches: 2, 7: "graph" }"""),
    ],
)
def test_values_in_typescript(generate: ModuleType, value: object, text: str) -> None:
    assert generate.literal(value) == text
