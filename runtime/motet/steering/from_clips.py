"""A steered figure made of motion files in seconds: what is trained is only the principal components of poses.

    files -> clips on the humanoid -> recordings of gaits (recorded.py) -> rows (rows.py) -> tables (tables.py)

``motet train matching`` makes rows of the same recordings by the same functions, and then trains codes and poses.
"""

import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from motet.bundle.golden import TOLERANCE, vectors
from motet.bundle.graph import Arrays
from motet.bundle.manifest import Manifest
from motet.bundle.members import array_bytes
from motet.errors import ArgumentError, FormatError, MotetError, MotionError, listed, needs, quoted
from motet.figures.feet.treadmill import travelling
from motet.figures.floor import above_floor
from motet.figures.humanoid import HUMANOID, on_humanoid
from motet.figures.trimming import repeated, trim
from motet.files import files_in
from motet.formats import OF_FOLDERS, clips, read_motion
from motet.formats.text import MARK
from motet.models.control import ControlModel
from motet.motion.motion import Motion
from motet.representation.contract import MotionContract, living, sequences
from motet.settings import Progress
from motet.steering.recorded import SHORTEST_RECORDING, Recording, held_level, parts_of
from motet.steering.rows import rows_of
from motet.steering.settings import SteeringSettings
from motet.steering.tables import DTYPE_OF_TABLE, speeds_of, tables_of

MOST_CLIPS = 2000
"""Of a figure; more are refused before any is read."""

MOST_SECONDS = 3600
"""Of all clips together: the table is in memory, and searched."""

MOST_FAULTS = 10
"""Clips that an error names."""

ROW_RATE = 30.0
"""Rows a second."""

EVEN_CODES = 32
"""Codes of a pose that a mirror image has alike. More than a trained figure has, as these are not trained."""

ODD_CODES = 24
"""Codes of a pose that a mirror image has with the other sign."""

GAIT_WORDS = {
    "walk": "walk walks walking stroll strolling step steps sidestep sidesteps strafe",
    "run": "run runs running jog jogs jogging sprint sprinting",
}
"""Gait -> words in the names of its clips."""

IDLE_TAG = "idle"
"""What clips are tagged with that belong to every gait: standing and turning on the spot."""

IDLE_WORDS = frozenset(("idle", "stand", "standing", "still", "sway", "turn", "turning", "pivot"))
JUMP_TAG = "jump"
JUMP_WORDS = frozenset(["jump", "jumps", "jumping", "hop", "hops", "hopping"])
LOOP_WORDS = frozenset(("loop", "loops", "cycle"))
"""In the names of clips that are one period: they are repeated."""


Tags = Mapping[str, str | None]
"""Name of a clip, or a pattern of names -> its tags, such as "walk" or "walk, run"; None leaves it out."""


@dataclass(frozen=True)
class Clip:
    """A clip of a file, None for its only one."""

    path: Path
    clip: str | None

    @property
    def name(self) -> str:
        """The file's name without extension, with the clip's name if the file has several: "moves#Walk"."""
        return self.path.stem if self.clip is None else f"{self.path.stem}{MARK}{self.clip}"

    @property
    def words(self) -> list[str]:
        """The words of the clip's own name, in lower case: of "WalkTurn_Left90" walk, turn and left."""
        name = self.path.stem if self.clip is None else self.clip
        return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[^\W\d_a-zA-Z]+", name)]


def tags_of(clip: Clip) -> frozenset[str]:
    """The gaits that a clip shows by the words of its name; else :data:`IDLE_TAG`, "jump", or these words as an act."""
    words = clip.words
    gaits = [gait for gait, known in GAIT_WORDS.items() if set(known.split()) & set(words)]
    if gaits:
        return frozenset(gaits)
    if IDLE_WORDS & set(words):
        return frozenset((IDLE_TAG,))
    if JUMP_WORDS & set(words):
        return frozenset((JUMP_TAG,))
    return frozenset((" ".join(words) or clip.path.stem,))


def clips_of(places: str | Path | Sequence[str | Path]) -> list[Clip]:
    """The clips of a folder with all below it, or of files and folders; FormatError where there are none, MotionError
    for more than :data:`MOST_CLIPS`."""
    needs(places, str | Path | Sequence, "a folder or a list of motion files")
    if isinstance(places, str | Path):
        places = [places]
    files: list[Path] = []
    for place in map(Path, places):
        inside = files_in(place, OF_FOLDERS) if place.is_dir() else [place]
        if not inside:
            raise FormatError(place, f"no motion files ({' '.join(OF_FOLDERS)}) are in it")
        files += inside
    if not files:
        raise MotionError("the list of motion files is empty: name a folder, or files")
    _check_count(len(files))
    all_clips: list[Clip] = []
    for path in files:
        all_clips += [Clip(path, name) for name in _names_in(path)]
    _check_count(len(all_clips))
    return all_clips


def _check_count(count: int) -> None:
    if count > MOST_CLIPS:
        raise MotionError(f"{count} clips: a figure is made of at most {MOST_CLIPS}; choose some")


def _names_in(path: Path) -> Sequence[str | None]:
    try:
        names = clips(path)
    except MotetError:  # reading the file says why
        names = ()
    return names if len(names) > 1 else [None]


def tagged(all_clips: Sequence[Clip], tags: Tags | None) -> list[tuple[Clip, frozenset[str]]]:
    """The tags of each clip: those of the first name or pattern in ``tags`` that fits its name, else by its name; clips
    whose tags are None are left out. ArgumentError for a name that fits none, and for tags that are no names."""
    chosen = {pattern: _parsed(pattern, text) for pattern, text in (tags or {}).items()}
    names = [clip.name for clip in all_clips]
    for pattern in chosen:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise ArgumentError(f"tags: no clip is called {quoted(pattern)}; there are {listed(names)}")
    pairs = []
    for clip in all_clips:
        fitting = [gaits for pattern, gaits in chosen.items() if fnmatchcase(clip.name, pattern)]
        pairs.append((clip, fitting[0] if fitting else tags_of(clip)))
    return [(clip, gaits) for clip, gaits in pairs if gaits]


def _parsed(pattern: str, text: str | None) -> frozenset[str]:
    """The tags in a text such as "walk, run"; none of None."""
    if text is None:
        return frozenset()
    parts = [part.strip() for part in text.split(",")] if isinstance(text, str) else []
    if not parts or not all(parts):
        raise ArgumentError(f"expected tags such as 'walk' or 'walk, run' for {pattern!r:.60}, not {text!r:.60}")
    return frozenset(parts)


def recorded(clip: Clip, gaits: frozenset[str]) -> list[Recording]:
    """The recordings in a clip; MotionError for one that cannot be read, is of no human, or is too short."""
    motion = trim(above_floor(on_humanoid(travelling(read_motion(clip.path, clip=clip.clip)))))
    features = next(iter(sequences("root_sixd", motion, ROW_RATE)))
    if LOOP_WORDS & set(clip.words):
        features = repeated(features)
    if features.duration < SHORTEST_RECORDING:
        raise MotionError(f"it lasts {features.duration:.2g} s, and a clip needs {SHORTEST_RECORDING:g} s")
    parts = parts_of(held_level(features), gaits, gaits == {JUMP_TAG})
    if not parts:
        flaw = "in which no bone turns by over 45 degrees between frames" if gaits != {JUMP_TAG} else "around a jump"
        raise MotionError(f"it has no {SHORTEST_RECORDING:g} s {flaw}")
    return parts


def all_recorded(pairs: Sequence[tuple[Clip, frozenset[str]]], progress: Progress) -> list[Recording]:
    """The recordings of all clips; MotionError that names those that cannot be used, and for too long ones together."""
    recordings: list[Recording] = []
    faults: list[str] = []
    for number, (clip, gaits) in enumerate(pairs, start=1):
        # go on after a fault, so that all are named at once
        try:
            recordings += recorded(clip, gaits)
        except MotetError as error:
            faults.append(f"{clip.name}: {getattr(error, 'reason', error)}")
        if sum(len(recording.features) for recording in recordings) > MOST_SECONDS * ROW_RATE:
            raise MotionError(f"the clips are longer than {MOST_SECONDS / 60:g} minutes together: choose some")
        progress(number, len(pairs))
    if faults:
        more = f"; and {len(faults) - MOST_FAULTS} more" if len(faults) > MOST_FAULTS else ""
        reasons = "; ".join(faults[:MOST_FAULTS]) + more
        unusable = f"{len(faults)} of {len(pairs)} clips cannot be used: {reasons}"
        raise MotionError(f"{unusable}. Mend them, or leave them out: tags={{'clip': None}}")
    return recordings


def with_gaits(recordings: Sequence[Recording], settings: SteeringSettings) -> tuple[list[Recording], tuple[str, ...]]:
    """Recordings with the gaits that they are of, and the names of these, those with the most rows first, and before
    the acts, which are played as recorded: tags whose clips hardly travel, and jumps.

    Clips that are :data:`IDLE_TAG` belong to all gaits that travel. MotionError where nothing travels.
    """
    tags, gaits = _travelling(recordings, settings.idle)
    if not gaits:
        raise MotionError(
            f"no clip walks or runs; tags are {listed(tags) or 'none'}. Call such clips walk_*, or name their tags: "
            "tags={'clip': 'walk'}"
        )
    placed = []
    for recording in recordings:
        names = recording.gaits - {IDLE_TAG} or frozenset(gaits)
        placed.append(replace(recording, gaits=names, as_recorded=names.isdisjoint(gaits)))
    return placed, (*gaits, *(tag for tag in tags if tag not in (*gaits, IDLE_TAG)))


def _travelling(recordings: Sequence[Recording], idle: float) -> tuple[list[str], list[str]]:
    """All tags, those with the most rows first, and those of which over half of the rows are faster than ``idle``."""
    rows = Counter[str]()
    travels = Counter[str]()
    for recording in recordings:
        pace = np.hypot(*recording.features.values[:, :2].T)
        rows.update(dict.fromkeys(recording.gaits, len(pace)))
        travels.update(dict.fromkeys(recording.gaits, int((pace > idle).sum())))
    tags = [tag for tag, _ in rows.most_common()]
    return tags, [tag for tag in tags if tag not in (IDLE_TAG, JUMP_TAG) and 2 * travels[tag] > rows[tag]]


def made_of(
    places: str | Path | Sequence[str | Path], tags: Tags | None, progress: Progress
) -> tuple[Manifest, Arrays]:
    """The manifest and the tables of :meth:`motet.steering.model.SteerModel.from_clips`, with its errors."""
    settings = SteeringSettings()
    pairs = tagged(clips_of(places), tags)
    recordings, gaits = with_gaits(all_recorded(pairs, progress), settings)
    rows = rows_of(recordings, gaits, settings)
    # as a recipe stores them
    tables = {}
    for name, table in tables_of(rows, EVEN_CODES, ODD_CODES).items():
        tables[name] = table.astype(DTYPE_OF_TABLE[name])
    # what the loop has to know of them
    config = {"even": EVEN_CODES, "odd": ODD_CODES, "gaits": gaits, "speeds": speeds_of(rows, settings)}
    name = Path(places).resolve().stem if isinstance(places, str | Path) else "clips"
    contract = _contract([recording.features for recording in recordings])
    return _manifest(name or "clips", contract, config, [clip.name for clip, _ in pairs]), tables


def _manifest(name: str, contract: MotionContract, config: Mapping[str, Any], names: Sequence[str]) -> Manifest:
    """The manifest of a model that is in no bundle yet. names: of its clips."""
    about: dict[str, Any] = {key: {} for key in ("defaults", "settings", "licence", "quality", "parity")}
    about |= {"name": name, "verb": "control", "model": "motion-matching", "loop": "matching"}
    about |= {"motion": contract.to_json(), "config": json.loads(json.dumps(config)), "training": {"clips": names}}
    return Manifest.from_json({**about, "graphs": {}, "tables": {}, "files": {}})


def _contract(features: Sequence[Motion]) -> MotionContract:
    """The contract of features, with their mean and standard deviation."""
    values = np.concatenate([motion.values for motion in features])
    first = features[0]
    std = living(values.std(axis=0), first.units)
    return MotionContract("root_sixd", first.channels, first.units, ROW_RATE, values.mean(axis=0), std, HUMANOID)


def bundled(model: ControlModel) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The manifest and the files of a bundle of a model without graphs, with golden vectors of 12 ticks in each of two
    directions."""
    contract = model.contract
    # straight ahead, then to the side with another facing
    spread = np.linspace(-1, 1, 12)[:, None]
    track = np.repeat([[0.0, 1.2, 0.0], [1.2, 0.0, 1.5]], 12, axis=0).astype(np.float32)
    golden = vectors(model, {}, {"track": track}, {}, contract.mean + spread * contract.std)

    # each table is a file
    files = {"golden.npz": golden}
    entries = {}
    for name in model.tables:
        table = model.tables[name]
        entries[name] = {"file": f"{name}.npy", "dtype": table.dtype.name, "shape": list(table.shape)}
        files[f"{name}.npy"] = array_bytes(table)
    entry = {"file": "golden.npz", "tolerance": TOLERANCE, "run": {}}
    settings = {kind.FEATURE: asdict(model.settings(kind)) for kind in model.SETTINGS}
    return {**model.manifest.source, "settings": settings, "tables": entries, "golden": entry}, files
