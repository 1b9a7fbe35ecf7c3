import numpy as np
import pytest

from motet.errors import TextError
from motet.models.text import EOS, MAX_WORDS, PAD, SOS, SPECIALS, SPELLING, UNK, Vocabulary, normalise, words

SENTENCES = [
    "A person walks forward.",
    "A person turns ninety degrees to the left!",
    "The person's left knee is bent by 180-degrees; then he walks.",
]


@pytest.mark.parametrize(
    ("sentence", "normal"),
    [
        ("A person walks.", "a person walks"),
        ("  The Person's\tknee,\n(left)... isn\u2019t bent! ", "the persons knee left isnt bent"),
        ("one-legged jump_over/under", "1 legged jump over under"),
        ("a peron wlaks foward, counter clock-wise", "a person walks forward counterclockwise"),
        ("turns counter-clockwise infront", "turns counterclockwise in front"),
        ("a grand jeté", "a grand jete"),
        ("turns by ninety degrees", "turns by 90 degrees"),
        ("twenty-five steps", "25 steps"),
        ("one hundred and eighty degrees", "180 degrees"),
        ("a hundred and walks", "a 100 and walks"),
        ("two hundred twenty", "220"),
        ("twenty ten", "20 10"),
        ("a 90° turn, 1.5 m", "a 90 turn 1 5 m"),
        ("someone, everyone", "someone everyone"),
        ("?!", ""),
    ],
)
def test_normalise(sentence: str, normal: str) -> None:
    assert normalise(sentence) == normal
    assert normalise(normal) == normal
    assert normalise(sentence.upper()) == normal


def test_the_spelling_table_is_normal_and_settled() -> None:
    for wrong, right in SPELLING.items():
        assert normalise(wrong, {}) == wrong or wrong in {"fourty"}
        assert normalise(right, SPELLING) == normalise(right, {})
    assert normalise("teh walk", {"teh": "the"}) == "the walk"


def test_each_digit_is_a_word() -> None:
    assert words("Turns 180 degrees, 3D") == ["turns", "1", "8", "0", "degrees", "3", "d"]


def test_a_vocabulary_is_sorted_by_count_then_name() -> None:
    vocabulary = Vocabulary.of(["b a", "c b", "b c a d"])
    assert vocabulary.words == (*SPECIALS, "b", "a", "c", "d")
    assert [vocabulary.ids[word] for word in (PAD, SOS, EOS, UNK)] == [0, 1, 2, 3]
    assert Vocabulary.of(["b a", "c b", "b c a d"]) == vocabulary
    assert hash(vocabulary) == hash(Vocabulary(vocabulary.words))


def test_sentences_survive_the_way_there_and_back() -> None:
    vocabulary = Vocabulary.of(SENTENCES)
    for sentence in SENTENCES:
        ids, unknown = vocabulary.encode(sentence)
        assert (ids.dtype, unknown) == (np.int64, [])
        assert vocabulary.decode(ids) == normalise(sentence)
        assert vocabulary.decode([1, *ids.tolist(), 2, 0, 0]) == normalise(sentence)
    assert Vocabulary.from_json(vocabulary.to_json()) == vocabulary
    assert len(vocabulary) == len(vocabulary.to_json())


def test_unknown_words_become_unk_and_are_named() -> None:
    vocabulary = Vocabulary.of(SENTENCES)
    ids, unknown = vocabulary.encode("A zebra walks backward")
    assert unknown == ["zebra", "backward"]
    assert [vocabulary.words[i] for i in ids] == ["a", UNK, "walks", UNK]
    assert vocabulary.encode("PAD SOS walks")[1] == ["pad", "sos"]  # no word of a user's is special


@pytest.mark.parametrize(
    ("sentence", "reason"),
    [
        ("", "has no words"),
        (" .,! ", "has no words"),
        ("colourless green ideas", "knows no word of 'colourless green ideas'; it knows words such as 0, a"),
        ("walks " * (MAX_WORDS + 1), f"{MAX_WORDS + 1} words, and at most {MAX_WORDS}"),
    ],
)
def test_a_sentence_that_no_model_can_take(sentence: str, reason: str) -> None:
    with pytest.raises(TextError, match=reason):
        Vocabulary.of(SENTENCES).encode(sentence)


@pytest.mark.parametrize("bad", [[], ["a", "b"], [*SPECIALS, "a", "a"]])
def test_what_is_no_vocabulary(bad: list[str]) -> None:
    with pytest.raises(TextError, match="a vocabulary"):
        Vocabulary(bad)
