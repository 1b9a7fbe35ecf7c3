"""What a sentence is shown as, what of it is left out and how well it is known: the same at every door."""

import json
import warnings

import pytest
from command_line import run

import motet
from motet import CodesModel, Shown, TextError, TextWarning
from motet.live.protocol import ClientSession
from motet.steering.sentence_acts import SaidActs

SENTENCES = {
    "a person waves": (),
    "a person walks to the window": ("window",),
    "he plays slowly while kicking a ball": ("slowly",),
    "a person turns 90 degrees left": (),
    "a person waves and then he kicks a ball happily": ("happily",),
}
"""Sentences with the words that are left out."""

SECONDS = 3.0


@pytest.fixture(scope="module")
def model() -> CodesModel:
    return motet.load_as(CodesModel, "generate")


@pytest.fixture(scope="module")
def shown(model: CodesModel) -> dict[str, list[Shown]]:
    """What Python answers: of each sentence its parts."""
    answers = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TextWarning)
        for text in SENTENCES:
            (made,) = model.generate(text, seconds=SECONDS)
            parts = getattr(made, "passages", None) or [made]
            answers[text] = [Shown(one.action, one.lacking, one.confidence) for one in parts]
    return answers


def rows(parts: list[Shown]) -> list[tuple[str, list[str], object]]:
    return [(one.action, list(one.lacking), pytest.approx(one.confidence)) for one in parts]


def whole(parts: list[Shown]) -> Shown:
    """What is said of all parts together."""
    lacking = tuple(word for one in parts for word in one.lacking)
    return Shown(parts[0].action if len(parts) == 1 else "", lacking, min(one.confidence or 0 for one in parts))


def test_python_tells_what_is_left_out(shown: dict[str, list[Shown]], model: CodesModel) -> None:
    assert {text: whole(parts).lacking for text, parts in shown.items()} == SENTENCES
    with pytest.warns(TextWarning, match="leaves out 'window'") as caught:
        model.generate("a person walks to the window", seconds=SECONDS)
    assert {one.filename for one in caught} == {__file__}


@pytest.mark.parametrize("text", SENTENCES)
def test_the_command_tells_the_same(text: str, shown: dict[str, list[Shown]], tmp_path: object) -> None:
    result = run("generate", text, "--seconds", SECONDS, "--json", "-o", f"{tmp_path}/a.npz")
    (row,) = json.loads(result.stdout)
    (made,) = row["hypotheses"]
    told = [(one["action"], one["lacking"], one["confidence"]) for one in made.get("passages", [made])]
    assert told == rows(shown[text])
    for word in whole(shown[text]).lacking:
        assert f"leaves out '{word}'" in result.stderr
        assert f", without '{word}'" in run("generate", text, "--seconds", SECONDS, "-o", f"{tmp_path}/b.npz").stdout


def test_the_server_tells_the_same(shown: dict[str, list[Shown]]) -> None:
    testclient = pytest.importorskip("starlette.testclient")
    from motet.serve.application import app

    with testclient.TestClient(app(), base_url="http://127.0.0.1") as client:
        for text, parts in shown.items():
            answer = client.get("/generate.json", params={"text": text, "seconds": SECONDS})
            for understood in (answer.json()["understood"], json.loads(answer.headers["Motet-Understood"])):
                told = [(one["action"], one["lacking"], one["confidence"]) for one in understood]
                assert told == rows(parts), text
            answer = client.get("/generate.json", params={"text": text, "seconds": SECONDS, "strict": "true"})
            assert answer.status_code == (400 if SENTENCES[text] else 200), text


@pytest.mark.parametrize("text", SENTENCES)
def test_a_session_tells_the_same_each_time(text: str, shown: dict[str, list[Shown]], model: CodesModel) -> None:
    """Acts that a figure knows by name are no matter of the model."""
    control = motet.load("control")
    if control.act_said(text):
        (told,) = control.start(words=model).act(text)
        assert told == Shown(control.read_said(text).caption, (), 1.0)
        return
    words = SaidActs(control, model)
    for session in (control.start(words=words), control.start(words=words)):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", TextWarning)
            (told,) = session.act(text)
        assert rows([told]) == rows([whole(shown[text])])
        assert ["leaves out" in str(one.message) for one in caught] == [True] * bool(SENTENCES[text])
        assert {one.filename for one in caught} <= {__file__}
    notes = ClientSession(control, words=words).handle(json.dumps({"type": "act", "motion": text}))
    assert ["leaves out" in one for one in notes] == [True] * bool(SENTENCES[text])


@pytest.mark.parametrize("text", SENTENCES)
def test_strict_refuses_what_leaves_out_a_word(text: str, model: CodesModel) -> None:
    strict = motet.load("control").start(words=model, strict=True)
    doors = (
        lambda: model.generate(text, 2, seconds=SECONDS, strict=True),
        lambda: model.story(text, seconds=SECONDS, strict=True),
        lambda: model.stream(text, seconds=SECONDS, strict=True),
        *([] if strict.model.act_said(text) else [lambda: strict.act(text)]),
    )
    for door in doors:
        if SENTENCES[text]:
            with pytest.raises(TextError, match=f"leaves out '{SENTENCES[text][0]}'"):
                door()
        else:
            door()


def test_strict_draws_only_actions_that_leave_out_nothing(model: CodesModel) -> None:
    text = "a person walks"
    made = model.generate(text, 8, seconds=0.5, strict=True, seed=5)
    assert not any(one.lacking for one in made)


def test_a_text_that_is_refused_leaves_the_others(tmp_path: object) -> None:
    result = run(
        "generate", "a person walks to the window", "a person waves", "--strict", "--json", "-o", f"{tmp_path}/a.npz"
    )
    assert result.exit_code == 1
    assert [row["input"] for row in json.loads(result.stdout)] == ["a person waves"]
    assert "leaves out 'window'" in result.stderr
