"""Acts by sentence: what a figure that is steered is told to do in words, made by a generate model."""

from typing import TYPE_CHECKING

from motet.decode.acts import Act
from motet.errors import TextError, TextWarning, collected
from motet.models.generate import GenerateModel

if TYPE_CHECKING:
    from motet.models.steer import SteerModel

SECONDS = 3.0
"""That are generated: of a motion that lasts longer the act that its sentence means."""


KEPT = 256
"""Acts, after which the one that was made first is forgotten."""


class SaidActs:
    """Acts for a model, each made once: sessions can share it."""

    def __init__(self, model: "SteerModel", words: GenerateModel) -> None:
        self.model, self.words = model, words
        self._made: dict[str, Act] = {}

    def act(self, sentence: str) -> Act:
        """The act of a sentence, such as "wave" or "sit down"; TextError for one that the model does not know."""
        if sentence not in self._made:
            with collected(TextWarning):  # of a sentence that was checked
                (found,) = self.words.generate(self._known(sentence), 1, seconds=SECONDS)
            if len(self._made) >= KEPT:
                del self._made[next(iter(self._made))]
            self._made[sentence] = self.model.act_of(found.motion, sentence)
        return self._made[sentence]

    def _known(self, sentence: str) -> str:
        """A sentence that the model knows: itself, or what a person does who is told it."""
        self.words.vocabulary.encode(sentence)  # an order without words is none, though "a person" is known
        try:
            self.words.check(sentence)
        except TextError:
            told = _of_a_person(sentence)
            try:
                self.words.check(told)
            except TextError:
                told = ""
            if not told:
                raise
            return told
        return sentence


def _of_a_person(order: str) -> str:
    """An order in the third person: "wave" as "a person waves"."""
    verb, _, rest = order.strip().partition(" ")
    ending = "es" if verb.endswith(("s", "sh", "ch", "x", "o")) else "s"
    return f"a person {verb}{ending} {rest}".strip()
