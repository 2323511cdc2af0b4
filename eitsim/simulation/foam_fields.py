"""Fields inside the foam of a touch, on its axisymmetric section or near the rim in the volume, and their VTU file."""

from pathlib import Path
from typing import Any

import meshio
import numpy as np

from eitsim.mechanics.rim.half_disc_fields import volume_fields
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.kinematics import tensors
from eitsim.mechanics.solid.section_gradient import NODES, displacement_gradient, order_of, resisted_deformation
from eitsim.scene.results import Array, Section, Touch

_CELLS = {1: "quad", 2: "quad9"}  # By order of the elements, the cell's name.


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
        order = order_of(_section(touch))
        blocks = [(_CELLS[order], np.arange(len(points)).reshape(-1, len(NODES[order])))]
    cells: list[Any] = list(blocks)
    meshio.Mesh(points, cells, point_data=fields).write(path, file_format="vtu")


def section_fields(touch: Touch) -> tuple[Array, dict[str, Array]]:
    """Points (n elements, 3), m, and point fields, each element with its own n = 4 or 9 nodes: nothing is averaged.

    Tensors (n elements, 9) are row by row in the order r, z, hoop, see `tensors.tensors`. A node at which the gradient
    turns the foam inside out takes the gradient of its element's centre; taken_from_centre tells where.
    contact_pressure_Pa, facet averages on the deformed surface, is 0 below the top.
    """
    section = _section(touch)
    order = order_of(section)
    at = 2 / order * NODES[order] - 1
    grad_u = displacement_gradient(section, at)
    fine = axisymmetric_assembly.admissible(grad_u)
    grad_u = np.where(fine[..., None], grad_u, displacement_gradient(section, np.zeros((1, 2))))
    gradient = resisted_deformation(section, grad_u, at).reshape(-1, 3, 3)
    flat = section.elements.ravel()
    moved, place = section.displacement_m[flat], section.nodes_m[flat]
    none = np.zeros(len(flat))
    pressure = np.interp(place[:, 0], touch.radius_m, touch.pressure_Pa)
    fields = {"displacement_m": np.column_stack([moved, none]), **tensors(section.law, gradient),
              "contact_pressure_Pa": np.where(place[:, 1] == section.nodes_m[:, 1].max(), pressure, 0.0),
              "taken_from_centre": (~fine).ravel().astype(float)}
    return np.column_stack([place, none]), fields


def _section(touch: Touch) -> Section:
    if touch.rim is not None:
        raise ValueError("the section knows no rim, which this touch has; take its fields in the volume.")
    if touch.section is None:
        raise ValueError("this touch keeps no fields inside the layer: it is from a table or from `general`. Solve "
                         "the scene with solve_scene(..., bodies=False), as `eitsim run --fields` does.")
    return touch.section
