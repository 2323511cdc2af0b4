"""What of frames an image is made of: the readings that were measured, as differences from the untouched frame.

"volts": touched less untouched readings, where a uniform skin explains the untouched frame. "normalised":
(v - v_0) / v_0 of each reading, in which a gain of each cancels, and the uniform skin's derivatives over its own
readings (Adler et al. 2009, DOI 10.1088/0967-3334/30/6/S03, image such differences as well). "given": readings that
are differences already. Of magnitudes the signs are those of the uniform skin.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.cem.assembly import Array
from eitsim.electrics.imaging.gauss_newton import Untouched, fitted, measured, uniform
from eitsim.scene.scene import Scene

DIFFERENCES = ("auto", "volts", "normalised")
# Part of the untouched frame that the best uniform skin may leave, 2-norms. The water tank of the Kuopio tomography
# challenge of 2023 leaves 0.18 uncalibrated; the default drive's readings in a random order leave 0.46.
_WORST_MISFIT = 0.3
# How many times smaller than the middle one's an untouched reading may be: against the uniform skin's a smaller one has
# no relative change to speak of, and the uniform skin's own count as so large where they are smaller.
_VANISHING = 30.0


class Unexplained(ValueError):
    """An untouched frame that no uniform skin explains."""


@dataclass(frozen=True, eq=False)
class Compared:
    """Frames as differences from the untouched one, in volts or, normalised, as parts of it."""

    untouched: Untouched  # in the same unit; NaN, and without derivative, for readings that were not measured
    signal: Array  # (frames, readings), 0 there
    reference: Array  # (readings,) the untouched frame, 0 there
    # 2-norm of what the best uniform skin misses of the untouched frame over the frame's; None where none was fitted
    misfit: float | None
    differences: str  # "volts", "normalised" or "given"
    why: str  # why differences are normalised where that was not asked for, in words; empty otherwise
    vanishing: int = 0  # how many readings were measured and have no relative change to speak of


def compared(frames: Array, reference: Array | None, scene: Scene, kind: str, differences: str) -> Compared:
    """Frames (n, readings) and the untouched one (readings,), None of differences; empty readings are NaN.

    ValueError where no reading is left, or, with "volts", no uniform skin explains the untouched frame.
    """
    there = _measured(frames, reference)
    if there.sum() < scene.electrodes.count:
        raise ValueError(f"only {there.sum()} of {len(there)} readings are measured, the others are empty or 0 in all "
                         f"frames; an image needs {scene.electrodes.count} or more. Check the file, or [drive].")
    if kind == "difference":
        untouched = _uniform(scene, there)
        given = frames if reference is None else frames - reference
        return Compared(untouched, np.where(there, given, 0.0), np.zeros(len(there)), None, "given", "")
    assert reference is not None
    if kind == "magnitude":
        frames, reference = np.abs(frames), np.abs(reference)
    why = ""
    if differences != "normalised":
        try:
            return _in_volts(frames, np.where(there, reference, np.nan), scene, kind)
        except Unexplained as error:
            if differences == "volts":
                raise
            why = str(error)
    return _normalised(frames, reference, there, scene, why)


def _measured(frames: Array, reference: Array | None) -> NDArray[np.bool_]:
    """(readings,) which are empty in no frame, and not 0 in all of them."""
    rows = frames if reference is None else np.vstack([reference[None], frames])
    return np.logical_and(np.isfinite(rows).all(axis=0), rows.any(axis=0))


def _uniform(scene: Scene, there: NDArray[np.bool_]) -> Untouched:
    return measured(uniform(scene.body, scene.electrodes, scene.drive, scene.channels), there)


def _in_volts(frames: Array, reference: Array, scene: Scene, kind: str) -> Compared:
    """Differences in volts; Unexplained where no uniform skin makes the untouched frame."""
    there = ~np.isnan(reference)
    sign = np.ones(len(reference))
    if kind == "magnitude":
        sign = np.sign(_uniform(scene, there).readings_V)
    try:
        untouched = fitted(scene.body, scene.electrodes, scene.drive, sign * reference, scene.channels)
    except ValueError as error:
        raise Unexplained(str(error)) from None
    if kind == "magnitude" and (again := np.sign(untouched.readings_V))[there].tolist() != sign[there].tolist():
        sign = again
        untouched = fitted(scene.body, scene.electrodes, scene.drive, sign * reference, scene.channels)
    there = np.isfinite(untouched.readings_V)
    signed, change = (np.where(there, sign * one, 0.0) for one in (reference, frames - reference))
    misfit = float(np.linalg.norm(np.nan_to_num(untouched.readings_V) - signed) / np.linalg.norm(signed))
    if misfit > _WORST_MISFIT:
        raise Unexplained(f"the untouched frame is no uniform skin's with these electrodes and this drive: "
                          f"{misfit:.2%} of it stay unexplained.")
    return Compared(untouched, change, signed, misfit, "volts", "")


def _normalised(frames: Array, reference: Array, there: NDArray[np.bool_], scene: Scene, why: str) -> Compared:
    untouched = _uniform(scene, there)
    model = untouched.readings_V
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = np.where(reference == 0, np.nan, model / reference)
    measured_here = there & np.isfinite(model)
    there = np.abs(gain) <= _VANISHING * np.nanmedian(np.abs(gain))
    unit = 1 / np.maximum(np.abs(model), np.nanmedian(np.abs(model)) / _VANISHING)
    slopes = untouched.jacobian_V * np.nan_to_num(unit)[:, None]
    relative = replace(untouched, readings_V=model * unit, jacobian_V=slopes)
    signal = np.where(there, (frames - reference) * gain * unit, 0.0)
    return Compared(measured(relative, there), signal, np.where(there, model * unit, 0.0), None, "normalised", why,
                    int((measured_here & ~there).sum()))
