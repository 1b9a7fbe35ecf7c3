"""Whether descriptions name the right action, how often confident ones are right, and whether they mention turns."""

from collections.abc import Sequence

import numpy as np

from motet.models.describe import DescribeModel, Description
from motet.models.nearest_neighbour import NOTHING
from motet.motion.rotations import Array, Mask
from motet_train.data.kinds import Shown, named, shown_by
from motet_train.data.store import Split, Store, matches
from motet_train.evaluate.language.attributes import common_side, side, turning
from motet_train.evaluate.language.confidence import CHAIN, fits_timeline, share, timelines_of
from motet_train.evaluate.language.describe import nearest_motions
from motet_train.evaluate.language.split_store import SplitStore, matching
from motet_train.evaluate.tables import Figures, Report

BINS = 10
"""Bins of the probability in the expected calibration error."""


def clips_apart(store: Store, patterns: str) -> SplitStore:
    """The clips whose names match one of several comma-separated patterns as the test part; all others train."""
    names = [entry.name for entry in store.records]
    train = matching(names, lambda name: not matches(name, patterns))
    return SplitStore(store, Split(train, (), matching(names, lambda name: matches(name, patterns))))


def actions_report(model: DescribeModel, corpus: SplitStore) -> Report:
    """How test motions are described.

    "actions": their number ("of"); the shares that are right by action (:class:`motet_train.data.kinds.Shown`), that
    some sentence of the model's known motions would describe correctly ("reachable"), that are sure, those of the sure
    ones that are right and wrong, and that have no description; the expected calibration error of the probability,
    and the error of as many perfectly calibrated ones. "lookup": the share of right sentences among those of the
    nearest training motions by mean and deviation of positions, speeds and path. "turns": how many motions have a turn
    and its side in half of their sentences, and the share of their descriptions that mention it. "timeline": see
    :func:`timelines`.
    """
    test = corpus.described(corpus.parts.test)
    motions = corpus.motions(test)
    shown = [_shown(corpus, record) for record in test]
    descriptions = [row[0] for row in model.describe(motions)]
    looked_up = []
    for actions, texts in zip(shown, corpus.references(nearest_motions(corpus, motions)), strict=True):
        looked_up.append(np.mean(list(map(actions.right, texts))))
    return {
        "actions": _action_figures(model, shown, descriptions),
        "lookup": {"right": np.average(looked_up)},
        "turns": _turns(corpus, test, descriptions),
        "timeline": timelines(model, corpus, test),
    }


def _action_figures(model: DescribeModel, shown: list[Shown], descriptions: list[Description]) -> Figures:
    pairs = list(zip(shown, descriptions, strict=True))
    right = np.array([actions.right(description.text) for actions, description in pairs])
    sure = np.array([description.confident for description in descriptions])
    probabilities = np.array([description.probability for description in descriptions])
    empty = np.array([description.text == NOTHING for description in descriptions])

    return {
        "of": float(len(shown)),
        "right": share(right),
        "reachable": _reachable(model, shown),
        "sure": share(sure),
        "right_if_sure": share(right[sure]),
        "wrong_if_sure": share(~right[sure]),
        "nothing": share(empty),
        "calibration_error": calibration_error(probabilities, right),
        "calibration_by_chance": error_by_chance(probabilities),
    }


def _reachable(model: DescribeModel, shown: list[Shown]) -> float:
    """The share of motions that some known sentence of a model describes correctly; NaN for a model without any."""
    known_kinds = {named(text) for text in (model.known.sentences if model.known else ())}
    if not known_kinds:
        return np.nan
    return share(np.array([any(map(actions.right_kinds, known_kinds)) for actions in shown]))


def _shown(corpus: SplitStore, record: int) -> Shown:
    entry = corpus.store.records[record]
    return shown_by((*entry.sentences, *entry.unseen), entry.action)


def _turns(corpus: SplitStore, records: Sequence[int], descriptions: Sequence[Description]) -> Figures:
    mentioned = []
    for record, description in zip(records, descriptions, strict=True):
        sentences = corpus.sentences(record)
        agreed_side = common_side([sentence for sentence in sentences if turning(sentence)])
        if agreed_side is None:
            continue
        # half of the sentences have to mention a turn to this side
        turns = [sentence for sentence in sentences if side(sentence) == {agreed_side} and "turn" in sentence]
        if 2 * len(turns) >= len(sentences):
            mentioned.append(side(description.text) == {agreed_side})
    return {"of": float(len(mentioned)), "told": share(np.array(mentioned, dtype=bool))}


def timelines(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> Figures:
    """Figures of 40 timelines of three motions of 2 to 12 s, drawn at random and joined: the share of time with a right
    description ("time_right"), of joins with a cut within half a second ("joins_found"), and of cuts with a join
    ("cuts_right"). Empty if there are fewer than three such motions."""
    usable = [record for record in records if fits_timeline(corpus.motion(record))]
    if len(usable) < CHAIN:
        return {}
    # the same chains for every model
    random = np.random.default_rng(0)
    chains = [random.choice(usable, CHAIN, replace=False).tolist() for _ in range(40)]
    described = timelines_of(model, corpus, chains, within=0.5)
    shown = {record: _shown(corpus, record) for record in usable}
    right = [shown[record].right(part.text) for record, part in described.moments]
    return {"time_right": share(np.array(right)), **described.cut_shares(40)}


def calibration_error(probability: Array, right: Mask) -> float:
    """The expected calibration error (Guo et al. 2017): the mean distance between probability (N,) and share of right
    ones over tenths of the probability, weighted by their size."""
    # equal bins of the probability
    bins = np.minimum((probability * BINS).astype(int), BINS - 1)
    errors = [abs(probability[bins == number].sum() - right[bins == number].sum()) for number in range(BINS)]
    return float(sum(errors) / len(right))


def error_by_chance(probability: Array, times: int = 1000) -> float:
    """The mean calibration error of perfectly calibrated probabilities (N,), due to the small number of motions."""
    # outcomes drawn with these very probabilities
    drawn = np.random.default_rng(0).random((times, len(probability))) < probability
    return float(np.mean([calibration_error(probability, right) for right in drawn]))
