"""Nearly incompressible layers without locking: the change of volume projected in each element.

With x = ln lambda of the displacements, theta = x_1 + x_2 + x_3 and P the projection of an element's theta onto 1, s, t
(1 alone in bilinear elements), orthogonal in the reference volume, the stored energy is int U(x + (P theta - theta)/3):
by displacements alone, of a symmetric Hessian with the same pattern. It is the mixed element of continuous biquadratic
displacements and discontinuous linear pressures with the pressure eliminated, which is stable. Source: Simo, Taylor,
Pister, Comput. Methods Appl. Mech. Eng. 51 (1985) 177, DOI 10.1016/0045-7825(85)90033-7; in logarithms of the volume,
so that it cannot turn negative.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.mechanics.solid.grid import Grid
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.jit import compiled

# kappa_0/mu_0 from which the change of volume is projected; nu = 0.45 has 9.7.
_STIFF = 10.0


def projects(law: Law) -> bool:
    """Whether a law resists a change of volume so much more than one of shape that elements would lock."""
    return law.kappa_0_Pa > _STIFF * law.mu_0_Pa


@dataclass(frozen=True)
class VolumeProjection:
    """P on values (elements, points)."""

    modes: Array  # (points, m)
    weight: Array  # (elements, points)
    dual: Array  # (elements, points, m): values (points,) give the coefficients of the modes

    def __call__(self, values: Array) -> Array:
        """P values (elements, points); weighted, it is its own transpose."""
        return self.coefficients(values) @ self.modes.T

    def coefficients(self, values: Array) -> Array:
        """(elements, m) of the modes in P values (elements, points)."""
        return np.einsum("eqm,eq->em", self.dual, values)


def volume_projection(grid: Grid) -> VolumeProjection:
    """The projection of a grid's elements."""
    return VolumeProjection(grid.modes, grid.weight, grid.dual)


def split(tau: Array, tangent: Array, projection: VolumeProjection) -> tuple[Array, Array]:
    """Turn Kirchhoff stresses (elements, points, 3) of the law at projected stretches into those that do work on x,
    with P of the pressure, and its tangents (..., 3, 3) into those of shape alone. Given are how the stresses of shape
    (..., 3) and the pressure (...) change with the projected change of volume."""
    coupling, bulk = np.empty(tau.shape), np.empty(tau.shape[:-1])
    _split(tau, tangent, projection.dual, projection.modes, coupling, bulk)
    return coupling, bulk


@compiled
def _split(tau, tangent, dual, modes, coupling, bulk):
    pressure = np.empty(modes.shape[1])
    for e in range(tau.shape[0]):
        pressure[:] = 0.0
        for q in range(tau.shape[1]):
            mean = (tau[e, q, 0] + tau[e, q, 1] + tau[e, q, 2]) / 3
            for m in range(len(pressure)):
                pressure[m] += dual[e, q, m] * mean
            for k in range(3):
                tau[e, q, k] -= mean
                coupling[e, q, k] = (tangent[e, q, k, 0] + tangent[e, q, k, 1] + tangent[e, q, k, 2]) / 3
            volume = (coupling[e, q, 0] + coupling[e, q, 1] + coupling[e, q, 2]) / 3
            for k in range(3):
                for j in range(3):
                    tangent[e, q, k, j] += volume - coupling[e, q, k] - coupling[e, q, j]
            for k in range(3):
                coupling[e, q, k] -= volume
            bulk[e, q] = volume
        for q in range(tau.shape[1]):
            for m in range(len(pressure)):
                for k in range(3):
                    tau[e, q, k] += modes[q, m] * pressure[m]
