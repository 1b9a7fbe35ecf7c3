"""Sentences that ask for several things in a row become stories of their parts."""

import numpy as np
import pytest

from motet.errors import TextError, TextWarning
from motet.generate.model import CodesModel, Story
from motet.text.clauses import parts_of, sentences_of, stem, verbs_of

VERBS = verbs_of(
    ["walking", "turning", "running", "jumping", "sitting", "drinking", "dancing", "bowing", "boxing", "something"]
)
COMPOSED = "he drinks, then he does a cartwheel"


@pytest.mark.parametrize(
    "words", ["dance dances dancing danced", "run runs running", "carry carries carrying", "punch punches punching"]
)
def test_forms_of_a_word_share_a_stem(words: str) -> None:
    assert len(set(map(stem, words.split()))) == 1


@pytest.mark.parametrize(
    ("sentence", "parts"),
    [
        ("walk to the table, drink, turn around and walk away", 4),
        ("First she runs, and then the woman slowly sits down", 2),
        ("a jab, then a hook", 2),
        ("he jumps up and down", 1),
        ("he walks with the left and the right hand raised", 1),
        ("a tall, thin man walks", 1),
        ("a boxer and a dancing man", 1),
        ("he sits next to the table", 1),
        ("then he bows", 1),
    ],
)
def test_a_sentence_is_cut_before_its_verbs(sentence: str, parts: int) -> None:
    found = parts_of(sentence, VERBS)
    assert len(found) == parts
    assert all(part in sentence for part in found)


@pytest.mark.parametrize(
    ("sentence", "parts"),
    [
        ("look up, then down", ["look up", "look down"]),
        ("kick with the left foot, then with the right", ["kick with the left foot", "kick with the right foot"]),
        ("kick with the left foot, then switch to the right", ["kick with the left foot", "kick with the right foot"]),
        ("walk left four times, then right", ["walk left four times", "walk right four times"]),
        ("walk left twice, then right once", ["walk left twice", "walk right once"]),
        ("jump forward twice and then backwards once", ["jump forward twice", "jump backwards once"]),
        ("walk left, then right again", ["walk left", "walk right again"]),
        ("walk left, then sit down again", ["walk left", "sit down again"]),
        ("carry a heavy box and drop it", ["carry a heavy box", "drop the heavy box"]),
        ("he sits, then stands", ["he sits", "stands up"]),
        ("kick with the left foot, then the other one", ["kick with the left foot", "kick with the right foot"]),
        ("touch your nose, then your right knee", ["touch your nose", "touch your right knee"]),
        ("raise your left arm, then your right one", ["raise your left arm", "raise your right arm"]),
        ("she stops to wave", ["she stops", "wave"]),
        ("she stops to the left", ["she stops to the left"]),
        ("wave before walking", ["wave", "walking"]),
        ("she waves before she walks", ["she waves", "she walks"]),
        ("wave before the house", ["wave before the house"]),
        ("bend down, then stand back up", ["bend down", "stands still"]),
        ("turn around, then walk back", ["turn around", "walk forward"]),
        ("walk, then back", ["walk", "back"]),  # no direction that it could take the place of
        ("wave, then drop it", ["wave", "drop it"]),
        ("walk slowly and after he sits down", ["walk slowly", "he sits down"]),
        ("raise the arms and hold for 3 seconds", ["raise the arms and hold for 3 seconds"]),
    ],
)
def test_a_part_is_read_in_full(sentence: str, parts: list[str]) -> None:
    assert parts_of(sentence, VERBS | set(map(stem, ("carry", "drop", "sit", "stand", "hold")))) == parts


def test_who_is_told_is_no_act() -> None:
    assert sentences_of("Robot, turn left. Hey dude, wave!") == ["turn left", "wave"]


def test_texts_are_cut_into_sentences_but_not_numbers() -> None:
    assert sentences_of("He walks 1.5 metres. He turns;\nhe sits!") == ["He walks 1.5 metres", "He turns", "he sits"]


def test_what_one_action_shows_stays_whole(codes_model: CodesModel) -> None:
    known = "a person is walking, then stops"
    assert codes_model.parts(known) == [known]
    assert codes_model.parts(COMPOSED) == ["he drinks", "he does a cartwheel"]


def test_a_composed_sentence_is_the_story_of_its_parts(codes_model: CodesModel) -> None:
    (made,) = codes_model.generate(COMPOSED, seed=4)
    told = codes_model.story(["he drinks", "he does a cartwheel"], seed=4)
    assert isinstance(made, Story)
    assert [one.text for one in made.passages] == ["he drinks", "he does a cartwheel"]
    np.testing.assert_array_equal(made.frames, told.frames)
    np.testing.assert_array_equal(made.frames, codes_model.story(COMPOSED, seed=4).frames)


def test_whole_takes_it_as_one_action(codes_model: CodesModel) -> None:
    (made,) = codes_model.generate(COMPOSED, whole=True)
    assert not isinstance(made, Story)
    assert len(codes_model.story(COMPOSED, whole=True).passages) == 1


def test_seconds_are_those_of_all_parts(codes_model: CodesModel) -> None:
    (made,) = codes_model.generate(COMPOSED, seconds=5)
    assert len(made.frames) == round(5 * codes_model.fps)
    assert isinstance(made, Story)
    assert made.passages[0].stop == pytest.approx(2.5, abs=codes_model.codec.seconds)


def test_strict_refuses_the_part_that_is_unknown(codes_model: CodesModel) -> None:
    with pytest.raises(TextError, match="plays the theremin"):
        codes_model.check("he drinks. he plays the theremin.")
    with pytest.warns(TextWarning, match="plays the theremin"):
        codes_model.generate("he drinks. he plays the theremin.")
    with pytest.raises(TextError, match="knows no word of 'xyzzy'"):
        codes_model.generate("he drinks. xyzzy.")
