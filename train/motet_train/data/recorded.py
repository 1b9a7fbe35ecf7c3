"""The recordings of gaits in a store."""

from collections import Counter

from motet.steering.recorded import Recording, held_level, parts_of
from motet_train.data.errors import DataError
from motet_train.data.store import Entry, Store
from motet_train.data.table import Gait, read_gaits


def gaits_of(store: Store) -> tuple[Gait, ...]:
    """The gaits that a store's records name, by decreasing number of frames; CMU's and ACCAD's if none are named."""
    frames = Counter[str]()
    for record in store.records:
        count = sum(stop - start for start, stop in record.spans)
        frames.update(dict.fromkeys(record.gaits, count))
    return tuple(Gait(name, (), ()) for name, _ in frames.most_common()) or read_gaits()


def recordings(store: Store, gaits: tuple[Gait, ...], held: bool = True) -> list[Recording]:
    """The recordings of a store that show gaits, of 1.5 s or more; DataError where a gait has none.

    held: put feet on level ground and give collar bones the same slope; otherwise motions stay as recorded.
    """
    kept: list[Recording] = []
    for index, record in enumerate(store.records):
        # recordings of gaits, in their usable parts
        names = frozenset(gait.name for gait in gaits if _shows(record, gait))
        if not names:
            continue
        features = store.motion(index)
        if held:
            features = held_level(features)
        kept += parts_of(features, names, as_recorded=names == {"jump"})
    # every gait needs one
    recorded_gaits = frozenset[str]().union(*(recording.gaits for recording in kept))
    for gait in gaits:
        if gait.name not in recorded_gaits:
            raise DataError(
                f"no recording of 1.5 s shows the gait {gait.name!r}: name gaits in a column gait of the table of "
                "sentences, or give motet prepare a table of them, --gaits"
            )
    return kept


def _shows(record: Entry, gait: Gait) -> bool:
    return gait.name in record.gaits or gait.shown(record.shows, record.subject)
