"""Where the time of a call goes, by ONNX Runtime's own profile, and how many operations its products take."""

import gc
import json
import math
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from motet.bench.machine import Machine
from motet.bench.measure import Call, Case, Row
from motet.bundle.graph import SessionOptions
from motet.files import Json

PRODUCTS = ("MatMul", "Gemm", "TransposeMatMul", "MatMulInteger", "MatMulIntegerToFloat", "DynamicQuantizeMatMul")

GATES_BY_CELL = {"GRU": 3, "LSTM": 4, "RNN": 1}
"""Rows of a recurrent kernel's weights for each of its units."""

HOLDERS = ("Scan", "Loop", "If")
"""Kernels that run other kernels, which the profile has too."""

PAUSE = 0.2
"""Seconds between what makes a call ready and the calls that count, which tells them apart in the profile: its times
are from when the session began, some time after it was configured."""


@dataclass(frozen=True)
class Profile:
    """Of one call: operations in the products of its graphs, and milliseconds by kernel; ``onnxruntime`` is the time in
    its sessions between kernels, ``python`` that outside of them, numpy included.

    The profile itself takes about a microsecond a kernel, so many small ones look dearer than they are.
    """

    operations: float
    parts: Mapping[str, float]


def profiled(options: SessionOptions, call_of: Callable[[SessionOptions], Call], seconds: float) -> Profile:
    """The profile of calls over about ``seconds``: ``call_of`` loads a model with the options and makes a call ready,
    all that holds its sessions."""
    begun: list[float] = []  # of each session, in turn
    with tempfile.TemporaryDirectory() as folder:

        def configure(session: Any) -> None:
            if options.configure is not None:
                options.configure(session)
            session.enable_profiling = True
            session.profile_file_prefix = str(Path(folder) / f"{len(begun):04}")
            begun.append(time.perf_counter())

        # once for the sessions, and a pause that marks where the measured calls begin
        call = call_of(replace(options, configure=configure))
        call()
        time.sleep(PAUSE)
        start = time.perf_counter()
        count = 0
        while not count or time.perf_counter() < start + seconds:
            call()
            count += 1
        taken = time.perf_counter() - start
        del call
        gc.collect()  # a session writes its profile when it ends
        since_begin = [start - PAUSE - session_begin for session_begin in begun]
        events = _events_after(since_begin, Path(folder))
    return _summed(events, taken, count)


def _events_after(seconds: Sequence[float], folder: Path) -> list[dict[str, Any]]:
    """The events in the profiles of a folder, of each session those later than so many seconds after its begin."""
    events = []
    for file, earliest in zip(sorted(folder.iterdir()), seconds, strict=True):
        recorded = json.loads(file.read_text(encoding="utf-8"))
        events += [event for event in recorded if event["ts"] / 1e6 > earliest]
    return events


def with_profiles(
    rows: Sequence[Row],
    options: SessionOptions,
    cases: Callable[[SessionOptions], Sequence[Case]],
    machine: Machine,
    seconds: float,
) -> list[Row]:
    """The rows with operations, the share of the machine's ceiling, and where the time goes, by profiles of
    ``seconds``."""
    profiled_rows = []
    for row in rows:

        def call_of(options_of_call: SessionOptions, name: str = row.name, batch: int = row.batch) -> Call:
            return next(case.call for case in cases(options_of_call) if (case.name, case.count) == (name, batch))

        profile = profiled(options, call_of, seconds)
        share = None
        if profile.operations and row.times is not None:
            share = profile.operations / row.times.median / 1e6 / machine.peak(options.threads)
        profiled_rows.append(replace(row, gflop=profile.operations / 1e9, share=share, parts=profile.parts))
    return profiled_rows


def _summed(events: list[Json], taken: float, count: int) -> Profile:
    kernels = Counter[str]()
    operations = 0.0
    sessions = 0.0
    for event in events:
        if event["name"] == "model_run":
            sessions += event["dur"]
        elif event["name"].endswith("_kernel_time") and event["args"]["op_name"] not in HOLDERS:
            kernels[event["args"]["op_name"]] += event["dur"]
            operations += operations_of(event["args"])
    parts = {name: of / 1e3 / count for name, of in kernels.most_common()}
    between = (sessions - kernels.total()) / 1e3 / count
    return Profile(
        operations / count, {**parts, "onnxruntime": between, "python": (1e3 * taken - sessions / 1e3) / count}
    )


def operations_of(kernel: Json) -> float:
    """Multiplications and additions in the products of a kernel, as the profile describes it; 0 of one without.

    Of weights that were packed when the graph was loaded the profile has no shape, so they are told from the results;
    of Einsum it does not have the equation, so that its products are not counted.
    """
    name = kernel["op_name"].removeprefix("Fused")
    inputs = [next(iter(shape.values())) for shape in kernel["input_type_shape"]]
    outputs = [next(iter(shape.values())) for shape in kernel["output_type_shape"]]
    # each element of a product sums over the last axis of its first factor
    if name in PRODUCTS:
        return 2.0 * float(math.prod(outputs[0])) * float(inputs[0][-1])
    # each gate of a recurrent unit sees the input and the state
    if name in GATES_BY_CELL:
        directions, batch, units = outputs[-1][-3:]  # of all states or of the last ones
        return 2.0 * float(inputs[0][0] * directions * batch * units * GATES_BY_CELL[name] * (inputs[0][2] + units))
    # each element of a convolution sums over a filter
    if name == "Conv":
        return 2.0 * float(math.prod(outputs[0])) * float(math.prod(inputs[1][1:]))
    return 0.0
