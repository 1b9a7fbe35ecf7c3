"""What the library logs, to loggers below "motet"."""

import subprocess
import sys
from pathlib import Path

import pytest

import motet


def test_reading_loading_and_resampling_are_logged(clips: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("DEBUG", logger="motet"):
        model, motion = motet.load("describe"), motet.read(clips / "39_14.amc")
        model.embed(motion)
    lines = [(record.levelname, record.getMessage()) for record in caplog.records]
    assert lines[0][0] == "INFO"
    assert lines[0][1].endswith("describe.zip for describe")
    assert lines[-1][0] == "INFO"
    assert lines[-1][1].startswith("made the encoder graph of ")
    assert lines[-1][1].endswith("describe.zip on CPUExecutionProvider")
    assert lines[1:-1] == [
        ("DEBUG", f"read {clips / '39_14.amc'}: {motion!r}"),
        ("DEBUG", f"resampling {motion!r} to 30 fps"),  # to see whether it walks in place
        ("DEBUG", f"resampling {motion!r} to 10 fps"),
        ("INFO", "brought to the humanoid: joints of CMU and HDM05, ASF/AMC, confidence 1.00"),
    ]


def test_the_library_is_silent_by_default() -> None:
    motion = "motet.Motion([[1.0]] * 9, ['a'], ['1'], 9)"
    code = f"import motet; motet.load('predict'); {motion}.resample(3)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
