import re
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from figures import walker

import motet
from motet.draw.svg import strip
from motet.errors import OutputError
from motet.live import demo
from motet.steering.model import SteerModel


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo."""
    found = tmp_path_factory.mktemp("demo") / "in" / "demo"
    motet.write_demo(found)
    return found


def test_the_index_leads_to_every_page_and_nothing_elsewhere(folder: Path) -> None:
    text = (folder / "index.html").read_text(encoding="utf-8")
    assert set(re.findall('href="([a-z.]+)"', text)) | {"index.html"} == {page.name for page in folder.iterdir()}
    assert text.count("<svg") == text.count("<li>") == 5
    assert sum(page.stat().st_size for page in folder.iterdir()) < 12e6
    for page in folder.iterdir():
        text = page.read_text(encoding="utf-8").replace('xmlns="http://www.w3.org/2000/svg"', "")
        assert not re.search(r"https?:|@import|\ssrc=|\{\{[A-Z]", text)
        assert "default-src 'none'" in text


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_its_pages_open_from_a_folder(folder: Path, tmp_path: Path) -> None:
    with Browser(tmp_path / "profile") as page:
        page.open(folder / "index.html", "document.readyState === 'complete'")
        pages = page.value("[...document.links].map((link) => link.href.split('/').pop())")
        page.value("void document.querySelector('a').focus()")
        assert page.value("document.activeElement.innerText").startswith("Live")
        for name in pages:
            page.open(folder / name, "document.querySelector('#facts, #speed')?.textContent")
            assert min(page.coloured()) > 20, name
        assert page.errors == []


def test_a_demo_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "there").mkdir()
    with pytest.raises(OutputError, match="it exists"):
        motet.write_demo(tmp_path / "there")

    def full(*_: object) -> None:
        raise OutputError("cannot write live.html: the disk is full")

    monkeypatch.setattr(demo, "write_live_page", full)
    with pytest.raises(OutputError, match="full"):
        motet.write_demo(tmp_path / "new")
    assert [place.name for place in tmp_path.iterdir()] == ["there"]


def test_a_strip_shows_each_pose_in_its_place(steer_model: SteerModel) -> None:
    drawn = strip(steer_model.run("walk 2s"), poses=3)
    (places,) = [np.array(re.findall(r"M(-?[\d.]+) (-?[\d.]+)", drawn), float)]
    assert 'viewBox="0 0 330 190"' in drawn
    counts = [((places[:, 0] // 110) == n).sum() for n in range(3)]
    assert min(counts) > 500
    assert sum(counts) > 0.95 * len(places)
    assert places[:, 1].min() > 10
    assert places[:, 1].max() < 190
    assert "--c:" in strip(walker())  # also on bones
