"""The one definition of a standing foot: bounds, thresholds, and steps that can be reckoned."""

import numpy as np
import pytest

from motet.figures.feet.contacts import SOLES, ContactSettings, contacts, contacts_of, ground_speeds, rise, standing


def test_contact_fades_from_the_first_bound_to_the_second() -> None:
    heights = np.linspace(-0.05, 0.1, 301)
    found = contacts(heights, None, SOLES)
    assert (np.diff(found) <= 0).all()
    assert (found[heights <= SOLES.heights[0]] == 1).all()
    assert (found[heights >= SOLES.heights[1]] == 0).all()
    assert contacts(np.array([np.mean(SOLES.heights)]), None, SOLES)[0] == pytest.approx(0.5)


def test_what_is_high_or_fast_does_not_stand() -> None:
    heights, speeds = np.meshgrid(np.linspace(0, 0.1, 41), np.linspace(0, 2, 41))
    expected = contacts(heights, None, SOLES) * (1 - rise(speeds, *SOLES.speeds))
    np.testing.assert_array_equal(contacts(heights, speeds, SOLES), expected)


def test_equal_bounds_are_a_threshold() -> None:
    heights = np.array([0.0, 0.03, np.nextafter(0.03, 1), 0.1])
    assert standing(heights, None, ContactSettings(heights=(0.03, 0.03))).tolist() == [True, True, False, False]


def test_a_foot_stands_between_steps() -> None:
    fps, frames = 60.0, 120
    time = np.arange(frames) / fps
    swing = np.clip((time % 1.0) - 0.5, 0, None) * 2  # half a second on the ground, half a second ahead by 0.5 m
    points = np.stack([0 * time, 0.15 * np.sin(np.pi * swing), 0.5 * (np.floor(time) + swing)], axis=1)[:, None]
    found = contacts_of(points, fps)[:, 0]
    middle = (time[1:] + time[:-1]) / 2 % 1.0
    assert (found[(middle > 0.1) & (middle < 0.4)] == 1).all()
    assert (found[(middle > 0.6) & (middle < 0.9)] == 0).all()
    speeds = ground_speeds(points, fps)[:, 0]
    np.testing.assert_allclose(speeds[(middle > 0.55) & (middle < 0.95)], 1.0, rtol=1e-9)
