"""The deformation gradient on the section of an axisymmetric touch."""

import math

import numpy as np

from eitsim.mechanics.solid.grid import lagrange, modes
from eitsim.scene.results import Section
from touchcal.arrays import Array, Index

# By order of the elements, the places of their nodes among order + 1 in each direction: corners counter-clockwise,
# middles of the edges from the first on, centre, as in VTK.
NODES = {1: np.array([(0, 0), (1, 0), (1, 1), (0, 1)]),
         2: np.array([(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)])}


def order_of(section: Section) -> int:
    """Order of a section's elements."""
    return math.isqrt(section.elements.shape[1]) - 1


def shapes(order: int, at: Array) -> tuple[Array, Array, Array]:
    """Nodal functions (points, nodes) at points (points, 2) in [-1, 1], and their derivatives along both."""
    node_r, node_z = NODES[order].T
    (shape_r, slope_r), (shape_z, slope_z) = (lagrange(order, t) for t in at.T)
    return (shape_r[:, node_r] * shape_z[:, node_z], slope_r[:, node_r] * shape_z[:, node_z],
            shape_r[:, node_r] * slope_z[:, node_z])


def displacement_gradient(section: Section, at: Array) -> Array:
    """F - 1 (elements, points, 5), parts rr, rz, zr, zz and hoop, at points (points, 2) in [-1, 1] of every element;
    u_r,r for the hoop at the axis."""
    return _gradient(section, np.arange(len(section.elements))[:, None], at)


def _gradient(section: Section, element: Index, at: Array) -> Array:
    """The same (..., 5) at points (points, 2) of elements (..., points or 1)."""
    place, moved = (nodes[section.elements[element]] for nodes in (section.nodes_m, section.displacement_m))
    shape, *slopes = shapes(order_of(section), at)
    half = (place[..., 2, :] - place[..., 0, :]) / 2
    along_r, along_z = (np.einsum("...a,...ai->...i", slope, moved) / half[..., i:i + 1]
                        for i, slope in enumerate(slopes))
    radius, outwards = (np.einsum("...a,...a->...", shape, nodes[..., 0]) for nodes in (place, moved))
    axis = radius == 0
    hoop = np.where(axis, along_r[..., 0], outwards / np.where(axis, 1.0, radius))
    return np.stack([along_r[..., 0], along_z[..., 0], along_r[..., 1], along_z[..., 1], hoop], axis=-1)


def deformation_of(grad_u: Array) -> Array:
    """Deformation gradients (..., 3, 3) along r, z and around, of the parts (..., 5) of F - 1."""
    gradient = np.zeros((*grad_u.shape[:-1], 3, 3))
    for part, (i, j) in enumerate([(0, 0), (0, 1), (1, 0), (1, 1), (2, 2)]):
        gradient[..., i, j] = grad_u[..., part]
    return gradient + np.eye(3)


def resisted_deformation(section: Section, grad_u: Array, at: Array) -> Array:
    """Deformation gradients (elements, points, 3, 3) of F - 1 (elements, points, 5) at points (points, 2) of every
    element, of the change of volume that a nearly incompressible law resists."""
    return _resisted(section, grad_u, np.arange(len(section.elements))[:, None], at)


def _resisted(section: Section, grad_u: Array, element: Index, at: Array) -> Array:
    gradient = deformation_of(grad_u)
    if section.log_volume is None:
        return gradient
    resisted = np.sum(section.log_volume[element] * modes(at[:, 0], at[:, 1], order_of(section)), axis=-1)
    return gradient * np.exp((resisted - np.log(np.linalg.det(gradient))) / 3)[..., None, None]


def gradient_at(section: Section, radius_m: Array, height_m: Array) -> Array:
    """Deformation gradients (..., 3, 3) along r, z and around, at radii and heights (...), m; the identity outside the
    section's last radius."""
    corners = section.nodes_m[section.elements[:, 0]]
    lines = [np.unique(np.append(corners[:, i], section.nodes_m[:, i].max())) for i in (0, 1)]
    number = np.empty([len(line) - 1 for line in lines], dtype=np.int64)
    number[tuple(np.searchsorted(line, corners[:, i]) for i, line in enumerate(lines))] = np.arange(len(corners))
    flat = [np.clip(np.ravel(x), line[0], line[-1]) for x, line in zip((radius_m, height_m), lines, strict=True)]
    index = [np.clip(np.searchsorted(line, x, side="right") - 1, 0, len(line) - 2)
             for x, line in zip(flat, lines, strict=True)]
    at = np.column_stack([2 * (x - line[i]) / (line[i + 1] - line[i]) - 1
                          for x, line, i in zip(flat, lines, index, strict=True)])
    element = number[tuple(index)]
    gradient = _resisted(section, _gradient(section, element, at), element, at)
    gradient[np.ravel(radius_m) > lines[0][-1]] = np.eye(3)
    return gradient.reshape(*np.shape(radius_m), 3, 3)
