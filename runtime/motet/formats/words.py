"""All words of a long text at once: numbers are parsed as exactly as by ``float``, in a third of the time."""

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array

LONGEST_WORD = 32
"""Longest word parsed as a number, in characters; no program writes longer ones."""

EXACT_DIGITS = 15
"""Digits of a number that float64 holds as an integer. It and powers of ten up to this are exact, so their quotient is
rounded only once, correctly."""

_POWERS = np.array([float(10**power) for power in range(EXACT_DIGITS + 1)])
_BLANK = np.zeros(256, dtype=bool)
_BLANK[[*b" \t\n\r\v\f\x1c\x1d\x1e\x1f"]] = True  # as in str.split()


class Words:
    """The words of an ASCII text, by position; UnicodeEncodeError for another text."""

    def __init__(self, text: str) -> None:
        # blanks at both ends, so that each word has an edge on both sides and can be read past its end
        content = np.frombuffer(b" " + text.encode("ascii") + b" " * (LONGEST_WORD + 1), dtype=np.uint8)
        blank = _BLANK[content]
        edges = np.flatnonzero(blank[1:] != blank[:-1]) + 1
        self._content, self.starts, self.lengths = content, edges[::2], edges[1::2] - edges[::2]

    def __len__(self) -> int:
        return len(self.starts)

    def are(self, picked: slice, word: str) -> bool:
        """Whether all of some words are ``word``."""
        if (self.lengths[picked] != len(word)).any():
            return False
        found = self._content[self.starts[picked, None] + np.arange(len(word))]
        return bool((found == np.frombuffer(word.encode(), np.uint8)).all())

    def are_digits(self, picked: slice) -> bool:
        """Whether all of some words consist of digits only."""
        read = self._read(self.starts[picked], self.lengths[picked])
        return read is not None and bool((read[1] == self.lengths[picked]).all())

    def numbers(self, picked: NDArray[np.bool_]) -> Array | None:
        """Numbers (N,) of some words; None where one is not a finite number in plain notation."""
        starts, lengths = self.starts[picked], self.lengths[picked]
        read = self._read(starts, lengths)
        if read is None:
            return None if len(starts) else np.zeros(0)
        mantissa, digits, behind, plain = read
        exact = plain & (digits > 0) & (digits <= EXACT_DIGITS)
        values = mantissa / _POWERS[np.where(exact, behind, 0)]
        values = np.where(self._content[starts] == ord("-"), -values, values)
        if not exact.all():
            rest = self._by_float(starts[~exact], lengths[~exact])
            if rest is None:
                return None
            values[~exact] = rest
        return values if np.isfinite(values).all() else None

    def _read(self, starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> tuple[NDArray[np.int64], ...] | None:
        """For each word: its digits as one number, their count, the count after the point, and whether it is plain.

        A plain word has digits, at most one point, and optionally a leading minus. None if words are too long.
        """
        if not len(starts) or lengths.max() > LONGEST_WORD:
            return None
        mantissa, digits, behind = (np.zeros(len(starts), dtype=np.int64) for _ in range(3))
        points = np.zeros(len(starts), dtype=np.int64)
        for place in range(int(lengths.max())):
            characters = self._content[starts + place]
            inside = place < lengths
            digit = inside & (characters - np.uint8(48) < 10)
            mantissa = np.where(digit, mantissa * 10 + characters - 48, mantissa)
            digits += digit
            behind += digit & (points > 0)
            points += inside & (characters == ord("."))
        signs = self._content[starts] == ord("-")
        return mantissa, digits, behind, (points <= 1) & (digits + points + signs == lengths)

    def _by_float(self, starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> Array | None:
        places = np.arange(int(lengths.max()))
        characters = np.where(places < lengths[:, None], self._content[starts[:, None] + places], 0).astype(np.uint8)
        if (characters == ord("_")).any():
            return None  # Python would read 1_000, which no other program does
        try:
            return np.ascontiguousarray(characters).view(f"S{len(places)}")[:, 0].astype(np.float64)
        except ValueError:
            return None
