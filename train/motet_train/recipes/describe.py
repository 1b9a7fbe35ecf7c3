"""Recipes of the motion-to-language model: ``paper`` is table 1 of Plappert et al. 2017."""

from dataclasses import replace
from functools import partial

from motet_train.fit import Fitting
from motet_train.models.language.motion_to_language import MotionToLanguageConfig
from motet_train.recipes.language import Recipe

DEFAULTS = {"beams": 5, "max_words": 40}

PAPER = Recipe("describe", "motion-to-language", MotionToLanguageConfig, Fitting(clip=8.0), DEFAULTS)
"""Encoder 2 x 64, 2 x 64; decoder 128, 128; embedding 64; dropout 0.4; 100 epochs in batches of 128."""

DEFAULT = replace(
    PAPER,
    config=partial(MotionToLanguageConfig, dropout=0.2, frame_noise=0.3, summary=5.0),
    fitting=Fitting(clip=8.0, epochs=40, batch=32, learning_rate=2e-3, decay=0.5, keep="last"),
    mirror=True,
    defaults={**DEFAULTS, "draws": 100, "temperature": 0.7},
)
"""What is shipped: for a small corpus, whose motions are seen through noise instead of more dropout.

Its hypotheses are ranked by consensus; those of the paper's model by a beam, as in the paper.
"""

RECIPES = {"default": DEFAULT, "paper": PAPER}
