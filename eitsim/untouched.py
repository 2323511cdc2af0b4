"""The untouched skin's impedance matrix: on the rim alone for lines, on a fine mesh of rings for patches."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eitsim.cem import impedance
from eitsim.electrodes import contact_impedances
from eitsim.rim import solve_rim
from eitsim.scene import Body, Electrodes
from eitsim.template import patch_radii, rim_angles, ring_mesh

Array = NDArray[np.float64]

# Level of the mesh for patches, its rings inside them, and the width of the outermost of these over their inner radius.
_LEVEL, _RINGS, _LAST = 6, 36, 4e-3


def untouched_impedance(body: Body, electrodes: Electrodes, conductance_S: float) -> Array:
    """Impedance matrix (N, N), Ohm, of electrodes that all have contact, on a skin of sheet conductance S, S;
    read-only."""
    if electrodes.kind == "line":
        return solve_rim(body, electrodes, conductance_S).impedance_Ohm
    return _with_patches(body, electrodes, conductance_S)


@lru_cache(maxsize=8)
def _with_patches(body: Body, electrodes: Electrodes, conductance_S: float, level: int = _LEVEL) -> Array:
    angles, electrode = rim_angles(body, electrodes, level)
    patches = patch_radii(body, electrodes, level)
    inside = 1 - np.geomspace(1, _LAST, _RINGS * level // _LEVEL)
    radii = np.concatenate([patches[0] * inside, patches])
    mesh = ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, electrodes.count, covered=len(patches) - 1)
    z = impedance(mesh, np.full(len(mesh.cells), conductance_S), contact_impedances(electrodes))
    z.flags.writeable = False
    return z
