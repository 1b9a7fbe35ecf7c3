"""The thesis' family as a figure that travels: its channels say where the root goes, its control values where to."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract, living
from motet.representation.root_sixd import ROOT_SIXD
from motet_train.data.errors import DataError
from motet_train.data.matching_rows import Recording, gaits_of, recordings
from motet_train.data.store import Store
from motet_train.data.table import Gait
from motet_train.papers.tdbn.angle_crbm import AngleCRBMConfig
from motet_train.papers.tdbn.contrastive import Learning
from motet_train.papers.tdbn.courses import LABELS, controls_of, course
from motet_train.papers.tdbn.recipe import Lessons, train_lessons, untrained
from motet_train.papers.tdbn.tdbn import TDBNConfig
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run

GAITS = ("walk", "run")

TDBN = TDBNConfig(
    hidden_per_part=60,
    control_units=8,
    past_noise=0.1,
    own=12,
    restarts=1,
    tries=1,
    rbm=Learning(40, rate=1e-2, final_rate=0.03, batch=50, temperature=(1.0, 0.38)),
    crbm=Learning(60, rate=1e-2, final_rate=0.05, batch=50, temperature=(0.38, 0.38)),
)

CRBM = AngleCRBMConfig(
    taps=6,
    control_units=4,
    free_units=200,
    past_noise=0.3,
    past_rate=2e-3,
    iterations=10,
    crbm=Learning(120, rate=1e-2, final_rate=0.03, batch=50, decay=2e-5, temperature=(1.0, 1.0)),
)

RECIPES = {
    "default": Recipe("control", "tdbn", "session", TDBN),
    "recorded-past": Recipe("control", "tdbn", "session", replace(TDBN, own=0, past_noise=0.3)),
    "crbm": Recipe("control", "angle-crbm", "session", CRBM),
}
"""The deep net; the same as the thesis has it, whose past is always the recorded one; and Taylor's, without the RBM."""


def train_steered(store: Store, job: Job, data: str = "") -> Run:
    """Train on the recordings of a store in ``root_sixd`` that show :data:`GAITS`, and on their mirror images.

    DataError where a gait has none, or where the store is in another representation.
    """
    if store.representation != "root_sixd":
        raise DataError(f"steering is trained on root_sixd (motet prepare --for codes), not {store.representation}")
    shown = {gait.name: gait for gait in gaits_of(store)}
    found = recordings(store, tuple(shown.get(name, Gait(name, (), ())) for name in GAITS))
    contract, motions = mirrored_too(store, found)
    controls = [controls_of(course(motion)) for motion in motions]
    assert contract.skeleton is not None
    config = replace(job.recipe.config, fps=store.fps)
    net = untrained(config, contract.skeleton, contract.channels, len(LABELS))
    net.measure_by(contract.mean, contract.std * config.sigma)
    control = {"labels": LABELS, "starts": dict.fromkeys(LABELS, _stillest(found, net.taps).round(6).tolist())}
    about = {"data": {"name": data, "recordings": len(found), "frames": sum(map(len, motions))}}
    manifest = job.manifest(contract, net.to_config(), net.defaults, None, about, control=control)
    return train_lessons(net, job, manifest, Lessons([[motion.values for motion in motions]], [controls], [1.0]))


def mirrored_too(store: Store, found: Sequence[Recording]) -> tuple[MotionContract, list[Motion]]:
    """The recordings and their mirror images, and the contract with the mean and deviation of all of them."""
    motions = [one.features for one in found]
    plain = np.zeros(len(store.channels))
    contract = MotionContract("root_sixd", store.channels, store.units, store.fps, plain, plain + 1, store.skeleton)
    motions += [replace(motion, values=contract.mirror(motion.values)) for motion in motions]
    every = np.concatenate([motion.values for motion in motions])
    return replace(contract, mean=every.mean(axis=0), std=living(every.std(axis=0), store.units)), motions


def _stillest(found: Sequence[Recording], taps: int) -> Array:
    """The frames (K, D) at the start of the recording in which the root moves least there."""
    starts = [one.features.values[:taps] for one in found if len(one.features) >= taps]
    return min(starts, key=lambda frames: float(np.abs(frames[:, : len(ROOT_SIXD) - 1]).sum()))
