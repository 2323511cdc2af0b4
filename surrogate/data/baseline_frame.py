"""The untouched frame: its noise, and whether it is that of the trained sensor."""

from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array

# Relative difference of the untouched frame from that of the training, 2-norm, from which it is cautioned.
OTHER_BASELINE = 0.2
SAME = 0.05  # difference, likewise, up to which a scaled or a sorted frame is taken for the training's


@dataclass(frozen=True)
class Untouched:
    """The frame that signals are differences to."""

    volts: Array  # (readings,) V
    # standard deviation of one reading of a touched frame minus this one, V; None where one frame cannot tell
    noise_V: float | None


def untouched(volts: Array) -> Untouched:
    """The mean of untouched frames (n, readings), V, and the noise by their scatter where there are two or more."""
    n = len(volts)
    noise = float(np.sqrt(np.nanmean(volts.var(axis=0, ddof=1)) * (1 + 1 / n))) if n > 1 else None
    return Untouched(volts.mean(axis=0), noise)


def caution(trained_V: Array, baseline_V: Array) -> str:
    """That an untouched frame (readings,), V, is not that of the training, and the likely cause; else empty."""
    finite = np.isfinite(baseline_V)
    trained, given = trained_V[finite], baseline_V[finite]
    separation = relative_difference(given, trained)
    if separation < OTHER_BASELINE:
        return ""
    return (f"the untouched frame differs by {separation:.0%} from that of the training: {_cause(trained, given)} "
            "Intervals do not count such a difference.")


def _cause(trained: Array, given: Array) -> str:
    scale = float(given @ trained / (trained @ trained))
    if scale != 0 and relative_difference(given / scale, trained) < SAME:
        if -2 < scale < -0.5:
            return "it has the other sign. Are the leads of the current or of the voltmeter exchanged?"
        return f"it is {scale:.3g} times that. Are the readings in volts, and is the current that of the training?"
    if relative_difference(np.sort(given), np.sort(trained)) < SAME:
        return "it holds the same voltages in another order. Are electrodes, patterns or columns mixed up?"
    return "is it untouched, of this sensor and drive, and in volts?"


def relative_difference(given: Array, trained: Array) -> float:
    """2-norm of the difference of frames (readings,), V, over that of the trained one."""
    return float(np.linalg.norm(given - trained) / np.linalg.norm(trained))
