"""Prompts as pictures, and sentences that a model says it does not know."""

import warnings
from pathlib import Path

import motet
import motet.keyed
from motet.errors import TextWarning
from motet.figures.humanoid.retarget import on_humanoid
from motet.generate.model import CodesModel
from motet.motion.motion import Motion
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.evaluate.figures import save
from motet_train.evaluate.text_adherence.prompts import OUTSIDE, PROMPTS
from motet_train.evaluate.text_adherence.table import said_to_be_outside, says_drawings
from motet_train.evaluate.text_adherence.track import track_of


class Walks:
    """Whatever is asked, it walks; and remembers what it was asked."""

    def __init__(self, walk: Motion) -> None:
        self.walk, self.asked = on_humanoid(walk), list[str]()

    def generate(self, text: str, seed: int) -> Motion:
        self.asked.append(text)
        return self.walk


def test_prompts_are_drawn_that_are_done_and_those_passed_over_are_counted(tmp_path: Path) -> None:
    walks = Walks(motet.read(CMU_FOLDER / "39_14.amc"))
    drawings = says_drawings(walks.generate)
    figure = drawings["says"]()
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    done = [prompt.text for prompt in PROMPTS if prompt.passes(track_of(walks.walk))]
    assert titles[0] == walks.asked[0] == "a person walks straight forward"
    assert set(titles) <= set(done)
    eights = [PROMPTS[start : start + 8] for start in range(0, len(PROMPTS), 8)]
    assert titles == [
        next(p.text for p in part if p.text in done) for part in eights if set(done) & {p.text for p in part}
    ]
    assert figure.get_suptitle().startswith(
        f"every eighth prompt; {len(walks.asked) - len(titles)} whose motions did not"
    )
    (picture,) = save(drawings, tmp_path)
    assert picture.name == "says.png"


def test_what_no_recording_shows_is_said_to_be_outside() -> None:
    model = motet.load("generate")
    assert isinstance(model, CodesModel)
    keyed = {act.says[0] for act in motet.keyed.ours().values()}
    others = []
    for sentence in OUTSIDE:
        if not any(model.likeliest(part).action in keyed for part in model.parts(sentence)):
            others.append(sentence)
    assert len(others) == 20
    assert said_to_be_outside(model, others) >= 0.8
    silent = set()
    for sentence in others:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", TextWarning)
            model.generate(sentence, max_seconds=0.2)
        silent |= set() if told else {sentence}
    # what hand-keyed clips show
    assert silent == {"someone drives a car", "a man does push ups", "a woman does yoga in the lotus position"}
    assert said_to_be_outside(model, ["a person walks forward", "a man is running", "someone kicks"]) == 0
    assert said_to_be_outside(model, ["xyzzy", ""]) == 1
