"""Draw the acts by key poses and the styles that ship, one strip each, for docs/acts.md and docs/steer.md:
`python docs/results/acts.py`."""

from functools import partial
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

import motet
import motet.keyed
from motet.steering.styles import STYLES
from motet_train.evaluate.figures import bodies, panels, save

FOLDER = Path(__file__).parents[1] / "figures"
SOME = (
    *("salute", "wave", "shrug", "phone", "think", "clap"),
    *("drink", "hammer", "play guitar", "shoot a bow", "facepalm", "walk like a zombie"),
)
"""Those of the picture in the README."""

COLUMNS, PER_SHEET, POSES = 3, 51, 5

STYLE_COLUMNS, STYLE_POSES = 2, 9


def sheet(names: list[str], bases: dict[str, motet.Motion]) -> Figure:
    """Acts by name, three a row. bases: what they are laid over, by its name."""
    rows = -(-len(names) // COLUMNS)
    picture, axes = panels(rows, COLUMNS, (2.4 * COLUMNS, 1.35 * rows))
    for place in axes:
        place.axis("off")
    for name, place in zip(names, axes, strict=False):
        act = motet.keyed.ours()[name]
        motion = act.motion(bases[act.over])
        place.set_title(f"{name}, {motion.duration:.1f} s", fontsize=8, loc="left")
        bodies(place, motion, POSES)
    return picture


def style_sheet(model: motet.SteerModel) -> Figure:
    """Figures that walk in each style at its pace, two a row: two seconds, once the style has come."""
    rows = -(-len(STYLES) // STYLE_COLUMNS)
    picture, axes = panels(rows, STYLE_COLUMNS, (5 * STYLE_COLUMNS, 1.35 * rows))
    for place in axes:
        place.axis("off")
    for name, place in zip(STYLES, axes, strict=False):
        motion = model.run(f"walk 4s style {name}")
        place.set_title(name, fontsize=8, loc="left")
        bodies(place, motion[60:], STYLE_POSES)
    return picture


def main() -> None:
    """Write the sheets."""
    model = motet.load_as(motet.SteerModel, "control")
    bases = {"stand": model.run("stop 14s"), "walk": model.run("walk speed 1.1 14s")}
    names = list(motet.keyed.ours())
    sheets = {"acts": list(SOME)}
    for start in range(0, len(names), PER_SHEET):
        sheets[f"acts-{1 + start // PER_SHEET}"] = names[start : start + PER_SHEET]
    drawn = {name: partial(sheet, acts, bases) for name, acts in sheets.items()}
    drawn["styles"] = partial(style_sheet, model)
    for path in save(drawn, FOLDER):
        Image.open(path).quantize(48).save(path, optimize=True)


if __name__ == "__main__":
    main()
