"""The chain from a sentence to a motion and back (Plappert et al. 2017, section 5.4.3, tables 3 and 4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motet.errors import TextError
from motet.models.describe import DescribeModel
from motet.models.generate import Generated, GenerateModel
from motet.motion.motion import Motion
from motet_train.evaluate.language.bleu import RANKS, bleu, ranks
from motet_train.evaluate.language.floors import retrieved
from motet_train.evaluate.language.split_store import SplitStore, unknown_words_allowed


@dataclass(frozen=True, eq=False)
class Answers:
    """Motions for sentences. records: for each sentence the one it describes. rows: ranked motions."""

    records: tuple[int, ...]
    sentences: tuple[str, ...]
    rows: tuple[list[Generated], ...]

    @property
    def best(self) -> list[Motion]:
        """The likeliest motion for each sentence."""
        return [row[0].features for row in self.rows]


def answers(model: GenerateModel, corpus: SplitStore, records: Sequence[int]) -> Answers:
    """Ranked motions for every sentence of the records; one of which the model knows no word is left out.

    As many hypotheses as the model keeps by default, as users get them; from one that keeps less than five the last
    stands for those that lack.
    """
    asked = known_sentences(model, corpus, records)
    with unknown_words_allowed():
        rows = model.generate([sentence for _, sentence in asked])
    return Answers(tuple(r for r, _ in asked), tuple(s for _, s in asked), tuple(rows))


def known_sentences(model: GenerateModel, corpus: SplitStore, records: Sequence[int]) -> list[tuple[int, str]]:
    """Every record with every sentence of it that the model can take."""
    return [(record, said) for record in records for said in corpus.sentences(record) if knows(model, said)]


def chained(describe: DescribeModel, found: Answers, corpus: SplitStore) -> dict[str, float]:
    """A row of table 3: BLEU of the descriptions of the first to the fifth motion, "1" to "5".

    One entry for each sentence that a motion was made for; references are all that was said about its record.
    """
    texts = [
        best_descriptions(describe, [row[min(rank, len(row) - 1)].features for row in found.rows])
        for rank in range(RANKS)
    ]
    return ranks(list(zip(*texts, strict=True)), corpus.references(found.records))


def bounds_chained(describe: DescribeModel, found: Answers, corpus: SplitStore) -> dict[str, float]:
    """The same with motions that are not generated.

    retrieval: the training motion about which the most alike sentence was said, the floor. data: the very motion that
    the sentence is about, what a perfect model would get.
    """
    references = corpus.references(found.records)
    records = {"retrieval": retrieved(corpus, found.sentences), "data": found.records}
    return {
        key: bleu(best_descriptions(describe, corpus.motions(chosen)), references) for key, chosen in records.items()
    }


def best_descriptions(describe: DescribeModel, motions: Sequence[Motion]) -> list[str]:
    """The best description of each motion; nothing for one that is too short to be described."""
    usable = [i for i, motion in enumerate(motions) if round(motion.duration * describe.fps) >= 2]
    rows = describe.describe([motions[i] for i in usable]) if usable else []
    texts = {i: row[0].text for i, row in zip(usable, rows, strict=True)}
    return [texts.get(i, "") for i in range(len(motions))]


def likelihood(model: GenerateModel, corpus: SplitStore, records: Sequence[int]) -> float:
    """Log-likelihood of a frame of the records' motions given each of their sentences, the ending frame included."""
    total, frames = 0.0, 0
    with unknown_words_allowed():
        for record, sentence in known_sentences(model, corpus, records):
            motion = corpus.motion(record)
            total += model.score(sentence, motion)
            frames += len(motion) + 1
    return total / frames if frames else np.nan


def knows(model: GenerateModel, sentence: str, every_word: bool = False) -> bool:
    """Whether a model knows a word of a sentence, or every word."""
    try:
        return not (model.unknown(sentence) and every_word)
    except TextError:
        return False
