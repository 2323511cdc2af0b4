"""Large-strain foam on a grid: energy, residual and consistent tangent of a law.

Displacement gradients grad_u = F - 1 have the parts rr, rz, zr, zz and hoop.
"""

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.solid.grid import Grid, Indices, modes
from eitsim.mechanics.solid.meridian_response import area_change, energy_density, log_stretches, response
from eitsim.mechanics.solid.volume_projection import (
    VolumeProjection,
    element_stiffness,
    projects,
    volume_projection,
)
from matcal.laws.law import Law
from touchcal.arrays import Array

# Weights of the parts rr, rz, zz and hoop of a symmetric tensor in a double contraction.
_TWICE_OFF_DIAGONAL = np.array([1.0, 2.0, 1.0, 1.0])


def deformation(grid: Grid, u: Array) -> Array:
    """F - 1 (elements, points, 5), parts rr, rz, zr, zz and hoop, of the unknown displacements u."""
    moved = nodal(grid, u)[grid.elements]
    elements, points = grid.weight.shape
    gradient = np.moveaxis(grid.gradient, 3, 2).reshape(elements, 3 * points, -1)
    slope = (gradient @ moved).reshape(elements, points, 3, 2)
    return np.stack([slope[..., 0, 0], slope[..., 1, 0], slope[..., 0, 1], slope[..., 1, 1], slope[..., 2, 0]], -1)


def nodal(grid: Grid, u: Array) -> Array:
    """Displacements (nodes, 2) of the unknowns u, zero where they are fixed."""
    return np.where(grid.unknown < 0, 0.0, u[grid.unknown])


def admissible(grad_u: Array) -> NDArray[np.bool_]:
    """Where F = 1 + grad_u (..., 5) keeps its orientation."""
    return (area_change(grad_u) > -1) & (grad_u[..., 4] > -1)


def second_piola(law: Law, grad_u: Array, projection: VolumeProjection | None = None) -> Array:
    """Second Piola-Kirchhoff stress (..., 4), parts rr, rz, zz and hoop, F^-1 P, at F = 1 + grad_u (..., 5)."""
    rr, rz, zr, zz, hoop = np.moveaxis(grad_u, -1, 0)
    p = response(law, grad_u, projection=projection).stress
    area = 1 + area_change(grad_u)
    return np.stack([((1 + zz) * p[..., 0] - rz * p[..., 2]) / area, ((1 + zz) * p[..., 1] - rz * p[..., 3]) / area,
                     ((1 + rr) * p[..., 3] - zr * p[..., 1]) / area, p[..., 4] / (1 + hoop)], axis=-1)


def green_lagrange(grad_u: Array) -> Array:
    """Green-Lagrange strain (..., 4), parts rr, rz, zz and hoop, (F'F - 1)/2 of F = 1 + grad_u (..., 5)."""
    rr, rz, zr, zz, hoop = np.moveaxis(grad_u, -1, 0)
    return np.stack([rr + (rr * rr + zr * zr) / 2, (rz + zr + rr * rz + zr * zz) / 2,
                     zz + (rz * rz + zz * zz) / 2, hoop + hoop * hoop / 2], axis=-1)


def push_forward(prestress: Array, grad_u: Array) -> Array:
    """First Piola stress (..., 5), F times a second Piola-Kirchhoff stress (..., 4), at F = 1 + grad_u (..., 5)."""
    rr, rz, zr, zz, hoop = np.moveaxis(grad_u, -1, 0)
    s_rr, s_rz, s_zz, s_hoop = np.moveaxis(prestress, -1, 0)
    return np.stack([(1 + rr) * s_rr + rz * s_rz, (1 + rr) * s_rz + rz * s_zz, zr * s_rr + (1 + zz) * s_rz,
                     zr * s_rz + (1 + zz) * s_zz, (1 + hoop) * s_hoop], axis=-1)


def geometric_stiffness(prestress: Array, negative_curvature_scale: float) -> Array:
    """d(F S)/dF (..., 5, 5) of a constant second Piola-Kirchhoff stress S (..., 4), negative parts scaled."""
    plane = prestress[..., [0, 1, 1, 2]].reshape(*prestress.shape[:-1], 2, 2)
    hoop = prestress[..., 3]
    if negative_curvature_scale != 1:
        value, vector = np.linalg.eigh(plane)
        value = np.where(value < 0, negative_curvature_scale, 1.0) * value
        plane = (vector * value[..., None, :]) @ np.swapaxes(vector, -1, -2)
        hoop = np.where(hoop < 0, negative_curvature_scale, 1.0) * hoop
    out = np.zeros((*hoop.shape, 5, 5))
    out[..., 0:2, 0:2], out[..., 2:4, 2:4], out[..., 4, 4] = plane, plane, hoop
    return out


def energy(law: Law, grid: Grid, u: Array, prestress: Array | None = None) -> float:
    """Stored energy; infinite where the foam would be turned inside out or squeezed out of the range of numbers. A
    prestress S (elements, points, 4), constant on the reference body, adds its potential S : E."""
    grad_u = deformation(grid, u)
    if not np.all(admissible(grad_u)):
        return np.inf
    with np.errstate(over="ignore", invalid="ignore"):
        local = energy_density(law, grad_u, projection_of(law, grid))
        if prestress is not None:
            local = local + (prestress * green_lagrange(grad_u)) @ _TWICE_OFF_DIAGONAL
        stored = float(np.sum(grid.weight * local))
    return stored if np.isfinite(stored) else np.inf


def residual_and_tangent(law: Law, grid: Grid, u: Array, negative_curvature_scale: float = 1.0,
                         prestress: Array | None = None) -> tuple[Array, Array]:
    """Gradient (unknowns,) and Hessian of the stored energy, its negative curvatures at points scaled. The Hessian is
    the lower band (unknowns, bandwidth + 1): column j holds rows j to j + bandwidth."""
    grad_u = deformation(grid, u)
    projection = projection_of(law, grid)
    at = response(law, grad_u, negative_curvature_scale, projection)
    force, tangent = at.stress, at.tangent
    if prestress is not None:
        force = force + push_forward(prestress, grad_u)
        tangent = tangent + geometric_stiffness(prestress, negative_curvature_scale)
    force, tangent = force * grid.weight[..., None], tangent * grid.weight[..., None, None]
    load, stiffness = element_integrals(grid, force, tangent)
    if projection is not None and at.by_volume is not None:
        stiffness += element_stiffness(grid, projection, grad_u, at.by_volume)
    return assemble(grid, load, stiffness)


def resisted(law: Law, grid: Grid, grad_u: Array) -> Array:
    """Logarithmic principal stretches (elements, points, 3) that the law resists, at F = 1 + grad_u of all points."""
    x = log_stretches(grad_u)
    if (projection := projection_of(law, grid)) is None:
        return x
    theta = x.sum(axis=-1)
    return x + ((projection(theta) - theta) / 3)[..., None]


def volume_modes(law: Law, grid: Grid, u: Array) -> Array | None:
    """(elements, m) of `grid.modes` in the logarithm of the change of volume that the law resists; None where that is
    the displacements' own."""
    if (projection := projection_of(law, grid)) is None:
        return None
    return projection.coefficients(log_stretches(deformation(grid, u)).sum(axis=-1))


def surface_volume(law: Law, grid: Grid, u: Array, facets: Indices, s: Array) -> Array | None:
    """Change of volume J (facets, points) that the law resists at s (points,) in [-1, 1] along top facets of these
    nodes (facets, p + 1); None where that is the displacements' own."""
    if (volume := volume_modes(law, grid, u)) is None:
        return None
    rows = len(grid.elements) // len(grid.top)
    element = rows * np.searchsorted(grid.top[:, 0], facets[:, 0]) + rows - 1
    return np.exp(volume[element] @ modes(s, np.ones(1), grid.order).T)


def projection_of(law: Law, grid: Grid) -> VolumeProjection | None:
    """How the change of volume is projected in a grid's elements; None for a law that does not need it."""
    return volume_projection(grid) if projects(law) else None


def element_integrals(grid: Grid, force: Array, tangent: Array) -> tuple[Array, Array]:
    """Loads (elements, n) sum_q B' force and stiffnesses (elements, n, n) sum_q B' tangent B of the elements' unknowns
    (u_r, u_z) node after node; B maps them to the parts rr, rz, zr, zz and hoop of F."""
    parts = grid.parts
    elements, points, _, n = parts.shape
    flat = parts.reshape(elements, 5 * points, n)
    load = (force.reshape(elements, 1, 5 * points) @ flat)[:, 0]
    return load, np.swapaxes(flat, 1, 2) @ (tangent @ parts).reshape(flat.shape)


def assemble(grid: Grid, load: Array, stiffness: Array) -> tuple[Array, Array]:
    """Sums (unknowns,) of the elements' loads and, as a lower band, of their stiffnesses."""
    width = grid.bandwidth + 1
    single, pair = grid.places
    gradient = np.bincount(single, load.ravel(), grid.unknowns + 1)[:-1]
    band = np.bincount(pair, stiffness.ravel(), grid.unknowns * width + 1)[:-1]
    return np.asarray(gradient, dtype=float), np.asarray(band.reshape(-1, width), dtype=float)
