"""Quantities to predict: what each is of stands in its own line, and nothing else knows the list."""

from __future__ import annotations

from surrogate.data import outputs
from surrogate.data.outputs import Role


def test_every_quantity_has_a_unit_and_the_touch_comes_first() -> None:
    assert all(output.unit in outputs.SI for output in outputs.ALL)
    roles = [output.role is Role.RESPONSE for output in outputs.ALL]
    assert roles == sorted(roles)
    assert (*outputs.TOUCHES, *outputs.RESPONSES) == outputs.NAMES
    assert outputs.PLACES == outputs.TOUCHES[:2] == ("x0", "y0")
