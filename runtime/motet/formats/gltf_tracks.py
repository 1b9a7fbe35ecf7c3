"""The animations of a glTF file: their names, the nodes they move, and the nodes' values at every frame."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from motet.errors import FormatError, quoted
from motet.formats.gltf_data import Gltf
from motet.motion.rotations import Array

GLTF_FPS = 30.0
"""The frame rate of a file without animation, or with keys too sparse to tell."""

PATHS = {"rotation": 4, "translation": 3, "scale": 3}
"""The animated properties of a node, and how many numbers each has; mesh weights are left out."""

Tracks = Mapping[tuple[int, str], Array]
"""(Node, property) -> values (T, 3 or 4)."""


def moved(animation: Mapping[str, Any]) -> set[int]:
    """The nodes that an animation moves."""
    targets = [channel["target"] for channel in animation.get("channels", [])]
    return {target["node"] for target in targets if target.get("path") in PATHS and target.get("node") is not None}


def tracks(gltf: Gltf, animation: Mapping[str, Any], name: str, nodes: set[int]) -> tuple[Tracks, float]:
    """The values of some nodes at every frame of the animation ``name``, and its frame rate."""
    samplers = animation.get("samplers", [])
    keys = {}
    for channel in animation.get("channels", []):
        node, path = channel["target"].get("node"), channel["target"].get("path")
        if node in nodes and path in PATHS:
            sampler = samplers[channel["sampler"]]
            times, values = gltf.array(sampler["input"]), gltf.array(sampler["output"])
            keys[node, path] = times.reshape(-1), values, sampler.get("interpolation", "LINEAR")
    if not all(len(times) for times, _, _ in keys.values()):
        raise FormatError(gltf.path, f"its animation {quoted(name)} has tracks without keys")
    start, end = min(times[0] for times, _, _ in keys.values()), max(times[-1] for times, _, _ in keys.values())
    steps = min((float(np.median(np.diff(times))) for times, _, _ in keys.values() if len(times) > 1), default=0.0)
    # keys further apart do not tell a frame rate
    rate = 1 / steps if 0 < steps < 0.1 else GLTF_FPS
    fps = float(round(rate)) if abs(rate - round(rate)) < 0.01 * rate else rate
    count = (end - start) * fps + 1
    # an hour of 90 nodes at 30 fps; for a small file a million, plus one per byte
    if not count * len(gltf.objects("nodes")) < min((10**7), (10**6) + gltf.size):
        raise FormatError(gltf.path, f"{end - start:g} s at {fps:g} fps is too many frames")
    frames = start + np.arange(round(count)) / fps
    return {place: _sampled(*key, frames, place[1]) for place, key in keys.items()}, fps


def _sampled(times: Array, values: Array, kind: str, frames: Array, name: str) -> Array:
    """Values (T, 3 or 4) at given times: linear (turns the shortest way), in steps, or by the tangents of splines."""
    values = values.reshape(len(times), -1, PATHS[name])
    before = np.clip(np.searchsorted(times, frames + 1e-6, side="right") - 1, 0, max(len(times) - 2, 0))
    after = np.minimum(before + 1, len(times) - 1)
    span = np.maximum(times[after] - times[before], 1e-9)
    part = np.clip((frames - times[before]) / span, 0, 1)[:, None]
    if kind == "CUBICSPLINE":
        low, high = values[before], values[after]
        p, m0, q, m1 = low[:, 1], low[:, 2] * span[:, None], high[:, 1], high[:, 0] * span[:, None]
        t, u = part, 1 - part
        cubic: Array = (1 + 2 * t) * u**2 * p + t * u**2 * m0 + t**2 * (3 - 2 * t) * q - t**2 * u * m1
        return cubic
    low, high = values[before, 0], values[after, 0]
    if kind == "STEP":
        stepped: Array = np.where(part < 1 - 1e-4, low, high)
        return stepped
    if name != "rotation":
        linear: Array = low + part * (high - low)
        return linear
    return _between(low, high, part)


def _between(low: Array, high: Array, part: Array) -> Array:
    """Quaternions (T, 4) between two by the shortest way, at constant speed."""
    low, high = (quats / np.linalg.norm(quats, axis=-1, keepdims=True) for quats in (low, high))
    cosine = np.sum(low * high, axis=-1, keepdims=True)
    high, cosine = np.where(cosine < 0, -high, high), np.abs(cosine)
    angle = np.arccos(np.clip(cosine, -1, 1))
    near = angle < 1e-4
    sine = np.where(near, 1.0, np.sin(angle))
    one = np.where(near, 1 - part, np.sin((1 - part) * angle) / sine)
    other = np.where(near, part, np.sin(part * angle) / sine)
    mixed: Array = one * low + other * high
    return mixed
