import importlib.util
from pathlib import Path

import pytest
from command_line import check_refused, run

import motet
from motet.steering.model import SteerModel

OSC = ("--osc", "127.0.0.1:39539")


def test_the_page_is_that_of_python(tmp_path: Path, steer_model: SteerModel) -> None:
    bundle = motet.list_bundles()["control"]
    result = run("live", "-o", tmp_path / "live.html", "--characters", 2, "--bundle", bundle)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.startswith(str(tmp_path / "live.html"))
    motet.write_live_page(tmp_path / "twin.html", steer_model, 2, title="live")
    assert (tmp_path / "live.html").read_bytes() == (tmp_path / "twin.html").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "say what to do"),
        (("-o", "{out}/live.html", "--port", 1), "-o writes a page and does nothing else"),
        (("-o", "{out}/live.html", "--script", "walk"), "-o writes a page and does nothing else"),
        (("-o", "{out}/none/live.html"), "the folder {out}/none does not exist"),
        (("-o", "{out}/live.html", "--bundle", "search"), "bundle search is for 'search'; need one for 'control'"),
        (("-o", "{out}/live.html", "--bundle", "tdbn"), "its loop is 'session'; need one that is a SteerModel"),
        (("--port", 1, *OSC, "--script", "walk"), "--script is for --osc without --port"),
        (("--port", 99999), "99999 is not in the range"),
        (OSC, "--osc needs --script, or --port"),
        (("--osc", "here", "--script", "walk"), "expected an address and a port"),
        (("--osc", "here:0", "--script", "walk"), "expected an address and a port"),
    ],
)
def test_refusals(tmp_path: Path, arguments: tuple[object, ...], said: str) -> None:
    if "--osc" in arguments and not importlib.util.find_spec("pythonosc"):
        pytest.skip("the extra live is not installed")
    told = [str(argument).replace("{out}", str(tmp_path)) for argument in arguments]
    check_refused(run("live", *told), said.replace("{out}", str(tmp_path)), tmp_path)
