"""Readings of driven electrodes that hold no measurement.

Some boards leave them at 0, empty, or at the end of their range; everywhere else such a reading is dead.
"""

import numpy as np

from eitsim.scene.drive import Protocol
from eitsim.sensors.order_evidence import not_taken_of
from touchcal.arrays import Mask


def idle_readings(asked: Protocol, silent: Mask) -> Mask:
    """(m,) which of the readings that hold no measurement (m,) a board does not take under a drive."""
    carries = np.abs(asked.currents_A) > 1e-9 * np.abs(asked.currents_A).max(axis=1, keepdims=True)
    read = asked.weights != 0
    any_driven = (read & carries[:, None]).any(axis=2).ravel()
    all_driven = (~read | carries[:, None]).all(axis=2).ravel()
    return not_taken_of((any_driven, all_driven), silent)
