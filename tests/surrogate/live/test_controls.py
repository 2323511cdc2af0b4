"""Messages of a browser: what they state is limited, and what is none is refused without harm."""

import json
import math
import threading
import time
from dataclasses import asdict, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from surrogate.data.skin_edges import Circle, Polygons
from surrogate.live.controls import MOST_BYTES, Controls, Latest, Limits, controls_of

REACH_MM = 45.0
LIMITS = Limits(Circle((0.0, 0.0), 100.0), 100.0 - REACH_MM, (0.0, 0.0), (10.0, 12.0, 14.0), 2.0, 2.0, 1.0)
PRESS = Controls(3.0, -4.0, 12.0, 1.5, 0.2, 0.1, 17.0)


def text_of(**changes: object) -> str:
    return json.dumps(asdict(PRESS) | changes)


def test_a_message_states_the_controls() -> None:
    assert controls_of(text_of(), LIMITS) == PRESS


def test_controls_are_pulled_within_the_limits() -> None:
    found = controls_of(text_of(x_mm=300.0, y_mm=-400.0, diameter_mm=13.4, force_N=1e9, noise_mV=-1), LIMITS)
    assert (found.x_mm, found.y_mm) == pytest.approx((27.0, -36.0))
    assert (found.diameter_mm, found.force_N, found.noise_mV) == (14.0, 2.0, 0.0)


def test_a_press_near_an_edge_of_an_outline_has_no_force() -> None:
    square = Polygons((np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]]),))
    limits = replace(LIMITS, edges=square, gap_mm=15.0)
    assert [controls_of(text_of(x_mm=20.0, y_mm=y), limits).force_N for y in (20.0, 15.0, 14.9, 39.0, -3.0)] == [
        1.5, 1.5, 0.0, 0.0, 0.0]
    assert controls_of(text_of(x_mm=-30.0, y_mm=99.0), limits).x_mm == 0.0


@pytest.mark.parametrize("text", [
    "", "{", "[]", "null", "1", text_of(x_mm="1"), text_of(x_mm=None), text_of(x_mm=True), text_of(more=1),
    text_of(x_mm=math.nan), text_of(force_N=math.inf), text_of(x_mm=10**400), "[" * 1000, "{}",
    text_of(x_mm=1.0) + " " * MOST_BYTES])
def test_what_is_no_message_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="a message"):
        controls_of(text, LIMITS)


NUMBERS = some.one_of(some.floats(), some.integers(), some.none(), some.text(max_size=4), some.booleans())


@settings(max_examples=250, deadline=None)
@given(some.one_of(some.text(max_size=200), some.recursive(NUMBERS, some.lists, max_leaves=8).map(json.dumps),
                   some.fixed_dictionaries(dict.fromkeys(asdict(PRESS), NUMBERS)).map(json.dumps)))
def test_any_text_is_controls_within_the_limits_or_refused(text: str) -> None:
    try:
        found = controls_of(text, LIMITS)
    except ValueError:
        return
    assert math.hypot(found.x_mm, found.y_mm) <= REACH_MM * (1 + 1e-9)
    assert found.diameter_mm in LIMITS.diameters_mm
    assert 0 <= found.force_N <= LIMITS.force_N


def test_who_waits_hears_of_new_controls_at_once_and_once() -> None:
    latest, begun = Latest(PRESS), time.perf_counter()
    threading.Timer(0.05, latest.set, [Controls(0.0, 0.0, 10.0)]).start()
    found, new = latest.wait(5.0)
    assert (found.diameter_mm, new) == (10.0, True)
    assert time.perf_counter() - begun < 2.0
    assert latest.wait(0.0) == (found, False)
