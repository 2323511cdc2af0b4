"""What a change of the electrodes' contact impedances makes of the readings of the untouched skin, to first order.

Of independent changes of 1, 5, 10 and 20 % rms, first order misses 2, 3, 5 and 10 % of what they make of the readings
of a touched skin with line electrodes, and 1, 5, 10 and 21 % with patches, which feel them five times as much
(benchmarks/measured.py).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eitsim.drive import read_out
from eitsim.electrodes import IMPEDANCES, alike, among_all, contact_impedances, present, there
from eitsim.scene import Body, Drive, Electrodes
from eitsim.untouched import untouched_impedance

Array = NDArray[np.float64]

# Step of the logarithm of a contact impedance; the central difference is off by some step^2, over the derivative.
_STEP = 1e-3


def by_contact(body: Body, electrodes: Electrodes, drive: Drive, conductance_S: float) -> Array:
    """dV/dlog z_e (readings, electrodes), V, of the untouched skin of a sheet conductance, S, by a central difference.

    0 by an electrode without contact, NaN for readings that need one. Electrodes that are alike take two solutions,
    others two each.
    """
    kept = np.flatnonzero(there(electrodes))
    own = present(electrodes)
    count = own.count
    if alike(own):
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
    more, less = (untouched_impedance(body, _scaled(electrodes, k, np.exp(step)), conductance_S)
                  for step in (_STEP, -_STEP))
    return (more - less) / (2 * _STEP)


def _scaled(electrodes: Electrodes, k: int, factor: float) -> Electrodes:
    z = contact_impedances(electrodes)
    z[k] *= factor
    return replace(electrodes, **{IMPEDANCES[electrodes.kind]: tuple(z.tolist())})
