"""BLEU, what sentences say, and the floors that are looked up."""

from collections import Counter

import numpy as np
import pytest
from language_models import STORE, told

from motet_train.data.errors import DataError
from motet_train.evaluate.language.attributes import VERBS, common_side, common_turning, mentioned, side, words_right
from motet_train.evaluate.language.describe import (
    agreement,
    bleu,
    copied_bleu,
    frequent_sentence,
    nearest_motions,
    ranks,
    retrieved,
)
from motet_train.evaluate.language.split_store import SplitStore, split_as


@pytest.fixture(scope="module")
def corpus() -> SplitStore:
    return split_as(told(STORE, "describe"), STORE)


def naive_bleu(hypotheses: list[list[str]], references: list[list[list[str]]], longest: int = 4) -> float:
    """Papineni et al. 2002, literally: clipped precisions, closest reference length, the shorter of two as close."""
    logs = 0.0
    for n in range(1, longest + 1):
        hits = total = 0
        for words, row in zip(hypotheses, references, strict=True):
            grams = [Counter(tuple(text[i : i + n]) for i in range(len(text) - n + 1)) for text in (words, *row)]
            hits += sum(min(count, max(one[gram] for one in grams[1:])) for gram, count in grams[0].items())
            total += sum(grams[0].values())
        if not hits:
            return 0.0
        logs += np.log(hits / total) / longest
    length = sum(map(len, hypotheses))
    closest = sum(
        min((abs(len(one) - len(words)), len(one)) for one in row)[1]
        for words, row in zip(hypotheses, references, strict=True)
    )
    return float(np.exp(logs + min(0.0, 1 - closest / length)))


def test_bleu_is_that_of_a_naive_twin() -> None:
    rng = np.random.default_rng(0)
    seen = []
    for _ in range(20):
        sizes = rng.integers(4, 9, size=6)
        hypotheses = [list(rng.choice(list("abc"), size)) for size in sizes]
        references = [[list(rng.choice(list("abc"), rng.integers(3, 10))) for _ in range(1 + i % 3)] for i in range(6)]
        expected = naive_bleu(hypotheses, references)
        texts = [[" ".join(words) for words in row] for row in references]
        assert bleu([" ".join(words) for words in hypotheses], texts) == pytest.approx(expected, abs=1e-6)
        for longest in (1, 2):
            shorter = bleu([" ".join(words) for words in hypotheses], texts, longest=longest)
            assert shorter == pytest.approx(naive_bleu(hypotheses, references, longest), abs=1e-6)
        marked = [["SOS", *words, "EOS"] for words in hypotheses]
        expected = naive_bleu(marked, [[["SOS", *words, "EOS"] for words in row] for row in references])
        assert bleu([" ".join(words) for words in hypotheses], texts, True) == pytest.approx(expected, abs=1e-6)
        seen.append(expected)
    assert len(set(seen)) > 15


def test_bleu_by_hand() -> None:
    """5 of 6, 4 of 5, 3 of 4 and 2 of 3 n-grams; the hypothesis is as long as the reference."""
    expected = (5 / 6 * 4 / 5 * 3 / 4 * 2 / 3) ** 0.25
    assert bleu(["a person walks 4 steps back"], [["a person walks 4 steps ahead"]]) == pytest.approx(expected)
    # too short by two words: the brevity penalty alone
    assert bleu(["a person walks slowly"], [["a person walks slowly to somewhere"]]) == pytest.approx(np.exp(1 - 6 / 4))
    assert bleu(["A person turns 90 degrees"], [["a person turns 9 0 degrees"]]) == 1.0
    assert bleu(["", "a b c d"], [["x y"], ["a b c d"]]) == pytest.approx(np.exp(1 - 6 / 4))


def test_ranks_are_columns_of_table_2() -> None:
    references = [["a b c d e"], ["f g h i j"]]
    found = ranks([["a b c d e", "x x x x x"], ["f g h i j"]], references)
    assert found["1"] == 1.0
    assert found["2"] == found["5"] == bleu(["x x x x x", "f g h i j"], references)
    assert list(found) == ["1", "2", "3", "4", "5"]


def test_agreement_holds_each_sentence_out() -> None:
    assert agreement([["a b c d e"] * 2, ["f g h i j"] * 3, ["alone it does not count"]]) == pytest.approx(1)
    assert agreement([["a b c d e", "v w x y z"]]) == 0
    assert np.isnan(agreement([["a b c d e"]]))


@pytest.mark.parametrize(
    ("sentence", "verbs"),
    [
        ("A person walks.", {"walk"}),
        ("Someone is jogging, then LEAPS", {"run", "jump"}),
        ("he grabs the rungs", set()),
        ("runs instead of walking", {"run"}),
        ("A human goes forward on foot", {"walk"}),
        ("chopping", set()),
    ],
)
def test_verbs_that_a_sentence_says(sentence: str, verbs: set[str]) -> None:
    assert mentioned(VERBS, sentence) == verbs


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        ("turns leftwards", {"left"}),
        ("turns right at a right angle", {"right"}),
        ("turns at a right angle", set()),
        ("a right-angled turn to the left", {"left"}),
        ("with the left and the right foot in turn", set()),
    ],
)
def test_sides_that_a_sentence_says(sentence: str, expected: set[str]) -> None:
    assert side(sentence) == expected


def test_what_is_right_of_a_hypothesis() -> None:
    references = [["a man runs", "he jogs and leaps"], ["she walks left", "she bears left"], ["a cartwheel", "a wheel"]]
    counts = {"verbs_of": 2, "sides_of": 1, "turns_of": 1}  # the first one jumps, too, so that turns do not count
    assert words_right(["runs", "walks left", "jumps"], references) == {"verbs": 1, "sides": 1, "turns": 1, **counts}
    wrong = words_right(["jumps", "walks and runs, left or right", "right"], references)
    assert wrong == {"verbs": 0.5, "sides": 0, "turns": 0, **counts}  # half say jump; nobody says run
    assert words_right(["", "turns around", ""], references)["turns"] == 1
    assert np.isnan(words_right([""], references[2:])["verbs"])
    assert common_turning(references[1]) is True
    assert common_turning(["a man walks", "he walks, using the left and the right foot in turn"]) is False
    assert common_turning(["he jumps to the left"]) is None
    assert common_side(["left", "right"]) is None


def test_the_nearest_motion_and_sentence(corpus: SplitStore) -> None:
    test = corpus.parts.test
    kinds = [record % 5 for record in test]
    assert [record % 5 for record in nearest_motions(corpus, corpus.motions(test))] == kinds
    asked = corpus.parts.train[3:9]
    assert nearest_motions(corpus, corpus.motions(asked)) == list(asked)
    assert retrieved(corpus, [corpus.sentences(record)[2] for record in asked]) == list(asked)
    assert [r % 5 for r in retrieved(corpus, ["someone jumps", "he turns right"])] == [4, 3]
    # two of three sentences of a kind are the same, the third has a word of its own
    references = corpus.references(test)
    nearest = corpus.references(nearest_motions(corpus, corpus.motions(test)))
    expected = np.mean([1.0, 1.0, bleu([said[2] for said in nearest], references)])
    assert copied_bleu(nearest, references) == pytest.approx(expected)
    fewer = [nearest[0][:2], *nearest[1:]]  # begins again with its first
    last = [fewer[0][0], *(said[2] for said in fewer[1:])]
    expected = np.mean([1.0, 1.0, bleu(last, references)])
    assert copied_bleu(fewer, references) == pytest.approx(expected)


def test_the_most_frequent_sentence(corpus: SplitStore) -> None:
    assert frequent_sentence(corpus) == "a person jumps"  # of five as frequent the first by name


def test_a_model_of_other_data_is_refused() -> None:
    other = told(STORE, "describe")
    other.training["split"]["train"] += 1
    with pytest.raises(DataError, match="was not trained on this data: its 21 training"):
        split_as(other, STORE)
    other.training.clear()
    with pytest.raises(DataError, match="does not say which motions"):
        split_as(other, STORE)
    other = told(STORE, "describe")
    other.training["split"]["test"][0] = "elsewhere"
    with pytest.raises(DataError, match="was not trained on this data"):
        split_as(other, STORE)
    # a motion that is both for validation and for testing is another division
    other = told(STORE, "describe")
    other.training["split"]["test"].append(other.training["split"]["validation"][0])
    with pytest.raises(DataError, match="was not trained on this data"):
        split_as(other, STORE)
