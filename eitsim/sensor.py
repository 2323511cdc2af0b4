"""The sensor of a data set: its disc, electrodes and drive, and the sheet conductance that its frames tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.drive import read_out
from eitsim.electrodes import among_all, present
from eitsim.scene import Scene, is_list, scene_from
from eitsim.untouched import untouched_impedance

Array = NDArray[np.float64]

TABLES = ("body", "electrodes", "drive")
# Sheet conductance, S, that the search starts from, its steps and where it ends; readings are nearly its reciprocal.
_START_S, _STEPS, _CLOSE = 1e-3, 40, 1e-8
# Relative difference, 2-norm, above which readings are not those of a sensor.
_OTHER = 1e-5


def sensor_of(tables: Mapping[str, Any]) -> Scene:
    """The disc, electrodes and drive of a design's tables, the rest by default; ValueError where they are drawn."""
    fixed = {name: tables[name] for name in TABLES if name in tables}
    for name, table in fixed.items():
        if varied := [key for key, value in table.items()
                      if isinstance(value, list | Mapping) and not is_list(name, key, value)]:
            raise ValueError(f"{varied[0]} in [{name}] varies between the rows, and this needs one sensor. Sweep with "
                             "it fixed.")
    return scene_from(fixed)


def untouched_readings(sensor: Scene, conductance_S: float) -> Array:
    """Readings (readings,), V, of the untouched skin of a sensor; NaN where an electrode is missing."""
    impedance = untouched_impedance(sensor.body, present(sensor.electrodes), conductance_S)
    return read_out(sensor.drive, among_all(sensor.electrodes, impedance)).ravel()


def conductance_of(sensor: Scene, baseline_V: Array) -> float:
    """The sheet conductance, S, whose untouched readings come closest to these (readings,), V, in the 2-norm.

    ValueError where they are further apart than rounding.
    """
    read = np.isfinite(baseline_V)
    sheet = _START_S
    for _ in range(_STEPS):
        found = untouched_readings(sensor, sheet)[read]
        ratio = float(found @ baseline_V[read] / (found @ found))
        if not 0 < ratio < np.inf or abs(ratio - 1) < _CLOSE:
            break
        sheet /= ratio
    apart = float(np.linalg.norm(untouched_readings(sensor, sheet)[read] - baseline_V[read])
                  / np.linalg.norm(baseline_V[read]))
    if not apart <= _OTHER:
        raise ValueError(f"the untouched readings differ by {apart:.1e} from those of its electrodes on any sheet "
                         "conductance; the set was not made with them.")
    return sheet
