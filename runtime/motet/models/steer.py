"""Steer: figures that go where they are told, live, on the ground."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from motet.arguments import checked_int
from motet.bundle.fields import Fields
from motet.bundle.graph import Arrays, Graph
from motet.bundle.manifest import Manifest
from motet.decode.matching import FEATURES, Matcher, Playing, Table
from motet.errors import BundleError, ControlError
from motet.models.control import ControlModel
from motet.models.steer_script import captions, parse_orders
from motet.models.steer_session import SteerSession
from motet.models.tdbn_control import MAX_CHARACTERS
from motet.motion.humanoid import BONES
from motet.motion.motion import Motion
from motet.motion.pose import Pose
from motet.motion.rotations import rotmat_to_quat
from motet.representation.root_sixd import KINDS, ROOT_SIXD, joint_rotations

CHANNELS = (*ROOT_SIXD, *(f"{bone}.{kind}" for bone in BONES for kind in KINDS))
"""In the order of a pose's numbers."""


class SteerModel(ControlModel):
    """A figure to be steered; any number of sessions and threads share it.

    graphs: "encoder" (rotations, height -> codes), "rows" (row -> frames, features, gaits, left), and "step", see
        :mod:`motet.decode.matching`.
    """

    LOOPS = ("matching",)
    ROLES = ("encoder", "rows", "step")

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        config = Fields(manifest.config, "config")
        self.gaits = config.texts("gaits")
        speeds = config.table("speeds", 5)
        if len(speeds) != len(self.gaits):
            raise BundleError("manifest, config.speeds: must hold a row for each gait")
        self.slowest, self.fastest = speeds[:, 0], speeds[:, 2:]
        self.speeds = {
            gait: (low, high) for gait, (low, _, high, _, _) in zip(self.gaits, speeds.tolist(), strict=True)
        }
        self.usual = dict(zip(self.gaits, speeds[:, 1].tolist(), strict=True))
        if self.contract.channels != CHANNELS:
            raise BundleError("manifest, motion.channels: must be those of the humanoid, in its order")
        self.sizes |= {"G": len(self.gaits), "F": FEATURES, "J": len(BONES)}
        self._bind()
        self.matcher = self._matcher(config)

    def _bind(self) -> None:
        self.bind("encoder", {"rotations": "batch J 4", "height": "batch 1"}, {"codes": "batch K"})
        rows = {"frames": "batch W", "features": "batch F", "gaits": "batch G", "left": "*batch"}
        self.bind("rows", {"row": "*batch"}, rows)
        self.bind("step", self.loop.inputs, self.loop.outputs)
        codes = self.sizes["K"]
        if self.sizes["W"] != codes + 6:
            raise BundleError(f"manifest, graphs.rows: 'frames' has {self.sizes['W']} numbers, expected {codes + 6}")
        for name, size in {"root": 4, "course": 6, "bend": 2 * codes}.items():
            found = self.graphs["step"].spec.input(name).size(1)
            if found != size:
                raise BundleError(f"manifest, graphs.step: {name!r} has {found} numbers, expected {size}")

    def _matcher(self, config: Fields) -> Matcher:
        mean, scale = config.numbers("mean", FEATURES), config.numbers("scale", FEATURES, low=1e-6)
        count = config.whole("rows", 100, 1 << 20)
        table = Table.of(self.graphs["rows"], count, mean.astype(np.float32), scale.astype(np.float32))
        even, odd = (config.whole(name, 0, 1000) for name in ("even", "odd"))
        if even + odd != self.sizes["K"]:
            raise BundleError(f"manifest, config.even and odd: must be {self.sizes['K']} together, not {even + odd}")
        signs = np.repeat(np.array([1, -1], dtype=np.float32), [even, odd])
        how = config.fields("steering")
        springs = how.number("velocity", 0.01, 10), how.number("facing", 0.01, 10)
        fastest = how.numbers("rates", 2)[1]
        found = Matcher(table, signs, self.fps, config.whole("every", 1, 60), fastest, springs)
        for gait, (rows, *_) in zip(self.gaits, found.goals, strict=True):
            if not len(rows):
                raise BundleError(f"graph rows: the gait {gait!r} has no row that goes on for {found.reserve} more")
        return found

    def start(
        self,
        start: Motion | str | None = None,
        *,
        characters: int = 1,
        places: ArrayLike | None = None,
        hold_feet: bool = True,
        strict: bool = False,
    ) -> SteerSession:
        """A session of ``characters`` figures that stand still, or go on from a motion's last pose.

        start: a gait, by default the first; or a motion of any human figure. places: (characters, 3) x and z in metres
            and facing in degrees; by default all are at the origin and face z.
        hold_feet: keep feet where they stand, by turning hips and knees. strict: refuse a speed that a gait does not
            have, which is brought into its range otherwise.
        ControlError for values out of range, MotionError for a motion that does not fit.
        """
        characters = checked_int("characters", characters, 1, MAX_CHARACTERS, ControlError)
        gait = self.gaits[0] if start is None or isinstance(start, Motion) else start
        playing = self._standing(characters, self.gait(gait))
        session = SteerSession(self, playing, gait, hold_feet, strict)
        if isinstance(start, Motion):
            session.take(self.pose_of(start))
        if places is not None:
            session.put(places)
        return session

    def gait(self, name: str) -> int:
        """The number of a gait; ControlError for one that the model does not have."""
        if name not in self.gaits:
            raise ControlError(f"unknown gait {name!r}; expected one of {', '.join(self.gaits)}")
        return self.gaits.index(name)

    def _standing(self, characters: int, gait: int) -> Playing:
        """Characters that do what is stillest of a gait."""
        table = self.matcher.table
        usable = np.flatnonzero((table.gaits[:, gait] > 0) & (table.left >= self.matcher.reserve))
        still = usable[table.frames[usable, -3].argmin()]
        states = {
            name: np.zeros((characters, self.graphs["step"].spec.input(name).size(1)), dtype=np.float32)
            for name in self.graphs["step"].spec.feedback
        }
        states["root"][:, 3] = 1  # played as fast as it was recorded
        side = np.ones(characters, dtype=np.float32)
        due = np.zeros(characters, dtype=np.int64)  # the same for all: each moves as it would alone
        return Playing(np.full(characters, still, dtype=np.float32), side, due, states)

    def pose_of(self, motion: Motion) -> Pose:
        """The last pose of a motion, at the origin; MotionError for one that is not of a human figure."""
        same = motion if motion.fps == self.fps else motion.continuous().resample(self.fps, to_end=True)
        features = self.contract.features(self.contract.frames(same)[-1:])
        local = joint_rotations(features)
        quats = np.stack([rotmat_to_quat(local[bone]) for bone in BONES], axis=1).astype(np.float32)
        height = features.select(("root.height",)).values[:, 0].astype(np.float32)
        return Pose(np.zeros((1, 3), np.float32), quats, height, np.ones((1, 2), np.float32))

    def run(self, script: str, start: Motion | str | None = None, *, hold_feet: bool = True) -> Motion:
        """The motion of one figure that is steered by a script (:mod:`motet.models.steer_script`).

        start, hold_feet: as :meth:`start`; by default the script's first gait.
        """
        orders = parse_orders(script, self.gaits)
        return self.start(orders[0].gait if start is None else start, hold_feet=hold_feet).run(script)[0]

    def captions(self, script: str) -> list[tuple[float, str]]:
        """See :meth:`ControlModel.captions`."""
        return captions(parse_orders(script, self.gaits))

    def replay(self, given: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """A track (T, 3) of velocities along x and z, m/s, and facings, radians, to frames (T, D)."""
        session = self.start(hold_feet=False)
        poses = [session.tick_to(control[None]) for control in given["track"]]
        return {"frames": session.frames_of(poses)[0]}
