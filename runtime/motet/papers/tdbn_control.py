"""Control: one figure or thousands, moved tick by tick by control values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.loop import RowNoise, RowsOfNoise
from motet.errors import BundleError, ControlError, DecodingError, MotionError
from motet.models.control import LARGEST_CROWD, ControlModel, captions
from motet.motion.kinematics import without_heading
from motet.motion.motion import TURN, Motion
from motet.papers.control_script import control_track, parse_segments
from motet.papers.gibbs_chain import LOOPS, tick
from motet.papers.lookahead import Ahead, Lookahead, LookaheadSettings
from motet.settings import Seed, checked_int, seeds_of


class TdbnModel(ControlModel):
    """A model of labelled motions that runs live; sessions and threads can share it. The step of a model with free
    hidden units also takes codes."""

    LOOPS = LOOPS
    SETTINGS = (LookaheadSettings,)

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        if manifest.control is None:
            raise BundleError("manifest, control: is missing")
        self.encoder = graphs["encoder"]
        self.stepper = graphs["step"]
        self.labels = manifest.control.labels
        self.starts = manifest.control.starts
        self.has_free_units = self.stepper.spec.takes("codes")
        self.sizes["L"] = len(self.labels)
        self._bind_graphs()
        self.taps = self.sizes["K"]
        self.codes = self.sizes["H"]
        turns = np.array([TURN.get(unit, np.inf) for unit in self.contract.units], dtype=np.float32)
        self.lookahead = Lookahead(self.settings(LookaheadSettings), self.fps, turns)
        self._check_starts()

    def _bind_graphs(self) -> None:
        self.bind("encoder", {"frames": "batch D"}, {"codes": "batch H"})
        free = {"codes": "batch H"} if self.has_free_units else {}
        self.bind("step", {**self.loop.inputs, **free}, self.loop.outputs)
        if "history" not in self.stepper.spec.feedback:
            raise BundleError("manifest, graphs.step.feedback: no output is fed back to 'history'")

    def _check_starts(self) -> None:
        for label, frames in self.starts.items():
            if len(frames) != self.taps:
                raise BundleError(f"manifest, control.starts.{label}: must hold {self.taps} frames, not {len(frames)}")

    def encode(self, frames: ArrayLike) -> Floats:
        """Frames (B, D) in the contract's units to codes (B, H) float32."""
        return self.encoder({"frames": np.asarray(frames, dtype=np.float32)})["codes"]

    def start(
        self,
        start: Motion | str | None = None,
        *,
        characters: int = 1,
        seed: Seed = 0,
        variety: float = 0.0,
        temperature: float | None = None,
        iterations: int | None = None,
        smooth: bool = True,
    ) -> "TdbnSession":
        """A session of ``characters`` figures with the same start.

        start: a label of the model, or a motion to continue from its last frames; by default the first label. A
            label is also the first control; after a motion, set one before the first step.
        seed: of the noise. Character i has seed + i (or seed[i]) and moves as it would alone with that seed.
        variety: 0 runs on probabilities, always the same; 1 draws binary codes; values between blend the two.
        temperature: of the sigmoid, the bundle's by default; lower is more deterministic.
        iterations: Gibbs iterations for each frame, by default as many as the bundle's; more than 1 only in models
            with free hidden units.
        smooth: show frames that do not tremble more than recorded ones (:mod:`motet.papers.lookahead`), not those of
            the net itself. The net runs the same.
        Raises ControlError for values out of range, MotionError for a motion that does not fit.
        """
        characters = checked_int("characters", characters, 1, LARGEST_CROWD, ControlError)
        seeds = seeds_of(seed, characters, ControlError)
        first, label = self._begun(start)
        settings = self._settings(variety, temperature, iterations)
        session = TdbnSession(self, first, seeds, settings, smooth)
        if label is not None:
            session.control(**{label: 1.0})
        return session

    def run(
        self,
        script: str,
        start: Motion | str | None = None,
        *,
        seed: Seed = 0,
        variety: float = 0.0,
        temperature: float | None = None,
        in_place: bool = False,
        smooth: bool = True,
    ) -> Motion:
        """The motion of one figure that runs a control script, starting from its first label unless ``start`` is given.
        The parameters are those of :meth:`start` and :meth:`TdbnSession.run`."""
        first = parse_segments(script, self.labels)[0].start
        begin = max(first, key=first.__getitem__) if start is None else start
        session = self.start(begin, seed=seed, variety=variety, temperature=temperature, smooth=smooth)
        return session.run(script, in_place)[0]

    def captions(self, script: str) -> list[tuple[float, str]]:
        """See :meth:`ControlModel.captions`."""
        return captions(parse_segments(script, self.labels))

    def replay(self, inputs: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """From the start of the first label, at variety 1: a track (T, labels) and noise (T, N) to frames (T, D). With
        several iterations a tick (of the settings), each tick has that many rows of noise."""
        session = self.start(variety=1.0, iterations=settings.get("iterations"), smooth=False)
        session.noise = RowsOfNoise(inputs["noise"])
        return {"frames": session.frames(inputs["track"])[0]}

    def _begun(self, start: Motion | str | None) -> tuple[Floats, str | None]:
        """The frames (K, D) that a session begins from, and the label that they show; None after a motion."""
        if not isinstance(start, Motion):
            label = self.labels[0] if start is None else start
            if label not in self.starts:
                raise ControlError(f"cannot start from {label!r}; expected one of {', '.join(self.starts)}")
            return np.asarray(self.starts[label], dtype=np.float32), label
        last = self.contract.on_figure(start.continuous().resample(self.fps, to_end=True))[-self.taps :]
        if len(last) < self.taps:
            raise MotionError(f"a start needs {self.taps} frames at {self.fps:g} fps, this motion has {len(last)}")
        # levelled by themselves: where the figure faced long before says nothing about where it faces now
        return self.contract.frames(without_heading(last)).astype(np.float32), None

    def _settings(self, variety: float, temperature: float | None, iterations: int | None) -> dict[str, float]:
        if not 0 <= variety <= 1:
            raise ControlError(f"variety must be between 0 and 1, not {variety}")
        try:
            chosen = self.loop.settled(self.defaults, {"temperature": temperature, "iterations": iterations})
        except DecodingError as error:
            raise ControlError(str(error)) from error
        if chosen["iterations"] > 1 and not self.has_free_units:
            raise ControlError("iterations must be 1 in a model without free hidden units")
        return {**chosen, "variety": variety}


@dataclass(frozen=True, eq=False, repr=False)
class TdbnSnapshot:
    """All that changes in a session, for n characters: the frames (K, n, D) that it began from, history (n, K, H),
    control (n, labels), the tick, and the look-ahead of a smooth session."""

    first: Floats
    history: Floats
    control: Floats
    tick: int
    ahead: Ahead | None = None

    def __repr__(self) -> str:
        return f"TdbnSnapshot({len(self.history)} characters, tick {self.tick})"


class TdbnSession:
    """Characters that move in one batch, each with its own control; holds their whole state."""

    def __init__(
        self, model: TdbnModel, first: Floats, seeds: Sequence[int], settings: Mapping[str, float], smooth: bool
    ) -> None:
        """first: the frames (K, D) that all characters continue from, one character for each seed."""
        self.model = model
        self.smooth = smooth
        self.characters = len(seeds)
        self.iterations = int(settings["iterations"])
        self._first = np.repeat(first[:, None], self.characters, axis=1)
        self._history = np.repeat(model.encode(first)[None], self.characters, axis=0)
        self._ahead: Ahead | None = None
        self._tick = 0
        width = model.stepper.spec.input("noise").size(1)
        column = np.ones((self.characters, 1), dtype=np.float32)
        self._inputs: dict[str, Floats] = {
            "control": np.zeros((self.characters, len(model.labels)), dtype=np.float32),
            "variety": column * np.float32(settings["variety"]),
            "temperature": column * np.float32(settings["temperature"]),
            "noise": np.zeros((self.characters, width), dtype=np.float32),
        }
        is_random = settings["variety"] > 0  # without, noise has no effect: any array will do
        self.noise: RowNoise | RowsOfNoise | None = RowNoise(seeds, width) if is_random else None

    def __repr__(self) -> str:
        return f"TdbnSession({self.characters} characters, tick {self._tick}, {self.model!r})"

    def control(self, **values: ArrayLike) -> None:
        """Set the control from now on: labels to numbers, or arrays (characters,), between 0 and 1. Labels not named
        become 0. ControlError for an unknown label or a value out of range; the control is unchanged then."""
        unknown = sorted(values.keys() - set(self.model.labels))
        if unknown:
            raise ControlError(f"unknown control {', '.join(unknown)}; expected one of {', '.join(self.model.labels)}")
        control = np.zeros((self.characters, len(self.model.labels)), dtype=np.float32)
        for label, value in values.items():
            try:
                control[:, self.model.labels.index(label)] = value
            except (TypeError, ValueError) as error:
                needed = f"a number or one for each of {self.characters} characters"
                raise ControlError(f"control {label!r} needs {needed}") from error
        self.set_control(control)

    def set_control(self, control: ArrayLike) -> None:
        """Set the control (labels,) or (characters, labels) from now on, in the order of ``model.labels``."""
        wanted = np.asarray(control, dtype=np.float32)
        if wanted.ndim == 0 or wanted.shape[-1] != len(self.model.labels):
            raise ControlError(f"a control needs one value for each of {', '.join(self.model.labels)}")
        if not ((wanted >= 0) & (wanted <= 1)).all():
            raise ControlError("control values must be between 0 and 1")
        if wanted.shape[:-1] not in ((), (1,), (self.characters,)):
            raise ControlError(f"a control of shape {wanted.shape} does not fit {self.characters} characters")
        self._inputs["control"] = np.array(np.broadcast_to(wanted, (self.characters, wanted.shape[-1])))

    def step(self) -> Floats:
        """One tick: the next frame (characters, D) float32, in the units of ``model.contract``."""
        if self.smooth:
            control = self._inputs["control"]
            lookahead = self.model.lookahead
            now = self._ahead or lookahead.begun(self._run, self._history, self._first, control)
            self._ahead = lookahead.ticked(now, self._run, control)
            frame = self._ahead.shown.copy()
            self._history = self._ahead.histories[0]
        else:
            frame, self._history = self._run(self._history, 0)
        self._tick += 1
        return frame

    def _run(self, history: Floats, later: int) -> tuple[Floats, Floats]:
        """The net's frame (characters, D) after a history, and the next history, ``later`` ticks from now."""
        calls = count((self._tick + later) * self.iterations)

        def inputs() -> Arrays:
            if self.noise is not None:
                self._inputs["noise"] = self.noise.at(next(calls))
            return self._inputs

        return tick(self.model.stepper, history, inputs, self.iterations)

    def run(self, script: str, in_place: bool = False) -> list[Motion]:
        """Run a control script (:mod:`motet.steering.scripts`) for all characters; one motion for each. The root's path
        follows from the feet on the ground; ``in_place`` leaves it out."""
        segments = parse_segments(script, self.model.labels)
        frames = self.frames(control_track(segments, self.model.labels, self.model.fps))
        return [self.model.contract.motion(character, plant=not in_place) for character in frames]

    def frames(self, track: ArrayLike) -> Floats:
        """Run a control track (T, labels) or (T, characters, labels): frames (characters, T, D) float32."""
        controls = np.asarray(track, dtype=np.float32)
        channels = len(self.model.contract.channels)
        frames = np.empty((self.characters, len(controls), channels), dtype=np.float32)
        for place, control in enumerate(controls):
            self.set_control(control)
            frames[:, place] = self.step()
        return frames

    def snapshot(self) -> TdbnSnapshot:
        """Frames, control and tick, without the noise: a session that continues from it uses its own seeds."""
        return TdbnSnapshot(self._first, self._history.copy(), self._inputs["control"].copy(), self._tick, self._ahead)

    def restore(self, snapshot: TdbnSnapshot) -> None:
        """Go back to a snapshot of this session or of one with as many characters of the same model. The same frames
        follow, except for random draws in a session of other seeds."""
        if snapshot.history.shape != self._history.shape:
            raise ControlError(f"a snapshot of history {snapshot.history.shape} does not fit {self._history.shape}")
        if self.smooth and snapshot.tick and snapshot.ahead is None:
            raise ControlError("a snapshot of a session that is not smooth does not fit one that is")
        self.set_control(snapshot.control)
        self._first = snapshot.first
        self._tick = snapshot.tick
        self._history = np.array(snapshot.history, dtype=np.float32)
        self._ahead = snapshot.ahead if self.smooth else None
