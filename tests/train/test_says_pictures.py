"""Twelve prompts as pictures, and sentences that a model says it does not know."""

from pathlib import Path

import motet
from motet.models.codes import CodesModel
from motet.motion.motion import Motion
from motet.motion.retarget import on_humanoid
from motet_train.data.clips import CMU_FOLDER
from motet_train.evaluate.figures import save
from motet_train.evaluate.says.outside import OUTSIDE, said_to_be_outside
from motet_train.evaluate.says.pictures import drawn, says_drawings


class Walks:
    """Whatever is asked, it walks; and remembers what it was asked."""

    def __init__(self, walk: Motion) -> None:
        self.walk, self.asked = on_humanoid(walk), list[str]()

    def generate(self, text: str, seed: int) -> Motion:
        self.asked.append(text)
        return self.walk


def test_twelve_prompts_are_drawn_and_those_that_fail_are_marked(tmp_path: Path) -> None:
    walks = Walks(motet.read(CMU_FOLDER / "39_14.amc"))
    drawings = says_drawings(walks)
    figure = drawings["says"]()
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert walks.asked == [prompt.text for prompt in drawn()]
    assert len(titles) == 12
    assert titles[0] == "a person walks straight forward"
    failed = sum(title.endswith("(does not)") for title in titles)
    assert figure.get_suptitle() == f"{12 - failed} of 12 do what they say"
    assert 8 <= failed <= 11
    (picture,) = save(drawings, tmp_path)
    assert picture.name == "says.png"


def test_what_no_recording_shows_is_said_to_be_outside() -> None:
    model = motet.load("generate")
    assert isinstance(model, CodesModel)
    assert said_to_be_outside(model, OUTSIDE) >= 0.9
    assert said_to_be_outside(model, ["a person walks forward", "a man is running", "someone kicks"]) == 0
    assert said_to_be_outside(model, ["xyzzy", ""]) == 1
