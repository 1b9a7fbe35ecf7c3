"""Scripts for figures that are steered."""

import pytest

from motet.errors import ScriptError
from motet.models.control import captions
from motet.steering.scripts import Order, parse_orders

GAITS = ("walk", "run")


def test_orders_say_what_to_do_in_any_order_of_their_words() -> None:
    script = "walk 3s speed 1.4, turn left 90, walk backwards 2s, run turn right 45 4s, stop"
    assert parse_orders(script, GAITS) == [
        Order("walk", 1.4, 0.0, 0.0, 3.0, "walk 3s speed 1.4", style="none"),
        Order(None, -1.0, None, 90.0, 1.5, "turn left 90"),
        Order("walk", None, 180.0, 0.0, 2.0, "walk backwards 2s", style="none"),
        Order("run", None, 0.0, -45.0, 4.0, "run turn right 45 4s", style="none"),
        Order(None, 0.0, None, 0.0, 1.5, "stop"),
    ]
    assert parse_orders("go to 2 -3.5, go to -.5 0 speed 1.2 facing -90 4s", GAITS) == [
        Order(None, None, None, 0.0, 5.0, "go to 2 -3.5", goal=(2.0, -3.5)),
        Order(None, 1.2, None, 0.0, 4.0, "go to -.5 0 speed 1.2 facing -90 4s", goal=(-0.5, 0.0), facing=-90.0),
    ]
    assert captions(parse_orders("walk, turn left 90 2s,stop 1s", GAITS)) == [
        (0.0, "walk"),
        (2.0, "turn left 90 2s"),
        (4.0, "stop 1s"),
    ]


@pytest.mark.parametrize(
    ("script", "position", "reason"),
    [
        ("", 0, "expected an order here: walk, run, turn, stop, act, go"),
        ("walk 3s,", 8, "expected an order"),
        ("walk 3s, , run", 9, "expected an order"),
        ("swim 3s", 0, "unknown order 'swim'"),
        ("walk 3", 5, "expected seconds"),
        ("walk speed", 5, "expected metres a second after this"),
        ("walk speed fast", 11, "expected metres a second, such as"),
        ("turn 90", 5, "expected left or right"),
        ("turn left", 5, "expected degrees after this"),
        ("walk 3s 4s", 8, "gives its seconds twice"),
        ("walk 9999s", 0, "at most 3600 s"),
        ("walk -3s", 5, "expected seconds"),
        ("walk 3s facing 90", 8, "expected seconds"),
        ("go 2 3", 3, "expected to, such as go to 2 3.5"),
        ("go to 2", 6, "expected z in metres after this"),
        ("go to 2 far", 8, "expected z in metres, such as"),
        ("go to 2 3 facing ahead", 17, "expected degrees, such as"),
        ("go to 2 3 backwards", 10, "takes seconds, speed and facing, each once"),
        ("go to 2 3 facing 4 facing 5", 26, "takes seconds, speed and facing, each once"),
        ("walk>run 3s", 0, "unknown order 'walk>run'"),
    ],
)
def test_errors_mark_their_place(script: str, position: int, reason: str) -> None:
    with pytest.raises(ScriptError, match=reason) as caught:
        parse_orders(script, GAITS)
    assert caught.value.position == position
