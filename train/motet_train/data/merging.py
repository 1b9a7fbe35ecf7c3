"""Stores of the shards of a corpus, prepared by several processes or machines, as one store."""

import json
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from motet.errors import SettingError
from motet.files import new_folder
from motet.jobs import Shard
from motet_train.data.corpus import NO_MOTION, Skipped
from motet_train.data.errors import DataError
from motet_train.data.store import FRAMES, INDEX, Entry, Store, StoreWriter


def merge_stores(places: Sequence[Path], path: Path) -> None:
    """Merge the stores of all shards of a corpus into the new folder ``path``, whole or not at all.

    The bytes are those of the corpus prepared at once; one motion is in memory at a time. Of clips of one name in two
    shards the first counts. DataError where shards are missing, given twice, or of different preparations; OutputError
    where something is at ``path``.
    """
    parts = sorted(file.parent.relative_to(places[0]) for file in places[0].rglob(INDEX))
    ordered = _ordered(places, parts[0])
    with new_folder(path) as folder:
        for part in parts:
            (folder / part).mkdir(exist_ok=True)
            _merge([place / part for place in ordered], folder / part)


def _ordered(places: Sequence[Path], part: Path) -> list[Path]:
    """All shards, in order."""
    found: dict[Shard, Path] = {}
    for place in places:
        Store.open(place / part)  # complete, or DataError
        try:
            shard = Shard.parse(str(json.loads((place / part / INDEX).read_text(encoding="utf-8")).get("shard")))
        except SettingError as error:
            raise DataError(f"{place} is not the store of a shard: prepare it with --shard") from error
        if shard in found:
            raise DataError(f"{found[shard]} and {place} are both shard {shard}")
        found[shard] = place
    count = max(shard.count for shard in found)
    wanted = [Shard(number, count) for number in range(1, count + 1)]
    if found.keys() ^ set(wanted):
        missing = [str(one) for one in wanted if one not in found]
        raise DataError(f"shards are missing or of another count: {', '.join(missing[:9]) or max(map(str, found))}")
    return [found[one] for one in wanted]


def _merge(places: Sequence[Path], folder: Path) -> None:
    stores = [Store.open(place) for place in places]
    for place, store in zip(places, stores, strict=True):
        if _kind(store) != _kind(stores[0]):
            raise DataError(f"{place} was prepared in another way than {places[0]}")
    with ExitStack() as stack:
        writer = StoreWriter(stack.enter_context((folder / FRAMES).open("wb")), stores[0].representation)
        names: set[str] = set()
        for store in stores:
            known = frozenset(names)
            for number, entry in enumerate(store.records):
                if entry.name in known:
                    writer.skipped.append(Skipped(entry.name, "a second motion of this name"))
                else:
                    _copy(store, number, entry, writer)
                    names.add(entry.name)
            writer.skipped += [one for one in store.skipped if one.reason != NO_MOTION]
        lacking = [{one for one in store.skipped if one.reason == NO_MOTION} for store in stores]
        writer.skipped += [one for one in stores[0].skipped if all(one in found for found in lacking)]
        (folder / INDEX).write_text(json.dumps(writer.finish()), encoding="utf-8")


def _kind(store: Store) -> tuple[object, ...]:
    return store.representation, store.channels, store.units, store.fps


def _copy(store: Store, number: int, entry: Entry, writer: StoreWriter) -> None:
    phases = [store.motion(number, offset) for offset in range(len(entry.spans))]
    spans = tuple(writer.put(one) for one in phases)
    own = None if entry.skeleton is None else writer.skeleton(store.skeletons[entry.skeleton])
    writer.entries.append(replace(entry, spans=spans, skeleton=own))
