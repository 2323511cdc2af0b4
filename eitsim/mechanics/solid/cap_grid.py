"""A mesh of the meridian half-plane bent onto a spherical cap: the layer outside, or inside, a rigid ball."""

from dataclasses import replace

import numpy as np

from eitsim.mechanics.solid.grid import Grid
from eitsim.scene.surfaces.geodesic_arcs import arcs
from touchcal.arrays import Array


def on_cap(grid: Grid, curvature: float) -> Grid:
    """An axisymmetric grid whose radii become arc lengths and heights distances along the normal, of a surface of a
    curvature (positive: convex) whose apex is the origin: isoparametric, its nodes exact. ValueError where the layer
    would reach the ball's centre or the arcs half a turn."""
    flat = grid.nodes
    if curvature * -float(flat[:, 1].min()) >= 1 or abs(curvature) * float(flat[:, 0].max()) >= np.pi:
        raise ValueError(f"a layer of thickness {-flat[:, 1].min():.3g} and length {flat[:, 0].max():.3g} does not fit "
                         f"on a ball of radius {1 / curvature:.3g}.")
    at, normal = meridian(flat[:, 0], curvature)
    nodes = at + flat[:, 1:] * normal
    nodes[flat[:, 0] == 0, 0] = 0.0
    corners, flat_radius = nodes[grid.elements], 1 / grid.gradient[..., 2].sum(axis=2)
    jacobian = np.einsum("eqak,eai->eqik", grid.gradient[..., :2], corners)
    inside = np.linalg.solve(np.swapaxes(jacobian, 2, 3)[:, :, None], grid.gradient[..., :2, None])[..., 0]
    value = grid.gradient[..., 2] * flat_radius[..., None]
    radius = np.einsum("eqa,ea->eq", value, corners[..., 0])
    weight = grid.weight * np.linalg.det(jacobian) * radius / flat_radius
    gradient = np.concatenate([inside, (value / radius[..., None])[..., None]], axis=-1)
    return replace(grid, nodes=nodes, gradient=gradient, weight=weight, laid=flat,
                   curvature=curvature)


def meridian(length: Array, curvature: float) -> tuple[Array, Array]:
    """Places and outward normals (n, 2), r and z, of the cap at arc lengths (n,) from its apex."""
    at, normal = arcs(np.column_stack([length, np.zeros_like(length)]), curvature * np.eye(2))
    return at[:, [0, 2]], normal[:, [0, 2]]
