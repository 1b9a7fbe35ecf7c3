"""The floor: the trial whose sentences share most words with the prompt, played as it is."""

from collections.abc import Sequence

from motet.models.text import RULES
from motet.motion.motion import Motion
from motet_train.data.errors import DataError
from motet_train.evaluate.text_adherence.trials import Trial


class LookUp:
    """A generator that has no model. Trials without a sentence are never found; DataError if none has one."""

    def __init__(self, trials: Sequence[Trial]) -> None:
        known = [(trial, frozenset(RULES.words(said))) for trial in trials for said in trial.sentences]
        self._known = sorted(((trial, words) for trial, words in known if words), key=lambda pair: pair[0].name)
        if not self._known:
            raise DataError("no trial to look up has a sentence")

    def generate(self, text: str, seed: int) -> Motion:
        """The motion of :meth:`found`, the same for every seed."""
        return self.found(text).motion

    def found(self, text: str) -> Trial:
        """The trial with the sentence that shares most different words with the text; of several such sentences the one
        with the fewest different words, and where they are as many, of the first trial by name."""
        asked = frozenset(RULES.words(text))
        return max(self._known, key=lambda pair: (len(asked & pair[1]), -len(pair[1])))[0]
