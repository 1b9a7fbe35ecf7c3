"""Errors over time, and predictions for a test window as stick figures (Li et al. 2018, figures 3 to 5).

The 38 exponential maps of a line of CMU's text files are those of the joints of an ASF skeleton, depth first, its left
leg first, tips of bones among them: the order of :attr:`motet.motion.skeleton.Skeleton.joints`. Vectors of joints are
rows there and are turned by the matrix from the right, so a rotation here is the transposed one. (The .amc of a test
file, 35_01 of walking/walking_1.txt, gives the same rotations.) Files do not name the performer; bones are those of
the trial 39_14.
"""

from collections.abc import Mapping
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from motet.errors import MotionError
from motet.formats import read_motion
from motet.motion.kinematics import chained, skeleton_of
from motet.motion.rotations import Array, axis_to_rotmat, rotvec_to_rotmat
from motet.motion.skeleton import Skeleton
from motet.predict.model import PredictModel
from motet_train.data.cmu_trials import cmu_trial
from motet_train.evaluate.figures import SPACING, Drawings, error_over_time, in_profile, panels, stick_figures
from motet_train.papers.li2018.expmap import CMU_LAYOUT, OUTPUT_FRAMES, SEED_FRAMES, STRIDE, ExpmapCorpus
from motet_train.papers.li2018.protocol import predictor, windows
from motet_train.papers.li2018.report import MANY, Results

FRAMES_APART = 2
"""Frames from one stick figure to the next."""

SEED_POSES = 4
"""Stick figures of seed frames."""


def drawings(results: Results) -> Drawings:
    """Errors over time, and stick figures of CMU's actions; bones of Human3.6M's figure are unknown."""
    corpus = results.corpus
    errors: dict[str, dict[str, Array]] = {}
    for name, parts in results.grouped().items():
        for kind, action in parts:
            if kind == MANY:
                errors.setdefault(action, {})[name] = parts[MANY, action]
    figures = {"predict-error": partial(error_over_time, errors, corpus.layout.fps / STRIDE, "Euler error")}
    if corpus.layout is CMU_LAYOUT:
        skeleton = skeleton_of(read_motion(cmu_trial("39_14")))
        # of several seeds the first: poses have no sensible mean
        models = {runs[0]: results.models[runs[0]] for runs in results.groups.values()}
        for action in ("running", "jumping"):
            if action in corpus.test:
                poses = strips(models, corpus, action, skeleton)
                figures[f"predict-{action}"] = partial(strips_drawing, poses, skeleton)
    return figures


def places(frames: Array, skeleton: Skeleton) -> Array:
    """Places (T, J, 3) of joints of frames (T, 3 + 3 J), in the skeleton's unit.

    The root is at the origin and faces along z; its lean is kept. MotionError if the skeleton has another number of
    joints.
    """
    count = len(skeleton.joints)
    if frames.shape[-1] != 3 + 3 * count:
        raise MotionError(f"frames of {frames.shape[-1]} columns do not fit a skeleton of {count} joints")
    vectors = frames[..., 3:].reshape(*frames.shape[:-1], count, 3)
    rotations = np.swapaxes(rotvec_to_rotmat(vectors), -1, -2)
    root = rotations[..., 0, :, :]
    heading = np.arctan2(root[..., 0, 2], root[..., 2, 2])
    rotations[..., 0, :, :] = axis_to_rotmat("y", -heading) @ root
    bones = np.tile(skeleton.offsets, (len(frames), 1, 1))
    bones[:, 0] = 0
    return chained(skeleton, rotations, bones)[1]


def strips(
    models: Mapping[str, PredictModel], corpus: ExpmapCorpus, action: str, skeleton: Skeleton
) -> dict[str, Array]:
    """The truth and each prediction of an action's first test window: places (K, J, 3) of every second frame.

    The first :data:`SEED_POSES` poses are seed frames. The root's rotation is drawn as predicted, though not measured.
    """
    window = windows(list(corpus.test[action].values()), 1, corpus.layout)
    seed = window[:, :SEED_FRAMES]
    # the truth and each prediction after the same seed
    frames = {"truth": window}
    for name, model in models.items():
        predicted = predictor(name, model, corpus)(seed)
        frames[name] = np.concatenate([seed, predicted], axis=1)
    shown = slice(SEED_FRAMES - SEED_POSES * FRAMES_APART, SEED_FRAMES + OUTPUT_FRAMES, FRAMES_APART)
    return {name: places(rows[0, shown], skeleton) for name, rows in frames.items()}


def strips_drawing(strips: Mapping[str, Array], skeleton: Skeleton) -> Figure:
    """Places of joints (K, J, 3) in profile, one strip below the other; seed frames are blue.

    The first strip is the truth, which is also drawn in grey behind the others.
    """
    truth = next(iter(strips.values()))
    width = 13
    height = 0.4 + 1.1 * width / (SPACING * (len(truth) + 1))
    figure, axes = panels(len(strips), 1, (width, height * len(strips)))
    # each strip over the truth
    for axis, (title, points) in zip(axes, strips.items(), strict=True):
        if points is not truth:
            stick_figures(axis, in_profile(truth, skeleton), skeleton, ["0.75"] * len(truth))
        colours = ["tab:blue"] * SEED_POSES + ["black"] * (len(points) - SEED_POSES)
        stick_figures(axis, in_profile(points, skeleton), skeleton, colours)
        axis.set_title(title, loc="left")
    return figure
