"""Fields inside the foam of a touch, on its axisymmetric section or near the rim in the volume, and their VTU file."""

import math
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from eitsim.mechanics.rim.half_disc_fields import volume_fields
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.grid import lagrange, modes
from eitsim.mechanics.solid.kinematics import tensors
from eitsim.scene.results import Array, Section, Touch

# By order of the elements, the cell's name and the places of its nodes among order + 1 in each direction: corners
# counter-clockwise, middles of the edges from the first on, centre, as in VTK.
_CELLS = {1: ("quad", np.array([(0, 0), (1, 0), (1, 1), (0, 1)])),
          2: ("quad9", np.array([(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]))}


def write_vtu(touch: Touch, path: Path | str) -> None:
    """Write the fields of a touch as a VTU file, point data on cells of the undeformed foam, each with its own points.

    Points are (r, z, 0) on the axisymmetric section, m; of a touch with a rim (x, y, z) in the half disc, see
    `half_disc.volume_fields`. Names end in units, and what has none has no unit. "Warp By Vector" with displacement_m
    shows the deformed foam. ValueError where the touch keeps no such fields.
    """
    fields: dict[str, Any]
    if touch.rim is not None:
        points, blocks, fields = volume_fields(touch)
    else:
        points, fields = section_fields(touch)
        cell, place = _CELLS[_order(_section(touch))]
        blocks = [(cell, np.arange(len(points)).reshape(-1, len(place)))]
    cells: list[Any] = list(blocks)
    meshio.Mesh(points, cells, point_data=fields).write(path, file_format="vtu")


def section_fields(touch: Touch) -> tuple[Array, dict[str, Array]]:
    """Points (n elements, 3), m, and point fields, each element with its own n = 4 or 9 nodes: nothing is averaged.

    Tensors (n elements, 9) are row by row in the order r, z, hoop, see `tensors.tensors`. A node at which the gradient
    turns the foam inside out takes the gradient of its element's centre; taken_from_centre tells where.
    contact_pressure_Pa, facet averages on the deformed surface, is 0 below the top.
    """
    section = _section(touch)
    order = _order(section)
    at = 2 / order * _CELLS[order][1] - 1
    grad_u = _gradient(section, at)
    fine = axisymmetric_assembly.admissible(grad_u)
    grad_u = np.where(fine[..., None], grad_u, _gradient(section, np.zeros((1, 2)))).reshape(-1, 5)
    flat = section.elements.ravel()
    moved, place = section.displacement_m[flat], section.nodes_m[flat]
    none = np.zeros(len(flat))
    pressure = np.interp(place[:, 0], touch.radius_m, touch.pressure_Pa)
    gradient = _matrix(grad_u)
    if section.log_volume is not None:
        resisted = (section.log_volume @ modes(at[:, 0], at[:, 1], order).T).ravel()
        gradient *= np.exp((resisted - np.log(np.linalg.det(gradient))) / 3)[:, None, None]
    fields = {"displacement_m": np.column_stack([moved, none]), **tensors(section.law, gradient),
              "contact_pressure_Pa": np.where(place[:, 1] == section.nodes_m[:, 1].max(), pressure, 0.0),
              "taken_from_centre": (~fine).ravel().astype(float)}
    return np.column_stack([place, none]), fields


def _section(touch: Touch) -> Section:
    if touch.rim is not None:
        raise ValueError("the section knows no rim, which this touch has; take its fields in the volume.")
    if touch.section is None:
        raise ValueError("this touch keeps no fields inside the foam: it is from a table or from `general`. Solve "
                         "the scene with solve_scene(..., bodies=False), as `eitsim run --fields` does.")
    return touch.section


def _order(section: Section) -> int:
    return math.isqrt(section.elements.shape[1]) - 1


def _gradient(section: Section, at: Array) -> Array:
    """F - 1 (elements, points, 5), parts rr, rz, zr, zz and hoop, at points (points, 2) in [-1, 1] of every element;
    u_r,r for the hoop at the axis."""
    place, moved = section.nodes_m[section.elements], section.displacement_m[section.elements]
    order = _order(section)
    node_r, node_z = _CELLS[order][1].T
    (shape_r, slope_r), (shape_z, slope_z) = (lagrange(order, t) for t in at.T)
    shape = shape_r[:, node_r] * shape_z[:, node_z]
    by_r, by_z = slope_r[:, node_r] * shape_z[:, node_z], shape_r[:, node_r] * slope_z[:, node_z]
    half = (place[:, 2] - place[:, 0]) / 2
    along_r = np.einsum("na,eai->eni", by_r, moved) / half[:, None, :1]
    along_z = np.einsum("na,eai->eni", by_z, moved) / half[:, None, 1:]
    radius, outwards = place[..., 0] @ shape.T, moved[..., 0] @ shape.T
    axis = radius == 0
    hoop = np.where(axis, along_r[..., 0], outwards / np.where(axis, 1.0, radius))
    return np.stack([along_r[..., 0], along_z[..., 0], along_r[..., 1], along_z[..., 1], hoop], axis=-1)


def _matrix(grad_u: Array) -> Array:
    """Deformation gradients (n, 3, 3) of the parts rr, rz, zr, zz and hoop (n, 5) of F - 1."""
    gradient = np.zeros((len(grad_u), 3, 3))
    for part, (i, j) in enumerate([(0, 0), (0, 1), (1, 0), (1, 1), (2, 2)]):
        gradient[:, i, j] = grad_u[:, part]
    return gradient + np.eye(3)
