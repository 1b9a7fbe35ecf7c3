"""Words of a text all at once, against str.split and float."""

from typing import Any

import numpy as np
import pytest

from motet.formats.words import Words


def numbers_of(text: str) -> Any:
    words = Words(text)
    return words.numbers(np.ones(len(words), dtype=bool))


def test_numbers_are_those_of_float_to_the_last_bit() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=20_000) * 10.0 ** rng.integers(-9, 12, 20_000)
    forms = ("{:.6g}", "{:.6f}", "{:.0f}", "{!r}", "{:.15g}", "{:.16g}", "{:e}")
    found = [forms[n % len(forms)].format(value) for n, value in enumerate(values.tolist())]
    found += ["0", "-0", "-0.0", "5.", ".5", "-.5", "007", "+1.5", "1e-015", "999999999999999", "9" * 16, "9" * 32]
    read = numbers_of(" \n".join(found))
    assert read is not None
    expected = np.array([float(word) for word in found])
    np.testing.assert_array_equal(read, expected)
    np.testing.assert_array_equal(np.signbit(read), np.signbit(expected))


@pytest.mark.parametrize("word", ["x", "-", ".", "1.2.3", "--5", "5-", "1_000", "1,5", "nan", "inf", "1e999", "9" * 33])
def test_what_is_no_number_in_plain_notation_is_none(word: str) -> None:
    assert numbers_of(f"1.5 {word} 2") is None


def test_words_are_those_of_split_and_are_compared() -> None:
    text = "1\tlfemur 3.5\r\n2 lfemur\x0b\x1c-4 \n3 rfemur 5"
    words = Words(text)
    assert [text[a - 1 :][:n] for a, n in zip(words.starts, words.lengths, strict=True)] == text.split()
    assert words.are_digits(slice(0, None, 3))
    assert not words.are_digits(slice(2, None, 3))
    assert words.are(slice(1, 6, 3), "lfemur")
    assert not any(words.are(slice(1, None, 3), name) for name in ("lfemur", "lfemu", "lfemurs", "x" * 100))
    assert numbers_of(" \n").shape == (0,)
    with pytest.raises(UnicodeEncodeError):
        Words("1\u00a02")
