"""Predict: the next frames of a motion, from its last ones."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.bundle.graph import Arrays, Graph
from motet.bundle.manifest import Manifest
from motet.bundle.signature import bind
from motet.decode.rollout import two_rows
from motet.errors import DecodingError, MotionError
from motet.models.base import BundleModel
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.representation.joint_vectors import carry_on, continuous_vectors, joints_of, to_joint_vectors

Floats = NDArray[np.float32]

MAX_FRAMES = 100_000
"""Of one prediction, which is in memory as a whole."""


class PredictModel(BundleModel):
    """A model that carries motions on; shared between any number of sessions and threads.

    graphs: "encoder" (frames (B, L, C) -> what the step takes first) and "step" (-> frame (B, C), and what it takes
        next). After ``horizon`` frames, its default, a prediction goes on from its own last frames.
    """

    VERB = "predict"

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph]) -> None:
        super().__init__(manifest, graphs)
        self.horizon = int(self.defaults["horizon"])
        encoder, step = graphs["encoder"].spec, graphs["step"].spec
        self.bind("encoder", {"frames": "batch L D"}, {})
        bind("step", step, self.loop.inputs, self.loop.outputs, self.sizes, given=encoder.outputs)
        self.seed_frames = self.sizes["L"]

    def predict(self, motion: Motion, frames: int | None = None, append: bool = False) -> Motion:
        """The ``frames`` (as many as the horizon by default) that follow a motion, at the model's frame rate.

        A mocap motion of the model's figure is carried on in its own channels, units and skeleton, from where its root
        is; a motion in the channels of :attr:`contract` in those. Only the last :attr:`seed_frames` at the model's
        frame rate are looked at; one at another rate is resampled, so that its last frame is kept.
        append: give the motion, resampled, and what follows it.
        MotionError for a motion that is too short, or lacks joints or channels of the model, which are named.
        """
        whole = ending(motion, self.fps)
        seed = whole[max(0, len(whole) - self.seed_frames - 1) :]
        figure = self.figure(seed)
        if len(figure) < self.seed_frames:
            limit = f"the model needs {self.seed_frames} frames at {self.fps:g} fps"
            raise MotionError(f"{limit}, and the motion has {len(figure)} ({len(motion)} at {motion.fps:g} fps)")
        found = self.next_frames(figure.values[None, -self.seed_frames :], frames)[0]
        following = self.contract.motion(found)
        if _converted(self.contract, motion):
            following = carry_on(seed, following)
        else:
            whole = whole.select(self.contract.channels, self.contract.units)
        if append:
            whole = whole.continuous() if motion.fps != self.fps else whole
            following = replace(following, values=np.concatenate([whole.values, following.values]))
        return following

    def figure(self, motion: Motion) -> Motion:
        """A motion at the model's frame rate in the channels and units of :attr:`contract`; MotionError as above."""
        if not len(motion):
            raise MotionError(f"the model needs {self.seed_frames} frames, and the motion has none")
        if not _converted(self.contract, motion):
            return motion.select(self.contract.channels, self.contract.units)
        found = to_joint_vectors(motion, joints_of(self.contract.channels))
        return continuous_vectors(found.select(self.contract.channels, self.contract.units))

    def next_frames(self, seeds: ArrayLike, frames: int | None = None) -> Floats:
        """Seed frames (B, L, C) in the contract's channels, to the next frames (B, frames, C) float32.

        Each row gives what it gives alone, to the bit with one thread.
        DecodingError for a number of frames out of range, MotionError for seeds of another shape.
        """
        given = np.asarray(seeds, dtype=np.float32)
        count = self.horizon if frames is None else frames
        if not 1 <= count <= MAX_FRAMES:
            raise DecodingError(f"1 to {MAX_FRAMES} frames can be predicted, not {count}")
        shape = (self.seed_frames, len(self.contract.channels))
        if given.ndim != 3 or given.shape[1:] != shape:
            raise MotionError(
                f"seeds of shape {given.shape} do not fit: the model takes (batch, {shape[0]}, {shape[1]})"
            )
        rows = two_rows(np.arange(len(given)))
        found: Floats = self.loop.run(self.graphs["encoder"], self.graphs["step"], given[rows], count, self.horizon)
        return found[: len(given)]

    def replay(self, given: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """Seed frames (L, C) and the number of "frames" of the settings to the next frames (frames, C)."""
        return {"frames": self.next_frames(given["frames"][None], int(settings["frames"]))[0]}

    def stream(self, start: Motion | None = None) -> "PredictSession":
        """A session that frames are pushed into as they come.

        start: the motion so far; its channels, units, frame rate and skeleton are those of the frames to come. By
            default there is none, and frames come in the channels and at the frame rate of :attr:`contract`.
        """
        if start is None:
            start = self.contract.motion(np.empty((0, len(self.contract.channels))))
        return PredictSession(self, start)


class PredictSession:
    """A motion that goes on: push what happens, ask what comes next. Keeps only the frames that are looked at."""

    def __init__(self, model: PredictModel, start: Motion) -> None:
        self.model = model
        self._kept = math.ceil((model.seed_frames + 1) * start.fps / model.fps) + 1
        self._motion = start[-self._kept :]

    def push(self, frames: ArrayLike) -> None:
        """The next frame (D,), or several (T, D); MotionError where they do not fit, and then nothing has changed."""
        new = np.atleast_2d(np.asarray(frames, dtype=np.float64))
        if new.ndim != 2 or new.shape[1] != len(self._motion.channels):
            raise MotionError(f"a frame of shape {np.shape(frames)} does not fit {len(self._motion.channels)} channels")
        values = np.concatenate([self._motion.values, new])[-self._kept :]
        self._motion = replace(self._motion, values=values)

    def predict(self, frames: int | None = None) -> Motion:
        """As :meth:`PredictModel.predict`, after all that was pushed so far."""
        return self.model.predict(self._motion, frames)


def ending(motion: Motion, fps: float) -> Motion:
    """The motion at another frame rate, such that its last frame stays; what is left over falls away at the start."""
    if motion.fps == fps:
        return motion
    count = math.floor((len(motion) - 1) * fps / motion.fps + 1e-9) + 1
    backwards: Array = motion.values[::-1]
    resampled = replace(motion, values=backwards).resample(fps)[: max(count, 0)]
    return replace(resampled, values=resampled.values[::-1])


def _converted(contract: MotionContract, motion: Motion) -> bool:
    """Whether the motion comes as a mocap figure that has to be put into the contract's channels."""
    return (
        bool(joints_of(contract.channels))
        and motion.skeleton is not None
        and not (set(contract.channels) <= set(motion.channels))
    )
