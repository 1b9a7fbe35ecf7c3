"""The engine ray on a local cluster of two workers: the same answers, whatever happens to them."""

import json
import os
import re
import shlex
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from command_line import run

import motet
from motet.corpus.answers import Answer, Describe, Verb, to_json
from motet.corpus.sources import Source, files_of

ray = pytest.importorskip("ray")
pytest.importorskip("ray.data")
parquet = pytest.importorskip("pyarrow.parquet")

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A cluster of two workers, and a core that reads for them; they find what this file defines."""
    before = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = os.pathsep.join((str(Path(__file__).parent), before))
    ray.init(num_cpus=3, include_dashboard=False, logging_level="ERROR", log_to_driver=False)
    yield str(ray.get_runtime_context().gcs_address)
    ray.shutdown()
    os.environ["PYTHONPATH"] = before


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory, clips: Path) -> Path:
    """A hundred motions, one of them broken."""
    place = tmp_path_factory.mktemp("ray") / "motions"
    place.mkdir()
    walk = motet.to_humanoid(motet.read(clips / "39_14.amc")).motion
    for number in range(100):
        motet.write(place / f"{number:02}.npz", walk[number : 100 + number])
    (place / "33.npz").write_text("hello")
    return place


@dataclass(frozen=True)
class Mortal(Verb):
    """Ends its process, once, at the tenth motion."""

    grave: str = ""

    def rows(self, answer: Answer) -> list[Any]:
        """The name."""
        if answer.source.number == 10 and not Path(self.grave).exists():
            Path(self.grave).touch()
            os._exit(1)
        return [answer.source.name]


def test_answers_are_those_of_one_process_in_order(address: str, corpus: Path) -> None:
    from motet.corpus import ray_engine

    sources = [Source(file, number=number) for number, file in enumerate(files_of([corpus]))]
    alone = Describe({})(sources)
    found = list(ray_engine.answers(Describe({}), sources, 2, None))
    assert list(map(to_json, [vars(one)["rows"] for one in found])) == [to_json(one.rows) for one in alone]
    assert [one.error for one in found] == [one.error for one in alone]
    assert [one.source for one in found] == sources


def test_of_a_worker_that_dies_nothing_is_lost_and_nothing_comes_twice(address: str, tmp_path: Path) -> None:
    from motet.corpus import ray_engine

    sources = [Source(Path(f"{number}.npz"), number=number) for number in range(40)]
    found = list(ray_engine.answers(Mortal({}, str(tmp_path / "grave")), sources, 2, None))
    assert (tmp_path / "grave").exists()
    assert [one.source for one in found] == sources
    assert [one.rows for one in found] == [[str(number)] for number in range(40)]


def test_the_commands_of_the_page_run_on_a_cluster(address: str, corpus: Path, tmp_path: Path) -> None:
    page = (ROOT / "docs" / "scale.md").read_text(encoding="utf-8")
    block = page.partition("<!-- on a Ray cluster -->")[2].partition("<!-- end -->")[0]
    commands = re.findall(r"^    (motet .*)$", block, re.MULTILINE)
    assert len(commands) == 3
    (tmp_path / "motions").symlink_to(corpus)
    for command in commands:
        words = shlex.split(command.partition(" #")[0])[1:]
        words = [address if word == "auto" else word for word in words]
        done = subprocess.run(
            [sys.executable, "-m", "motet", *words], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode in (0, 1), done.stderr  # 1: the broken motion
    table = parquet.read_table(tmp_path / "answers.parquet").to_pylist()
    assert [Path(row["path"]).name for row in table] == sorted(path.name for path in corpus.iterdir())
    assert [row["path"] for row in table if row["error"]] == ["motions/33.npz"]
    best = motet.load("describe").describe(motet.read(corpus / "00.npz"))[0]
    assert json.loads(table[0]["answer"])[0]["hypotheses"][0]["text"] == best.text


def test_where_nothing_answers_is_one_message(corpus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from motet.corpus import ray_engine

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        place = f"127.0.0.1:{free.getsockname()[1]}"
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    with pytest.raises(motet.MotetError, match=f"^no Ray cluster answers at {place}: "):
        list(ray_engine.answers(Describe({}), [Source(corpus)], 2, place))


def test_without_ray_the_extra_is_named(corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    result = run("check", corpus, "--engine", "ray", "--parts", tmp_path)
    assert result.exit_code == 2
    assert "pip install 'motet[scale]'" in result.stderr
