"""Whether readings are those of an ohmmeter, without a model: a linear, reciprocal body and channels free of ground.

Such an instrument repeats a reading, changes its sign alone where source and sink are exchanged, reads the same where
what drives and what is read are exchanged, and adds up the readings of drives that add up.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.scene.drive import Protocol
from eitsim.sensors.reading_checks import Apart, reciprocity, repeats, source_against_sink
from eitsim.sensors.sensor_file import Sensor, pairs_of
from touchcal.arrays import Array

_ROUNDING = 1e-9  # of weights


@dataclass(frozen=True)
class OhmTests:
    """How far from each other readings are that an ohmmeter makes the same, of their norm; None where the drive has no
    such readings, or where magnitudes, or readings that are no pairs, do not say it."""

    repeats: float | None  # the same drive twice
    source_against_sink: float | None  # source and sink exchanged
    reciprocity: float | None  # what drives and what is read exchanged
    superposition: float | None  # readings from what is linear in the currents


def ohm_tests(sensor: Sensor, volts: Array) -> OhmTests:
    """The tests of one frame (patterns, readings), NaN where dead."""
    asked, signed = sensor.protocol, sensor.kind == "voltage"
    try:
        pairs = pairs_of(sensor)
    except ValueError:
        again, exchanged, reciprocal = None, None, None
    else:
        current = np.repeat(asked.currents_A.max(axis=1), asked.shape[1])
        again, exchanged, reciprocal = (test(volts.reshape(1, -1), pairs, current, signed=signed)
                                        for test in (repeats, source_against_sink, reciprocity))
    return OhmTests(_together(again), _together(exchanged), _together(reciprocal),
                    superposition(asked, volts) if signed else None)


def superposition(asked: Protocol, volts: Array) -> float | None:
    """Norm of what readings (patterns, readings) leave of the best linear function of their patterns' currents, by the
    degrees of freedom left, over their norm; None where no pattern depends on others."""
    weights = asked.weights.reshape(-1, asked.weights.shape[2])
    first = weights[np.arange(len(weights)), (weights != 0).argmax(axis=1)]
    _, which = np.unique(np.round(weights / first[:, None] / _ROUNDING), axis=0, return_inverse=True)
    value, pattern = volts.ravel() / first, np.repeat(np.arange(len(volts)), volts.shape[1])
    left, size = 0.0, 0.0
    for reading in np.unique(which):
        own = np.flatnonzero((which.ravel() == reading) & np.isfinite(value))
        currents = asked.currents_A[pattern[own]]
        if (rank := np.linalg.matrix_rank(currents)) < len(own):
            linear = currents @ np.linalg.lstsq(currents, value[own])[0]
            left += float(np.sum((value[own] - linear) ** 2)) * len(own) / (len(own) - rank)
            size += float(np.sum(value[own] ** 2))
    return float(np.sqrt(left / size)) if size else None


def _together(apart: Apart | None) -> float | None:
    return apart.together if apart is not None else None
