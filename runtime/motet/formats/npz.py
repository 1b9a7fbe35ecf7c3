"""NPZ: all of a motion, without loss, as numpy arrays. Nothing in it is pickled.

Arrays: ``values`` (T, D) float64, ``channels`` (D,) and ``units`` (D,) text, ``fps`` float64, and ``skeleton``, the
text of the JSON object of :meth:`motet.motion.skeleton.Skeleton.to_json`, empty for a motion without skeleton.
"""

import io
import json
import zipfile
import zlib
from pathlib import Path

import numpy as np

from motet.errors import FormatError, MotionError
from motet.files import write_whole
from motet.motion.motion import Motion
from motet.motion.skeleton import Skeleton

KEYS = ("values", "channels", "units", "fps", "skeleton")


def read(path: str | Path) -> Motion:
    """Read a motion that :func:`write` wrote; FormatError for any other file."""
    path = Path(path)
    try:
        # the test for a zip file comes first: np.load would take anything else for a pickle
        with io.BytesIO(path.read_bytes()) as content:
            if not zipfile.is_zipfile(content):
                raise FormatError(path, "this is no NPZ file, or not a whole one")
            content.seek(0)
            with np.load(content, allow_pickle=False) as arrays:
                values, channels, units, fps, skeleton = (arrays[key] for key in KEYS)
        text = str(skeleton)
        return Motion(
            values,
            tuple(map(str, channels.tolist())),
            tuple(map(str, units.tolist())),
            float(fps),
            Skeleton.from_json(json.loads(text)) if text else None,
        )
    except KeyError as error:
        raise FormatError(path, f"this is no motion: it needs the arrays {', '.join(KEYS)}: {error}") from error
    except FormatError:
        raise
    except (OSError, EOFError, TypeError, ValueError, zipfile.BadZipFile, zlib.error, MotionError) as error:
        raise FormatError(path, f"this is no motion: {error}") from error


def write(path: str | Path, motion: Motion) -> None:
    """Write a motion; OutputError if it cannot be written."""
    content = io.BytesIO()
    skeleton = "" if motion.skeleton is None else json.dumps(motion.skeleton.to_json())
    np.savez_compressed(
        content,
        values=motion.values,
        channels=np.array(motion.channels, dtype=np.str_),
        units=np.array(motion.units, dtype=np.str_),
        fps=np.float64(motion.fps),
        skeleton=np.str_(skeleton),
    )
    write_whole(path, content.getvalue())
