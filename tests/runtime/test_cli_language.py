"""``motet describe``, ``generate`` and ``embed`` over small models whose graphs are numpy."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, run
from fake_models import describe_model, generate_model, moving

from motet.formats import read_motion, write_motion
from motet.models.describe import ConfidenceSettings
from motet.models.load import load


@pytest.fixture(autouse=True)
def bundles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small models in the place of the shipped ones."""
    models = {"describe": describe_model(), "generate": generate_model()}
    monkeypatch.setattr("motet.models.load.load", lambda name, threads=1: models.get(name) or load(name, threads))


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """Two motions that fit, the second at another frame rate."""
    paths = [tmp_path / "one.npz", tmp_path / "two.npz"]
    write_motion(paths[0], moving(20))
    write_motion(paths[1], moving(60, fps=40.0, seed=1))
    return paths


def test_describe_prints_json_for_every_file(files: list[Path]) -> None:
    result = run("describe", *files, "--beams", 3, "--json")
    assert result.exit_code == 0
    rows = json.loads(result.stdout)
    assert [row["input"] for row in rows] == [str(path) for path in files]
    expected = describe_model().describe([read_motion(path) for path in files], 3)
    for row, wanted in zip(rows, expected, strict=True):
        assert [set(h) for h in row["hypotheses"]] == [
            {"text", "log_probability", "score", "confident", "probability"}
        ] * 3
        assert [h["text"] for h in row["hypotheses"]] == [d.text for d in wanted]
        np.testing.assert_allclose(
            [h["log_probability"] for h in row["hypotheses"]], [d.log_probability for d in wanted], atol=1e-5
        )


def test_describe_draws_sentences_that_agree(files: list[Path]) -> None:
    rows = json.loads(run("describe", *files, "--beams", 2, "--draws", 50, "--json").stdout)
    expected = describe_model().describe([read_motion(path) for path in files], 2, draws=50)
    assert [[h["text"] for h in row["hypotheses"]] for row in rows] == [[d.text for d in row] for row in expected]


def test_describe_says_that_it_resampled_if_asked_to(files: list[Path]) -> None:
    result = run("--verbose", "describe", *files)
    assert result.stderr == "motet: resampled 1 of 2 motions to 10 fps\n"
    lines = result.stdout.splitlines()
    assert (len(lines), lines[0], lines[6]) == (12, str(files[0]), str(files[1]))
    assert run("describe", files[0]).stdout.splitlines() == lines[1:6]
    assert run("describe", files[1]).stderr == ""


def test_the_list_is_ordered_by_the_score_it_shows(files: list[Path]) -> None:
    for options in ([], ["--draws", 50]):
        scores = [float(line.split()[0]) for line in run("describe", files[0], *options).stdout.splitlines()]
        assert scores == sorted(scores, reverse=True)


def test_a_file_that_fails_is_named_and_the_others_are_described(files: list[Path], tmp_path: Path) -> None:
    (tmp_path / "bad.npz").write_text("hello")
    write_motion(tmp_path / "lacking.npz", moving(20).select(("knee.ry", "knee.rz")))
    paths = [tmp_path / "bad.npz", files[0], tmp_path / "lacking.npz", tmp_path / "none.npz", files[1]]
    result = run("describe", *paths, "--json")
    assert result.exit_code == 1
    rows = json.loads(result.stdout)
    assert rows == json.loads(run("describe", *files, "--json").stdout)
    for path in (paths[0], paths[2], paths[3]):
        assert result.stderr.count(f"motet: {path}: ") == 1
    assert len(result.stderr.splitlines()) == 3
    out = tmp_path / "out.npy"
    result = run("embed", *paths, "-o", out)
    assert (result.exit_code, len(result.stderr.splitlines())) == (1, 3)
    np.testing.assert_array_equal(np.load(out), describe_model().embed([read_motion(path) for path in files]))


def test_a_long_motion_is_described_in_windows(tmp_path: Path, files: list[Path]) -> None:
    write_motion(tmp_path / "long.npz", moving(450))
    rows = json.loads(run("describe", tmp_path / "long.npz", "--json").stdout)
    assert [(row["start"], row["stop"]) for row in rows] == [(0.0, 22.5), (22.5, 45.0)]
    parts = [part for _, part in describe_model().windows(moving(450))]
    assert [row["hypotheses"][0]["text"] for row in rows] == [d[0].text for d in describe_model().describe(parts)]
    lines = run("describe", tmp_path / "long.npz", files[0]).stdout.splitlines()
    assert [lines[0], lines[1], lines[7], lines[13]] == [
        str(tmp_path / "long.npz"),
        "0.0 to 22.5 s",
        "22.5 to 45.0 s",
        str(files[0]),
    ]


def test_a_timeline_has_a_line_for_each_part(tmp_path: Path, files: list[Path]) -> None:
    path = tmp_path / "long.npz"
    write_motion(path, moving(450))
    expected = describe_model().timeline(read_motion(path))
    rows = json.loads(run("describe", path, "--timeline", "--json").stdout)
    assert rows == [{"input": str(path), "in_place": False, **part.to_json()} for part in expected]
    assert {"start", "stop", "text", "log_probability", "confident"} <= set(rows[0])
    lines = run("describe", path, "--timeline").stdout.splitlines()
    told = [f"{part.start:.1f}-{part.stop:.1f} s  {'' if part.confident else '? '}{part.text}" for part in expected]
    assert lines == told
    both = run("describe", path, tmp_path / "none.npz", files[0], "--timeline")
    assert (both.exit_code, both.stderr.count("none.npz: no such file")) == (1, 1)
    assert both.stdout.splitlines()[: len(lines) + 2] == [str(path), *lines, str(files[0])]


def test_what_is_not_sure_has_a_question_mark(files: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    expected = describe_model().describe(read_motion(files[0]))
    limit = ConfidenceSettings(expected[1].log_probability)
    monkeypatch.setattr("motet.models.describe.DescribeModel.settings", lambda self, kind: limit)
    texts = [line[10:] for line in run("describe", files[0]).stdout.splitlines()]
    assert texts == [*(found.text for found in expected[:2]), *(f"? {found.text}" for found in expected[2:])]
    (row,) = json.loads(run("describe", files[0], "--json").stdout)
    assert [found["confident"] for found in row["hypotheses"]] == [True, True, False, False, False]


def test_generate_writes_the_same_bytes_every_time(tmp_path: Path) -> None:
    outs = [tmp_path / name for name in ("a.bvh", "b.bvh", "c.bvh")]
    for out, seed in zip(outs, (1, 1, 2), strict=True):
        result = run("generate", "a person walks", "-o", out, "--seed", seed)
        assert (result.exit_code, result.stderr) == (0, "")
        assert result.stdout.startswith(f"{out}: {len(read_motion(out))} frames at 30 fps, ")
    assert outs[0].read_bytes() == outs[1].read_bytes() != outs[2].read_bytes()
    assert read_motion(outs[0]).fps == pytest.approx(30)


def test_generate_numbers_the_files_of_several_motions(tmp_path: Path) -> None:
    out = tmp_path / "out.npz"
    options = ["--hypotheses", 2, "--candidates", 1, "--temperature", 0.5, "--max-seconds", 2, "--fps", 10, "--json"]
    rows = json.loads(run("generate", "walks", "a person walks", "-o", out, "--all", "--seed", 3, *options).stdout)
    found = generate_model().generate(
        ["walks", "a person walks"], 2, candidates=1, temperature=0.5, max_seconds=2, seed=3
    )
    assert [row["input"] for row in rows] == ["walks", "a person walks"]
    written = [h for row in rows for h in row["hypotheses"]]
    assert [Path(h["output"]).name for h in written] == ["out-1.npz", "out-2.npz", "out-3.npz", "out-4.npz"]
    for hypothesis, generated in zip(written, [g for row in found for g in row], strict=True):
        motion = read_motion(hypothesis["output"])
        np.testing.assert_allclose(motion.values, generated.playable(10).values, atol=1e-6)
        assert hypothesis["log_likelihood"] == generated.log_likelihood
        assert (hypothesis["frames"], hypothesis["fps"]) == (len(motion), 10)
    assert run("generate", "walks", "walks", "-o", tmp_path / "best.npz").exit_code == 0
    assert run("generate", "walks", "walks", "-o", tmp_path / "{name}.npz").exit_code == 0
    assert [(tmp_path / f"{number}.npz").exists() for number in (0, 1, 2)] == [False, True, True]
    assert sorted(path.name for path in tmp_path.glob("best*")) == ["best-1.npz", "best-2.npz"]


def test_each_text_is_tried_and_those_that_fail_are_named(tmp_path: Path) -> None:
    texts, out = ["", "walks", "zebra", "a person walks"], tmp_path / "out.npz"
    result = run("generate", *texts, "-o", out, "--seed", 3)
    assert result.exit_code == 1
    assert [line.partition(";")[0] for line in result.stderr.splitlines()] == [
        "motet: the sentence '' has no words",
        "motet: the model, for English, knows no word of 'zebra'",
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out-2.npz", "out-4.npz"]
    # the seed goes by the place among all texts
    for index in (1, 3):
        expected = generate_model().generate(texts[index], seed=3 + index)[0].playable()
        np.testing.assert_allclose(read_motion(tmp_path / f"out-{index + 1}.npz").values, expected.values, atol=1e-6)
    rows = json.loads(run("generate", *texts, "-o", out, "--all", "--hypotheses", 3, "--json").stdout)
    names = [[Path(found["output"]).name for found in row["hypotheses"]] for row in rows]
    assert names == [[f"out-{n}.npz" for n in (4, 5, 6)], [f"out-{n}.npz" for n in (10, 11, 12)]]
    vectors = run("embed", *(word for text in texts for word in ("--text", text)), "-o", tmp_path / "out.npy")
    assert (vectors.exit_code, len(vectors.stderr.splitlines())) == (1, 2)
    np.testing.assert_array_equal(np.load(tmp_path / "out.npy"), generate_model().embed([texts[1], texts[3]]))


def test_unknown_words_are_said_and_the_rest_is_used(tmp_path: Path) -> None:
    result = run("generate", "a zebra walks", "-o", tmp_path / "out.bvh")
    assert result.exit_code == 0
    assert result.stderr == "motet: the model does not know zebra (in 'a zebra walks')\n"
    assert run("--quiet", "generate", "a zebra walks", "-o", tmp_path / "out.bvh").stderr == ""
    result = run("embed", "--text", "a zebra walks", "--text", "walks", "-o", tmp_path / "out.npy")
    assert result.stderr == "motet: the model does not know zebra (in 'a zebra walks')\n"


def test_embed_takes_sentences(tmp_path: Path) -> None:
    out = tmp_path / "out.npy"
    result = run("embed", "--text", "walks", "--text", "a person", "--text", "left", "-o", out)
    assert result.stdout == f"{out}: 3 context vectors of 4 numbers\n"
    np.testing.assert_array_equal(np.load(out), generate_model().embed(["walks", "a person", "left"]))


@pytest.mark.parametrize(
    ("code", "arguments", "said"),
    [
        (1, ["describe", "{bad}/none.npz"], "none.npz: no such file"),
        (
            1,
            ["describe", "{bad}/lacking.npz"],
            "lacking.npz: the motion lacks 2 of 3 channels: hips.ty",
        ),
        (1, ["describe", "{bad}/frame.npz"], "frame.npz: the model needs two frames at 10 fps, but the motion has 1"),
        (1, ["embed", "{bad}/long.npz", "-o", "{out}/a.npy"], "long.npz: the motion lasts 31.0 s"),
        (1, ["describe", "{bad}/nan.csv"], "nan.csv"),
        (2, ["describe", "{bad}/good.npz", "--beams", "0"], "range 1<=x<=100"),
        (2, ["describe", "{bad}/good.npz", "--timeline", "--beams", "3"], "goes with neither --beams nor --draws"),
        (2, ["describe", "{bad}/good.npz", "--draws", "-1"], "range 0<=x<=1000"),
        (2, ["describe", "{bad}/good.npz", "--bundle", "nothing"], "unknown bundle 'nothing'"),
        (2, ["describe", "{bad}/good.npz", "--bundle", "generate"], "is for 'generate'; need one for 'describe'"),
        (2, ["describe"], "Missing argument"),
        (1, ["generate", "", "-o", "{out}/a.bvh"], "has no words"),
        (1, ["generate", "zebra", "-o", "{out}/a.bvh"], "knows no word of 'zebra'"),
        (1, ["generate", "walks " * 41, "-o", "{out}/a.bvh"], "41 words, but at most 40"),
        (2, ["generate", "walks", "-o", "{out}/a.xyz"], "expected one of .amc"),
        (2, ["generate", "walks", "-o", "{out}/no/a.bvh"], "does not exist"),
        (2, ["generate", "walks", "-o", "{out}/a.bvh", "--seed", "-1"], "x>=0"),
        (2, ["generate", "walks", "-o", "{out}/a.bvh", "--temperature", "0"], "range 0.01<=x<=100"),
        (2, ["generate", "walks", "-o", "{out}/a.bvh", "--candidates", "0"], "range 1<=x<=100"),
        (2, ["generate", "walks", "-o", "{out}/a.bvh", "--hypotheses", "0"], "range 1<=x<=100"),
        (2, ["generate", "walks", "-o", "{out}/a.bvh", "--max-seconds", "-3"], "range 0<=x<=600"),
        (2, ["generate", "walks", "-o", "{out}/a.bvh", "--fps", "0"], "range 0<x<=10000"),
        (2, ["generate", "walks", "-o", "{out}/a.bvh", "--bundle", "tdbn"], "is for 'control'"),
        (2, ["embed", "-o", "{out}/a.npy"], "either motion files or --text"),
        (2, ["embed", "{bad}/good.npz", "--text", "walks", "-o", "{out}/a.npy"], "either motion files or --text"),
        (2, ["embed", "{bad}/good.npz", "-o", "{out}/a.txt"], "written as .npy"),
        (1, ["embed", "{bad}/lacking.npz", "-o", "{out}/a.npy"], "lacking.npz: the motion lacks 2"),
        (1, ["embed", "--text", "zebra", "-o", "{out}/a.npy"], "knows no word"),
        (2, ["embed", "--text", "walks", "-o", "{out}/no/a.npy"], "does not exist"),
    ],
)
def test_bad_input_gets_one_message_and_writes_nothing(
    code: int, arguments: list[str], said: str, tmp_path: Path, out: Path
) -> None:
    bad = tmp_path / "bad"
    bad.mkdir()
    motion = moving(20)
    write_motion(bad / "good.npz", motion)
    write_motion(bad / "lacking.npz", motion.select(("knee.ry", "knee.rz")))
    write_motion(bad / "frame.npz", motion[:1])
    write_motion(bad / "long.npz", moving(310))
    write_motion(bad / "nan.csv", motion)
    text = (bad / "nan.csv").read_text().splitlines()
    (bad / "nan.csv").write_text("\n".join([*text[:-1], ",".join(["nan"] * len(text[-1].split(",")))]))
    result = run(*(argument.format(out=out, bad=bad) for argument in arguments))
    check_refused(result, said, out, code)


def test_a_file_without_a_unit_of_length_is_refused_until_it_is_told(tmp_path: Path) -> None:
    motion = moving(20).select(("hips.ty", "knee.rx", "knee.ry"), ("length", "deg", "deg"))
    write_motion(tmp_path / "a.bvh", motion)  # as many programs write it: BVH does not hold the unit
    result = run("describe", tmp_path / "a.bvh")
    assert (result.exit_code, "--unit-in" in result.stderr) == (1, True)
    assert run("describe", tmp_path / "a.bvh", "--unit-in", "m").exit_code == 0
