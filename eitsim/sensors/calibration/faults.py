"""Electrodes whose readings are dead, or that no state of the instrument explains, and frames without them."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from eitsim.sensors import reading_checks
from eitsim.sensors.calibration.stages import Untouched, driven
from touchcal.arrays import Array, Mask

# An electrode is suspect where so many times the median of all electrodes is left of its readings, and named where the
# others are explained so many times better without it.
_SUSPECT, _BETTER = 2.0, 3.0


def read_at(frame: Untouched, electrode: int) -> Mask:
    """(patterns, readings) readings with a weight at an electrode."""
    return np.asarray(frame.asked.weights[..., electrode] != 0)


def dead_electrodes(frame: Untouched) -> dict[int, str]:
    """Electrodes, from 0, nearly all of whose readings are dead while others are not, with the words that say so."""
    uses = [read_at(frame, k).ravel() for k in range(frame.asked.currents_A.shape[1])]
    found = reading_checks.dead_electrodes(~np.isfinite(frame.volts).ravel(), uses)
    return {k: f"{share:.0%} of the readings at it are dead" for k, share in found.items()}


def suspect(by_electrode: Sequence[float]) -> int | None:
    """The electrode of which most is left, where that is far more than of most others."""
    worst = int(np.argmax(by_electrode))
    return worst if by_electrode[worst] > _SUSPECT * float(np.median(by_electrode)) else None


def unexplained(misfit: float, without_it: float) -> str:
    """Why an electrode is left out, by the misfits, V, with and without it; empty where it is not."""
    if misfit < _BETTER * without_it:
        return ""
    return f"no state of the model explains it: the others are explained {misfit / without_it:.2g} times better without"


def without(frame: Untouched, electrodes: Iterable[int]) -> Untouched:
    """A frame in which readings at some electrodes, and all of drives through them, are dead."""
    lost = np.zeros(frame.volts.shape, dtype=bool)
    for k in electrodes:
        lost |= read_at(frame, k) | driven(frame.asked)[:, [k]]
    return replace(frame, volts=np.where(lost, np.nan, frame.volts))


def left_by_electrode(frame: Untouched, model: Array) -> tuple[float, ...]:
    """(N,) 2-norm of what a model leaves of the readings at each electrode, off the driven ones, over that of the
    readings; 0 where none is there."""
    left = frame.volts - (model if frame.signed else np.abs(model))
    out = []
    for k in range(frame.asked.currents_A.shape[1]):
        at = read_at(frame, k) & frame.off_driven
        size = np.linalg.norm(frame.volts[at])
        out.append(float(np.linalg.norm(left[at]) / size) if size else 0.0)
    return tuple(out)
