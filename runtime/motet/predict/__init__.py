"""Frames between and after given ones.

    predict: frames -> encoder -> step, frame by frame (free_run.py) -> the next frames; beyond the model's horizon a
    generate model continues them
    fill: frames on both sides of a gap -> placed frames -> graph "filler" (between.py) -> the frames of the gap

Main names: PredictModel (model.py), FillModel (fill.py), free_run (free_run.py), between (between.py).
Numbers: FreeRunSettings (free_run.py) and BetweenSettings (between.py), as defaults in the manifest.
"""
