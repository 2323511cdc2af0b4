"""From touches to readings: the complete electrode model on a mesh that follows the touch."""

from __future__ import annotations

import time
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eitsim.cem import impedance, quadrature_points, sparsity
from eitsim.drive import read_out
from eitsim.results import Readings, Touch
from eitsim.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.skin import extrapolated_fraction, sheet_conductance, untouched_conductance
from eitsim.template import rim_angles, ring_mesh, template
from matcal.conductivity import Conductivity

Array = NDArray[np.float64]

LEVELS = (1, 2, 4)


def solve(body: Body, skin: Skin, electrodes: Electrodes, drive: Drive, touches: tuple[tuple[Punch, Touch], ...],
          law: Conductivity, *, signal: float = 0.002) -> Readings:
    """Readings of a touched skin; the mesh is refined until the estimated relative error of dV is below `signal`.

    dV is the difference of two solutions on one mesh that follows the touch. ValueError for several touches, a
    conducting punch or patch electrodes, which are not built, and where the conductivity is not positive.
    """
    start = time.process_time()
    (punch, touch), = _one(touches)
    estimate, previous, used = np.inf, None, 0
    signal_V, touched_Ohm = np.empty(0), np.empty(0)
    for level in LEVELS:
        change_Ohm, touched_Ohm, used = _level(body, skin, electrodes, punch, touch, law, level)
        signal_V = read_out(drive, change_Ohm)
        if previous is not None:
            estimate = float(np.linalg.norm(signal_V - previous) / (3 * np.linalg.norm(signal_V)))
        if estimate <= signal:
            break
        previous = signal_V
    baseline_V = read_out(drive, baseline_impedance(body, electrodes, untouched_conductance(law, skin)))
    return Readings(baseline_V + signal_V, baseline_V, signal_V, touched_Ohm, estimate,
                    extrapolated_fraction(body, punch, touch, skin, law), used, time.process_time() - start)


@lru_cache(maxsize=64)
def baseline_impedance(body: Body, electrodes: Electrodes, conductance_S: float) -> Array:
    """Impedance matrix (count, count), Ohm, of the untouched skin, one for every touch."""
    angles, electrode = rim_angles(body, electrodes, 4)
    rings = 1 - np.concatenate([[1.0], np.geomspace(1, 0.004, 24)[1:], [0.0]])
    mesh = ring_mesh(rings * body.radius_m, np.zeros((len(rings), 2)), angles, electrode, electrodes.count)
    return impedance(mesh, np.full(len(mesh.cells), conductance_S), electrodes.contact_impedance_Ohm_m)


def _one(touches: tuple[tuple[Punch, Touch], ...]) -> tuple[tuple[Punch, Touch], ...]:
    if len(touches) != 1:
        raise ValueError(f"{len(touches)} touches at once are not built; give one.")
    if touches[0][0].conductor:
        raise ValueError("conductor = true (a punch that shunts the skin) is not built; set it to false.")
    return touches


def _level(body: Body, skin: Skin, electrodes: Electrodes, punch: Punch, touch: Touch, law: Conductivity,
           level: int) -> tuple[Array, Array, int]:
    """Change of the impedance matrix by the touch, the touched one, and the number of unknowns."""
    mesh = template(body, electrodes, punch, touch, level)
    pattern = sparsity(mesh)
    touched = sheet_conductance(quadrature_points(mesh), punch, touch, skin, law)
    untouched = np.full(len(mesh.cells), untouched_conductance(law, skin))
    touched_Ohm, untouched_Ohm = (impedance(mesh, s, electrodes.contact_impedance_Ohm_m, pattern=pattern, refinements=0)
                                  for s in (touched, untouched))
    return touched_Ohm - untouched_Ohm, touched_Ohm, pattern.size - 1
