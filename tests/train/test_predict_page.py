"""The page of results: its sentences are true of its tables, whatever the figures are."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from test_predict_data import write_files
from test_predict_report import FIVE, line, manifest, saved

from motet.cli import main
from motet_train.data.expmap_files import CMU_LAYOUT, H36M_LAYOUT, ExpmapCorpus
from motet_train.evaluate.predict.ablation_sentences import ablation_sentences, largest_spread
from motet_train.evaluate.predict.ablations import ablated, ablation_table
from motet_train.evaluate.predict.commands import run_words, shown, training_commands
from motet_train.evaluate.predict.curves import FEW, MANY, MEAN, ROTATION, Curves
from motet_train.evaluate.predict.floors import CONSTANT, DAMPED, ZERO
from motet_train.evaluate.predict.page import Surroundings, page, sentences
from motet_train.evaluate.predict.protocol import REPORTED
from motet_train.evaluate.predict.protocol_table import means_table
from motet_train.evaluate.predict.published import FRAMES
from motet_train.evaluate.predict.results import Results, from_curves
from motet_train.evaluate.predict.seed_groups import seed_groups
from motet_train.evaluate.predict.sentences import Figures, beside_floors, beside_goals, beside_papers, smallest
from motet_train.evaluate.predict.text_floors import TEXT_FLOORS
from motet_train.evaluate.predict.training_sentences import training_sentences
from motet_train.evaluate.predict.words import at, listed

CORPUS = ExpmapCorpus(CMU_LAYOUT, {}, {action: {} for action in FIVE}, ("train/washwindow/washwindow_1.txt",))
KINDS = (FEW, MANY, ROTATION)


def models() -> dict[str, Any]:
    """Two seeds of motet's own predictor, three of the convolutional one, one of RRNN."""
    found = {f"ours-{n}": manifest(n, "trajectory") for n in range(2)}
    found |= {f"conv-{n}": manifest(n) for n in range(3)}
    return found | {"rrnn-0": manifest(0, "rrnn")}


def results(values: dict[str, float], **changed: float) -> Results:
    """Of systems whose errors are the same everywhere, but for changes: of a system at frame N of means, "name_N"."""
    found: Curves = {
        kind: {name: {part: np.full(25, value) for part in (*FIVE, MEAN)} for name, value in values.items()}
        for kind in KINDS
    }
    for place, value in changed.items():
        name, frame = place.rsplit("_", 1)
        for kind in KINDS:
            found[kind][name.replace("_", "-")][MEAN][int(frame)] = value
    return of(found)


def of(found: Curves) -> Results:
    every = models()
    runs = {name: model for name, model in every.items() if name in found[FEW]}
    return from_curves(runs, CORPUS, seed_groups(runs), found)


FLOORS = {ZERO: 0.9, CONSTANT: 1.9, DAMPED: 0.8}
SEEDS = {"ours-0": 0.40, "ours-1": 0.42, "conv-0": 0.5, "conv-1": 0.51, "conv-2": 0.52, "rrnn-0": 0.6}


def random(seed: int) -> Results:
    """Of errors drawn anew, some alike and some like those published."""
    rng = np.random.default_rng(seed)
    names = (*TEXT_FLOORS, *models())
    found: Curves = {
        kind: {
            name: {part: rng.choice([0.3, 0.4, 0.41, 0.9], 25) + rng.random() for part in (*FIVE, MEAN)}
            for name in names
        }
        for kind in KINDS
    }
    return of(found)


def frames(text: str) -> list[int]:
    return list(REPORTED) if "every frame" in text else [int(number) for number in re.findall(r"\d+", text)]


def table(text: str) -> dict[str, list[float]]:
    """The first block of a table, name -> the numbers at the frames reported; spreads in brackets left out."""
    rows: dict[str, list[float]] = {}
    block, *_ = text.split("mean of basketball, jumping, running, soccer, walking\n")[1].split("\n\n")
    for row in block.splitlines():
        name, *cells = re.split(r"\s{2,}", re.sub(r"\s*\[.*?\]", "", row).strip())
        rows[name] = [float(cell) for cell in cells]
    return rows


def names(found: Results) -> Iterator[tuple[str, str]]:
    """Each row's name in sentences, and in the table."""
    figures = Figures(found)
    return ((figures.name(row), row) for row in found.systems)


@pytest.mark.parametrize("seed", range(8))
def test_the_smallest_is_that_of_the_table(seed: int) -> None:
    found = random(seed)
    first, *_ = smallest(Figures(found), FEW)
    rows = table(means_table(found.means, CORPUS, found.spreads))
    said: dict[int, set[str]] = {}
    for part in first.removeprefix("Eight windows: ").rstrip(".").split("; "):
        who, where = re.split(r" ha(?:s|ve) the smallest mean error ", part)
        for frame in frames(where):
            assert frame not in said
            said[frame] = set(re.split(r", | and ", who))
    assert set(said) == set(REPORTED)
    for place, frame in enumerate(REPORTED):
        least = min(rows[row][place] for _, row in names(found))
        assert said[frame] == {name for name, row in names(found) if rows[row][place] == least}


@pytest.mark.parametrize("seed", range(8))
def test_what_is_over_a_published_row_is_so_in_the_table(seed: int) -> None:
    found = random(seed)
    rows = table(means_table(found.means, CORPUS, found.spreads))
    said = beside_papers(Figures(found))
    for name, row, paper in (
        ("conv", "conv (3 seeds)", "published: ConvSeq2Seq (Li 2018)"),
        ("rrnn-0", "rrnn-0", "published: RRNN (Martinez 2017)"),
    ):
        sentence = next(one for one in said if one.startswith(f"{name} is"))
        ours = [rows[row][REPORTED.index(frame)] for frame in FRAMES]
        over = {
            frame: round(value - known, 2)
            for frame, value, known in zip(FRAMES, ours, rows[paper], strict=True)
            if round(value - known, 2) > 0
        }
        mean = sentence.split("; by action")[0]
        if not over:
            assert mean == f"{name} is at or under its published row at every frame"
            continue
        _, _, tail = mean.rpartition("over it" if "at or under" in mean else "over its published row")
        where, amounts = tail.split(", by ")
        assert (list(FRAMES) if "every" in where else frames(where)) == list(over)
        assert [float(f"0{a}" if a.startswith(".") else a) for a in re.split(r", | and ", amounts)] == list(
            over.values()
        )


@pytest.mark.parametrize("seed", range(4))
def test_what_is_no_better_than_a_floor_is_so_in_the_table(seed: int) -> None:
    found = random(seed)
    rows = table(means_table(found.means, CORPUS, found.spreads))
    said = beside_floors(Figures(found))
    for floor, words in ((ZERO, "standing still"), (CONSTANT, CONSTANT), (DAMPED, DAMPED)):
        start = f"Eight windows: no better than {words} in the mean: "
        sentence = next((one.removeprefix(start).rstrip(".") for one in said if one.startswith(start)), "")
        parts = dict(part.split(" at ", 1) for part in sentence.split("; ")) if sentence else {}
        for name, row in names(found):
            worse = [f for f, a, b in zip(REPORTED, rows[row], rows[floor], strict=True) if a >= b]
            if row not in TEXT_FLOORS:
                assert (frames(parts[name]) if name in parts else []) == worse


def test_leads_are_said_with_the_spread_of_the_seeds() -> None:
    clear = smallest(Figures(results({**FLOORS, **SEEDS})), FEW)
    assert clear == [
        "Eight windows: ours has the smallest mean error at every frame.",
        "At every frame the lead over the next row is more than the spread of the seeds.",
    ]
    near = smallest(Figures(results({**FLOORS, **SEEDS, "ours-0": 0.46, "ours-1": 0.52}, ours_0_24=0.6)), FEW)
    assert near[0] == (
        "Eight windows: ours has the smallest mean error at frames 1, 3, 7, 9 and 13; "
        "conv has the smallest mean error at frame 24."
    )
    assert near[1:] == [
        "At frames 1, 3, 7, 9 and 13 the lead of ours over conv is within the spread of their seeds.",
        "At frame 24 the lead of conv over ours is within the spread of their seeds.",
    ]
    lone = smallest(Figures(results({**FLOORS, **SEEDS, "rrnn-0": 0.1})), FEW)
    assert lone[1:] == ["At every frame the lead of rrnn-0 over ours rests on one run of rrnn-0."]
    even = smallest(Figures(results({**FLOORS, **SEEDS, "rrnn-0": 0.41})), ROTATION)
    assert even == ["Angles of rotation: ours and rrnn-0 have the smallest mean angle at every frame."]


def test_a_floor_can_be_the_best() -> None:
    said = smallest(Figures(results({**FLOORS, DAMPED: 0.1, **SEEDS})), FEW)
    assert said[0] == "Eight windows: damped velocity has the smallest mean error at every frame."
    assert "lead over the next row is more than the spread" in said[1]
    worse = beside_floors(Figures(results({**FLOORS, DAMPED: 0.1, **SEEDS, "rrnn-0": 0.9})))
    every = "ours at every frame; conv at every frame; rrnn-0 at every frame"
    assert worse[:3] == [
        "Eight windows: no better than standing still in the mean: rrnn-0 at every frame.",
        f"Eight windows: no better than damped velocity in the mean: {every}.",
        "Eight windows: better than constant velocity in the mean, at every frame: all rows.",
    ]
    assert "By action, ours is better than standing still everywhere." in worse


def test_goals_are_those_of_motets_own_predictor() -> None:
    said = beside_goals(Figures(results({**FLOORS, "ours-0": 0.68, "ours-1": 0.68, "conv-0": 0.1})))
    assert said == [
        "Eight windows: ours is at or under the goal at frames 9 and 24, and over it at frames 1, 3 and 7, "
        "by .42, .29 and .01.",
        "256 windows: ours is at or under the goal at frames 9 and 24, and over it at frames 1, 3 and 7, "
        "by .43, .29 and .04.",
    ]
    other = from_curves({}, ExpmapCorpus(H36M_LAYOUT, {}, {}, ()), [], {kind: {} for kind in KINDS})
    assert beside_goals(Figures(other)) == []


def test_actions_where_a_row_is_over_its_published_one() -> None:
    found = results({**FLOORS, "conv-0": 0.36})
    (said,) = beside_papers(Figures(found))
    assert said == (
        "conv-0 is at or under its published row at frames 3, 7, 9 and 24, and over it at frame 1, by .03; by action, "
        "it is over it in running at frame 1, in soccer at frame 1, in walking at frame 1, "
        "nowhere in basketball and jumping."
    )


def trained(**changed: Any) -> list[str]:
    """The sentences on training of runs whose manifests differ so, from ``ours`` on."""
    every = models()
    for name, model in every.items():
        recipe = {"warp": 0.15, "reverse": 0.3, "mirror": 0.5, "average": 0.99, "steps": 100}
        model.manifest.training |= {"data": {"files": 32}, "recipe": recipe, "steps": 100}
        if name.startswith("ours"):
            recipe.update({key: value for key, value in changed.items() if key in recipe})
            model.manifest.training["data"] = {"files": changed.get("files", 32)}
            model.manifest.training["steps"] = changed.get("ended", 100)
    found: Curves = {k: {n: {part: np.ones(25) for part in (*FIVE, MEAN)} for n in every} for k in KINDS}
    return training_sentences(Figures(from_curves(every, CORPUS, seed_groups(every), found)))


def test_what_rows_have_in_common_is_read_from_their_manifests() -> None:
    same = trained()
    assert same[0] == "All rows have the same files: 32 trained on, none held out."
    assert same[1] == "All rows have the same augmentation: warp 0.15, reverse 0.3 and mirror 0.5."
    assert same[2] == "All rows have the same running mean of the weights: 0.99."
    assert same[3] == "Not all rows have the same number of seeds: ours 2; conv 3; rrnn-0 1."
    assert not any("stopped early" in one for one in same)
    other = trained(files=27, mirror=0.0, ended=60)
    assert other[0].startswith(
        "Not all rows have the same files: ours 27 trained on, none held out; conv and rrnn-0 32"
    )
    assert "ours warp 0.15, reverse 0.3 and mirror 0;" in other[1]
    assert "ours stopped early, after 60 of 100 steps." in other


def test_ablations_are_beside_the_first_row() -> None:
    runs = {"a-0": manifest(0), "a-1": manifest(1), "b": manifest(0, long_term="none"), "c": manifest(0, window=5)}
    values = {"a-0": 0.50, "a-1": 0.54, "b": 0.58, "c": 0.53}
    found: Curves = {k: {n: {p: np.full(25, v) for p in (*FIVE, MEAN)} for n, v in values.items()} for k in KINDS}
    found[MANY]["b"][MEAN][9] = 0.40
    made = from_curves(runs, CORPUS, seed_groups(runs), found)
    figures, said = Figures(made), ablated(runs, made.groups)
    assert largest_spread(figures) == 0.04
    lines = ablation_sentences(figures, said, 0.04)
    assert lines == [
        "Differences of .04 or less, the largest spread of this model's seeds, say nothing.",
        "without long-term encoder: worse at frames 1, 3, 7 and 24, by .06, .06, .06 and .06; "
        "better at frame 9, by .12.",
        "window 5: no difference.",
    ]
    assert "[.04]" in line(ablation_table(made.means, said, made.spreads), "a (2 seeds)")
    assert "no spread was measured" in ablation_sentences(figures, said, 0.0)[0]


def test_commands_are_those_of_the_manifests_without_places() -> None:
    every = models()
    for n in range(3):
        words = f"motet train convseq2seq --data /home/me/cmu-expmap.zip --seed {n} --out=/tmp/x/conv-{n} --name 'a b'"
        every[f"conv-{n}"].manifest.training["command"] = words
    found: Curves = {k: {n: {p: np.ones(25) for p in (*FIVE, MEAN)} for n in every} for k in KINDS}
    (command,) = training_commands(from_curves(every, CORPUS, seed_groups(every), found))
    assert "/home" not in command
    assert "/tmp" not in command
    assert command.startswith("motet train convseq2seq --data cmu-expmap.zip --seed 0 --out=conv-0 --name 'a b'")
    assert command.endswith("# seeds 1, 2 too")
    long = shown("motet train x " + " ".join(f"--option-{n} value" for n in range(20)))
    assert max(map(len, long.splitlines())) <= 112
    assert " ".join(part.rstrip("\\").strip() for part in long.splitlines()).count("--option") == 20
    assert run_words(["/a/runs/x", "/a/runs/y"], ["x", "y"]) == ["runs/*"]
    assert run_words(["runs/x", "runs/y"], ["x", "y", "z"]) == ["runs/x", "runs/y"]
    assert run_words(["one"], ["one"]) == ["one"]
    assert shown("motet evaluate 'runs/*'") == "motet evaluate runs/*"


def test_the_page_has_all_its_parts_and_its_pictures() -> None:
    found = random(0)
    text = page(found, Surroundings("motet evaluate runs/*", {"Error over time": "figures/predict-error.png"}))
    heads = [row for row in text.splitlines() if row.startswith("#")]
    assert heads == ["# Predictors compared", "## Means of the actions", "## How they were trained", "## By action"]
    assert "    motet evaluate runs/*\n" in text
    assert "![Error over time](figures/predict-error.png)" in text
    assert "1 of 48 files are missing: washwindow (1 of 5 training)." in text
    joined = " ".join(text.split())
    for sentence in (*sentences(Figures(found)), *training_sentences(Figures(found))):
        assert f"* {sentence}" in joined
    assert max(len(row) for row in text.split("```")[::2] for row in row.splitlines()) <= 120


def test_the_page_is_written_by_a_command(tmp_path: Path) -> None:
    data = write_files(tmp_path / "data", actions=("running",))
    (tmp_path / "runs").mkdir()
    (tmp_path / "without").mkdir()
    for n in range(2):
        saved(tmp_path / "runs" / f"conv-{n}", data, n)
    saved(tmp_path / "without" / "a", data, 0)
    saved(tmp_path / "without" / "b", data, 0, long_term="none")
    runs = [str(tmp_path / "runs" / f"conv-{n}") for n in range(2)]
    where = ["--page", str(tmp_path / "page.md"), "--plots", str(tmp_path / "figures")]
    more = ["--ablations", str(tmp_path / "without")]
    done = CliRunner().invoke(main, ["evaluate", *runs, "--data", str(data), *where, *more])
    assert done.exit_code == 0, done.output
    text = (tmp_path / "page.md").read_text()
    assert "    motet evaluate runs/* --data data --ablations without --plots figures --page page.md\n" in text
    assert "![Running: the truth, and what each predicts](figures/predict-running.png)" in text
    assert "## The paper's ablations" in text
    assert line(text, "without long-term encoder")
    assert str(tmp_path) not in text
    for one in re.findall(r"^\* .*(?:\n  .*)*", text.split("## How they were trained")[0], re.MULTILINE):
        assert " ".join(one.split()) in " ".join(done.output.split())  # what the page says, the command says


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--page", "{tmp}/none/page.md"], "the folder"),
        (["--ablations", "{tmp}"], "give --page"),
        (["--page", "{tmp}/page.md", "--ablations", "{tmp}/data"], "has no runs"),
    ],
)
def test_pages_that_cannot_be_written_are_refused(tmp_path: Path, given: list[str], said: str) -> None:
    data = write_files(tmp_path / "data", actions=("running",))
    run = saved(tmp_path / "run", data, 0)
    options = [option.format(tmp=tmp_path) for option in given]
    done = CliRunner().invoke(main, ["evaluate", str(run), "--data", str(data), *options])
    assert (done.exit_code, said in done.output) == (2, True), done.output


def test_words() -> None:
    assert [listed(["a"]), listed(["a", "b"]), listed(["a", "b", "c"])] == ["a", "a and b", "a, b and c"]
    assert [at([7]), at([1, 3]), at(list(REPORTED))] == ["at frame 7", "at frames 1 and 3", "at every frame"]
