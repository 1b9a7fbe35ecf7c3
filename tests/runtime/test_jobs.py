"""Many files in several processes: the same results in the same order, and what goes wrong."""

import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import run
from figures import walker

import motet
from motet.jobs import FEW, batches, in_order


def late(number: int) -> tuple[int, int]:
    time.sleep(0.02 * (number % 3 == 0))
    if number == 99:
        raise motet.MotionError("this one")
    return number, os.getpid()


def test_results_come_in_order_from_other_processes() -> None:
    found = list(in_order(late, range(30), 2))
    assert [number for number, _ in found] == list(range(30))
    assert os.getpid() not in {process for _, process in found}
    assert {process for _, process in in_order(late, range(30), 1)} == {os.getpid()}
    assert {process for _, process in in_order(late, range(FEW - 1), 2)} == {os.getpid()}
    assert list(in_order(late, [], None)) == []


def test_a_fault_ends_all_and_so_does_who_has_seen_enough() -> None:
    with pytest.raises(motet.MotionError, match="this one"):
        list(in_order(late, [*range(20), 99, *range(20)], 2))
    assert len(list(itertools.islice(in_order(late, range(10_000), 2), 3))) == 3


def test_check_says_the_same_by_one_process_and_by_two(tmp_path: Path) -> None:
    for number in range(FEW + 2):
        motet.write(tmp_path / f"{number}.bvh", walker(20 + number))
    (tmp_path / "5.bvh").write_text("hello")
    for options in ((), ("--json",)):
        one, two = (run("check", tmp_path, *options, "--jobs", jobs) for jobs in (1, 2))
        assert (one.exit_code, one.stdout, one.stderr) == (two.exit_code, two.stdout, two.stderr)
        assert "5.bvh" in two.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="no such signals there")
def test_an_interrupt_ends_it_quietly(tmp_path: Path) -> None:
    code = (
        "import signal, sys, time\nfrom motet.jobs import in_order\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell may ignore it
        "try:\n    for _ in in_order(time.sleep, [.05] * 2000, 2):\n        print('on', flush=True)\n"
        "except KeyboardInterrupt:\n    sys.exit(130)"
    )
    started = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert started.stdout
    started.stdout.readline()  # that of the first result: the processes work
    started.send_signal(signal.SIGINT)
    assert started.communicate(timeout=60)[1] == ""
    assert started.returncode == 130


@pytest.mark.parametrize(("count", "jobs"), [(0, 2), (1, 2), (9, 1), (628, 2), (628, 16), (10_000, 3)])
def test_batches_are_all_things_in_order_and_the_last_ones_small(count: int, jobs: int) -> None:
    found = list(batches(range(count), jobs, 64))
    assert [thing for batch in found for thing in batch] == list(range(count))
    sizes = [len(batch) for batch in found]
    assert max(sizes, default=1) <= 64
    if jobs > 1:
        assert sizes == sorted(sizes, reverse=True)
        assert sizes[-jobs:] == [1] * len(sizes[-jobs:])
