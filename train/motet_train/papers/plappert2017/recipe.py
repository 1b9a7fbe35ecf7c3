"""Recipes of the language-to-motion model: ``paper`` is table 1 of Plappert et al. 2017."""

from dataclasses import replace

from motet_train.descent import Training
from motet_train.papers.plappert2017.language_to_motion import LanguageToMotionConfig
from motet_train.recipes.language import SIZES, LanguageVisits
from motet_train.recipes.recipe import Recipe

NADAM = Training(epochs=100, batch=128, optimiser="nadam", clip=25.0, keep="last")
BEAM = {"hypotheses": 5, "candidates": 4, "temperature": 1.0, "max_seconds": 15}
"""Decoding by the beam of section 4.3.3."""

PAPER = Recipe(
    "generate",
    "language-to-motion",
    "mixture",
    LanguageToMotionConfig(0, 0),
    SIZES,
    NADAM,
    LanguageVisits(pairs=True),
    BEAM,
)
"""Encoder 2 x 64, 2 x 64; decoder 3 x 400; embedding 64; 20 components; dropout 0.1; loss 12; 100 epochs of every pair
of a motion and a sentence, and the last weights, as in the authors' code."""

SMALL_NET = {"decoder_units": (200, 200), "components": 5, "loss": "likelihood", "variance_floor": 0.01}
DEFAULT = replace(
    PAPER,
    config=replace(PAPER.config, **SMALL_NET, feed_noise=0.2, frame_dropout=0.3, summary=60.0),
    training=replace(NADAM, epochs=400, batch=16, learning_rate=2e-3, falling=0.5),
    visits=LanguageVisits(offsets=1, windows=(50, 50), mirror=True),
    defaults={**BEAM, "hypotheses": 10, "candidates": 1, "temperature": 0.05},
)
"""What is shipped: trained on the true likelihood (eq. 11), on windows of motions, and to recover from small errors.

The last weights are kept: the sentence decides little of the likelihood of a frame whose predecessors are known, and is
still being learned when that of validation no longer falls. By default it gives the likeliest of ten independent
samples, with little noise in their frames, which is what makes figures tremble and slide: with more candidates the beam
takes the frames that are likely because they hardly move.
"""

RECIPES = {"default": DEFAULT, "paper": PAPER}
