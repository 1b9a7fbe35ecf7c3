"""The KIT Motion-Language data: NNNNN_mmm.xml beside NNNNN_annotations.json, in a folder or zip of any release."""

import json
from collections.abc import Iterator
from pathlib import Path

from motet.formats.mmm import motion_name, read
from motet_train.data.archive import BROKEN, Archive
from motet_train.data.errors import DataError
from motet_train.data.records import Record, Skipped

MOTION, ANNOTATIONS = "_mmm.xml", "_annotations.json"


def records(archive: Archive) -> Iterator[Record | Skipped]:
    """Every motion of the archive with its sentences; Skipped where it has none or a file is damaged."""
    names = frozenset(archive.names)
    for stem in (name.removesuffix(MOTION) for name in archive.names if name.endswith(MOTION)):
        try:
            record = _record(archive, stem) if stem + ANNOTATIONS in names else None
            yield record or Skipped(stem, "no sentence")
        except BROKEN as error:
            yield Skipped(stem, archive.reason(error))


def _record(archive: Archive, stem: str) -> Record | None:
    with archive.opened(stem + ANNOTATIONS) as place:
        sentences = _sentences(place)
    if not sentences:
        return None
    with archive.opened(stem + MOTION) as place:
        return Record(stem.rpartition("/")[2], motion_name(place) or stem, read(place), sentences)


def _sentences(path: Path) -> tuple[str, ...]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise DataError(f"{path.name} is not JSON: {error}") from error
    if not (isinstance(found, list) and all(isinstance(sentence, str) for sentence in found)):
        raise DataError(f"{path.name} is not a list of sentences")
    return tuple(sentence.strip() for sentence in found if sentence.strip())
