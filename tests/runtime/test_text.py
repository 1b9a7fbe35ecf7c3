import json
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from motet.errors import BundleError, TextError
from motet.text.clauses import stem
from motet.text.spelling import corrected, distance
from motet.text.vocabulary import (
    EOS,
    MAX_WORDS,
    NEW_MODEL_RULES,
    PAD,
    SOS,
    SPECIALS,
    SPELLING,
    UNK,
    TextRules,
    Vocabulary,
)

LENIENT = replace(NEW_MODEL_RULES, spelling={})

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
        ("a 90° turn, 1.5 m", "a 90 turn 1 point 5 m"),
        ("someone, everyone", "someone everyone"),
        ("?!", ""),
    ],
)
def test_normalise(sentence: str, normal: str) -> None:
    assert NEW_MODEL_RULES.normalise(sentence) == normal
    assert NEW_MODEL_RULES.normalise(normal) == normal
    assert NEW_MODEL_RULES.normalise(sentence.upper()) == normal


def test_the_spelling_table_is_normal_and_settled() -> None:
    for wrong, right in SPELLING.items():
        assert LENIENT.normalise(wrong) == wrong
        assert NEW_MODEL_RULES.normalise(right) == LENIENT.normalise(right)
    assert replace(NEW_MODEL_RULES, spelling={"teh": "the"}).normalise("teh walk") == "the walk"


def test_rules_travel_and_the_codes_own_do_not_change_what_a_vocabulary_reads() -> None:
    plain = json.loads(json.dumps(replace(NEW_MODEL_RULES, spelling={"klaw": "walk"}, spelled=3).to_json()))
    rules = TextRules.from_json(plain)
    old = Vocabulary([*SPECIALS, "walk", "wlaks", "2", "5", "one", "steps"], rules)
    assert rules.to_json() == plain
    assert old.decode(old.encode("klaw wlaks two 5 steps")[0]) == "walk wlaks 25 steps"
    new = Vocabulary(old.words)
    assert new.encode("klaw wlaks 2")[1] == ["klaw"]
    assert new.encode("klaw wlaks 2")[0].tolist() == [3, 4, 6]
    assert old.encode("wlak wlaks")[1] == []


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"rules": 2}, "text.rules: must be"),
        ({"dropped": 1}, "text.dropped: must be a string"),
        ({"spelling": ["a"]}, "text.spelling: must be an object"),
        ({"spelling": {"a": 1}}, "text.spelling.a: must be a string"),
        ({"numbers": {"one": 100}}, "text.numbers.one: must be a whole number between 0 and 99"),
        ({"spelling": {str(n): "" for n in range(3000)}}, "at most 2000 words"),
        ({"spelled": True}, "text.spelled: must be a whole number"),
    ],
)
def test_what_is_not_a_set_of_rules(change: dict[str, Any], reason: str) -> None:
    with pytest.raises(BundleError, match=reason):
        TextRules.from_json({**NEW_MODEL_RULES.to_json(), **change})
    with pytest.raises(BundleError, match=r"text\.hundred: is missing"):
        TextRules.from_json({key: value for key, value in NEW_MODEL_RULES.to_json().items() if key != "hundred"})


@pytest.mark.parametrize(
    ("sentence", "again"),
    [
        ("putting 1 foot in front of the other", "putting one foot in front of the other"),
        ("turns ninety degrees", "turns 90 degrees"),
        ("walks 12 steps", "walks twelve steps"),
        ("walks 13 steps", "walks 13 steps"),
        ("walks 1.5 m", "walks 1.5 m"),
        ("walks 0.5 m", "walks 0.5 m"),
        ("agent 007", "agent 007"),
    ],
)
def test_small_numbers_come_back_as_words_and_points_stay(sentence: str, again: str) -> None:
    vocabulary = Vocabulary.of([sentence])
    ids = vocabulary.encode(sentence)[0]
    assert vocabulary.decode(ids) == again
    np.testing.assert_array_equal(vocabulary.encode(again)[0], ids)


def test_a_point_that_is_not_known_does_not_make_another_number() -> None:
    vocabulary = Vocabulary([*SPECIALS, "walks", "1", "5", "m"])
    ids, unknown = vocabulary.encode("walks 1.5 m")
    assert unknown == ["point"]
    assert vocabulary.decode(ids) == "walks one five m"


def test_a_long_sentence_is_refused_at_once() -> None:
    vocabulary = Vocabulary.of(SENTENCES)
    started = time.process_time()
    with pytest.raises(TextError, match="400000 letters, but at most 2000"):
        vocabulary.encode("a " * 200_000)
    assert time.process_time() - started < 0.1


def test_each_digit_is_a_word() -> None:
    assert NEW_MODEL_RULES.words("Turns 180 degrees, 3D") == ["turns", "1", "8", "0", "degrees", "3", "d"]


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
        wanted = NEW_MODEL_RULES.normalise(sentence).replace(" 1 ", " one ")
        assert vocabulary.decode(ids) == wanted
        assert vocabulary.decode([1, *ids.tolist(), 2, 0, 0]) == wanted


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
        ("walks " * (MAX_WORDS + 1), f"{MAX_WORDS + 1} words, but at most {MAX_WORDS}"),
    ],
)
def test_a_sentence_that_no_model_can_take(sentence: str, reason: str) -> None:
    with pytest.raises(TextError, match=reason):
        Vocabulary.of(SENTENCES).encode(sentence)


@pytest.mark.parametrize("bad", [[], ["a", "b"], [*SPECIALS, "a", "a"]])
def test_what_is_no_vocabulary(bad: list[str]) -> None:
    with pytest.raises(TextError, match="a vocabulary"):
        Vocabulary(bad)


KNOWN = Vocabulary((*SPECIALS, "walks", "walking", "jumps", "person"), common={"strolls": "walks", "leaps": "jumps"})


def test_common_words_go_on_after_the_words_of_sentences() -> None:
    ids, unknown = KNOWN.encode("a person strolls, then leaps")
    assert ids.tolist() == [3, 7, 8, 3, 9]
    assert unknown == ["a", "then"]
    assert (len(KNOWN), KNOWN.near("leaps"), KNOWN.near("jumps"), KNOWN.near("then")) == (8, "jumps", "jumps", "")


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("walk", "walks"),  # the first with the stem, by count
        ("walked", "walks"),
        ("strolling", "strolls"),
        ("jmups", "jumps"),
        ("jumpz", ""),  # another letter
        ("prson", "person"),
        ("erson", ""),  # another first letter
        ("pxrsxn", ""),  # two letters off
        ("ump", ""),
        ("j", ""),
        ("", ""),
    ],
)
def test_a_word_is_known_by_its_stem_or_with_a_letter_wrong(word: str, meant: str) -> None:
    assert KNOWN.meant(word) == meant


def test_without_common_words_nothing_counts_as_misspelt() -> None:
    assert [Vocabulary((*SPECIALS, "touches")).meant(word) for word in ("torches", "touched")] == ["", "touches"]


@pytest.mark.parametrize("common", [{"walks": "jumps"}, {"UNK": "jumps"}, {"strolls": "hops"}])
def test_what_are_no_common_words(common: dict[str, str]) -> None:
    with pytest.raises(TextError):
        Vocabulary((*SPECIALS, "walks", "jumps"), common=common)


def naive_distance(first: str, second: str) -> int:
    """By trying all that could be done to the last letters."""
    if not first or not second:
        return len(first) + len(second)
    found = [
        naive_distance(first[:-1], second) + 1,
        naive_distance(first, second[:-1]) + 1,
        naive_distance(first[:-1], second[:-1]) + (first[-1] != second[-1]),
    ]
    if first[-2:] == second[-2:][::-1] and len(first) > 1 and len(second) > 1:
        found.append(naive_distance(first[:-2], second[:-2]) + 1)
    return min(found)


def test_distances_are_those_of_a_naive_twin() -> None:
    rng = np.random.default_rng(0)
    for _ in range(150):
        first, second = ("".join(rng.choice(list("abc"), rng.integers(0, 6))) for _ in range(2))
        assert distance(first, second) == naive_distance(first, second), (first, second)


def test_a_misspelt_word_is_the_nearest_one_where_that_is_clear() -> None:
    words = ["jump", "jumps", "jumble", "kick", "kicks", "kiss", "backflips", "bump"]
    assert corrected("jmup", words) == "jump"
    assert corrected("kicsk", words) == "kicks"
    assert corrected("kiks", [*words, "kinks"]) == ""  # kicks or kinks
    assert corrected("kiks", ["kicks"], ["kinks"]) == "kicks"
    assert corrected("juump", words) == "jump"
    assert corrected("trun", ["trunk", "turn"]) == "turn"  # of the same letters
    assert corrected("bakcflps", words) == "backflips"  # two letters off of eight
    assert corrected("jumpss", ["jump", "jumping"], words) == "jumps"


@pytest.mark.parametrize(("word", "other"), [("coin", "chin"), ("robot", "root"), ("papers", "pacers")])
def test_a_word_of_english_is_no_misspelling(word: str, other: str) -> None:
    assert corrected(word, [other]) == ""


@pytest.mark.parametrize(
    "forms",
    [
        ("sing", "sings", "singing"),
        ("swing", "swings", "swinging"),
        ("cry", "cries", "crying"),
        ("tie", "ties", "tied", "tying"),
        ("lie", "lies", "lying"),
        ("dance", "dances", "dancing"),
    ],
)
def test_forms_of_a_word_have_one_stem(forms: tuple[str, ...]) -> None:
    stems = set(map(stem, forms))
    assert len(stems) == 1
    assert len(stems.pop()) > 1
