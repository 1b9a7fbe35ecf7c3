"""The short runs of the fuzzers of bundles, motions, archives and uploads: the same mutants every time."""

from pathlib import Path

import fuzz_archives
import fuzz_bundles
import fuzz_motions
import numpy as np
import pytest
from fuzzing import Found, Steps, Worker, failure, put

SECONDS, MEGABYTES = 2.0, 500.0


@pytest.mark.parametrize(
    ("mutate", "steps", "count", "expected"),
    [
        (fuzz_bundles.mutate, fuzz_bundles.steps, 80, {"BundleError", "runs"}),
        (fuzz_motions.mutants(fuzz_motions.own_files()), fuzz_motions.steps, 150, {"FormatError", "runs"}),
        (fuzz_archives.mutate, fuzz_archives.steps, 150, {"FormatError", "OutputError", "runs"}),
    ],
    ids=["bundles", "motions", "archives"],
)
def test_mutants_give_motets_own_errors_soon_and_in_little_memory(
    mutate: fuzz_motions.Mutate, steps: Steps, count: int, expected: set[str], tmp_path: Path
) -> None:
    check(mutate, steps, count, expected, tmp_path)


def test_mutants_that_are_uploaded_are_answered(tmp_path: Path) -> None:
    pytest.importorskip("starlette", reason="the extra serve is not installed")
    pytest.importorskip("httpx2", reason="Starlette's test client needs it")
    import fuzz_uploads

    check(fuzz_uploads.mutate, fuzz_uploads.steps, 30, {"RequestError", "runs"}, tmp_path)


def check(mutate: fuzz_motions.Mutate, steps: Steps, count: int, expected: set[str], folder: Path) -> None:
    """Try some mutants, none of which may fail, and all outcomes that are expected have to come."""
    worker, outcomes = Worker(steps, address_space=4096, patience=60), set()
    for number in range(count):
        how, files = mutate(np.random.default_rng([1, number]))
        found = worker.run(put(folder / "mutant", files))
        assert failure(found, 10 * SECONDS, MEGABYTES) is None, (number, how, found)  # the machine may be busy
        outcomes.add(found.outcome)
    worker.close()
    assert outcomes >= expected


def test_what_is_a_failure() -> None:
    for found, reason in (
        (Found("runs", 0.1, 100), None),
        (Found("BundleError", 0.1, 100), None),
        (Found("FOREIGN", 0.1, 100), "FOREIGN"),
        (Found("DIED", 0.1, 0), "DIED"),
        (Found("runs", 2.5, 100), "2.5 s"),
        (Found("BundleError", 0.1, 501), "501 MB"),
    ):
        assert failure(found, SECONDS, MEGABYTES) == reason
