"""What a server can be asked: the addresses, their settings and files, by which requests are read and documented."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from motet.figures.humanoid import RIGS
from motet.generate.model import Stand
from motet.motion.skeleton import METRES
from motet.serve.request import Parameter
from motet.serve.uploads import TAKES

DRAWING_PARAMETERS = {
    "text": Parameter("texts", "A sentence, such as 'a person walks and turns left'; of a story, one after the other."),
    "seed": Parameter("whole", "Seed, 0 by default: the same seed gives the same motion."),
    "seconds": Parameter(
        "numbers", "Length in seconds, of a story one for each sentence. By default it ends by itself."
    ),
    "max_seconds": Parameter("number", "Length at which a motion that does not end is cut."),
    "temperature": Parameter("number", "Sampling temperature."),
    "top_p": Parameter("number", "Nucleus sampling: draw from the likeliest codes up to this mass."),
    "stand": Parameter("text", "Start or end in standing.", get_args(Stand)),
    "whole": Parameter("flag", "Do not split a text that asks for several things in a row."),
    "strict": Parameter("flag", "Refuse a sentence that the model knows only in part."),
}
SHAPING = {
    "like": Parameter(
        "text", "Put the motion on the skeleton of a rig; as a file of a form, on that of a character.", RIGS
    ),
    "fps": Parameter("number", "Frame rate of the answer."),
    "in_place": Parameter("flag", "Remove horizontal travel; height and turns stay."),
}
READING = {
    "format": Parameter(
        "text", "Type of the file, where its name does not say it.", tuple(extension[1:] for extension in TAKES)
    ),
    "clip": Parameter("text", "Clip of a file with several: its name, or its number from 1."),
    "figure": Parameter("text", "Skeleton of a file with several: its name, or its number from 1."),
    "unit_in": Parameter("text", "Length unit of a file that does not state it.", tuple(METRES)),
    "partial": Parameter("flag", "Take the complete frames of a truncated file."),
}
FILE_PARAMETERS = {
    "file": f"A motion of any human figure ({' '.join(TAKES)}).",
    "after": "A motion to continue.",
    "like": "A character whose skeleton takes the motion.",
    "onto": "A character (.glb, .gltf with all data in it, .vrm), which comes back with its mesh and the motion.",
}


@dataclass(frozen=True)
class Door:
    """An address: what it gives, and the settings and files that it takes. formats: whether its extension is one of an
    answer's formats. methods: of HTTP."""

    path: str
    name: Literal["generate", "stream", "describe", "predict"]
    help: str
    parameters: dict[str, Parameter]
    files: tuple[str, ...] = ()
    formats: bool = False
    methods: tuple[str, ...] = field(default=("GET", "POST"))


DOORS = (
    Door(
        "/generate.{format}",
        "generate",
        "The motion of a sentence, like `motet generate`.",
        {
            **DRAWING_PARAMETERS,
            "story": Parameter("flag", "Several sentences become one motion, in their order."),
            "loop": Parameter("flag", "Only a seamless loop."),
            "no_plant": Parameter("flag", "Skip foot planting: the figure moves as drawn."),
            **SHAPING,
        },
        ("after", "like", "onto"),
        formats=True,
    ),
    Door(
        "/stream",
        "stream",
        "The same as lines of JSON while it is drawn, feet not planted: the figure first, then its frames.",
        DRAWING_PARAMETERS,
        ("after",),
    ),
    Door(
        "/describe",
        "describe",
        "Sentences for a motion, the best first, like `motet describe --json`.",
        {
            "beams": Parameter("whole", "Sentences to give."),
            "draws": Parameter("whole", "Samples for consensus decoding; 0: beam search."),
            "seed": Parameter("whole", "Seed of the samples."),
            "timeline": Parameter("flag", "One sentence for each part of the motion, with its times."),
            **READING,
        },
        ("file",),
        methods=("POST",),
    ),
    Door(
        "/predict.{format}",
        "predict",
        "How a motion goes on, like `motet predict`.",
        {
            "seconds": Parameter("number", "Length in seconds, by default the horizon of the model."),
            "frames": Parameter("whole", "The same in frames."),
            "append": Parameter("flag", "Give the motion too, then the prediction."),
            "seed": Parameter("whole", "Seed, used where more is asked for than the horizon."),
            **SHAPING,
            **READING,
        },
        ("file", "like", "onto"),
        formats=True,
        methods=("POST",),
    ),
)
