"""Merge the stores of a corpus' shards, prepared by several processes or machines, into one store."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from motet.errors import SettingError
from motet.files import new_folder
from motet.jobs import Shard
from motet_train.data.corpus import NO_MOTION, Skipped
from motet_train.data.errors import DataError
from motet_train.data.store import FRAMES_FILE, INDEX, Entry, Store, StoreWriter


def merge_stores(places: Sequence[Path], path: Path) -> None:
    """Merge the stores of all shards of a corpus into the new folder ``path``, whole or not at all.

    The result is byte for byte the store of the corpus prepared at once; one motion is in memory at a time. Of clips of
    one name in two shards the first counts. DataError where shards are missing, given twice, or prepared in different
    ways; OutputError if ``path`` exists.
    """
    parts = sorted(file.parent.relative_to(places[0]) for file in places[0].rglob(INDEX))
    ordered = _ordered(places, parts[0])
    with new_folder(path) as folder:
        for part in parts:
            (folder / part).mkdir(exist_ok=True)
            _merge([place / part for place in ordered], folder / part)


def _ordered(places: Sequence[Path], part: Path) -> list[Path]:
    """The places in order of their shards, of which none may be missing."""
    by_shard: dict[Shard, Path] = {}
    for place in places:
        Store.open(place / part)  # complete, or DataError
        shard = _shard_of(place, part)
        if shard in by_shard:
            raise DataError(f"{by_shard[shard]} and {place} are both shard {shard}")
        by_shard[shard] = place
    count = max(shard.count for shard in by_shard)
    expected = [Shard(number, count) for number in range(1, count + 1)]
    if by_shard.keys() != set(expected):
        missing = [str(shard) for shard in expected if shard not in by_shard]
        raise DataError(f"shards are missing or of another count: {', '.join(missing[:9]) or max(map(str, by_shard))}")
    return [by_shard[shard] for shard in expected]


def _shard_of(place: Path, part: Path) -> Shard:
    index = json.loads((place / part / INDEX).read_text(encoding="utf-8"))
    try:
        return Shard.parse(str(index.get("shard")))
    except SettingError as error:
        raise DataError(f"{place} is not the store of a shard: prepare it with --shard") from error


def _merge(places: Sequence[Path], folder: Path) -> None:
    """Write one store with the records of those at ``places``, which are of one kind."""
    stores = [Store.open(place) for place in places]
    for place, store in zip(places, stores, strict=True):
        if _kind(store) != _kind(stores[0]):
            raise DataError(f"{place} was prepared in another way than {places[0]}")
    # copy record after record, one motion in memory at a time
    with (folder / FRAMES_FILE).open("wb") as file:
        writer = StoreWriter(file, stores[0].representation)
        names: set[str] = set()
        for store in stores:
            _append(store, writer, names)
        writer.skipped += _without_motion(stores)
        (folder / INDEX).write_text(json.dumps(writer.finish()), encoding="utf-8")


def _append(store: Store, writer: StoreWriter, names: set[str]) -> None:
    """Copy the records of a store but those with the name of a record in an earlier shard; add its names."""
    earlier = frozenset(names)
    for number, entry in enumerate(store.records):
        if entry.name in earlier:
            writer.skipped.append(Skipped(entry.name, "a second motion of this name"))
        else:
            _copy(store, number, entry, writer)
            names.add(entry.name)
    writer.skipped += [item for item in store.skipped if item.reason != NO_MOTION]


def _without_motion(stores: Sequence[Store]) -> list[Skipped]:
    """The clips of the table that have a motion in none of the shards."""
    skipped_by_all = set.intersection(*(set(store.skipped) for store in stores))
    return [item for item in stores[0].skipped if item.reason == NO_MOTION and item in skipped_by_all]


def _kind(store: Store) -> tuple[object, ...]:
    return store.representation, store.channels, store.units, store.fps


def _copy(store: Store, number: int, entry: Entry, writer: StoreWriter) -> None:
    phases = [store.motion(number, offset) for offset in range(len(entry.spans))]
    spans = tuple(writer.put(phase) for phase in phases)
    skeleton = None if entry.skeleton is None else writer.skeleton(store.skeletons[entry.skeleton])
    writer.entries.append(replace(entry, spans=spans, skeleton=skeleton))
