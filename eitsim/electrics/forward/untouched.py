"""The sensor of a data set: its disc, electrodes and drive, and the sheet conductance that its frames imply."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from eitsim.electrics.forward.skins import skin_of
from eitsim.scene.channels import channel_readings
from eitsim.scene.drive import protocol, read_out
from eitsim.scene.electrodes import among_all, present, there
from eitsim.scene.scene import Body, Drive, Electrodes, Scene, scene_from
from eitsim.scene.scene_keys import is_list
from touchcal.arrays import Array

TABLES = ("body", "electrodes", "drive", "channels")
# Sheet conductance, S, that the search starts from, its steps and where it ends; readings are nearly its reciprocal.
_START_S, _STEPS, _CLOSE = 1e-3, 40, 1e-8
_OTHER = 1e-5  # Relative difference, 2-norm, above which readings are not those of a sensor.


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
    asked = protocol(sensor.drive, sensor.electrodes.count)
    return channel_readings(asked, sensor.channels, among_all(sensor.electrodes, impedance)).ravel()


def conductance_of(sensor: Scene, baseline_V: Array) -> float:
    """The sheet conductance, S, whose untouched readings come closest to these (readings,), V, in the 2-norm.

    ValueError where they are further from them than rounding.
    """
    read = np.isfinite(baseline_V)
    sheet = _START_S
    for _ in range(_STEPS):
        found = untouched_readings(sensor, sheet)[read]
        ratio = float(found @ baseline_V[read] / (found @ found))
        if not 0 < ratio < np.inf or abs(ratio - 1) < _CLOSE:
            break
        sheet /= ratio
    separation = float(np.linalg.norm(untouched_readings(sensor, sheet)[read] - baseline_V[read])
                       / np.linalg.norm(baseline_V[read]))
    if not separation <= _OTHER:
        raise ValueError(f"the untouched readings differ by {separation:.1e} from those of its electrodes on any sheet "
                         "conductance; the set was not made with them.")
    return sheet


def by_contact(body: Body, electrodes: Electrodes, drive: Drive, conductance_S: float) -> Array:
    """dV/dlog z_e (readings, electrodes), V, of the untouched skin of a sheet conductance, S, by a central difference.

    0 by an electrode without contact, NaN for readings that need one. Identical electrodes take two solutions,
    others two each; on a skin with an outline adjoint fields serve them all.
    """
    kept = np.flatnonzero(there(electrodes))
    own = present(electrodes)
    slopes = skin_of(body, own, conductance_S).by_log_contact()
    columns = [read_out(drive, among_all(electrodes, slope)).ravel() for slope in slopes]
    out = np.zeros((len(columns[0]), electrodes.count))
    out[np.isnan(columns[0])] = np.nan
    out[:, kept] = np.stack(columns, axis=1)
    return out


def untouched_impedance(body: Body, electrodes: Electrodes, conductance_S: float) -> Array:
    """Impedance matrix (N, N), Ohm, of electrodes that all have contact, on a skin of sheet conductance S, S;
    read-only."""
    return skin_of(body, electrodes, conductance_S).impedance_Ohm()
