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


def split(tau: Array, tangent: Array, projection: VolumeProjection) -> tuple[Array, Array, tuple[Array, Array]]:
    """From Kirchhoff stresses (elements, points, 3) and tangents (..., 3, 3) of the law at projected stretches: the
    stresses that do work on x, with P of the pressure; the tangent of shape alone (..., 3, 3); how the stresses of
    shape (..., 3) and the pressure (...) change with the projected change of volume."""
    pressure = tau.mean(axis=-1)
    working = tau + (projection(pressure) - pressure)[..., None]
    by_volume = tangent.mean(axis=-1)
    pressure_by_volume = by_volume.mean(axis=-1)
    coupling = by_volume - pressure_by_volume[..., None]
    shape = tangent - by_volume[..., None] - by_volume[..., None, :] + pressure_by_volume[..., None, None]
    return working, shape, (coupling, pressure_by_volume)


def element_stiffness(grid: Grid, projection: VolumeProjection, grad_u: Array, by_volume: tuple[Array, Array]) -> Array:
    """(elements, n, n) what couples the points of an element, of the derivatives by the projected change of volume."""
    coupling, pressure_by_volume = by_volume
    volume = _on_nodes(grid, _piola(grad_u, np.ones((*coupling.shape[:-1], 3))), projection.dual)
    shape = _on_nodes(grid, _piola(grad_u, coupling), grid.weight[..., None] * grid.modes)
    stiffness = np.einsum("eq,qm,qn->emn", grid.weight * pressure_by_volume, grid.modes, grid.modes)
    across = np.swapaxes(shape, 1, 2) @ volume
    return across + np.swapaxes(across, 1, 2) + np.swapaxes(volume, 1, 2) @ stiffness @ volume


def _on_nodes(grid: Grid, piola: Array, factor: Array) -> Array:
    """(elements, m, n) sum over points of factor (elements, points, m) times B' piola (elements, points, 5)."""
    slope, p = grid.gradient, piola[:, :, None, :]
    nodes = np.stack([slope[..., 0] * p[..., 0] + slope[..., 1] * p[..., 1] + slope[..., 2] * p[..., 4],
                      slope[..., 0] * p[..., 2] + slope[..., 1] * p[..., 3]], axis=-1)
    return np.swapaxes(factor, 1, 2) @ nodes.reshape(*nodes.shape[:2], -1)


def _piola(grad_u: Array, tau: Array) -> Array:
    """tau F^-T (..., 5) of principal Kirchhoff stresses (..., 3) along the principal axes of F = 1 + grad_u (..., 5):
    the larger in-plane stretch's, the smaller's, the hoop's."""
    rr, rz, zr, zz, hoop = np.moveaxis(grad_u, -1, 0)
    f_rr, f_zz = 1 + rr, 1 + zz
    along, across = f_rr**2 + rz**2 - zr**2 - f_zz**2, 2 * (f_rr * zr + rz * f_zz)
    length = np.hypot(along, across)
    safe = np.where(length > 0, length, 1.0)
    mean, half = (tau[..., 0] + tau[..., 1]) / 2, (tau[..., 0] - tau[..., 1]) / 2
    s_rr, s_zz, s_rz = mean + half * along / safe, mean - half * along / safe, half * across / safe
    area = f_rr * f_zz - rz * zr
    return np.stack([(s_rr * f_zz - s_rz * rz) / area, (s_rz * f_rr - s_rr * zr) / area,
                     (s_rz * f_zz - s_zz * rz) / area, (s_zz * f_rr - s_rz * zr) / area,
                     tau[..., 2] / (1 + hoop)], axis=-1)
