"""motet as a server of the Motion Model Context Protocol (MMCP), which Blender's add-on Proscenium and others speak.

The protocol's own SDK, which the extra ``mmcp`` installs, checks requests and writes glTF. Here a time line of prompts
becomes a story, and constraints become keys that the motion passes through (docs/blender.md).
"""

import asyncio
import math
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np

from motet.composition.compose import GROUND, KEY_POSE_SECONDS, compose
from motet.composition.keys import Key, Moves
from motet.composition.plans import MOMENT_SECONDS, Moment
from motet.errors import DecodingError, MotetError, MotionError
from motet.figures.humanoid import HUMANOID, Figure, from_humanoid, leg_length
from motet.generate.model import CodesModel
from motet.motion import heading
from motet.motion.kinematics import chained, local_rotations, local_translations, motion_of
from motet.motion.motion import Motion, spline
from motet.motion.rotations import Array, identities, quat_to_rotmat, rotmat_to_quat
from motet.motion.skeleton import Joint, Skeleton
from motet.predict.fill import LOOP_SECONDS, FillModel
from motet.representation.placed import placed, unplaced
from motet.serve.answers import unwarned
from motet.steering.model import SteerModel

try:
    from fastapi import FastAPI
    from motionmcp import Backbone, GenerateRequest, ModelSpec, MotionResult, build_app, schemas
    from motionmcp.backbone import Limits
    from motionmcp.errors import ProtocolError
except ImportError as error:
    raise ImportError("motet.serve.mmcp needs motionmcp: install the extra with  pip install 'motet[mmcp]'") from error

IDLE_PROMPT = "a person stands still"
"""What is shown where a segment has no prompt."""

LEAST_FPS = 1.0
LARGEST_FPS = 240.0
"""Frames a second."""

MOST_ROTATIONS = 4_000_000
"""Rotations of a response: frames, times joints, times samples."""

Keys = Mapping[int, Key]
"""Frame -> what the figure is to be there."""


def mmcp_app(model: CodesModel, fill: FillModel, steer: SteerModel) -> FastAPI:
    """The ASGI application of an MMCP server whose prompts ``model`` shows, where ``fill`` goes between key poses, and
    ``steer`` along root paths.

    ImportError with the remedy where the SDK is missing.
    """
    application: FastAPI = build_app(MotetBackbone(model, fill, steer), title="motet")
    # FastAPI's manuals load scripts from another site; /mmcp/openapi.json says the same
    manuals = {application.docs_url, application.redoc_url, application.swagger_ui_oauth2_redirect_url}
    routes = application.router.routes
    application.router.routes = [route for route in routes if getattr(route, "path", "") not in manuals]
    return application


class MotetBackbone(Backbone):  # type: ignore[misc]  # the SDK has no types
    """What the SDK asks: what this server can do, and a motion for a request."""

    model_id = "motet"

    def __init__(self, model: CodesModel, fill: FillModel, steer: SteerModel) -> None:
        self.model = model
        self.fill = fill
        self.steer = steer

    def capabilities(self) -> ModelSpec:
        """See the SDK: no end effectors, no ground but a flat one, one seed for a whole time line."""
        return self._spec

    @cached_property
    def _spec(self) -> ModelSpec:
        joints = [_joint(HUMANOID, i) for i in range(len(HUMANOID.joints))]
        return ModelSpec(
            id=self.model_id,
            fps=self.fill.fps,
            canonical_skeleton=schemas.Skeleton(joints=joints),
            supports_retargeting=True,
            supports_loop=True,
            supported_constraints=["root_path", "pose_keyframe"],
            supported_guidance_types=["nocfg"],
            recommended_max_duration_seconds=30.0,
            limits=Limits(max_duration_seconds=60.0, max_num_samples=8),
        )

    async def generate(self, request: GenerateRequest) -> MotionResult:
        """A motion for a request, in a thread; ProtocolError for one that cannot be answered."""
        return await asyncio.to_thread(unwarned(self.answer), request)

    def answer(self, request: GenerateRequest) -> MotionResult:
        """See :meth:`generate`."""
        fps = request.fps(self.fill.fps)
        options = request.options or schemas.Options()
        _check(request, fps, options)
        with _refused("invalid_skeleton"):
            figure = _figure(request.skeleton)
        with _refused("invalid_request"):
            keys = _keys(request, figure.posture[0])
            seed = secrets.randbits(32) if options.seed is None else options.seed
            takes = [self._take(request, fps, figure, keys, seed + i) for i in range(options.num_samples)]
        turns, roots = (np.stack(part) for part in zip(*takes, strict=True))
        return MotionResult(
            rotations=rotmat_to_quat(turns).astype(np.float32),
            root_translations=roots.astype(np.float32),
            notes=self._notes(request, seed),
        )

    def _take(self, request: GenerateRequest, fps: float, figure: Figure, keys: Keys, seed: int) -> tuple[Array, Array]:
        """A sample: rotations (T, J, 3, 3) of the figure's joints and places (T, 3) of its root."""
        if not request.segments:
            motion = self._between(figure, keys, request.total_frames, fps)
        elif request.options and request.options.loop:
            motion = self._loop(request.segments[0], request.total_frames, fps, seed)
        else:
            motion = self._shown(request, fps, _steps(keys, figure), seed)
        moves = _on_figure(motion, figure).through(keys, round(KEY_POSE_SECONDS * fps))
        return moves.turns, moves.root

    def _shown(self, request: GenerateRequest, fps: float, steps: Mapping[int, Moment], seed: int) -> Motion:
        """The prompts as a story; with places on the way as a composition, whose walks are steered there."""
        texts = [getattr(segment, "prompt", IDLE_PROMPT) for segment in request.segments]
        seconds = [segment.duration_frames / fps for segment in request.segments]
        seconds[-1] += 2 / self.model.fps  # what the last frame is interpolated from
        # places on the way are walked to
        if steps.keys() - {0}:
            starts = accumulate(seconds, initial=0.0)
            prompts = [Moment(at, text) for at, text in zip(starts, [*texts, None], strict=True)]
            plan = _line(prompts, steps, fps, self.model.fps)
            composed = compose(self.model, plan, steer=self.steer, seed=seed)
            return composed.motion.resample(fps)[: request.total_frames]
        # prompts alone are a story
        plant = request.options is None or request.options.post_processing
        story = self.model.story(texts, seconds=seconds, seed=seed)
        return story.playable(fps, plant)[: request.total_frames]

    def _loop(self, segment: schemas.TextSegment, frames: int, fps: float, seed: int) -> Motion:
        """A cycle that ends as it began, at another place: the last half second leads back."""
        whole = max(2, round((frames - 1) / fps * self.fill.fps))
        gap = min(round(LOOP_SECONDS * self.fill.fps), whole // 3)
        # a story, whose last part is filled from its end to its beginning
        drawn = whole - gap
        prompt = getattr(segment, "prompt", IDLE_PROMPT)
        seconds = (drawn + 2) / self.fill.fps
        motion = self.model.story(prompt, seconds=seconds, seed=seed).playable(self.fill.fps)[:drawn]
        known = placed(motion)
        again = _begun_again(known, self.fill.context, gap)
        cycle = np.concatenate([known, self.fill.frames_between(known, again, gap), again[:1]])
        return unplaced(spline(cycle, np.linspace(0, whole, frames)), replace(motion[:1], fps=fps))

    def _between(self, figure: Figure, keys: Keys, frames: int, fps: float) -> Motion:
        """A way from key pose to key pose; before the first and after the last the figure holds it."""
        posed = {frame: key for frame, key in sorted(keys.items()) if key.turns}
        if len(posed) < 2:
            raise MotionError("without a prompt, motet goes from key pose to key pose: give two, or a prompt")
        motion = _humanoid(figure, posed, fps)
        poses = placed(motion)
        # the first pose is held until its frame, then each gap is filled, then the last is held
        pieces = [np.repeat(poses[:1], min(posed), axis=0)]
        for (start, stop), (before, after) in zip(pairwise(posed), pairwise(poses), strict=True):
            if (stop - start) / fps > self.fill.seconds:
                far = f"the key poses of frames {start} and {stop} are {(stop - start) / fps:.2g} s apart"
                raise MotionError(f"{far}, and at most {self.fill.seconds:g} s are filled: add one, or a prompt")
            pieces.append(self._way(before, after, stop - start, fps))
        pieces.append(np.repeat(poses[-1:], frames - max(posed), axis=0))
        return unplaced(np.concatenate(pieces), motion[:1])

    def _way(self, before: Array, after: Array, frames: int, fps: float) -> Array:
        """From one pose (D,) up to another, which is not in it: (frames, D)."""
        seconds = frames / fps
        span = seconds * self.fill.fps
        count = max(0, round(span) - 1)
        held_before = np.repeat(before[None], self.fill.least, axis=0)
        held_after = np.repeat(after[None], self.fill.least, axis=0)
        inner = self.fill.frames_between(held_before, held_after, count, span / (count + 1))
        way = np.concatenate([before[None], inner, after[None]])
        return spline(way, np.arange(frames) / frames * (count + 1))

    def _notes(self, request: GenerateRequest, seed: int) -> list[dict[str, str]]:
        """What the client cannot see: the seed that was drawn, and what was not understood."""
        notes = [("seed", "info", f"drawn with the seed {seed}")]
        # each prompt once: words left out, unknown words, prompts unlike the training data
        for text in dict.fromkeys(getattr(segment, "prompt", IDLE_PROMPT) for segment in request.segments):
            understood = self.model.understood(text)
            unknown = self.model.unknown(text)
            shown = self.model.likeliest(text)
            if shown.lacking:
                notes.append(("left_out", "warning", shown.left_out(text)))
            if unknown:
                notes.append(("unknown_words", "warning", f"{text!r}: unknown words: {', '.join(unknown)}"))
            if not understood.confident:
                near = ", ".join(map(repr, understood.nearest))
                notes.append(("unfamiliar", "warning", f"{text!r} is outside the training data; nearest: {near}"))
        if request.options and request.options.guidance and request.options.guidance.type != "nocfg":
            notes.append(("guidance", "info", "guidance is the model's own: the request's is not used"))
        return [dict(zip(("code", "severity", "message"), note, strict=True)) for note in notes]


def _begun_again(frames: Array, count: int, gap: int) -> Array:
    """The first ``count`` frames (T, D) once more, ``gap`` frames after the last, at the pace of both ends."""
    steps = np.diff(frames[:, GROUND], axis=0)
    metres_per_frame = (steps[-5:].mean(axis=0) + steps[:5].mean(axis=0)) / 2
    again = frames[:count].copy()
    again[:, GROUND] += frames[-1, GROUND] + (gap + 1) * metres_per_frame - frames[0, GROUND]
    return again


def _check(request: GenerateRequest, fps: float, options: schemas.Options) -> None:
    """ProtocolError for what the SDK does not check."""
    size = request.total_frames * len(request.skeleton.joints) * options.num_samples
    for wrong, code, message in (
        (
            not LEAST_FPS <= fps <= LARGEST_FPS,
            "invalid_options",
            f"timing.fps must be from {LEAST_FPS:g} to {LARGEST_FPS:g}",
        ),
        (
            size > MOST_ROTATIONS,
            "invalid_options",
            f"frames x joints x samples must be at most {MOST_ROTATIONS:,}, not {size:,}",
        ),
        (
            any(segment.seed is not None for segment in request.segments),
            "invalid_options",
            "a time line is drawn from one seed: give options.seed, and none to segments",
        ),
        (
            options.loop and (bool(request.constraints) or request.total_frames < LEAST_FPS * fps),
            "invalid_options",
            "a loop takes a second or more, and no constraints",
        ),
        (
            any(abs(abs(joint.rest_rotation[3]) - 1) > 1e-4 for joint in request.skeleton.joints),
            "invalid_skeleton",
            "rest_rotation must be [0, 0, 0, 1]: the rest pose is that of the rest_translations",
        ),
    ):
        if wrong:
            raise ProtocolError(code, message)


@contextmanager
def _refused(code: str) -> Iterator[None]:
    """motet's errors as the protocol's."""
    try:
        yield
    except DecodingError as error:
        raise ProtocolError("invalid_options", str(error)) from error
    except MotetError as error:
        raise ProtocolError(code, str(error)) from error


def _joint(skeleton: Skeleton, index: int) -> schemas.Joint:
    joint = skeleton.joints[index]
    parent = None if index == 0 else skeleton.names[joint.parent]
    return schemas.Joint(name=joint.name, parent=parent, rest_translation=joint.offset, rest_rotation=(0, 0, 0, 1))


def _figure(skeleton: schemas.Skeleton) -> Figure:
    """The client's figure; MotionError where it is no human's."""
    at = {joint.name: place for place, joint in enumerate(skeleton.joints)}
    joints = [Joint(joint.name, at.get(joint.parent, -1), joint.rest_translation) for joint in skeleton.joints]
    return replace(Figure.of(Skeleton(tuple(joints), 1.0)), ground=0.0)


def _keys(request: GenerateRequest, skeleton: Skeleton) -> Keys:
    """What the constraints ask for, by frame; MotionError where they contradict each other or hold no number."""
    keys: dict[int, Key] = {}

    def add(frame: int, key: Key) -> None:
        keys[frame] = key.joined(keys[frame]) if frame in keys else key

    # poses, and places on the ground with or without a facing
    for constraint in request.constraints:
        if constraint.type == "pose_keyframe":
            add(constraint.frame, _pose(constraint, skeleton))
            continue
        facing = constraint.heading_radians or [np.nan] * len(constraint.frames)
        if not np.isfinite([*np.ravel(constraint.positions_xz), *(constraint.heading_radians or ())]).all():
            raise MotionError("root_path: positions and headings must be finite numbers")
        for frame, (x, z), angle in zip(constraint.frames, constraint.positions_xz, facing, strict=True):
            add(frame, Key(place=np.array([x, np.nan, z]), facing=angle))
    return keys


def _pose(constraint: schemas.PoseKeyframeConstraint, skeleton: Skeleton) -> Key:
    """A key pose; MotionError for a rotation or a place that is none."""
    where = f"pose_keyframe of frame {constraint.frame}"
    # joints that are not given are free, or at rest
    turns = {} if constraint.fill_mode == "generate" else dict.fromkeys(range(len(skeleton.joints)), np.eye(3))
    for name, quat in constraint.joint_rotations.items():
        length = float(np.linalg.norm(quat))
        if not 1e-3 < length < 1e3:  # NaN is neither
            raise MotionError(f"{where}: {name!r}: {list(quat)} is no rotation")
        turns[skeleton.index(name)] = quat_to_rotmat(np.array(quat) / length)
    place = np.full(3, np.nan) if constraint.root_position is None else np.array(constraint.root_position)
    if constraint.root_position is not None and not np.isfinite(place).all():
        raise MotionError(f"{where}: root_position must be finite numbers")
    return Key(turns, place)


def _steps(keys: Keys, figure: Figure) -> dict[int, Moment]:
    """Where a root path goes, by frame, at the humanoid's size; where the figure faces first."""
    scale = leg_length() / figure.fitted.leg
    moments = {}
    for frame, key in keys.items():
        if np.isfinite(key.place[[0, 2]]).all():
            x, z = (scale * key.place[[0, 2]]).tolist()
            facing = None if frame or np.isnan(key.facing) else math.degrees(key.facing)
            moments[frame] = Moment(0, place=(x, z), facing=facing)
    return moments


def _line(prompts: Sequence[Moment], steps: Mapping[int, Moment], fps: float, rate: float) -> list[Moment]:
    """Prompts and the steps of a path in order of time; a step that is nearly at the time of a moment joins it."""
    line = {moment.at: moment for moment in prompts}
    for frame, step in sorted(steps.items()):
        at = frame / fps + 1 / rate if frame else 0.0  # a moment's frame is the last one before it
        at = next((time for time in line if abs(time - at) < MOMENT_SECONDS), at)
        moment = line.get(at, Moment(at))
        line[at] = moment if moment.place else replace(moment, place=step.place, facing=step.facing)
    return [line[at] for at in sorted(line)]


def _humanoid(figure: Figure, keys: Keys, fps: float) -> Motion:
    """Key poses of the client's figure, one after the other, as a motion of the humanoid; joints that are not given
    are at rest, and a root that is not stays where it was."""
    skeleton = figure.posture[0]
    at = figure.posture[0].offsets[0]
    turns = identities(len(keys), len(skeleton.joints))
    places = np.tile(skeleton.offsets, (len(keys), 1, 1))
    for number, key in enumerate(keys.values()):
        for joint, turn in key.turns.items():
            turns[number, joint] = turn
        at = np.where(np.isnan(key.place), at, key.place)
        places[number, 0] = at
    turned, places = chained(skeleton, turns, places)
    return figure.to_humanoid(motion_of(skeleton, turned, {0: places[:, 0]}, fps))


def _on_figure(motion: Motion, figure: Figure) -> Moves:
    """A motion of the humanoid on the client's figure, whose root alone moves: joints above the hips do not turn."""
    put = from_humanoid(motion, figure)
    skeleton = figure.posture[0]
    root = skeleton.offsets[0] + (local_translations(put) - skeleton.offsets).sum(axis=1)
    return Moves(local_rotations(put), root, heading(motion))
