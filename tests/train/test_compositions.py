"""The committed compositions, and what is measured of them."""

import numpy as np
import pytest

import motet
from motet_train.evaluate import compose
from motet_train.evaluate.compose import COMPOSE_GOALS, compose_report, compositions
from motet_train.evaluate.tables import reached


def test_two_of_them_reach_the_goals_that_their_prompts_alone_miss(monkeypatch: pytest.MonkeyPatch) -> None:
    every = compositions()
    assert len(every) == 20
    monkeypatch.setattr(compose, "compositions", lambda: [every[4], every[11]])
    report = compose_report(motet.load("generate"))
    for goal in COMPOSE_GOALS:
        group, key = goal.split(".")
        assert reached(COMPOSE_GOALS, goal, report["composed"][group][key])
        assert not reached(COMPOSE_GOALS, goal, report["unconstrained"][group][key])
    assert report["composed"]["place"]["count"] == 1
    assert report["composed"]["pose"]["count"] == 2
    assert report["composed"]["refused"]["count"] == 0
    assert all(np.isfinite(value) for own in report.values() for group in own.values() for value in group.values())
