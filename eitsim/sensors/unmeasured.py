"""Readings that hold no measurement: zeros and values at the end of the converter's range, in every frame.

Boards leave the readings of driven electrodes at 0, or drive the converter to its end there. Which readings that are
says of the order what no model can: see `order_evidence`.
"""

import numpy as np

from touchcal.arrays import Array, Mask

_SAME = 1e-3  # values at an end of the range are this close to each other, over their size
# An end holds at least so many readings, so many times as many as other values usually do, in this part of the frames.
_FEWEST, _TIMES, _ALWAYS = 6, 3, 0.9
# Within so many times that of the end lie at most so many times as many values: of a ring that is nearly even the
# largest readings go on below the very largest.
_NEAR, _FEW_NEAR = 5.0, 1.5


def unmeasured(values: Array) -> Mask:
    """(readings,) which readings (frames, readings) are empty or 0 in every frame, or at an end of the range."""
    silent = np.isnan(values).all(axis=0) | (np.nan_to_num(values) == 0).all(axis=0)
    live = np.where(silent, np.nan, values)
    top, bottom = _at_top(live), _at_top(-live)
    shared = _shared(np.where(top | bottom, np.nan, live))
    return silent | sum((end for end in (top, bottom) if end.sum() >= max(_FEWEST, _TIMES * shared)),
                        np.zeros_like(silent))


def _at_top(values: Array) -> Mask:
    """Readings (frames, readings) at the largest value of nearly every frame, where that is positive."""
    there = values[np.isfinite(values).any(axis=1)]
    if not len(there):
        return np.zeros(values.shape[1], dtype=bool)
    top = np.nanmax(there, axis=1, keepdims=True)
    below = top - np.where(np.isnan(there), -np.inf, there)
    at = below <= _SAME * top
    alone = (below <= _NEAR * _SAME * top).sum(axis=1) <= _FEW_NEAR * at.sum(axis=1)
    return (at & alone[:, None]).mean(axis=0) >= _ALWAYS


def _shared(values: Array) -> float:
    """How many readings have about the same value as one of them usually has, in the first frame that has any."""
    frame = next((np.sort(row[np.isfinite(row)]) for row in values if np.isfinite(row).any()), np.zeros(0))
    width = _SAME * np.abs(frame)
    near = np.searchsorted(frame, frame + width, side="right") - np.searchsorted(frame, frame - width)
    return float(np.median(near)) if len(near) else 1.0
