"""What can be told only of a process that did nothing else, printed as JSON: :mod:`motet.bench.machine` starts it."""

import json
import time


def main(started: float, what: str, *arguments: str) -> None:
    """``ceilings``, or ``model BUNDLE THREADS PROVIDER...``: milliseconds of import and load, and memory in MB.

    started: by ``time.perf_counter``, before motet was imported.
    """
    imported = time.perf_counter() - started
    from motet.bench import machine

    figures = machine.ceilings() if what == "ceilings" else {"import": 1e3 * imported, **model(*arguments)}
    print(json.dumps(figures))


def model(bundle: str, threads: str, *providers: str) -> dict[str, float]:
    """Of a model that is loaded, and of one that has made each call that is measured, the largest batches included."""
    from motet import SessionOptions, load
    from motet.bench import cases, machine

    before = time.perf_counter()
    loaded = load(bundle, SessionOptions(int(threads), providers))
    memory = {"load": 1e3 * (time.perf_counter() - before), "memory": machine.peak_memory()}
    for case in cases.cases(loaded):
        case.call()
    memory["memory_peak"] = machine.peak_memory()
    return {name: value for name, value in memory.items() if value is not None}
