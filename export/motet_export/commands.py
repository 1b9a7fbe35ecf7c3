"""Plain acts for bare commands, added to a bundle that generates codes."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motet.bundle.bundle import Bundle
from motet.bundle.fields import Json
from motet.bundle.graph import Arrays
from motet.bundle.manifest import Manifest
from motet.errors import BundleError
from motet.generate.model import CodesModel
from motet.models.load import build, kind_of
from motet_export.exporter import ExportError

Steps = NDArray[np.int16]

Cut = Mapping[str, int]
"""The number of an action, of one of its recordings ("take"), and its steps from "first" up to "stop"."""


def with_commands(bundle: Bundle, table: Path) -> CodesModel:
    """The model of a bundle with the commands of a table, such as docs/results/commands.toml, in place of any others.

    ExportError for a bundle of another loop, and for a table that does not fit it.
    """
    model = kind_of(bundle.manifest).load(bundle)
    if not isinstance(model, CodesModel):
        raise ExportError(f"bundle {bundle.path} has another loop than codes, the only one with commands")
    try:
        entries = tomllib.loads(table.read_text(encoding="utf-8"))["command"]
        return _built(model, entries)
    except (OSError, ValueError, KeyError, TypeError, IndexError, BundleError) as error:
        raise ExportError(f"{table} does not fit bundle {bundle.path}: {error!r}") from error


def _built(model: CodesModel, entries: Sequence[Json]) -> CodesModel:
    # the memory without the commands that it has
    memory = model.tables["memory"]
    known = len(model.manifest.source["actions"])
    motions = [memory[memory[:, -2] < known]]

    # each command with the steps of its motions after it
    commands = []
    for number, entry in enumerate(entries, start=known + 1):
        cuts = [motion["cuts"] for motion in entry.get("motion", ())]
        motions += [_joined(model, parts, number) for parts in cuts]
        commands.append(
            {
                "sentence": entry["sentence"],
                "action": entry["action"] if not cuts else cuts[0][0]["action"],
                "texts": entry["texts"],
                "instead": entry.get("instead", []),
            }
        )
    manifest = Manifest.from_json({**model.manifest.source, "commands": commands})
    tables: Arrays = {**model.tables, "memory": np.concatenate(motions)}
    built = build(manifest, model.graphs, tables)
    assert isinstance(built, CodesModel)
    return built


def _joined(model: CodesModel, cuts: Sequence[Cut], number: int) -> Steps:
    """The steps (T, P + 2) of a motion that joins cuts, and of its end, as those of a command."""
    parts: list[NDArray[np.int64]] = []
    for cut in cuts:
        codes = _recording(model, cut)
        if cut["first"] and not parts:
            # what begins a motion is coded as its beginning, with nothing before
            hop = model.codec.field.hop
            frames = model.codec.frames_of(codes)[cut["first"] * hop : cut["stop"] * hop]
            parts.append(model.codec.codes_of(frames))
        else:
            parts.append(codes[cut["first"] : cut["stop"]])
    end = np.zeros_like(parts[0][:1])
    end[0, 0] = model.codec.moves
    codes = np.concatenate([*parts, end])
    ages = np.arange(len(codes))
    return np.column_stack([codes, np.full(len(codes), number), ages]).astype(np.int16)


def _recording(model: CodesModel, cut: Cut) -> NDArray[np.int64]:
    """The steps (N, P) of the recording of a cut, without its end."""
    memory = model.source.memory
    take = memory.recordings(cut["action"])[cut["take"]]
    codes: NDArray[np.int64] = memory.codes[memory.rows[cut["action"]][take.places]]
    codes = codes[codes[:, 0] < model.codec.moves]
    if not 0 <= cut["first"] < cut["stop"] <= len(codes):
        raise ValueError(f"the recording of {dict(cut)} has {len(codes)} steps")
    return codes
