"""How sentences say lists, frames and amounts."""

from collections.abc import Mapping, Sequence

from motet_train.evaluate.predict.protocol import REPORTED


def listed(words: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def at(frames: Sequence[int], among: Sequence[int] = REPORTED) -> str:
    """At which of some frames."""
    if list(frames) == list(among):
        return "at every frame"
    return f"at frame{'s' if len(frames) > 1 else ''} {listed([str(frame) for frame in frames])}"


def amount(value: float) -> str:
    """A number of two digits, without a zero in front."""
    return f"{value:.2f}".removeprefix("0")


def grouped(found: Mapping[int, str]) -> dict[str, list[int]]:
    """Frame -> word as word -> frames."""
    turned: dict[str, list[int]] = {}
    for frame, word in found.items():
        turned.setdefault(word, []).append(frame)
    return turned
