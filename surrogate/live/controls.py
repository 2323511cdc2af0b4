"""What is pressed and how noisy the readings are, as a browser's messages say it; and the latest of them."""

import json
import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

from surrogate.data.skin_edges import Edges, Place

MOST_BYTES = 1024  # longest message that is read


@dataclass(frozen=True)
class Controls:
    """One state of the page's controls."""

    x_mm: float  # place of the punch's axis, mm
    y_mm: float
    diameter_mm: float
    force_N: float = 0.0  # 0 where nothing is pressed
    noise_mV: float = 0.0  # standard deviation of one reading
    drift_mV_per_min: float = 0.0  # standard deviation, over the readings, of the rate at which they wander
    sent_ms: float = 0.0  # the browser's clock when it sent this, which comes back with the answer


@dataclass(frozen=True, eq=False)
class Limits:
    """What may be pressed."""

    edges: Edges  # of the skin
    gap_mm: float  # least distance of the punch's axis from them
    start_mm: Place  # of the first press
    diameters_mm: tuple[float, ...]
    # largest force, noise and drift
    force_N: float
    noise_mV: float
    drift_mV_per_min: float


def controls_of(text: str, limits: Limits) -> Controls:
    """The controls that a message states, places and forces pulled within the limits.

    ValueError where it is longer than MOST_BYTES, no JSON object of exactly these names, or holds anything but finite
    numbers.
    """
    if len(text) > MOST_BYTES:
        raise ValueError(f"a message of {len(text)} characters, at most {MOST_BYTES} are read.")
    names = [field.name for field in fields(Controls)]
    try:
        given = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError("a message that is no JSON.") from None
    if not isinstance(given, Mapping) or sorted(given) != sorted(names):
        raise ValueError(f"a message must be an object of {', '.join(names)}.")
    if not all(type(value) in (int, float) and math.isfinite(float_of(value)) for value in given.values()):
        raise ValueError("a message must hold finite numbers.")
    return within(Controls(**{name: float(given[name]) for name in names}), limits)


def float_of(value: float) -> float:
    """A number as a float, infinite where it is too large for one."""
    try:
        return float(value)
    except OverflowError:
        return math.inf


def within(controls: Controls, limits: Limits) -> Controls:
    """Controls pulled within limits; the nearest diameter there is; no force where the edges refuse the press."""
    place = limits.edges.held((controls.x_mm, controls.y_mm), limits.gap_mm)
    diameter = min(limits.diameters_mm, key=lambda d: abs(d - controls.diameter_mm))
    force = min(max(controls.force_N, 0.0), limits.force_N)
    return replace(
        controls, x_mm=place[0], y_mm=place[1], diameter_mm=diameter,
        force_N=0.0 if limits.edges.refuses(place, diameter, limits.gap_mm) else force,
        noise_mV=min(max(controls.noise_mV, 0.0), limits.noise_mV),
        drift_mV_per_min=min(max(controls.drift_mV_per_min, 0.0), limits.drift_mV_per_min))


class Latest:
    """The latest controls, which one thread sets and another waits for."""

    def __init__(self, controls: Controls) -> None:
        self._controls, self._new, self._changed = controls, False, threading.Condition()

    def set(self, controls: Controls) -> None:
        """Replace the controls, and wake who waits for them."""
        with self._changed:
            self._controls, self._new = controls, True
            self._changed.notify()

    def lift(self) -> None:
        """The same controls with nothing pressed."""
        with self._changed:
            self._controls, self._new = replace(self._controls, force_N=0.0), True
            self._changed.notify()

    def wait(self, timeout_s: float) -> tuple[Controls, bool]:
        """The controls, and whether they were set since the last call, as soon as they are or after the time."""
        with self._changed:
            self._changed.wait_for(lambda: self._new, max(timeout_s, 0.0))
            new, self._new = self._new, False
            return self._controls, new
