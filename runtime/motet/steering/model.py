"""Steer: figures that follow live controls over the ground."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.bundle.bundle import write_bundle
from motet.bundle.fields import LARGEST_NUMBER, Fields
from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.errors import ArgumentError, BundleError, ControlError, quoted
from motet.figures.feet.treadmill import travelling
from motet.figures.humanoid import BONES
from motet.models.control import LARGEST_CROWD, ControlModel, captions
from motet.motion.motion import Motion
from motet.motion.rotations import rotmat_to_quat
from motet.representation.root_block import way
from motet.representation.root_sixd import ROOT_SIXD, SIXD_KINDS, joint_rotations
from motet.settings import Progress, checked_int, silent
from motet.steering.acts import Act, ActSettings
from motet.steering.avoidance import AvoidanceSettings
from motet.steering.foot_lock import FootLockSettings
from motet.steering.from_clips import Tags, bundled, made_of
from motet.steering.gaits import Gaits
from motet.steering.idle import IdleSettings
from motet.steering.look_layer import LookSettings
from motet.steering.matching import FEATURES, Matcher, Playback, Rows, Table
from motet.steering.paths import ArrivalSettings
from motet.steering.pose import Pose
from motet.steering.reach_layer import ReachSettings
from motet.steering.repertoire import Repertoire, entries
from motet.steering.scripts import parse_orders
from motet.steering.sentence_acts import SaidActs, SentenceModel
from motet.steering.session import SteerSession
from motet.steering.settings import SteeringSettings
from motet.steering.spoken import Reading, words_for
from motet.steering.step import LOOPS, PoseCodes
from motet.steering.stepping import StepSettings
from motet.steering.style_layer import StyleSettings
from motet.steering.styles import STYLE_NAMES
from motet.steering.tables import FEATURE_STEPS
from motet.steering.terrain import TerrainSettings
from motet.steering.turn_limit import TurnSettings
from motet.text.clauses import Shown

SPREAD_FROM = 32
"""Number of characters from which the searches of a session are spread over the ticks."""

POSE_CHANNELS = (*ROOT_SIXD, *(f"{bone}.{kind}" for bone, kind in product(BONES, SIXD_KINDS)))


class SteerModel(ControlModel):
    """A model of a steerable figure; sessions and threads can share it.

    tables: of N rows "codes" (N, K), "moves" (N, 6), "features" (N, F), "shows" (N, G) and "left" (N,), the
        parts of a :class:`motet.steering.matching.Table`; "feature_mean" and "feature_scale" (F,); "pose_mean" (P,) and
        "pose_basis" (K, P), see :class:`motet.steering.step.PoseCodes`.
    """

    LOOPS = LOOPS
    ROLES = ()
    styles = STYLE_NAMES
    """The styles in which figures go, and "none"."""

    SETTINGS = (
        SteeringSettings,
        FootLockSettings,
        StepSettings,
        TerrainSettings,
        ActSettings,
        StyleSettings,
        IdleSettings,
        LookSettings,
        ReachSettings,
        TurnSettings,
        ArrivalSettings,
        AvoidanceSettings,
    )

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        config = Fields(manifest.config, "config")
        settings = self.settings(SteeringSettings)
        self.abilities = Gaits.read(config, settings)
        self.gaits = self.abilities.names
        low, usual, high = (column.tolist() for column in self.abilities.speeds.T[:3])
        self.speeds = dict(zip(self.gaits, zip(low, high, strict=True), strict=True))
        self.usual = dict(zip(self.gaits, usual, strict=True))
        if self.contract.channels != POSE_CHANNELS:
            raise BundleError("manifest, motion.channels: must be those of the humanoid, in its order")
        self.sizes |= {"G": len(self.gaits), "F": FEATURES, "P": 4 * len(BONES) + 1}
        self.matcher = self._matcher(config, settings)
        self.pose_codes = self._pose_codes()

    @classmethod
    def from_clips(
        cls,
        clips: str | Path | Sequence[str | Path],
        *,
        tags: Tags | None = None,
        progress: Progress = silent,
    ) -> "SteerModel":
        """The model of a figure that is steered by motion files of any human figures: no training, some seconds.

        clips: a folder with all below it, or a list of files. Each clip shows what its name says: "walk", "run" (or
            "jog"), "idle" (or "stand", "turn") for all gaits, "jump"; other names, such as "wave_02", are acts by their
            words if they hardly travel, else gaits. A clip in place gets the path that its feet imply, with a
            TravelWarning; one with "loop" in its name is repeated.
        tags: of clips by their name without extension, or a pattern of it; None leaves them out:
            ``{"take_07": "walk, run", "z_*": "limp", "broken": None}``.
        progress: called with the number of clips done and in total.
        FormatError for a folder without motion files; ArgumentError for tags of no clip; MotionError that names the
        clips that cannot be read, are of no human or shorter than 1.5 s, and where nothing walks, or there is more than
        an hour or 2,000 clips.
        """
        manifest, tables = made_of(clips, tags, progress)
        return cls(manifest, {}, tables)

    def save(self, path: str | Path) -> None:
        """Write the model as a bundle, a zip or a new folder, for :func:`motet.load`; OutputError if it cannot be."""
        write_bundle(path, *bundled(self))

    def _pose_codes(self) -> PoseCodes:
        mean = self.table("pose_mean", "P", "float32")
        basis = self.table("pose_basis", "K P", "float16")
        return PoseCodes(mean.astype(np.float64), basis.astype(np.float64))

    def _matcher(self, config: Fields, settings: SteeringSettings) -> Matcher:
        """The search of the table; BundleError for a gait without a row to jump to."""
        matcher = Matcher(self._table(config), settings, self.fps)
        for gait, goals in zip(self.gaits, matcher.goals, strict=True):
            if not len(goals.rows):
                need = matcher.least_left
                raise BundleError(f"table left: no row of {gait!r} is followed by {need} more of its recording")
        return matcher

    def _table(self, config: Fields) -> Table:
        codes = self.table("codes", "N K", "float16")
        moves = self._bounded("moves", "N 6", "float32")
        return Table.of(
            np.concatenate([codes, moves], axis=1, dtype=np.float32),
            (self.table("features", "N F", "int8") / FEATURE_STEPS).astype(np.float32),
            config.whole("odd", 0, self.sizes["K"]),
            shows=self._bounded("shows", "N G", "uint8", 0, 1) > 0,
            left=self._bounded("left", "N", "int32", 0, np.arange(len(codes))[::-1]).astype(np.int64),
            mean=self._bounded("feature_mean", "F", "float32").astype(np.float64),
            scale=self._bounded("feature_scale", "F", "float32", 1e-6).astype(np.float64),
        )

    def _bounded(
        self, name: str, shape: str, dtype: str, low: float = -LARGEST_NUMBER, high: ArrayLike = LARGEST_NUMBER
    ) -> NDArray[Any]:
        """A table whose numbers are within limits, one for all or one for each; BundleError where one is not."""
        table = self.table(name, shape, dtype)
        if not ((table >= low) & (table <= np.asarray(high))).all():
            raise BundleError(f"table {name}: holds a number that is out of range")
        return table

    def start(
        self,
        start: Motion | str | None = None,
        *,
        characters: int = 1,
        places: ArrayLike | None = None,
        hold_feet: bool = True,
        strict: bool = False,
        phases: ArrayLike | None = None,
        words: SentenceModel | SaidActs | None = None,
    ) -> SteerSession:
        """A session of ``characters`` figures that stand still, or continue from a motion's last pose.

        start: a gait, by default the first; or a motion of any human figure. places: (characters, 3) x and z in metres
            and facing in degrees; by default all are at the origin and face z.
        hold_feet: keep planted feet in place, by turning hips and knees. strict: refuse a speed outside a gait's range,
            instead of clamping it, and acts in words where a word is left out.
        phases: a whole number for all or for each, from 0, less than the ``search_every`` of the bundle's settings: the
            ticks until its first search of the table. From then on it searches in its turn alone, every
            ``search_every`` ticks, and commands wait for that. By default the phases of 32 characters or more are 0,
            1, 2 and so on in turn, so that each tick costs the same; fewer search after every command. A character
            moves as it would alone with its phase.
        words: a generate model, which makes the acts of sentences; or its
            :class:`motet.steering.sentence_acts.SaidActs`, which sessions share.
        ControlError for values out of range, MotionError for a motion that does not fit.
        """
        characters = checked_int("characters", characters, 1, LARGEST_CROWD, ControlError)
        gait = self.gaits[0] if start is None or isinstance(start, Motion) else start
        number = self.abilities.number(gait)
        spread = self.phases(characters, phases)
        playback = Playback.at(self.matcher.stillest(number), characters, self.sizes["K"], spread)
        session = SteerSession(self, playback, number, hold_feet, strict, self._sentence_acts(words))
        if isinstance(start, Motion):
            session.take(self.pose_of(start))
        if places is not None:
            session.put(places)
        return session

    def _sentence_acts(self, words: SentenceModel | SaidActs | None) -> SaidActs | None:
        if not (words is None or hasattr(words, "act") or isinstance(words, SentenceModel)):
            raise ArgumentError(f"expected words of a model, such as motet.load('generate'), not {words!r:.60}")
        return SaidActs(self, words) if isinstance(words, SentenceModel) else words

    def phases(self, characters: int, chosen: ArrayLike | None = None) -> Rows | None:
        """The phase of each character; None for those that search after every command."""
        every = self.matcher.settings.search_every
        if chosen is None:
            return np.arange(characters) % every if characters >= SPREAD_FROM else None
        phases = np.asarray(chosen)
        fits = phases.shape in ((), (characters,)) and phases.dtype.kind in "iu"
        if not (fits and (phases >= 0).all() and (phases < every).all()):
            raise ControlError(
                f"phases must be whole numbers from 0 to {every - 1}, for all or for each of {characters}"
            )
        return np.broadcast_to(phases.astype(np.int64), characters)

    def pose_of(self, motion: Motion) -> Pose:
        """The last pose of a motion, at the origin; MotionError for one that is not of a human figure."""
        features = self.contract.features(self.contract.frames(self.at_own_rate(motion))[-1:])
        quats, height = self._bodies(features)
        return Pose(np.zeros((1, 3)), quats, height, np.ones((1, 2), np.float32))

    def act_of(self, motion: Motion, name: str = "act") -> Act:
        """A motion of any human figure as an act: what a session's ``act`` takes, for many characters and often.

        A clip in place gets the path that its feet imply, with a TravelWarning. The rest at both ends is left out.
        MotionError for one that is not of a human figure, ControlError for one of less than three ticks.
        """
        features = self.contract.features(self.contract.frames(self.at_own_rate(travelling(motion))))
        return self._act(name, *self._bodies(features), features.select(ROOT_SIXD[:3]).values)

    @cached_property
    def _repertoire(self) -> Repertoire:
        return Repertoire(self)

    def act_named(self, name: str, side: str = "", tempo: float = 1.0, count: int = 1) -> Act:
        """An act of the repertoire (:mod:`motet.steering.repertoire`) by its name; with a hand or foot, or to a side,
        "left" or "right"; so many times as fast; so often in a row. ControlError for another name."""
        if name not in entries():
            raise ControlError(f"there is no act {quoted(name)}; session.say finds the nearest names")
        return self._repertoire.act(name, side, tempo, count)

    def read_said(self, text: str) -> Reading:
        """What a sentence is read as, for :meth:`motet.steering.session.SteerSession.say`."""
        return words_for(tuple(gait for gait in self.gaits if self.usual[gait])).read(text)

    def act_said(self, sentence: str) -> tuple[Act, Shown] | None:
        """The act that a sentence names in all its words, and what it is shown as; None for any other sentence."""
        steps = self.read_said(sentence).steps
        if len(steps) != 1 or steps[0].kind != "act" or steps[0].lacking:
            return None
        (step,) = steps
        return self.act_named(step.name, step.side, step.tempo, step.count), Shown(step.caption, (), 1.0)

    @cached_property
    def takes(self) -> dict[str, tuple[Act, ...]]:
        """The recordings of gaits that go nowhere, such as "jump", as acts, by the gait's name."""
        table = self.matcher.table
        takes = dict[str, tuple[Act, ...]]()
        for gait, name in enumerate(self.gaits):
            if not self.usual[name]:
                rows = np.flatnonzero(table.shows[:, gait])
                recordings = np.split(rows, np.flatnonzero(table.left[rows] == 0)[:-1] + 1)
                takes[name] = tuple(self._take(name, table.frames[0, recording]) for recording in recordings)
        return takes

    def _take(self, name: str, frames: Floats) -> Act:
        """Frames (T, K + 6) of the table as an act."""
        quats, height = self.pose_codes.decode(frames[:, :-6].astype(np.float64))
        return self._act(name, quats, height, frames[:, -6:-3])

    def _act(self, name: str, quats: Floats, height: Floats, velocities: NDArray[Any]) -> Act:
        """An act of quaternions (T, J, 4), heights (T,) of the hips and velocities (T, 3): forward, left and turn."""
        facing, x, z = way(velocities / self.fps)
        numbers = np.column_stack([quats.reshape(len(quats), -1), x, z, facing, height]).astype(np.float32)
        return Act.of(name, numbers, self.fps, self.settings(ActSettings))

    def _bodies(self, features: Motion) -> tuple[Floats, Floats]:
        """Quaternions (T, J, 4) and the hips' height (T,) of features."""
        local = joint_rotations(features)
        quats = np.stack([rotmat_to_quat(local[bone]) for bone in BONES], axis=1).astype(np.float32)
        return quats, features.select(("root.height",)).values[:, 0].astype(np.float32)

    def run(
        self,
        script: str,
        start: Motion | str | None = None,
        *,
        hold_feet: bool = True,
        words: SentenceModel | SaidActs | None = None,
    ) -> Motion:
        """The motion of one figure that is steered by a script (:mod:`motet.steering.scripts`).

        start, hold_feet, words: like :meth:`start`; by default the script's first gait.
        """
        orders = parse_orders(script, self.gaits)
        first = orders[0].gait if start is None else start
        return self.start(first, hold_feet=hold_feet, words=words).run(script)[0]

    def captions(self, script: str) -> list[tuple[float, str]]:
        """See :meth:`ControlModel.captions`."""
        return captions(parse_orders(script, self.gaits))

    def replay(self, inputs: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """A track (T, 3) of velocities along x and z, m/s, and facings, radians, to frames (T, D)."""
        session = self.start(hold_feet=False)
        poses = [session.tick_to(target[None]) for target in inputs["track"].astype(np.float64)]
        return {"frames": session.frames_of(poses)[0]}
