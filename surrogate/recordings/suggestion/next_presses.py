"""Where to press next, so that few presses teach most: the places whose presses lower the variance of the map from
place to pattern, averaged over the skin, most; greedily, each given those before it (Cohn, Neural networks 9, 1996).

The map is a process of Matern-5/2 kernel; its variance depends on where presses are, not on what they read, so that
places can be suggested before the first press. A press at c lowers the variance at p by k(p, c)^2 / (k(c, c) + noise).
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from surrogate.recordings.disc_grid import disc_grid
from surrogate.recordings.pattern_process import matern
from touchcal.arrays import Array, Index

SUGGESTED = "suggested.csv"  # file of a model's folder that holds the table
LENGTH = 0.9  # of the kernel, over the radius of the body
NOISE = 0.01  # variance of the noise of a press over that of the map
SHARE = 0.95  # of the radius: places further out are at the rim
ACROSS = 45  # places across the disc that are compared
SPANNED = 0.8  # of the diameter, along x and along y: the range of presses that says where the body lies


@dataclass(frozen=True, eq=False)
class NextPresses:
    """Places to press, the best first."""

    middle: Array  # (2,) of the body, mm
    place: Array  # (n, 2) mm
    gain: Array  # (n,) part of the variance before any press, over the skin, that a press takes away

    def table(self) -> pd.DataFrame:
        """A row a place: x_mm, y_mm, expected_gain."""
        return pd.DataFrame({"x_mm": self.place[:, 0], "y_mm": self.place[:, 1], "expected_gain": self.gain})


def next_presses(radius: float, pressed: Array, count: int) -> NextPresses:
    """The `count` places of a disc of this radius, mm, to press after places pressed (n, 2), mm, of which there may be
    none. The disc lies about the origin, or about the middle of the pressed places where some lie outside that.

    ValueError where count is below 1 or above the places that are compared, or where pressed places lie outside the
    disc about the origin and span too little of it to say where it lies.
    """
    middle = _middle(pressed, radius)
    place = disc_grid(middle, SHARE * radius, ACROSS)
    if not 1 <= count <= len(place):
        raise ValueError(f"{count} places to press next; ask for 1 to {len(place)}.")
    chosen, gain = greedy(left_open(place, pressed, radius), np.full(len(place), 1 / len(place)), count)
    return NextPresses(middle, place[chosen], gain)


def left_open(place: Array, pressed: Array, radius: float) -> Array:
    """(g, g) covariance of the map of a body of this radius at places (g, 2) after presses at others (n, 2), mm."""
    length = LENGTH * radius
    known = matern(pressed, pressed, length) + NOISE * np.eye(len(pressed))
    shared = matern(place, pressed, length)
    return matern(place, place, length) - shared @ np.linalg.solve(known, shared.T)


def greedy(covariance: Array, weight: Array, count: int) -> tuple[Index, Array]:
    """Numbers of the places whose presses lower the weighted sum of variances most, each given those before it, and by
    how much; covariance (g, g) of the map at the places, weight (g,)."""
    left, chosen, gain = covariance.copy(), np.empty(count, np.intp), np.empty(count)
    for number in range(count):
        lowered = weight @ left**2 / (np.diag(left) + NOISE)
        best = int(lowered.argmax())
        chosen[number], gain[number] = best, lowered[best]
        left -= np.outer(left[:, best], left[:, best]) / (left[best, best] + NOISE)
    return chosen, gain


def _middle(pressed: Array, radius: float) -> Array:
    """(2,) the origin where all pressed places lie on the body about it, or there are none; else the middle of their
    range, where that is SPANNED of the body or more."""
    if not len(pressed) or np.linalg.norm(pressed, axis=1).max() <= radius:
        return np.zeros(2)
    if np.ptp(pressed, axis=0).min() < SPANNED * 2 * radius:
        x, y = pressed[np.linalg.norm(pressed, axis=1).argmax()]
        raise ValueError(f"the press at ({x:.4g}, {y:.4g}) mm lies outside the body, of radius {radius:.4g} mm about "
                         f"the origin, and the presses span less than {100 * SPANNED:.0f} % of it, too little to say "
                         "where its middle lies. Give labels about the middle of the body, or correct radius_mm.")
    return np.asarray((pressed.min(axis=0) + pressed.max(axis=0)) / 2)

