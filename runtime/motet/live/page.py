"""Write a steered figure as one HTML page that runs it: no network, no other file, any browser.

The page is ``page.html`` with ``control.js``, built from ``runtime/web`` (``npm run build:live`` there), and with the
bundle's own numbers: its settings, and its tables, gzipped.
"""

from dataclasses import asdict

from motet.bundle.packing import packed
from motet.draw.figure import Body
from motet.draw.page import body_data, filled, source
from motet.draw.skinned import person
from motet.errors import BundleError, ControlError
from motet.figures.humanoid import HUMANOID, T_POSE
from motet.files import File, Json, place_of, write_whole
from motet.settings import checked_int
from motet.steering.foot_lock import FootLockSettings
from motet.steering.model import SteerModel
from motet.steering.repertoire import document
from motet.steering.settings import SteeringSettings


def write_live_page(file: File, model: SteerModel, characters: int = 1, title: str | None = None) -> None:
    """Write the page of :func:`live_page`; the title is the file's name where none is given.

    Errors as there, and OutputError if the file cannot be written.
    """
    title = place_of(file).stem if title is None else title
    write_whole(file, live_page(model, characters, title))


def live_page(model: SteerModel, characters: int = 1, title: str = "motet") -> str:
    """The HTML of a page in which a figure is steered with keys, a gamepad or a finger, and others go with it.

    characters: how many figures there are at first, 1 to 50. ControlError for another number, BundleError for another
    model.
    """
    if not isinstance(model, SteerModel):
        raise BundleError(f"{model} is not steered: a page needs a model such as motet.load('control')")
    most = 50
    characters = checked_int("characters", characters, 1, most, ControlError)
    data = {"net": net_data(model), "body": live_body(), "characters": characters, "most": most, "acts": document()}
    return filled(source("motet.live", "page.html"), title, data, CONTROL=source("motet.live", "control.js"))


def net_data(model: SteerModel) -> Json:
    """All that ``control.js`` steers a figure with, ready for JSON: ``Given`` of ``livePage.ts``, and the bytes."""
    manifest = model.manifest
    kinds = (SteeringSettings, FootLockSettings)
    motion = manifest.source["motion"]
    return {
        "manifest": {
            "motion": {name: motion[name] for name in ("representation", "fps", "channels", "skeleton")},
            "settings": {kind.FEATURE: asdict(model.settings(kind)) for kind in kinds},
            "config": {name: manifest.config[name] for name in ("gaits", "speeds", "odd")},
        },
        **packed(model.tables),
    }


def live_body() -> Json:
    """The body that is drawn on the humanoid, and its height in metres."""
    height = Body(HUMANOID).height
    return {"height": height, **body_data(person(), T_POSE / height)}
