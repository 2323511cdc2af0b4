"""Large-strain foam on a grid: energy, residual and consistent tangent of a law.

Displacement gradients grad_u = F - 1 have the parts rr, rz, zr, zz and hoop.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.solid.grid import Grid, Indices, modes
from eitsim.mechanics.solid.meridian_response import ByVolume, area_change, energy_density, log_stretches, response
from eitsim.mechanics.solid.volume_projection import VolumeProjection, projects, volume_projection
from eitsim.numerics.linear_solvers import Solve, condensed, factorise_band
from eitsim.numerics.work_budget import charge
from matcal.laws.law import Law
from touchcal.arrays import Array, Index
from touchcal.jit import compiled, compiles


@dataclass(frozen=True)
class Stiffness:
    """A Hessian whose unknowns inside elements, which no other element has, are eliminated."""

    # (outer unknowns, bandwidth + 1) lower band of what is left: column j holds rows j to j + bandwidth
    band: Array
    inner: Array  # (elements, c, c) the Hessian of `Grid.inner`
    across: Array  # (elements, n, c) of the unknowns of `Grid.numbers` by these


# Weights of the parts rr, rz, zz and hoop of a symmetric tensor in a double contraction.
_TWICE_OFF_DIAGONAL = np.array([1.0, 2.0, 1.0, 1.0])


def deformation(grid: Grid, u: Array) -> Array:
    """F - 1 (elements, points, 5), parts rr, rz, zr, zz and hoop, of the unknown displacements u."""
    return _deformation(grid, u, slice(None))


def _deformation(grid: Grid, u: Array, element: Index | slice) -> Array:
    """The same of some elements."""
    moved, slopes = nodal(grid, u)[grid.elements[element]], grid.slopes[element]
    slope = (slopes.reshape(len(moved), -1, moved.shape[1]) @ moved).reshape(*slopes.shape[:3], 2)
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
                         prestress: Array | None = None) -> tuple[Array, Callable[[], Stiffness]]:
    """Gradient (unknowns,) and, when called, Hessian of the stored energy, its negative curvatures at points scaled."""
    grad_u = deformation(grid, u)
    projection = projection_of(law, grid)
    at = response(law, grad_u, negative_curvature_scale, projection)
    force, tangent = at.stress, at.tangent
    if prestress is not None:
        force = force + push_forward(prestress, grad_u)
        tangent = tangent + geometric_stiffness(prestress, negative_curvature_scale)
    return assembled_load(grid, force), lambda: assembled_stiffness(grid, tangent, at.by_volume)


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
    return _volume_modes(grid, u, slice(None)) if projects(law) else None


def _volume_modes(grid: Grid, u: Array, element: Index | slice) -> Array:
    volume = log_stretches(_deformation(grid, u, element)).sum(axis=-1)
    return VolumeProjection(grid.modes, grid.weight[element], grid.dual[element]).coefficients(volume)


def surface_volume(law: Law, grid: Grid, u: Array, facets: Indices, s: Array) -> Array | None:
    """Change of volume J (facets, points) that the law resists at s (points,) in [-1, 1] along top facets of these
    nodes (facets, p + 1); None where that is the displacements' own."""
    if not projects(law):
        return None
    rows = len(grid.elements) // len(grid.top)
    element = rows * np.searchsorted(grid.top[:, 0], facets[:, 0]) + rows - 1
    return np.exp(_volume_modes(grid, u, element) @ modes(s, np.ones(1), grid.order).T)


def projection_of(law: Law, grid: Grid) -> VolumeProjection | None:
    """How the change of volume is projected in a grid's elements; None for a law that does not need it."""
    return volume_projection(grid) if projects(law) else None


def assembled_load(grid: Grid, stress: Array) -> Array:
    """Integral (unknowns,) of B' stress (elements, points, 5); B maps the unknowns to the parts rr, rz, zr, zz and hoop
    of F."""
    elements, points, nodes, _ = grid.gradient.shape
    pushed = (grid.weight[..., None] * stress)[..., [0, 2, 1, 3, 4, 4]]  # along r and z by each of `Grid.slopes`
    pushed[..., 5] = 0.0
    slopes = grid.slopes.reshape(elements, 3 * points, nodes)
    load = np.swapaxes(slopes, 1, 2) @ pushed.reshape(elements, 3 * points, 2)
    gathered = np.bincount(grid.unknown[grid.elements].ravel() + 1, load.ravel(), grid.unknowns + 1)[1:]
    return np.asarray(gathered, dtype=float)


def assembled_stiffness(grid: Grid, tangent: Array, by_volume: ByVolume | None = None) -> Stiffness:
    """Integral of B' tangent (elements, points, 5, 5) B, symmetric; with what the projected change of volume couples.
    """
    if not compiles():
        return stiffness_by_arrays(grid, tangent, by_volume)
    band, none = np.zeros((len(grid.outer), grid.bandwidth + 1)), np.empty((1, 0, 0))
    count, inner = grid.inner.shape
    whole = Stiffness(band, np.empty((count, inner, inner)), np.empty((count, grid.numbers.shape[1], inner)))
    coupled = (none, none[0], none, none, none[0]) if by_volume is None else (
        grid.dual, grid.modes, by_volume.volume, by_volume.shape, by_volume.bulk)
    _assemble(grid.slopes, grid.numbers, grid.weight, np.ascontiguousarray(tangent), *coupled, band, whole.inner,
              whole.across)
    return whole


def stiffness_by_arrays(grid: Grid, tangent: Array, by_volume: ByVolume | None = None) -> Stiffness:
    """The same without compiled loops, which take a hundred times longer where they are not compiled."""
    elements, points, _, nodes = grid.slopes.shape
    parts = np.zeros((elements, points, 5, 2 * nodes))
    parts[:, :, [0, 1, 4], :nodes], parts[:, :, [2, 3], nodes:] = grid.slopes, grid.slopes[:, :, :2]
    flat = parts.reshape(elements, 5 * points, 2 * nodes)
    pushed = grid.weight[..., None, None] * (tangent @ parts)
    stiffness = np.swapaxes(flat, 1, 2) @ pushed.reshape(flat.shape)
    if by_volume is not None:
        shape, bulk = grid.weight[..., None] * by_volume.shape, grid.weight * by_volume.bulk
        by_mode = np.einsum("eqm,eqi,eqin->enm", grid.dual, by_volume.volume, parts, optimize=True)
        across = np.einsum("qm,eqi,eqin->enm", grid.modes, shape, parts, optimize=True)
        across += by_mode @ np.einsum("qm,qk,eq->emk", grid.modes, grid.modes, bulk, optimize=True) / 2
        coupled = across @ np.swapaxes(by_mode, 1, 2)
        stiffness += coupled + np.swapaxes(coupled, 1, 2)
    within, width = np.arange(2 * nodes) % nodes >= grid.numbers.shape[1] // 2, grid.bandwidth + 1
    inner, across = stiffness[:, within][:, :, within], stiffness[:, ~within][:, :, within]
    stiffness = stiffness[:, ~within][:, :, ~within] - across @ np.linalg.solve(inner, np.swapaxes(across, 1, 2))
    row, column = np.broadcast_arrays(grid.numbers[:, :, None], grid.numbers[:, None, :])
    kept = (row >= column) & (column >= 0)
    place = column[kept] * width + row[kept] - column[kept]
    band = np.bincount(place, stiffness[kept], len(grid.outer) * width)
    return Stiffness(np.asarray(band, dtype=float).reshape(-1, width), inner, across)


def factorised(grid: Grid, stiffness: Stiffness) -> Solve:
    """Cholesky factors of a stiffness, whose band is overwritten. Indefinite is raised where it is not positive."""
    charge(grid.inner.size)
    return condensed(factorise_band(stiffness.band), stiffness.inner, stiffness.across, grid.inner, grid.numbers,
                     grid.outer)


@compiled
def _assemble(slopes, numbers, weight, tangent, dual, modes, volume, shape, bulk, band, inner, coupling):
    points, nodes, count, inside = slopes.shape[1], slopes.shape[3], modes.shape[1], inner.shape[1] > 0
    outer = numbers.shape[1] // 2
    along, pushed, pair = np.empty((nodes, points, 3)), np.empty((nodes, points, 10)), np.empty((2, 2))
    by_mode, across, square = np.empty((2, nodes, count)), np.empty((2, nodes, count)), np.empty((count, count))
    local, passed = np.zeros((2, nodes, 2, nodes)), np.zeros((2, outer, 2))
    for e in range(slopes.shape[0]):
        by_mode[:] = 0.0
        across[:] = 0.0
        square[:] = 0.0
        for q in range(points):
            w, c = weight[e, q], tangent[e, q]
            for m in range(count):
                for k in range(count):
                    square[m, k] += w * bulk[e, q] * modes[q, m] * modes[q, k] / 2
            for a in range(nodes):
                r, z, hoop = slopes[e, q, 0, a], slopes[e, q, 1, a], slopes[e, q, 2, a]
                along[a, q, 0], along[a, q, 1], along[a, q, 2] = r, z, hoop
                for i in range(5):
                    pushed[a, q, i] = w * (c[i, 0] * r + c[i, 1] * z + c[i, 4] * hoop)
                    pushed[a, q, 5 + i] = w * (c[i, 2] * r + c[i, 3] * z)
                if count:
                    v, t = volume[e, q], shape[e, q]
                    v_r, v_z = v[0] * r + v[1] * z + v[4] * hoop, v[2] * r + v[3] * z
                    t_r, t_z = w * (t[0] * r + t[1] * z + t[4] * hoop), w * (t[2] * r + t[3] * z)
                    for m in range(count):
                        by_mode[0, a, m] += dual[e, q, m] * v_r
                        by_mode[1, a, m] += dual[e, q, m] * v_z
                        across[0, a, m] += modes[q, m] * t_r
                        across[1, a, m] += modes[q, m] * t_z
        for i in range(2):
            for a in range(nodes):
                for m in range(count):
                    for k in range(count):
                        across[i, a, m] += square[m, k] * by_mode[i, a, k]
        for a in range(nodes):
            for b in range(a + 1):
                rr, rz, zr, zz = 0.0, 0.0, 0.0, 0.0
                for q in range(points):
                    r, z, hoop, p = along[a, q, 0], along[a, q, 1], along[a, q, 2], pushed[b, q]
                    rr += r * p[0] + z * p[1] + hoop * p[4]
                    zr += r * p[2] + z * p[3]
                    rz += r * p[5] + z * p[6] + hoop * p[9]
                    zz += r * p[7] + z * p[8]
                pair[0, 0], pair[0, 1], pair[1, 0], pair[1, 1] = rr, rz, zr, zz
                for i in range(2):
                    for j in range(2):
                        value = pair[i, j]
                        for m in range(count):
                            value += across[i, a, m] * by_mode[j, b, m] + by_mode[i, a, m] * across[j, b, m]
                        local[i, a, j, b] = value
        if inside:
            for i in range(2):
                for j in range(2):
                    inner[e, i, j] = local[i, outer, j, outer]
            first, mixed, second = inner[e, 0, 0], inner[e, 1, 0], inner[e, 1, 1]
            det = first * second - mixed * mixed
            for j in range(2):
                for b in range(outer):
                    r, z = local[0, outer, j, b], local[1, outer, j, b]
                    coupling[e, j * outer + b, 0], coupling[e, j * outer + b, 1] = r, z
                    passed[j, b, 0], passed[j, b, 1] = (second * r - mixed * z) / det, (first * z - mixed * r) / det
        for i in range(2):
            for a in range(outer):
                row = numbers[e, i * outer + a]
                for j in range(2):
                    for b in range(a + 1 if j <= i else a):
                        column = numbers[e, j * outer + b]
                        if row < 0 or column < 0:
                            continue
                        value = local[i, a, j, b]
                        if inside:
                            value -= passed[i, a, 0] * coupling[e, j * outer + b, 0]
                            value -= passed[i, a, 1] * coupling[e, j * outer + b, 1]
                        band[min(row, column), abs(row - column)] += value
