"""Draw what the bundle `generate` shows for the sentences of a table, two seeds each, and print what it says of them.

`python docs/results/sixty.py` takes docs/results/sixty.tsv and draws into docs/figures; another table and folder may
follow. docs/results/sixty.md tells how they were judged."""

import csv
import sys
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import motet
from motet_train.evaluate.figures import bodies, panels, save
from motet_train.evaluate.text_adherence.track import track_of

TABLE = Path(__file__).with_suffix(".tsv")
FOLDER = Path(__file__).parents[1] / "figures"
SEEDS = (0, 1)
PER_SHEET, POSES = 10, 10
WARNED = " | warned"


def shown(model: motet.GenerateModel, sentence: str) -> Iterator[tuple[motet.Motion | None, str]]:
    """A motion for each seed, None where the sentence is refused, and a line that says what it is."""
    for seed in SEEDS:
        with warnings.catch_warnings(record=True) as messages:
            warnings.simplefilter("always")
            try:
                generated = model.generate(sentence, seed=seed)[0]
            except motet.MotetError as error:
                yield None, f"refused: {error}"
                continue
        track = track_of(generated.motion)
        way = float(np.linalg.norm(np.diff(track.points[:, 0, [0, 2]], axis=0), axis=1).sum())
        reading = f"as: {generated.action}" if generated.action else "in parts"
        line = f"{reading} | {track.seconds:.1f} s, {way:.1f} m, {track.turn:.0f} degrees"
        yield generated.motion, line + WARNED * bool(messages)


def sheet(rows: list[tuple[str, list[tuple[motet.Motion | None, str]]]]) -> Figure:
    """Sentences, one a row, with the strips of their seeds side by side."""
    picture, axes = panels(len(rows), len(SEEDS), (7 * len(SEEDS), 1.45 * len(rows)))
    places = iter(axes)
    for sentence, motions in rows:
        for motion, line in motions:
            place = next(places)
            place.set_title(f"{sentence}\n{line}", fontsize=7, loc="left")
            if motion is None:
                place.axis("off")
            else:
                bodies(place, motion, POSES)
    return picture


def main(table: Path = TABLE, folder: Path = FOLDER) -> None:
    """Write the sheets, and the lines above the strips on stdout."""
    model = motet.load("generate")
    with table.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    strips = [(row["sentence"], list(shown(model, row["sentence"]))) for row in rows]
    for sentence, motions in strips:
        print(sentence, *(f"    {line}" for _, line in motions), sep="\n")
    done = [row[seed] == "yes" for row in rows for seed in ("first", "second")]
    silent = [not line.startswith("refused") and WARNED not in line for _, motions in strips for _, line in motions]
    wrong = sum(not is_done and quiet for is_done, quiet in zip(done, silent, strict=True))
    both = sum(map(min, done[::2], done[1::2]))
    print(f"done: {both} sentences, {sum(done)} strips; wrong without a word: {wrong} strips")
    sheets = [strips[start : start + PER_SHEET] for start in range(0, len(strips), PER_SHEET)]
    for path in save({f"{table.stem}-{n}": partial(sheet, rows) for n, rows in enumerate(sheets, 1)}, folder):
        Image.open(path).quantize(64).save(path, optimize=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
