"""What a motion file holds and how it is understood: what to look at first of a file that nobody knows."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from motet.errors import MotionError
from motet.figures.feet.treadmill import IMPLIED, is_in_place
from motet.figures.humanoid import (
    HUMANOID,
    SURE_OF_JOINTS,
    Humanoid,
    ground_under,
    is_mmm,
    leg_length,
    to_humanoid,
    with_figure,
)
from motet.files import Json, place_of
from motet.formats import contents_of, read_motion, split_part
from motet.formats.text import Clip, Figure, choice
from motet.motion.kinematics import global_transforms, heading, positions
from motet.motion.motion import Motion
from motet.motion.skeleton import Names


@dataclass(frozen=True)
class Checked:
    """One clip of a motion file, or all of a file without clips.

    file: its path. clip: its name, None in a file without clips. clips: the names of all clips of the file.
    figure: the name of the skeleton that was asked for, None for the format's default. figures: the names of all
        skeletons of the file; empty where a format names none.
    frames, fps: how many, and how many a second. joints: of the skeleton, 0 where there is none.
    refused: why it is not taken for a human's motion; what follows is then None or empty. None where it is one.
    convention: of the joints' names, or "by the tree". confidence: from 0 to 1, that every joint is what it is taken
        for.
    unit: metres of one unit of the file's lengths. height: metres of the figure, standing straight. None, both, where
        nothing tells the unit; other lengths are then those of an adult.
    facing: degrees by which the figure faces to the left of +z in the first frame; None where it faces up or down.
    ground: metres over y = 0 of the ground that the soles stand on. lowest: the same of the lowest point of the body in
        all frames.
    travel: metres between the ends of the ground that the hips pass over.
    strides: whether its feet stride while its root stays (:func:`motet.motion.is_in_place`), as in clips of games.
    notes: sentences about what was assumed.
    bones: bone of the humanoid -> the names of the joints that it was taken from.
    """

    file: str
    clip: str | None
    clips: Names
    figure: str | None
    figures: Names
    frames: int
    fps: float
    joints: int
    refused: str | None
    convention: str | None = None
    confidence: float | None = None
    unit: float | None = None
    height: float | None = None
    facing: float | None = None
    ground: float | None = None
    lowest: float | None = None
    travel: float | None = None
    strides: bool = False
    notes: Names = ()
    bones: Mapping[str, Names] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """Frames over frames a second."""
        return self.frames / self.fps

    @property
    def sure(self) -> bool:
        """Whether it is a human's motion beyond doubt."""
        return self.confidence is not None and self.confidence >= SURE_OF_JOINTS

    @property
    def in_place(self) -> bool:
        """Whether the figure hardly leaves its place."""
        return self.travel is not None and self.travel < 0.3  # metres

    def to_json(self) -> Json:
        """All fields, and :attr:`seconds`, :attr:`sure` and :attr:`in_place`."""
        return {**asdict(self), "seconds": self.seconds, "sure": self.sure, "in_place": self.in_place}


def check(file: str | Path, *, clip: Clip = None, figure: Figure = None, **options: Any) -> Checked:
    """Look at a motion file, or at one clip or figure of it: "file.glb#Walk", ``clip``, by default the first, and
    ``figure``, by default the one that moves the most.

    options: as :func:`motet.read` takes them. FormatError for what cannot be read; what is read, and is no human's
    motion, has the reason in :attr:`Checked.refused`.
    """
    motion = read_motion(file, clip=clip, figure=figure, **options)
    checked = _described(motion, file, clip, figure, options.get("format"))
    try:
        humanoid = to_humanoid(motion)
    except MotionError as error:
        return replace(checked, refused=str(error))
    ground, lowest = _heights(motion, humanoid)
    strides = is_in_place(motion)
    return replace(
        checked,
        convention=humanoid.convention,
        confidence=humanoid.confidence,
        unit=humanoid.unit,
        height=humanoid.height,
        facing=_facing(humanoid.motion),
        ground=ground,
        lowest=lowest,
        travel=_travel(humanoid),
        strides=strides,
        notes=(*humanoid.notes, IMPLIED) if strides else humanoid.notes,
        bones=humanoid.joints,
    )


def _described(motion: Motion, file: str | Path, clip: Clip, figure: Figure, format: str | None) -> Checked:
    """What a file says of a motion in it; clip and figure as :func:`check` takes them."""
    unnamed, named_clip, named_figure = split_part(file, format)
    clip = named_clip if clip is None else clip
    figure = named_figure if figure is None else figure
    path = place_of(unnamed)
    parts = contents_of(path, format=format)
    # the first clip of several is read where none is named
    if clip is None and figure is None and parts.clips:
        clip = 1
    clip_index, figure_index = choice(path, parts, clip, figure)
    names = tuple(parts.figures)
    return Checked(
        file=str(path),
        clip=None if clip_index is None else parts.clips[clip_index],
        clips=parts.clips,
        figure=None if figure_index is None else names[figure_index],
        figures=names,
        frames=len(motion),
        fps=motion.fps,
        joints=0 if motion.skeleton is None else len(motion.skeleton.joints),
        refused=None,
    )


def _travel(humanoid: Humanoid) -> float:
    """Metres between the ends of the ground that the hips pass over."""
    extent = np.ptp(positions(humanoid.motion)[:, 0], axis=0)
    return float(np.hypot(extent[0], extent[2])) * (humanoid.leg or leg_length()) / leg_length()


def _facing(motion: Motion) -> float | None:
    """Degrees to the left of +z that the hips of the humanoid face in the first frame; None for up or down."""
    forward = global_transforms(motion[:1])[0][0, 0, :, 2]
    level = float(np.hypot(forward[0], forward[2]))  # the sine of the angle from the vertical
    return float(np.degrees(heading(motion[:1])[0])) if level > 0.5 else None


def _heights(motion: Motion, humanoid: Humanoid) -> tuple[float, float]:
    """The ground under the soles and the lowest point of soles and joints, in metres over the file's y = 0."""
    fitted = humanoid.figure.fitted
    turn = humanoid.figure.turn
    rotations = global_transforms(humanoid.motion)[0]
    places = positions(with_figure(motion) if is_mmm(motion) else motion) @ turn.T
    soles = fitted.soles({bone: rotations[:, HUMANOID.index(bone)] for bone in fitted.heights}, places)
    lowest = min(float(places[..., 1].min()), float(soles[..., 1].min()))
    metres = (humanoid.leg or leg_length()) / fitted.leg
    return ground_under(soles) * metres, lowest * metres
