"""Fields inside the foam of a touch, on its axisymmetric section, and their VTU file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from eitsim import solid
from eitsim.mesh import lagrange
from eitsim.results import Section, Touch
from matcal.ellipticity import strongly_elliptic
from matcal.hyperfoam import kirchhoff

Array = NDArray[np.float64]

# By order of the elements, the cell's name and the places of its nodes among order + 1 in each direction: corners
# counter-clockwise, middles of the edges from the first on, centre, as in VTK.
_CELLS = {1: ("quad", np.array([(0, 0), (1, 0), (1, 1), (0, 1)])),
          2: ("quad9", np.array([(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]))}


def write_vtu(touch: Touch, path: Path | str) -> None:
    """Write the fields of a touch as a VTU file, point data on the elements of the undeformed (r, z) section.

    Points are (r, z, 0), m; names end in units, and what has none has no unit. "Warp By Vector" with displacement_m
    shows the deformed foam. ValueError where the touch has no section, or a rim that the section does not know.
    """
    fields: dict[str, Any]
    points, fields = section_fields(touch)
    cell, place = _CELLS[_order(_section(touch))]
    cells = np.arange(len(points)).reshape(-1, len(place))
    meshio.Mesh(points, [(cell, cells)], point_data=fields).write(path, file_format="vtu")


def section_fields(touch: Touch) -> tuple[Array, dict[str, Array]]:
    """Points (n elements, 3), m, and point fields, each element with its own n = 4 or 9 nodes: nothing is averaged.

    Tensors (n elements, 9) are row by row in the order r, z, hoop. Green-Lagrange strain is (F'F - 1)/2, nominal strain
    V - 1 with V^2 = FF'; Kirchhoff stress is J times Cauchy's. A node at which the gradient turns the foam inside out
    takes the gradient of its element's centre; taken_from_centre tells where. elliptic is 1 where the law is strongly
    elliptic. contact_pressure_Pa, facet averages on the deformed surface, is 0 below the top.
    """
    section = _section(touch)
    order = _order(section)
    strain = _gradient(section, 2 / order * _CELLS[order][1] - 1)
    fine = solid.admissible(strain)
    strain = np.where(fine[..., None], strain, _gradient(section, np.zeros((1, 2)))).reshape(-1, 5)
    flat = section.elements.ravel()
    moved, place = section.displacement_m[flat], section.nodes_m[flat]
    none = np.zeros(len(flat))
    pressure = np.interp(place[:, 0], touch.radius_m, touch.pressure_Pa)
    fields = {"displacement_m": np.column_stack([moved, none]), **_tensors(section, strain),
              "contact_pressure_Pa": np.where(place[:, 1] == section.nodes_m[:, 1].max(), pressure, 0.0),
              "elliptic": strongly_elliptic(section.law, solid.log_stretches(strain)).astype(float),
              "taken_from_centre": (~fine).ravel().astype(float)}
    return np.column_stack([place, none]), fields


def _section(touch: Touch) -> Section:
    if touch.rim is not None:
        raise ValueError("the fields inside the foam are kept without the rim's effect, which this touch has; write "
                         "those of a touch far from the rim.")
    if touch.section is None:
        raise ValueError("this touch keeps no fields inside the foam; solve it with eitsim.axisymmetric.")
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


def _tensors(section: Section, strain: Array) -> dict[str, Array]:
    gradient = np.zeros((len(strain), 3, 3))
    for part, (i, j) in enumerate([(0, 0), (0, 1), (1, 0), (1, 1), (2, 2)]):
        gradient[:, i, j] = strain[:, part]
    gradient += np.eye(3)
    volume = np.linalg.det(gradient)
    square, axes = np.linalg.eigh(gradient @ np.swapaxes(gradient, 1, 2))
    stretch = np.sqrt(square)
    stress = _from_axes(kirchhoff(section.law, np.log(stretch)), axes)
    tensors = {"deformation_gradient": gradient,
               "green_lagrange_strain": (np.swapaxes(gradient, 1, 2) @ gradient - np.eye(3)) / 2,
               "nominal_strain": _from_axes(stretch - 1, axes), "kirchhoff_stress_Pa": stress,
               "cauchy_stress_Pa": stress / volume[:, None, None]}
    return {name: tensor.reshape(-1, 9) for name, tensor in tensors.items()} | {"volume_ratio": volume}


def _from_axes(value: Array, axes: Array) -> Array:
    """Symmetric tensors (n, 3, 3) of principal values (n, 3) on axes, columns of (n, 3, 3)."""
    return (axes * value[:, None, :]) @ np.swapaxes(axes, 1, 2)
