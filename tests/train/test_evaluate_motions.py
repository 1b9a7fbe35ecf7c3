"""Measures of motions, prompts, the chain, and whole reports, against models whose answers are known."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from language_data import SKELETON
from language_models import (
    CHANNELS,
    FPS,
    FRAMES,
    KINDS,
    STORE,
    UNITS,
    FakeDescribe,
    FakeGenerate,
    manifest,
    moving,
    told,
)
from trainings import done, refused

from motet.motion.motion import Motion
from motet.text.vocabulary import NEW_MODEL_RULES, Vocabulary
from motet_train.data.store import FRAMES_FILE, INDEX, Store
from motet_train.evaluate.language.describe import bleu, copied_bleu, describe_report, nearest_motions
from motet_train.evaluate.language.generate import (
    LANGUAGE_GOALS,
    answers,
    best_descriptions,
    bounds_chained,
    chained,
    generate_report,
    kinds,
    measurable,
    prompted,
    recognised,
    thresholds,
    travel,
)
from motet_train.evaluate.language.motions import energy, feet_of, last_energy, measures, skate, speed
from motet_train.evaluate.language.split_store import SplitStore, split_as
from motet_train.evaluate.tables import aligned, json_ready, reached, report_table
from motet_train.runs import MODELS, Run


@pytest.fixture(scope="module")
def corpus() -> SplitStore:
    return split_as(told(STORE, "generate"), STORE)


def test_speed_turn_and_rise() -> None:
    found = travel(moving(1.5, -90, 0.4))
    assert found == pytest.approx((1.5, -90, 0.4))
    assert speed(moving(1.5, 40, 0)) == pytest.approx(1.5)
    assert travel(moving(1.5, -90, 0.4)[:1]) == (0, 0, 0)


def test_feet_that_do_not_step_slide_as_fast_as_the_figure() -> None:
    assert [SKELETON.names[i] for i in feet_of(SKELETON)] == ["left_leg_end", "right_leg_end"]
    assert skate(moving(1.5, 0, 0, swing=0)) == pytest.approx(1.5)
    assert skate(moving(0, 0, 0, swing=0)) == 0
    # in the frame of the jump nothing is on the ground: both of its steps are left out
    jump = moving(0.2, 0, 0.5, swing=0)
    values = jump.values.copy()
    values[10:12, 0] = 9.0
    assert skate(replace(jump, values=values)) == pytest.approx(0.2)


def test_a_leg_that_stands_while_the_other_swings_does_not_slide() -> None:
    """The figure moves forward by what its left foot moves back; the right foot is in the air."""
    angle = np.linspace(-5, 5, 11)
    values = np.zeros((11, len(CHANNELS)))
    values[:, 6], values[:, 7] = angle, 60
    still = Motion(values, CHANNELS, UNITS, FPS, SKELETON)
    values[:, 0] = skate(still)  # about even over so small an angle
    assert values[0, 0] > 0.1
    assert skate(replace(still, values=values)) < 0.02 * values[0, 0]


def test_energy_of_a_ramp_and_of_a_motion_that_stops() -> None:
    ramp = np.outer(np.arange(21) / FPS, [2.0, 0.0])  # 2 z/s in one of two channels
    assert energy(ramp, FPS) == pytest.approx(2.0)
    stopped = np.concatenate([ramp, np.repeat(ramp[-1:], 10, axis=0)])
    assert last_energy(stopped, FPS) == 0
    assert last_energy(stopped[:-5], FPS) == pytest.approx(1.0)
    assert energy(ramp[:1], FPS) == 0


def test_a_motion_that_freezes_is_counted(corpus: SplitStore) -> None:
    motion = moving(1, 0, 0)
    frozen = replace(motion, values=np.repeat(motion.values[:1], FRAMES, axis=0))
    found = measures([motion, frozen], corpus.contract, 1e-6)
    assert (found["frozen"], found["seconds"], found["speed"]) == pytest.approx((0.5, 2.1, 1.0))


def test_thresholds_lie_between_the_training_motions(corpus: SplitStore) -> None:
    limits = thresholds(kinds(corpus))
    assert limits == pytest.approx({"slow": 0.5, "run": 2.0, "turn": 45, "rise": 0.25})
    assert recognised(kinds(corpus), limits) == dict.fromkeys(("walks", "runs", "left", "right", "jumps"), 1.0)
    assert measurable(thresholds(kinds(SplitStore(replace(STORE, channels=tuple("abcdefgh")), corpus.parts)))) == {}


def test_what_the_training_motions_do_not_show_is_not_measured(corpus: SplitStore) -> None:
    found = kinds(corpus) | {"jumps": [], "left": []}
    limits, asked = thresholds(found), ("walks", "runs", "left", "right")
    assert limits == pytest.approx({"slow": 0.5, "run": 2.0, "turn": 45})
    assert tuple(prompted(FakeGenerate(STORE), limits, 2)) == asked  # type: ignore[arg-type]
    shares = recognised(found, limits)
    assert tuple(shares) == asked
    assert np.isnan(shares.pop("left"))
    assert set(shares.values()) == {1.0}


def test_prompts_tell_the_kinds_apart(corpus: SplitStore) -> None:
    limits, model = thresholds(kinds(corpus)), FakeGenerate(STORE)
    asked = ("walks", "runs", "left", "right", "jumps")
    assert prompted(model, limits, 3) == dict.fromkeys(asked, 1.0)  # type: ignore[arg-type]
    wrong = FakeGenerate(STORE)
    wrong.motions = dict.fromkeys(wrong.motions, moving(*KINDS["walks"]))
    assert prompted(wrong, limits, 3) == dict.fromkeys(asked, 0.0) | {"walks": 1.0}  # type: ignore[arg-type]


def test_the_chain_of_perfect_models(corpus: SplitStore) -> None:
    generate: Any = FakeGenerate(STORE)
    describe: Any = FakeDescribe(STORE)
    found = answers(generate, corpus, corpus.parts.test)
    assert len(found.rows) == 3 * len(corpus.parts.test)
    assert found.records[:4] == [*[corpus.parts.test[0]] * 3, corpus.parts.test[1]]
    assert chained(describe, found, corpus) == dict.fromkeys("12345", 1.0)
    assert bounds_chained(describe, found, corpus) == {"retrieval": 1.0, "data": 1.0}
    assert best_descriptions(describe, [moving(1, 0, 0)[:1], moving(9, 9, 9)]) == ["", "somebody dances"]


def test_the_report_of_a_perfect_describe_model(corpus: SplitStore) -> None:
    model: Any = FakeDescribe(STORE)
    report = describe_report(model, corpus)
    assert report["train"] == {"seconds": 1.5, "epochs": 3}
    assert report["data"] == {
        **{"train": 20, "validation": 5, "test": 5},
        **{"test_unknown_words": 5, "test_people": 1, "test_people_unseen": 1},
    }
    for group in ("bleu_train", "bleu_test", "bleu_train_marked", "bleu_test_marked"):
        assert report[group] == pytest.approx(dict.fromkeys("12345", 1.0))
    # two of three sentences of each test motion were said of training motions of the same kind
    assert report["wording"] == pytest.approx(
        {"test_sentences": 15, "test_sentences_seen": 2 / 3, "test_motions_unseen": 5}
    )
    seen = {sentence for said in corpus.references(corpus.parts.train) for sentence in said}
    said = [sentence for one in corpus.references(corpus.parts.test) for sentence in one]
    assert report["wording"]["test_sentences_seen"] == np.mean([sentence in seen for sentence in said])
    assert report["bleu_unseen"]["1"] < report["bleu_unseen"]["3"] == pytest.approx(1.0)
    test = corpus.parts.test
    unseen, best = corpus.unseen(test), [corpus.sentences(record)[0] for record in test]
    assert report["unseen"]["bleu_1"] == pytest.approx(bleu(best, unseen, longest=1)) != 0
    assert report["unseen"]["bleu_4"] == report["bleu_unseen"]["1"]
    nearest = corpus.references(nearest_motions(corpus, corpus.motions(test)))
    assert report["unseen"]["nearest_2"] == pytest.approx(copied_bleu(nearest, unseen, 2)) != 0
    assert report["words"] == {"verbs": 1, "sides": 1, "turns": 1, "verbs_of": 5, "sides_of": 2, "turns_of": 4}
    assert report["gain"]["frequent"] == 1 - report["floor"]["frequent"]
    assert report["likelihood"] == {"test": -2.0}
    right = {"of": 5, "right": 1, "confident": 1, "right_if_confident": 1, "kept": 1}
    assert {key: value for key, value in report["confidence"].items() if np.isfinite(value)} == right
    shares = ("joins_found", "cuts_right", "time_right", "time_confident", "time_right_if_confident", "alone_right")
    assert report["timeline"] == {**dict.fromkeys(shares, 1.0), "parts": 3}
    assert reached(LANGUAGE_GOALS, "words.verbs", report["words"]["verbs"])
    assert "words.sides1>=0.8" in report_table({"fake": report}, LANGUAGE_GOALS).replace(" ", "").splitlines()


def test_the_report_of_a_perfect_generate_model(corpus: SplitStore) -> None:
    model: Any = FakeGenerate(STORE)
    describe: Any = FakeDescribe(STORE)
    report = generate_report(model, corpus, describe)
    assert report["relative_test"] == report["relative_train"] == dict.fromkeys("12345", 1.0)
    assert set(report["bound"].values()) == {1.0}
    assert report["likelihood"] == {"train": -3.0, "test": -3.0}
    for key in ("seconds", "speed"):
        assert report["motion"][key] == pytest.approx(report["motion_data"][key])
    alone = generate_report(model, corpus)
    assert set(report) - set(alone) == {"chain_train", "chain_test", "relative_train", "relative_test", "bound"}
    rows = report_table({"with": report, "alone": alone}, LANGUAGE_GOALS).splitlines()
    assert len(rows) == 1 + sum(map(len, report.values()))


def test_without_a_root_block_nothing_is_said_of_the_path() -> None:
    """The paper's representation: joint angles alone."""
    angles = replace(STORE, frames=STORE.frames[:, 6:], channels=CHANNELS[6:], units=UNITS[6:], skeletons=())
    entries = tuple(replace(entry, skeleton=None) for entry in STORE.records)
    angles = replace(angles, representation="angles", records=entries)
    model: Any = FakeGenerate(angles)
    report = generate_report(model, split_as(model.manifest, angles))
    assert set(report["motion"]) == {"seconds", "energy", "end_energy", "frozen"}
    assert (set(report["threshold"]), "asked" in report) == ({"quiet"}, False)


def test_heads_of_columns_are_whole_and_no_longer_than_they_have_to_be() -> None:
    report = {"a": {"b": 0.5}}
    heads = report_table({"runs/unseen-people/a-describe": report, "runs/trial/b": report}, {}).splitlines()[0]
    assert heads.split() == ["a-describe", "b"]
    assert report_table({"x/a": report, "y/a": {}}, {}).splitlines() == ["      x/a   y/a", "a.b   0.5"]


def test_columns_are_as_wide_as_their_widest_cell() -> None:
    rows = [("a heading of any width",), ("one", "1", "x"), ("three", "100", "yy")]
    assert aligned(rows, left=(0, 2)).splitlines() == ["a heading of any width", "one       1   x", "three   100   yy"]
    assert aligned([("alone",)]) == "alone"


def test_numbers_that_json_lacks_are_null() -> None:
    assert json_ready({"a": {"b": np.nan, "c": 1 / 3}}) == {"a": {"b": None, "c": 0.333333}}
    assert not reached(LANGUAGE_GOALS, "relative_test.1", np.nan)


SIZES = {"encoder_units": [4], "decoder_units": [6], "embedding": 3}


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """A store, and in the folders describe, unseen and generate runs of untrained nets."""
    torch.manual_seed(0)
    (tmp_path / "store").mkdir()
    _write(STORE, tmp_path / "store")
    vocabulary = list(Vocabulary.of(s for entry in STORE.records for s in entry.sentences).words)
    shared = {"channels": len(CHANNELS), "words": len(vocabulary), **SIZES}
    more = {"motion": STORE.contract(range(20)).to_json(), "text": NEW_MODEL_RULES.to_json(), "vocabulary": vocabulary}
    config = shared | {"dropout": 0.4, "gates": "sigmoid"}
    settings = {"model": "motion-to-language", "loop": "beam", "config": config}
    settings["defaults"] = {"beams": 5, "max_words": 5}
    for name, by in (("describe", "trial"), ("unseen", "subject")):
        net = MODELS["motion-to-language"](config)
        _save(Run(manifest(STORE, "describe", by) | more | settings, net), tmp_path / name)
    config = shared | {"components": 2}
    settings = {"model": "language-to-motion", "loop": "mixture", "config": config}
    settings["defaults"] = {"hypotheses": 2, "candidates": 2, "temperature": 1.0, "max_seconds": 1}
    net = MODELS["language-to-motion"](config)
    _save(Run(manifest(STORE, "generate") | more | settings, net), tmp_path / "generate")
    return tmp_path


def test_evaluate_of_runs(runs: Path) -> None:
    names = [str(runs / name) for name in ("describe", "unseen", "generate")]
    reports = json.loads(done("evaluate", *names, "--data", runs / "store", "--json", "--save").output)
    for name in names:
        assert json.loads((Path(name) / "run.json").read_text())["quality"] == reports[name]
    assert reports[names[0]]["people_unseen"] == reports[names[1]]
    assert set(reports[names[2]]) >= {"chain_test", "asked", "motion", "motion_data", "threshold"}


def test_evaluate_draws_the_papers_figures(runs: Path) -> None:
    command = ("evaluate", runs / "describe", runs / "generate", "--data", runs / "store", "--plots", runs / "plots")
    assert "relative_test.1" in done(*command).output
    drawn = sorted(path.relative_to(runs / "plots").as_posix() for path in (runs / "plots").glob("*/*.png"))
    assert [path.split("-contexts")[0] for path in drawn] == [
        "describe/figure-10-walking.png",
        "describe/figure-5-loss.png",
        "describe/figure-6-descriptions.png",
        "describe/figure-9a",
        "generate/figure-7-loss.png",
        "generate/figure-8-generated.png",
        "generate/figure-9b",
    ]


def test_evaluate_refuses_before_it_measures(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def measured(*_: object) -> None:
        raise AssertionError("it has measured")

    monkeypatch.setattr("motet_train.cli.suites.describe_report", measured)
    (runs / "file").touch()
    command = ("evaluate", runs / "describe")
    refused("cannot write plots to", *command, "--data", runs / "store", "--plots", runs / "file" / "plots")
    refused("describe is a bundle", *command, "--data", runs / "store", "describe", "--save")
    refused("need --data", *command)
    refused("separately", *command, "tdbn")


def _save(run: Run, folder: Path) -> None:
    folder.mkdir()
    run.save(folder)
    (folder / "log.jsonl").write_text('{"epoch": 1, "loss": 2.0, "validation": 3.0}\n')


def _write(store: Store, folder: Path) -> None:
    np.save(folder / FRAMES_FILE, store.frames)
    index = {
        **{"channels": store.channels, "units": store.units, "fps": store.fps, "skipped": []},
        "skeletons": [skeleton.to_json() for skeleton in store.skeletons],
        "representation": store.representation,
        "records": [vars(entry) for entry in store.records],
    }
    (folder / INDEX).write_text(json.dumps(index))
