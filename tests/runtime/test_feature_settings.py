"""Settings of features: ranges, defaults, and values of a manifest."""

import pickle
from dataclasses import FrozenInstanceError, dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from fake_models import search_model

from motet.bundle.manifest import Manifest
from motet.errors import BundleError, SettingError
from motet.search.model import SearchModel
from motet.settings import Range, Settings


@dataclass(frozen=True)
class Springs(Settings):
    FEATURE: ClassVar[str] = "springs"
    half_life: Annotated[float, Range(0.01, 10, "s")] = 0.2
    steps: Annotated[int, Range(1, 9)] = 3


@dataclass(frozen=True)
class Needed(Settings):
    rate: Annotated[float, Range(0, 1)]


def test_values_of_a_manifest_take_the_place_of_defaults() -> None:
    assert Springs.read({}, "settings.springs") == Springs(0.2, 3)
    assert Springs.read({"steps": 5}, "settings.springs") == Springs(0.2, 5)
    whole = Springs(np.float32(1), np.int64(2))  # type: ignore[arg-type]
    assert (type(whole.half_life), type(whole.steps)) == (float, int)
    assert pickle.loads(pickle.dumps(whole)) == whole
    with pytest.raises(FrozenInstanceError):
        whole.steps = 3  # type: ignore[misc]


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"half_life": 0}, "half_life must be between 0.01 and 10 s, not 0"),
        ({"half_life": float("nan")}, "half_life must be between 0.01 and 10 s, not nan"),
        ({"half_life": "1"}, "half_life must be between 0.01 and 10 s, not 1"),
        ({"half_life": True}, "half_life must be between 0.01 and 10 s, not True"),
        ({"half_life": None}, "half_life must be between 0.01 and 10 s, not None"),
        ({"half_life": [1.0]}, "half_life must be between"),
        ({"steps": 10}, "steps must be between 1 and 9, not 10"),
        ({"steps": 2.5}, "steps must be a whole number, not 2.5"),
    ],
)
def test_what_is_out_of_range_is_refused(given: dict[str, Any], reason: str) -> None:
    with pytest.raises(SettingError, match=reason):
        Springs(**given)
    with pytest.raises(BundleError, match=f"manifest, settings.springs.{reason}"):
        Springs.read(given, "settings.springs")


def test_unknown_and_missing_settings_are_named() -> None:
    with pytest.raises(BundleError, match=r"settings\.springs\.halflife: is unknown; expected one of half_life, steps"):
        Springs.read({"halflife": 1}, "settings.springs")
    with pytest.raises(BundleError, match=r"manifest, defaults\.rate: is missing"):
        Needed.read({}, "defaults")
    with pytest.raises(SettingError, match="there is no setting 'x', only half_life, steps"):
        Springs.check("x", 1)


class SpringySearch(SearchModel):
    SETTINGS = (Springs,)


def test_a_model_has_the_settings_of_its_features() -> None:
    plain = search_model()

    def model(settings: dict[str, Any]) -> SpringySearch:
        return SpringySearch(Manifest.from_json({**plain.manifest.source, "settings": settings}), plain.graphs)

    assert SpringySearch(plain.manifest, plain.graphs).settings(Springs) == Springs()
    assert model({"springs": {"steps": 9}}).settings(Springs) == Springs(steps=9)
    with pytest.raises(BundleError, match=r"manifest, settings\.springs\.steps must be between 1 and 9, not 0"):
        model({"springs": {"steps": 0}})
    with pytest.raises(BundleError, match=r"manifest, settings\.spring: is unknown; expected springs"):
        model({"spring": {"steps": 3}})
    with pytest.raises(BundleError, match=r"manifest, settings\.springs: must be an object, not 3"):
        model({"springs": 3})
