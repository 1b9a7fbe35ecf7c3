"""Figures of docs/results/speed.md: python tests/train/prepare_figures.py CLIPS [HOURS...]

How much memory, time and disk `motet prepare --for all` takes of so many hours: the motions of the folder CLIPS, at 30
frames a second, repeated by links until they are as many.
"""

import os
import subprocess
import sys
import tempfile
from itertools import cycle
from pathlib import Path

from motet import MotetError, read, to_humanoid, write
from motet.corpus.sources import files_of


def humanoids(clips: Path, folder: Path) -> dict[Path, float]:
    """Files of all motions that can be used, with their seconds."""
    found = {}
    for file in files_of([clips]):
        try:
            motion = to_humanoid(read(file)).motion.resample(30)
        except MotetError:
            continue
        write(place := folder / f"{file.stem}.npz", motion)
        found[place] = motion.duration
    return found


def corpus(files: dict[Path, float], folder: Path, hours: float) -> float:
    """A folder of links to files, and a table of a sentence each; its hours."""
    folder.mkdir()
    seconds, lines = 0.0, ["clip\tsentence"]
    for number, (file, length) in enumerate(cycle(files.items())):
        if seconds >= hours * 3600:
            break
        os.link(file, folder / f"{number:06}.npz")
        lines.append(f"{number:06}\ta person moves like number {number}")
        seconds += length
    (folder / "sentences.tsv").write_text("\n".join(lines) + "\n")
    return seconds / 3600


def prepared(folder: Path, out: Path) -> tuple[float, float]:
    """Processor time in seconds and the greatest memory in MB that preparing took."""
    command = [sys.executable, "-m", "motet", "prepare", str(folder), "--for", "all", "-o", str(out)]
    _, status, used = os.wait4(subprocess.Popen(command, stdout=subprocess.DEVNULL).pid, 0)
    if status:
        sys.exit("prepare failed")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    """Prepare so many hours each, and print a line of each."""
    with tempfile.TemporaryDirectory() as place:
        (motions := Path(place) / "motions").mkdir()
        files = humanoids(Path(sys.argv[1]), motions)
        for number, asked in enumerate(sys.argv[2:] or ["1.5", "5", "40"]):
            folder, out = Path(place) / f"corpus{number}", Path(place) / f"store{number}"
            hours = corpus(files, folder, float(asked))
            seconds, memory = prepared(folder, out)
            disk = sum(path.stat().st_size for path in out.rglob("*.*")) / 1e6
            print(
                f"{hours:.2f} hours of {len(list(folder.glob('*.npz')))} motions: {seconds:.0f} s of processor time, "
                f"{memory:.0f} MB of memory, {disk:.0f} MB of disk",
                flush=True,
            )


if __name__ == "__main__":
    main()
