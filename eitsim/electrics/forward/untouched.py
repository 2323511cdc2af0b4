"""The sensor of a data set: its disc, electrodes and drive, and the sheet conductance that its frames imply."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from eitsim.electrics.cem.assembly import Array, impedance
from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.mesh.ring_mesh import patch_radii, rim_angles, ring_mesh
from eitsim.electrics.outline.adapted_mesh import READINGS, impedance_by_log_contact, solve_untouched
from eitsim.scene.channels import channel_readings
from eitsim.scene.drive import protocol, read_out
from eitsim.scene.electrodes import IMPEDANCES, among_all, contact_impedances, identical, present, there
from eitsim.scene.scene import Body, Drive, Electrodes, Scene, is_list, scene_from

TABLES = ("body", "electrodes", "drive", "channels")
# Sheet conductance, S, that the search starts from, its steps and where it ends; readings are nearly its reciprocal.
_START_S, _STEPS, _CLOSE = 1e-3, 40, 1e-8
_OTHER = 1e-5  # Relative difference, 2-norm, above which readings are not those of a sensor.
# Step of the logarithm of a contact impedance; the central difference is off by some step^2, over the derivative.
_STEP = 1e-3
# Level of the mesh for patches, its rings inside them, and the width of the outermost of these over their inner radius.
_LEVEL, _RINGS, _LAST = 6, 36, 4e-3


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
    count = own.count
    if body.has_outline:
        slopes = list(impedance_by_log_contact(body.shape, own, conductance_S))
    elif identical(own):
        first = _impedance_by(body, own, conductance_S, 0)
        slopes = [np.roll(first, (k, k), axis=(0, 1)) for k in range(count)]
    else:
        slopes = [_impedance_by(body, own, conductance_S, k) for k in range(count)]
    columns = [read_out(drive, among_all(electrodes, slope)).ravel() for slope in slopes]
    out = np.zeros((len(columns[0]), electrodes.count))
    out[np.isnan(columns[0])] = np.nan
    out[:, kept] = np.stack(columns, axis=1)
    return out


def _impedance_by(body: Body, electrodes: Electrodes, conductance_S: float, k: int) -> Array:
    """dZ/dlog z_k (N, N), Ohm."""
    sides = []
    for step in (_STEP, -_STEP):
        z = contact_impedances(electrodes)
        z[k] *= np.exp(step)
        scaled = replace(electrodes, **{IMPEDANCES[electrodes.kind]: tuple(z.tolist())})
        sides.append(untouched_impedance(body, scaled, conductance_S))
    return (sides[0] - sides[1]) / (2 * _STEP)


def untouched_impedance(body: Body, electrodes: Electrodes, conductance_S: float) -> Array:
    """Impedance matrix (N, N), Ohm, of electrodes that all have contact, on a skin of sheet conductance S, S;
    read-only."""
    if body.has_outline:
        return solve_untouched(body.shape, electrodes, conductance_S, READINGS).impedance_Ohm
    if electrodes.kind == "line":
        return solve_rim(body, electrodes, conductance_S).impedance_Ohm
    return _with_patches(body, electrodes, conductance_S)


@lru_cache(maxsize=8)
def _with_patches(body: Body, electrodes: Electrodes, conductance_S: float) -> Array:
    angles, electrode = rim_angles(body, electrodes, _LEVEL)
    patches = patch_radii(body, electrodes, _LEVEL)
    inside = 1 - np.geomspace(1, _LAST, _RINGS)
    radii = np.concatenate([patches[0] * inside, patches])
    mesh = ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, electrodes.count, covered=len(patches) - 1)
    z = impedance(mesh, np.full(len(mesh.cells), conductance_S), contact_impedances(electrodes))
    z.flags.writeable = False
    return z
