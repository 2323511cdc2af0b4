"""An axisymmetric state read at points of space: the deformation gradient from its Gauss points, the surface's place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from eitsim import solid
from eitsim.pressing import Equilibrium, Pressing, interpolation, positions

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Base:
    """An axisymmetric equilibrium and its strain between the Gauss points; lengths in thicknesses."""

    model: Pressing
    state: Equilibrium
    # (n, 2) points (r, z) -> (n, 5) parts of F - 1 as in eitsim.solid
    strain: Callable[[Array], Array]
    # radius of the Gauss points next to the axis
    innermost: float


def base_of(model: Pressing, state: Equilibrium) -> Base:
    """Tabulate a state. Gauss points form a lattice, which is interpolated linearly: gradients at other places of the
    elements at the punch's edge may turn the foam inside out. The outermost points' lines go on to the surface."""
    grid = model.grid
    by_radius = grid.gradient[..., 2]
    radius = 1 / by_radius.sum(axis=-1)
    height = radius * (by_radius * grid.nodes[grid.elements][:, None, :, 1]).sum(axis=-1)
    radius, height = np.round(radius.ravel(), 9), np.round(height.ravel(), 9)
    lines = np.unique(radius), np.unique(height)
    values = solid.deformation(grid, state.x[:-1]).reshape(-1, 5)[np.lexsort([height, radius])]
    lattice = values.reshape(*map(len, lines), 5)
    table = RegularGridInterpolator(lines, lattice, bounds_error=False,
                                    fill_value=None)  # pyright: ignore[reportArgumentType]
    return Base(model, state, table, float(lines[0][0]))


def gradient(base: Base, points: Array) -> Array:
    """Deformation gradients (..., 3, 3) at points (..., 3) about the punch's axis."""
    radius, cosine, sine = polar(points)
    strain = base.strain(np.stack([np.maximum(radius, base.innermost), points[..., 2]], axis=-1))
    rr, rz, zr, zz, hoop = np.moveaxis(strain, -1, 0)
    rows = [[rr * cosine**2 + hoop * sine**2, (rr - hoop) * cosine * sine, rz * cosine],
            [(rr - hoop) * cosine * sine, rr * sine**2 + hoop * cosine**2, rz * sine],
            [zr * cosine, zr * sine, zz]]
    return np.eye(3) + np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def surface(base: Base, points: Array) -> Array:
    """Current positions (..., 3) of points (..., 3) of the surface."""
    grid = base.model.grid
    radius, cosine, sine = polar(points)
    top = np.append(grid.top[:, :-1].ravel(), grid.top[-1, -1])
    place = interpolation(grid.lines[0], radius.ravel(), grid.order) @ positions(base.model, base.state.x)[top]
    across, up = np.moveaxis(place.reshape(*radius.shape, 2), -1, 0)
    return np.stack([across * cosine, across * sine, up], axis=-1)


def polar(points: Array) -> tuple[Array, Array, Array]:
    """Distance of points (..., 2 or 3) from the axis, cosine and sine of their direction; (1, 0) on the axis."""
    radius = np.hypot(points[..., 0], points[..., 1])
    safe = np.where(radius > 0, radius, 1.0)
    return radius, np.where(radius > 0, points[..., 0] / safe, 1.0), points[..., 1] / safe
