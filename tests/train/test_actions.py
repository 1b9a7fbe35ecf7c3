"""Which action a sentence asks for: the net, the actions of a store, vectors of words, and the training."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from codes_data import ACTIONS, TEXT, small_store
from torch import nn
from trainings import check_resumed, log_of, refused, trained

from motet.text.vocabulary import SPECIALS
from motet_train.data.errors import DataError
from motet_train.data.sentences import actions_of, mirror_text
from motet_train.data.store import Store
from motet_train.data.word_table import nearest, principal, read_word_vectors, word_table
from motet_train.models.action_net import ActionNet, ActionsConfig, stem, stems_of
from motet_train.recipes.actions import ActionSentences
from motet_train.recipes.language import divided


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("actions")
    small_store(found)
    return found / "store"


@pytest.fixture(scope="module")
def store(folder: Path) -> Store:
    return Store.open(folder)


@torch.no_grad()
def test_a_sentence_of_a_padded_batch_gets_what_it_gets_alone() -> None:
    torch.manual_seed(1)
    model = ActionNet(ActionsConfig(9, 4, tuple(range(9)), embedding=6, hidden=5)).eval()
    nn.init.constant_(model.around.bias, -1.0)  # type: ignore[arg-type]  # so that the most of a number is below 0
    words, lengths = torch.tensor([[4, 5, 6, 7], [8, 0, 0, 0], [6, 4, 0, 0]]), torch.tensor([4, 1, 2])
    found = model(words, lengths)
    torch.testing.assert_close(found.exp().sum(dim=1), torch.ones(3))
    for row, length in enumerate(lengths.tolist()):
        alone = model(words[row : row + 1, :length], lengths[row : row + 1])
        torch.testing.assert_close(alone, found[row : row + 1])
    assert not torch.allclose(found[0], model(torch.tensor([[7, 6, 5, 4]]), torch.tensor([4]))[0])


@torch.no_grad()
def test_words_are_dropped_in_training_alone() -> None:
    model = ActionNet(ActionsConfig(9, 4, tuple(range(9)), dropout=0.0, word_dropout=1.0))
    words, unknown = torch.tensor([[4, 5, 6]]), torch.full((1, 3), 3)
    assert torch.equal(model.train()(words, torch.tensor([3])), model(unknown, torch.tensor([3])))
    assert not torch.equal(model.eval()(words, torch.tensor([3])), model(unknown, torch.tensor([3])))


def test_words_of_one_stem_have_one_number() -> None:
    for words in (
        ("run", "runs", "running"),
        ("walk", "walks", "walked", "walking", "walker", "walkers"),
        ("jump", "jumps", "jumping", "jumped"),
        ("slow", "slowly"),
        ("dance", "dances", "dancing", "dancer"),
    ):
        assert len({stem(word) for word in words}) == 1, words
        assert len(set(stems_of(words))) == 1
    assert [stem(word) for word in ("is", "bed", "she", "red")] == ["is", "bed", "she", "red"]
    assert stems_of(("a", "walks", "the", "walking")) == (0, 1, 2, 1)


def test_mirrored_motions_show_mirrored_actions(store: Store) -> None:
    found = actions_of(store, tuple(range(8)))
    names = [entry.action for entry in store.records[:8]]
    assert len(found) == 6  # the two that say a side have a mirror image each
    for record, name in enumerate(names):
        own, other = found.of[record, False], found.of[record, True]
        assert found.sentences[own] == ACTIONS[name]
        assert found.sentences[other] == tuple(map(mirror_text, ACTIONS[name]))
        assert (own == other) == (name in ("walk", "run"))
        assert found.of[record, False] == found.of[(record + 4) % 8, False]
    assert found.unseen[found.of[1, True]] == ("a person turns right slowly",)
    assert sorted(set(found.of.values())) == list(range(6))
    assert len(actions_of(store, (0, 4))) == 1


VECTORS = "walks 1 0 2 .5\nruns 0 1 2 0\n\nthe -1 0 0 0\nturns 0 0 1e-1 3\n"


def test_vectors_are_read_as_glove_and_word2vec_write_them(tmp_path: Path) -> None:
    file = tmp_path / "vectors.txt"
    for text in (VECTORS, f"4 4\n{VECTORS}", VECTORS.replace("\n", " \r\n"), f"{VECTORS}walks 9 9 9 9\n. . x x x x\n"):
        file.write_text(text)
        vectors = read_word_vectors(file, ("walks", "turns", "hops"))
        numbers = {word: vector.tolist() for word, vector in vectors.items()}
        assert numbers == {"walks": [1, 0, 2, 0.5], "turns": [0, 0, 0.1, 3]}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("walks 1 2\nruns 1\n", "line 2: expected a word and 2 numbers, not 1"),
        ("walks\n", "line 1: expected a word and some numbers, not 0"),
        ("runs 1 2\n\nwalks 1 x\n", "line 3: could not convert string to float: 'x'"),
        ("walks 1 nan\n", "line 1: a number is not finite"),
        ("hops 1 2\n", "has none of the 2 words of the sentences"),
        ("", "has none of the 2 words of the sentences"),
        (None, "cannot be read: "),
    ],
)
def test_what_is_no_file_of_vectors_is_refused(tmp_path: Path, text: str | None, said: str) -> None:
    file = tmp_path / "vectors.txt"
    if text is not None:
        file.write_text(text)
    with pytest.raises(DataError, match=r"vectors\.txt") as caught:
        read_word_vectors(file, ("walks", "runs"))
    assert said in str(caught.value)


def test_principal_components_are_those_of_scikit_learn() -> None:
    decomposition = pytest.importorskip("sklearn.decomposition")
    rng = np.random.default_rng(0)
    given = rng.normal(size=(9, 5)) @ rng.normal(size=(5, 5)) + 3
    words = [*"abcdefghi"]
    found = principal(dict(zip(words, given, strict=True)), ["x", *words, "y"], 3)
    expected = decomposition.PCA(3).fit_transform(given)
    assert not found[[0, -1]].any()
    signs = np.sign((found[1:-1] * expected).sum(axis=0))
    np.testing.assert_allclose(found[1:-1] * signs, expected / expected.std(), atol=1e-9)
    wide = principal(dict(zip(words, given, strict=True)), words, 8)
    assert not wide[:, 5:].any()
    centred = np.linalg.norm(given - given.mean(axis=0), axis=1)
    np.testing.assert_allclose(np.linalg.norm(wide, axis=1) * centred[0], centred * np.linalg.norm(wide[0]))


COMMON = """walks 1 0 0
strolls .9 .1 0
. 1 0 0
x 1 0 0
Runs 0 1 0
runs 0 1 0
sprints .1 .9 .1
cooks -1 .1 -1
walks 9 9 9
"""


def test_further_words_are_those_near_to_a_word_of_the_sentences(tmp_path: Path) -> None:
    file = tmp_path / "vectors.txt"
    file.write_text(COMMON)
    words = (*SPECIALS, "walks", "runs", "hops")
    found = read_word_vectors(file, words, first=9)
    assert list(found) == ["walks", "strolls", "runs", "sprints", "cooks"]
    assert nearest(found, words[4:]) == {"strolls": "walks", "sprints": "runs"}
    assert list(read_word_vectors(file, words, first=1)) == ["walks", "strolls", "runs"]
    table = word_table(file, words, 2)
    assert table.common == {"strolls": "walks", "sprints": "runs"}
    assert table.vectors.shape == (9, 2)
    assert table.vectors.any(axis=1).tolist() == [False] * 4 + [True, True, False, True, True]


@torch.no_grad()
def test_a_word_that_no_sentence_has_is_known_by_its_vector_and_its_stem() -> None:
    words, common = (*SPECIALS, "walks", "jumps"), ("strolls", "jumped")
    stems = stems_of(words, common)
    assert stems == (0, 1, 2, 3, 4, 5, 3, 5)
    config = ActionsConfig(6, 3, stems, embedding=4, hidden=5, common=2, vector=2, unheard=0.0, word_dropout=0.0)
    torch.manual_seed(0)
    net = ActionNet(config).eval()
    net.start_from(torch.tensor([[0.0, 0.0]] * 4 + [[1.0, -2.0], [0.5, 0.0], [1.0, -2.0], [9.0, -9.0]]))
    assert net.vectors[4:].tolist() == [[16, -32], [8, 0], [16, -32], [127, -127]]

    def said(*ids: int) -> torch.Tensor:
        found: torch.Tensor = net(torch.tensor([ids]), torch.tensor([len(ids)]))
        return found

    assert not torch.equal(said(3), said(6))
    assert not torch.equal(said(4), said(6))
    net.words.weight.zero_()
    net.roots.weight.zero_()
    assert torch.equal(said(4), said(6))
    net.roots.weight[5] = 1
    assert not torch.equal(said(4), said(5))
    net.train().dropout.p = 0
    assert torch.equal(said(4, 5), said(6, 5))
    replaced = ActionNet(replace(config, unheard=1.0, dropout=0.0)).train()
    replaced.load_state_dict(net.state_dict())
    replaced.words.weight[4] = 3
    net.words.weight[4], net.roots.weight[5] = 0, 0
    torch.testing.assert_close(replaced(torch.tensor([[4, 5]]), torch.tensor([2])), said(4, 5))


@torch.no_grad()
def test_what_is_understood_is_what_a_naive_twin_finds(store: Store) -> None:
    found = divided(store, mirror=True)
    actions = actions_of(store, found.parts.train)
    torch.manual_seed(0)
    net = ActionNet(ActionsConfig(len(found.vocabulary), len(actions), stems_of(found.vocabulary.words))).eval()
    right, losses = [], []
    for s in sorted({s for said in actions.unseen for s in said}):
        ids = torch.from_numpy(found.vocabulary.encode(s)[0])[None]
        chances = net(ids, torch.tensor([ids.shape[1]]))[0].exp().tolist()
        asked = [action for action, said in enumerate(actions.unseen) if s in said]
        right.append(chances.index(max(chances)) in asked)
        losses.append(-np.log(sum(chances[action] for action in asked)))
    sentences = ActionSentences(actions, found.vocabulary)
    assert sentences.measured(net) == {
        "validation": pytest.approx(np.mean(losses), abs=1e-4),
        "understood": pytest.approx(np.mean(right), abs=1e-4),
    }
    drawn = sentences.draw(300, np.random.default_rng(0))
    for row in range(300):
        ids = drawn.words[row, : int(drawn.lengths[row])].tolist()
        wanted = actions.sentences[int(drawn.actions[row])]
        assert ids in [found.vocabulary.encode(s)[0].tolist() for s in wanted]
        assert not drawn.words[row, len(ids) :].any()
    assert torch.equal(drawn[1::2].lengths, drawn.lengths[1::2])
    assert set(drawn.actions.tolist()) == set(range(len(actions)))


def test_sentences_without_a_known_word_are_not_measured_by(store: Store) -> None:
    found = divided(store, mirror=True)
    actions = actions_of(store, found.parts.train)
    more = replace(actions, unseen=(("pirouettes", "a person pirouettes"), *actions.unseen[1:]))
    known = ActionSentences(more, found.vocabulary)
    asked = {s for said in more.unseen for s in said}
    assert len(known.unseen[1]) == len(known.alike) == len(asked) - 1


def test_a_run_learns_with_vectors_and_without(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "vectors.txt").write_text(f"{VECTORS}strolls 1 0 2 1\n")
    longer = TEXT.replace("steps = 6\nevery = 3", "steps = 120\nevery = 40")
    given = ("--word-vectors", tmp_path / "vectors.txt", "--vectors-from", "nobody, CC0")
    runs = [trained("actions", longer, folder, tmp_path / "plain")]
    runs.append(trained("actions", longer, folder, tmp_path / "run", *given))
    for run, name in zip(runs, ("plain", "run"), strict=True):
        log = log_of(tmp_path / name)
        assert [line["step"] for line in log] == [40, 80, 120]
        assert log[-1]["loss"] < log[1]["loss"] < log[0]["loss"]
        assert all(0 <= line["understood"] <= 1 and line["validation"] > 0 for line in log)
        manifest, model = run.manifest, run.model
        assert isinstance(model, ActionNet)
        assert (manifest["verb"], manifest["model"]) == ("actions", "motion-actions")
        assert len(manifest["actions"]) == model.config.actions == 6
        assert len(manifest["vocabulary"]) == model.config.words == len(model.config.stems) - model.config.common
        by = {entry["sentence"]: entry["words"] for entry in manifest["actions"]}
        assert by["a person turns left"] == ["a", "goes", "left", "person", "someone", "the", "to", "turns"]
        assert set(by) >= {said[0] for said in ACTIONS.values()}
    said = {"file": "vectors.txt", "words": 5, "origin": "nobody, CC0"}
    assert runs[1].manifest["training"]["word_vectors"] == said
    assert runs[1].manifest["common"] == {"strolls": "walks"}
    assert "common" not in runs[0].manifest
    assert "word_vectors" not in runs[0].manifest["training"]
    first, second = (run.model.state_dict() for run in runs)
    assert any(not torch.equal(first[name], second[name]) for name in first)


def test_resumed_training_is_the_same_to_the_bit(folder: Path, tmp_path: Path) -> None:
    check_resumed(partial(trained, "actions", TEXT, folder), tmp_path, "--steps", 3)


def test_a_net_of_actions_is_no_bundle_by_itself(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("motet_export")
    trained("actions", TEXT, folder, tmp_path / "run")
    refused("manifest, verb: 'actions' is unknown", "export", tmp_path / "run", "--out", tmp_path / "run.zip")
    assert not (tmp_path / "run.zip").exists()


def test_a_wrong_file_of_vectors_leaves_no_run(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "vectors.txt").write_text("walks 1 2\nruns 1 x\n")
    command = ("train", "actions", "--data", folder, "--word-vectors", tmp_path / "vectors.txt")
    reason = "vectors.txt, line 2: could not convert string to float: 'x'"
    refused(reason, *command, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()
