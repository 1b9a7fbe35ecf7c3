"""The short run of tests/fuzz_bundles.py: the same bundles every time."""

from pathlib import Path

import numpy as np
from fuzz_bundles import Found, Worker, failure, mutate

from motet.bundle.bundle import list_bundles

COUNT, SECONDS, MEGABYTES = 80, 2.0, 500.0


def test_mutated_bundles_give_motets_own_errors_soon_and_in_little_memory(tmp_path: Path) -> None:
    zips = {name: path.read_bytes() for name, path in list_bundles().items()}
    worker, outcomes = Worker(address_space=4096, patience=60), set()
    for number in range(COUNT):
        how, data = mutate(np.random.default_rng([1, number]), zips)
        (tmp_path / "mutated.zip").write_bytes(data)
        found = worker.run(tmp_path / "mutated.zip")
        assert failure(found, 10 * SECONDS, MEGABYTES) is None, (number, how, found)  # the machine may be busy
        outcomes.add(found.outcome)
    worker.close()
    assert outcomes >= {"BundleError", "runs"}


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
