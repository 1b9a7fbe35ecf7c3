"""Recipes of the motion-to-language model: ``paper`` is table 1 of Plappert et al. 2017."""

from dataclasses import replace

from motet_train.descent import Training
from motet_train.models.motion_to_language import MotionToLanguageConfig
from motet_train.recipes.language import SIZES, LanguageVisits
from motet_train.recipes.recipe import Recipe

DEFAULTS = {"beams": 5, "max_words": 40}

PAPER = Recipe(
    "describe",
    "motion-to-language",
    "beam",
    MotionToLanguageConfig(0, 0),
    SIZES,
    Training(epochs=100, batch=128, optimiser="nadam", clip=8.0),
    LanguageVisits(),
    DEFAULTS,
)
"""Encoder 2 x 64, 2 x 64; decoder 128, 128; embedding 64; dropout 0.4; 100 epochs in batches of 128."""

DEFAULT = replace(
    PAPER,
    loop="beam",
    config=MotionToLanguageConfig(0, 0, dropout=0.2, frame_noise=0.3, travelled=3, summary=5.0),
    training=Training(epochs=200, batch=32, optimiser="nadam", learning_rate=2e-3, falling=0.5, clip=8.0, keep="last"),
    visits=LanguageVisits(offsets=3, mirror=True),
    defaults={**DEFAULTS, "draws": 100, "temperature": 0.7},
)
"""What is shipped: for a small corpus, whose motions are seen through noise instead of more dropout.

Many wordings share an action, so the most probable sentence says it better than the consensus of draws does.
"""

RECIPES = {"default": DEFAULT, "paper": PAPER}
