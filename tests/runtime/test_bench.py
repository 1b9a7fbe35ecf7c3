"""``motet bench``: figures of all bundles, beside those of before and of another machine."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run

import motet
from motet import bench
from motet.bench import Machine, Row, better, compared


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Which bundles were measured, each with two made-up figures."""
    measured: list[str] = []

    def made(model: Any, seconds: float, file: Path | None = None) -> bench.Figures:
        measured.append(model.manifest.name)
        return {"one": (2.0, "ms"), "many": (10.0, "motions/s")}

    monkeypatch.setattr(bench, "figures", made)
    return measured


def measured(*options: object) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(run("bench", "--no-torch", "--json", *options).stdout)
    return found


def test_all_bundles_are_measured_with_the_machine(figures: list[str]) -> None:
    found = measured("--bundle", "all")
    assert list(found["bundles"]) == list(motet.list_bundles())
    assert set(figures) == {motet.load(name).manifest.name for name in motet.list_bundles()}
    assert found["bundles"]["fill"][1] == {
        "name": "many",
        "value": 10.0,
        "unit": "motions/s",
        "baseline": None,
        "ratio": None,
    }
    assert found["machine"]["gflops"] > 1
    assert found["machine"]["gigabytes"] > 0.1
    assert found["machine"]["versions"]["motet"] == motet.__version__


def test_a_baseline_is_measured_in_turn_and_the_median_round_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    turns, values = list[str](), iter([1.0, 4.0, 100.0, 300.0, 2.0, 6.0])  # the second round was disturbed

    def made(model: Any, seconds: float, file: Path | None) -> bench.Figures:
        turns.append(model)
        return {"one": (next(values), "ms")}

    monkeypatch.setattr(bench, "figures", made)
    assert compared(["model", "torch"], 1.0) == [Row("one", 2.0, "ms", 6.0, 3.0)]  # type: ignore[list-item]
    assert turns == ["model", "torch"] * 3


def test_better_is_less_time_and_more_at_once() -> None:
    assert [better(0.5, "ms"), better(0.5, "motions/s"), better(0.5, "characters")] == [2.0, 0.5, None]


@pytest.mark.usefixtures("figures")
def test_earlier_figures_stand_beside_and_another_machine_is_said(tmp_path: Path) -> None:
    old, file = measured("--bundle", "fill"), tmp_path / "old.json"
    old["bundles"]["fill"][0]["value"] = 3.0
    file.write_text(json.dumps(old))
    same = run("bench", "--bundle", "fill", "--no-torch", "--compare", file)
    assert "x1.50 of before" in same.stdout
    assert "another machine" not in same.stderr
    old["machine"]["versions"]["numpy"] = "1.0"
    file.write_text(json.dumps(old))
    other = run("bench", "--bundle", "fill", "--no-torch", "--compare", file)
    assert f"{file}: another machine or version: versions" in other.stderr


@pytest.mark.parametrize(
    "content", ["hello", "[]", "{}", '{"machine": {}, "bundles": {}}', '{"machine": 1, "bundles": []}']
)
def test_what_is_no_comparison_is_refused_before_anything_is_measured(
    content: str, figures: list[str], tmp_path: Path
) -> None:
    (tmp_path / "old.json").write_text(content)
    result = run("bench", "--compare", tmp_path / "old.json")
    assert result.exit_code == 2
    assert f"{tmp_path / 'old.json'}: not what motet bench --json prints" in result.stderr
    assert figures == []


@pytest.mark.usefixtures("figures")
def test_a_busy_machine_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    for load, said in ((0.1, False), (3.0, True)):
        monkeypatch.setattr("os.getloadavg", lambda load=load: (load, 0.0, 0.0), raising=False)
        result = run("bench", "--bundle", "fill", "--no-torch")
        assert ("the machine is busy (load 3.0" in result.stderr) == said


def test_the_ceilings_are_those_of_a_product_and_a_copy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "durations", lambda call, seconds: np.array([0.5, 0.25]))
    here = Machine.here()
    assert here.gflops == pytest.approx(2 * 768**3 / 0.25e9)
    assert here.gigabytes == pytest.approx(2 * 64e6 / 0.25e9)
