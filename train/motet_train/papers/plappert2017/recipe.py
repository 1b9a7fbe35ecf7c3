"""Recipes of the language-to-motion model, see presets.toml: ``paper`` is table 1 of Plappert et al. 2017."""

from motet.bundle.fields import Json
from motet_train.data.table import read_toml
from motet_train.descent import Training
from motet_train.models.net import tuples
from motet_train.papers.plappert2017.language_to_motion import LanguageToMotionConfig
from motet_train.recipes.language import SIZES, LanguageVisits
from motet_train.recipes.recipe import Recipe


def _recipe(preset: Json) -> Recipe:
    config = LanguageToMotionConfig(0, 0, **tuples(preset["config"]))
    visits = LanguageVisits(**tuples(preset["visits"]))
    training = Training(**preset["training"])
    return Recipe("generate", "language-to-motion", "mixture", config, SIZES, training, visits, preset["defaults"])


RECIPES = {name: _recipe(preset) for name, preset in read_toml(__file__, "presets.toml").items()}
