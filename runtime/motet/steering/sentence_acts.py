"""Acts by sentence: made by a generate model, for steered figures."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from motet.errors import TextError, TextWarning, collected, each_once, warn
from motet.steering.acts import Act
from motet.text.clauses import Shown

if TYPE_CHECKING:
    from motet.steering.model import SteerModel

GENERATED_SECONDS = 3.0
"""Duration that is generated of a motion that lasts longer than the act of its sentence."""


REMEMBERED_ACTS = 256
"""Acts, after which the one that was made first is forgotten."""


@runtime_checkable
class SentenceModel(Protocol):
    """A model that makes motions for sentences, such as a :class:`motet.GenerateModel`."""

    def unknown(self, sentence: str) -> list[str]:
        """The words that it does not know; TextError where that is all."""

    def check(self, sentence: str, *, lacking: bool = True) -> None:
        """TextError for a sentence that it does not know; ``lacking``: or whose action leaves out a word."""

    def generate(self, sentences: str, hypotheses: int, *, seconds: float) -> Sequence[Any]:
        """``hypotheses`` motions of ``seconds`` for a sentence, as :class:`motet.Generated` has them."""


class SaidActs:
    """Acts for a model, each made once: sessions and threads can share it."""

    def __init__(self, model: "SteerModel", words: SentenceModel) -> None:
        self.model = model
        self.words = words
        self._made: dict[str, tuple[Act, Shown, list[str]]] = {}

    def act(self, sentence: str) -> Act:
        """The act of a sentence, such as "wave" or "sit down"; TextError for one that the model does not know. A
        TextWarning says what it leaves out, each time."""
        return self.shown(sentence)[0]

    def shown(self, sentence: str, strict: bool = False) -> tuple[Act, Shown]:
        """The act of a sentence, and what that is shown as; errors and warnings like :meth:`act`.

        strict: TextError for a sentence if the action leaves out a word.
        """
        if strict:
            self.words.check(self._known(sentence))
        known = self._made.get(sentence)
        if known is None:
            with collected(TextWarning) as notes:
                (made,) = self.words.generate(self._known(sentence), 1, seconds=GENERATED_SECONDS)
            if len(self._made) >= REMEMBERED_ACTS:
                self._made.pop(next(iter(self._made)), None)
            act = self.model.act_of(made.motion, sentence)
            known = act, Shown(made.action, made.lacking, made.confidence), each_once(notes)
            self._made[sentence] = known
        act, shown, warnings = known
        for warning in warnings:
            warn(warning, TextWarning)
        return act, shown

    def _known(self, sentence: str) -> str:
        """A sentence that the model knows: the given one, or that order in the third person."""
        self.words.unknown(sentence)  # an order without words is none, though "a person" is known
        try:
            self.words.check(sentence, lacking=False)
        except TextError:
            in_third_person = _of_a_person(sentence)
            try:
                self.words.check(in_third_person, lacking=False)
            except TextError:
                in_third_person = ""
            if not in_third_person:
                raise
            return in_third_person
        return sentence


def _of_a_person(order: str) -> str:
    """An order in the third person: "wave" as "a person waves"."""
    verb, _, rest = order.strip().partition(" ")
    ending = "es" if verb.endswith(("s", "sh", "ch", "x", "o")) else "s"
    return f"a person {verb}{ending} {rest}".strip()
