"""``motet bench``: calls measured beside torch, figures of before and the machine; operations; kernels."""

import json
import logging
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run

import motet
from motet.bench import machine, measure
from motet.bench.machine import Machine, ceilings, fresh, peak_memory
from motet.bench.measure import Case, Row, Taken, Times, compared
from motet.bench.profile import operations_of, profiled
from motet.bundle.graph import SessionOptions
from motet.predict.model import PredictModel

HERE = Machine("a processor", 2, {"motet": motet.__version__, "numpy": "2.0"}, 0.0, {"1": 100.0, "2": 180.0}, 9.0)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Which bundles were measured, each with two made-up figures, on a made-up machine."""
    asked: list[str] = []

    def made(name: str, *_: Any, **__: Any) -> list[Row]:
        asked.append(name)
        return [Row("one", 2.0, "ms"), Row("many", 10.0, "motions/s", 4)]

    monkeypatch.setattr("motet.cli.bench.measured", made)
    monkeypatch.setattr(Machine, "here", staticmethod(lambda: HERE))
    return asked


def printed(*options: object) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(run("bench", "--json", *options).stdout)
    return found


def test_all_bundles_are_measured_with_the_machine(quick: list[str]) -> None:
    found = printed("--bundle", "all")
    assert list(found["bundles"]) == quick == list(motet.list_bundles())
    many = found["bundles"]["fill"][1]
    assert (many["name"], many["value"], many["unit"], many["batch"]) == ("many", 10.0, "motions/s", 4)
    assert found["machine"] == {**vars(HERE)}


def test_earlier_figures_stand_beside_and_another_machine_is_said(quick: list[str], tmp_path: Path) -> None:
    old, file = printed("--bundle", "fill"), tmp_path / "old.json"
    old["bundles"]["fill"][0]["value"] = 3.0
    old["bundles"]["fill"][1]["value"] = 4.0
    file.write_text(json.dumps(old))
    same = run("bench", "--bundle", "fill", "--compare", file)
    assert ["x1.50 of before" in line for line in same.stdout.splitlines()[1:3]] == [True, False]
    assert "x2.50 of before" in same.stdout
    assert "another machine" not in same.stderr
    old["machine"]["versions"]["numpy"] = "1.0"
    file.write_text(json.dumps(old))
    other = run("bench", "--bundle", "fill", "--compare", file)
    assert f"{file}: another machine or version: versions" in other.stderr
    assert quick == ["fill"] * 3


@pytest.mark.parametrize(
    "content", ["hello", "[]", "{}", '{"machine": {}, "bundles": {}}', '{"machine": 1, "bundles": []}']
)
def test_what_is_no_comparison_is_refused_before_anything_is_measured(
    content: str, quick: list[str], tmp_path: Path
) -> None:
    (tmp_path / "old.json").write_text(content)
    result = run("bench", "--compare", tmp_path / "old.json")
    assert result.exit_code == 2
    assert f"{tmp_path / 'old.json'}: not what motet bench --json prints" in result.stderr
    assert quick == []


def test_a_load_is_that_of_others_while_it_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    counts = iter([2, 1, 3] * 9)
    waits: list[float] = []

    class State:
        def read_text(self) -> str:
            return f"cpu  1 2 3\nprocs_running {next(counts)}\nprocs_blocked 7\n"

    monkeypatch.setattr(machine, "STATE", State())
    monkeypatch.setattr(machine.time, "sleep", waits.append)
    assert machine.wanted_by_others() == 1.0
    assert sum(waits) == pytest.approx(0.5)
    # elsewhere it is that of the last minute
    monkeypatch.setattr(machine, "STATE", tmp_path / "none")
    monkeypatch.setattr(machine.os, "getloadavg", lambda: (0.61, 9.0, 9.0))
    assert machine.wanted_by_others() == 0.6


@pytest.mark.parametrize(("load", "options", "code"), [(1.5, (), 0), (3.0, (), 2), (3.0, ("--force",), 0)])
def test_a_busy_machine_is_said_and_an_overloaded_one_measures_nothing_without_force(
    load: float, options: tuple[str, ...], code: int, monkeypatch: pytest.MonkeyPatch, quick: list[str]
) -> None:
    busy = Machine(**{**vars(HERE), "load": load})
    monkeypatch.setattr(Machine, "here", staticmethod(lambda: busy))
    result = run("bench", "--bundle", "fill", *options)
    assert (result.exit_code, quick) == ((0, ["fill"]) if code == 0 else (2, []))
    assert f"the machine is busy (load {load} on 2 cores): " in result.stderr
    assert ("figures are too low" if code == 0 else "wait until") in result.stderr
    assert ("--force" in result.stderr) == (code == 2)


def test_the_ceilings_are_those_of_a_product_and_a_copy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "taken", lambda call, seconds: Taken(np.array([0.5, 0.25]), 1.0))
    assert ceilings() == pytest.approx({"gflops": 2 * 768**3 / 0.25e9, "gigabytes": 2 * 64e6 / 0.25e9})
    monkeypatch.setattr(machine, "fresh", lambda what, threads: {"gflops": 100.0 * threads, "gigabytes": 7.0 + threads})
    here = Machine.here()
    assert (here.peak(1), here.peak(2), here.gigabytes) == (100.0, 100.0 * machine.cores(), 8.0)


@pytest.mark.skipif(sys.platform != "linux", reason="the system does not tell")
def test_memory_is_that_of_the_new_process_alone() -> None:
    held = np.ones(60_000_000)  # 480 MB
    program = "from motet.bench.machine import peak_memory; print(peak_memory())"
    done = subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, check=True)
    mine = peak_memory()
    assert mine is not None
    assert 20 < float(done.stdout) < 300 < held.nbytes / 1e6 < mine


def test_a_new_process_tells_what_it_takes_to_begin() -> None:
    found = fresh("model", "predict", "1", "CPUExecutionProvider")
    assert found["import"] > 0 < found["load"]


class Clock:
    """A time that goes on only as calls take it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.worked = 0.0, 0.0
        monkeypatch.setattr(measure.time, "perf_counter", lambda: self.now)
        monkeypatch.setattr(measure.time, "process_time", lambda: self.worked)

    def call(self, *seconds: float, work: float = 2.0) -> Callable[[], None]:
        """A call that takes these times in turn, and ``work`` times as much of the processors."""
        turns = iter(np.tile(seconds, 1000).tolist())

        def one() -> None:
            spent = next(turns)
            self.now, self.worked = self.now + spent, self.worked + work * spent

        return one


def test_times_are_those_of_numpy_and_the_processors_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch)
    (row,) = compared({"motet": [Case("a", clock.call(0.01, 0.02, 0.09))]}, 30.0)
    seconds = np.tile([10.0, 20.0, 90.0], 300)
    assert row.times is not None
    assert row.value == row.times.median == pytest.approx(20)
    assert row.times.mean == pytest.approx(seconds.mean(), rel=0.02)
    assert [row.times.p95, row.times.p99] == pytest.approx(np.percentile(seconds, [95, 99]))
    assert row.times.processor == pytest.approx(2 * row.times.mean)


def test_the_fastest_batch_counts_and_the_ratio_is_of_things(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch)

    def batches(work: float, *seconds: float) -> list[Case]:
        sizes = zip(seconds, (10, 100), strict=True)
        return [Case("a", clock.call(one, work=work), "things/s", count) for one, count in sizes]

    (row,) = compared({"motet": batches(2, 0.1, 0.5), "eager": batches(5, 0.2, 4.0)}, 3.0)
    assert (row.value, row.batch) == (pytest.approx(200), 100)
    assert row.beside["eager"].value == pytest.approx(50)
    assert row.beside["eager"].ratio == pytest.approx(4)
    assert row.beside["eager"].processor_ratio == pytest.approx(4 * 5 / 2)


def test_rounds_are_in_turn_and_the_median_one_tells_the_ratio(monkeypatch: pytest.MonkeyPatch) -> None:
    found = iter([1.0] * 2 + [1.0, 4.0, 100.0, 300.0, 2.0, 6.0])  # two to begin; the second round was disturbed
    turns: list[object] = []

    def made(call: object, *_: float) -> Taken:
        turns.append(call)
        return Taken(np.array([next(found)]), 0.0)

    monkeypatch.setattr(measure, "taken", made)
    a, b = (lambda: None), (lambda: None)
    (row,) = compared({"motet": [Case("x", a, "s")], "eager": [Case("x", b, "s")]}, 1.0)
    assert turns == [a, b] * 4
    assert (row.value, row.beside["eager"].value, row.beside["eager"].ratio) == (2.0, 6.0, 3.0)


def test_who_fails_is_left_out_with_a_word(caplog: pytest.LogCaptureFixture) -> None:
    def fails() -> None:
        raise RuntimeError("no C++ compiler\nand more")

    with caplog.at_level(logging.WARNING):
        (row,) = compared({"motet": [Case("a", lambda: None)], "compiled": [Case("a", fails)]}, 0.001)
    assert row.beside == {}
    assert caplog.messages == ["a: compiled is left out: no C++ compiler"]
    with pytest.raises(RuntimeError):
        compared({"motet": [Case("a", fails)]}, 0.001)


def kernel(name: str, given: list[list[int]], *found: list[int]) -> dict[str, Any]:
    return {
        "op_name": name,
        "input_type_shape": [{"float": one} for one in given],
        "output_type_shape": [{"float": one} for one in found],
    }


def test_operations_of_kernels_are_those_counted_by_hand() -> None:
    assert operations_of(kernel("Gemm", [[2, 5], [7]], [2, 7])) == 2 * 2 * 5 * 7  # its weights are packed
    assert operations_of(kernel("FusedMatMul", [[3, 2, 4], [3, 4, 6]], [3, 2, 6])) == 3 * 2 * 2 * 4 * 6
    for outputs in ([[9, 1, 2, 4], [1, 2, 4]], [[9, 1, 2, 4]], [[1, 2, 4]]):
        gru = kernel("GRU", [[9, 2, 5], [1, 12, 5], [1, 12, 4]], *outputs)
        assert operations_of(gru) == 9 * 2 * 2 * (12 * 5 + 12 * 4)
    assert operations_of(kernel("Conv", [[2, 3, 8], [4, 3, 5]], [2, 4, 4])) == 2 * (2 * 4 * 4) * 3 * 5
    assert operations_of(kernel("Mul", [[2, 5], [2, 5]], [2, 5])) == 0


def test_a_profile_has_the_calls_alone_and_all_of_their_time() -> None:
    asked: list[SessionOptions] = []

    def ready(options: SessionOptions) -> Callable[[], object]:
        asked.append(options)
        model = motet.load("tdbn", options)
        session = model.start(smooth=False)
        for _ in range(50):
            session.step()  # not to be counted
        return session.step

    start = time.perf_counter()
    found = profiled(SessionOptions(), ready, 0.1)
    wall = time.perf_counter() - start
    assert 2 * 150 * 59 < found.operations < 1e6
    assert {"MatMul", "Gemm", "onnxruntime", "python"} <= set(found.parts)
    assert 0 < sum(found.parts.values()) < 1e3 * wall
    assert all(one.configure is not None for one in asked)


def test_operations_of_a_batch_are_those_of_one_so_often() -> None:
    def of(count: int) -> float:
        def ready(options: SessionOptions) -> Callable[[], object]:
            model: PredictModel = motet.load("predict", options)
            seeds = np.tile(model.contract.mean, (count, model.seed_frames, 1))
            return lambda: model.next_frames(seeds, 1)

        return profiled(SessionOptions(), ready, 0.0).operations

    assert 1e5 < of(4) < 1e8
    assert of(16) == pytest.approx(4 * of(4))


def test_rows_of_a_bundle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Machine, "here", staticmethod(lambda: HERE))
    rows = printed("--bundle", "predict", "--seconds", 0.001, "--no-torch")["bundles"]["predict"]
    kinds = ("first_frame", "horizon", "motion", "horizons", "streamed", "file")
    process = ("import", "load", "memory", "memory_peak")
    assert [row["name"] for row in rows] == [
        *(f"predict.{one}" for one in kinds),
        *(f"process.{one}" for one in process),
    ]
    assert all(row["value"] > 0 for row in rows)
    assert rows[-2]["value"] < rows[-1]["value"] < 1000
    for row in rows[: len(kinds)]:
        assert row["share"] == pytest.approx(row["gflop"] / row["times"]["median"] * 1e3 / HERE.gflops["1"])
        assert row["parts"]["python"] > 0


def test_units() -> None:
    assert Case("a", lambda: None, "us").value(0.5) == 5e5
    assert Case("a", lambda: None, "things/s", 8).value(0.5) == 16
    assert Times.of([Taken(np.array([0.1, 0.3]), 0.5)]).processor == pytest.approx(250)
