"""Fields on the skin of a touched scene: potential, current density, sheet conductance, and their VTU file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray
from skfem import ElementQuad2, ElementTriP1, ElementTriP2

from eitsim.electrics.cem.assembly import Array, SkinMesh, centred, potentials, quadrature_points
from eitsim.electrics.cem.floating_electrodes import floating, shunts
from eitsim.electrics.forward.skins import skin_of
from eitsim.scene.drive import protocol
from eitsim.scene.electrodes import contact_impedances, present, there
from eitsim.scene.results import Touch
from eitsim.scene.scene import Punch, Scene
from eitsim.sheet import sheet_conductance as sheet
from eitsim.sheet.sheet_conductance import touched_conductance
from eitsim.sheet.sheet_displacement import displacement
from matcal.laws.conductivity import Conductivity

Touches = tuple[tuple[Punch, Touch], ...]

# Name of the cell in VTK, whose order of nodes is the same, and the element, by the mesh's element.
_CELLS = {"P1": ("triangle", ElementTriP1), "P2": ("triangle6", ElementTriP2), "Q2": ("quad9", ElementQuad2)}
# An element's area at one of its nodes, over its mean, below which that node takes the gradient of the whole.
_COLLAPSED = 1e-6
_INWARDS = 1e-3  # Part of the way to an element's middle at which its nodes are taken to lie under a punch or not.


def write_skin_vtu(scene: Scene, touches: Sequence[Touch], law: Conductivity, path: Path | str,
                   patterns: Sequence[int] | None = None) -> None:
    """Write the fields of `skin_fields` as a VTU file; "Warp By Vector" with displacement_m shows the deformed skin."""
    fields: dict[str, Any]
    points, (cell, numbers), fields = skin_fields(scene, touches, law, patterns)
    cells: list[Any] = [(cell, numbers)]
    meshio.Mesh(points, cells, point_data=fields).write(path, file_format="vtu")


def skin_fields(scene: Scene, touches: Sequence[Touch], law: Conductivity, patterns: Sequence[int] | None = None
                ) -> tuple[Array, tuple[str, NDArray[np.int64]], dict[str, Array]]:
    """Points (n, 3) of the untouched surface, m, the cell's name in VTK with its nodes, and point fields; each cell has
    its own points, so that nothing is averaged.

    displacement_m; contact_pressure_Pa, facet averages, of the touch alone where the rim or a neighbour changes it;
    largest_in_plane_strain, the larger principal stretch less 1; sheet_conductance_S (n, 9), the tensor
    c t J_s C_s^-1 on the untouched surface, row by row; and of every pattern asked for (from 0; all by default)
    potential_V_<pattern> and untouched_potential_V_<pattern>, the mean of the electrodes being 0 V, and
    current_density_A_per_m_<pattern>, -sigma grad V per length of the untouched surface. A node where its cell is
    collapsed takes what the cell has at its middle; taken_from_middle tells where. The mesh follows the touches, also
    where the scene's own readings are solved without one, so that both differ by its error.
    Where punches conduct: contact_conductance_S_per_m2 to them, per area of the untouched surface, 0 outside their
    contacts; into_punch_A_per_m2_<pattern>, the current density into them; and shorted_potential_V_<pattern>, the
    punch's potential where it touches, the skin's elsewhere.

    ValueError for an unknown pattern, and one that drives a missing electrode.
    """
    currents = driven_currents(scene, patterns)
    pairs = tuple(zip(scene.punches, touches, strict=True))
    electrodes = present(scene.electrodes)
    free = sheet.untouched_conductance(law, scene.skin)
    mesh = skin_of(scene.body, electrodes, free).touched_mesh(pairs)
    sheets = (touched_conductance(quadrature_points(mesh), pairs, scene.skin, law),
              np.full(len(mesh.cells), sheet.untouched_conductance(law, scene.skin)))
    driven = np.stack(list(currents.values()))[:, there(scene.electrodes)]
    touched, untouched = (
        centred(mesh, potentials(mesh, conductance, contact_impedances(electrodes), floating=conductors))[:-mesh.count]
        @ driven.T for conductance, conductors in zip(sheets, (floating(mesh, pairs), None), strict=True))
    nodes = len(mesh.nodes_m)
    points, cells, fields = _at_nodes(mesh, pairs, scene, law, touched[:nodes], list(currents))
    fields |= _named("untouched_potential_V", untouched[mesh.cells.ravel()], list(currents))
    return points, cells, fields | _under_punches(mesh, pairs, touched[:nodes], touched[nodes:], list(currents))


def _under_punches(mesh: SkinMesh, touches: Touches, potential: Array, punches: Array,
                   patterns: Sequence[int]) -> dict[str, Array]:
    """Fields of conducting punches at potentials (conductors, patterns), V, over a skin at potentials (nodes,
    patterns), V; none without one."""
    if not len(punches):
        return {}
    place = mesh.nodes_m[mesh.cells]
    inside = place + _INWARDS * (place.mean(axis=1, keepdims=True) - place)
    joined = shunts(inside.reshape(-1, 2), touches)
    skin = potential[mesh.cells.ravel()]
    shorted = np.where((joined.sum(axis=0) > 0)[:, None], punches[joined.argmax(axis=0)], skin)
    density = joined.sum(axis=0)[:, None] * (skin - shorted)
    return {"contact_conductance_S_per_m2": joined.sum(axis=0)} | _named(
        "into_punch_A_per_m2", density, patterns) | _named("shorted_potential_V", shorted, patterns)


def _named(name: str, values: Array, patterns: Sequence[int]) -> dict[str, Array]:
    """Values (..., patterns) by the numbers of their patterns."""
    digits = max(2, len(str(max(patterns))))
    return {f"{name}_{k:0{digits}d}": values[..., i] for i, k in enumerate(patterns)}


def driven_currents(scene: Scene, patterns: Sequence[int] | None = None) -> dict[int, Array]:
    """Currents (electrodes,), A, of the patterns asked for, by default all that need no missing electrode; ValueError
    where `skin_fields` raises one."""
    rows = protocol(scene.drive, scene.electrodes.count).currents_A
    lost = ~there(scene.electrodes)
    known = [k for k, row in enumerate(rows) if not row[lost].any()]
    asked = known if patterns is None else list(patterns)
    for k in asked:
        if k not in known:
            problem = f"is none of 0 to {len(rows) - 1}" if not 0 <= k < len(rows) else "drives a missing electrode"
            raise ValueError(f"pattern {k} {problem}; patterns are counted from 0.")
    return {k: rows[k] for k in asked}


def _at_nodes(mesh: SkinMesh, touches: Touches, scene: Scene, law: Conductivity, potential: Array,
              patterns: Sequence[int]) -> tuple[Array, tuple[str, NDArray[np.int64]], dict[str, Array]]:
    """The fields at the nodes of every cell by itself, of potentials (nodes, patterns), V."""
    cell, element = _CELLS[mesh.element]
    place = mesh.nodes_m[mesh.cells]
    gradient, middle = _gradients(element, place, potential[mesh.cells])
    sigma = touched_conductance(place, touches, scene.skin, law)
    density = -np.einsum("enab,enbp->enap", sigma, gradient)
    points = place.reshape(-1, 2)
    metric, _ = sheet.added_metric(points, touches)
    fields = {"displacement_m": surface_displacement(points, touches),
              "contact_pressure_Pa": contact_pressure(points, touches),
              "largest_in_plane_strain": np.sqrt(np.linalg.eigvalsh(metric)[:, -1]) - 1,
              "sheet_conductance_S": _in_space(sigma.reshape(-1, 2, 2)).reshape(-1, 9),
              "taken_from_middle": middle.ravel().astype(float)}
    fields |= _named("potential_V", potential[mesh.cells.ravel()], patterns)
    fields |= _named("current_density_A_per_m", np.stack([_in_space(density[..., i].reshape(-1, 2))
                                                          for i in range(len(patterns))], axis=-1), patterns)
    numbers = np.arange(len(points)).reshape(mesh.cells.shape)
    return _in_space(points), (cell, numbers), fields


def _gradients(element: Any, place: Array, value: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Gradients (cells, k, 2, patterns) at the k nodes of cells (cells, k, 2) of nodal values (cells, k, patterns), and
    where the middle's stand for them (cells, k)."""
    nodes = np.array(element.doflocs, dtype=float)
    at = np.vstack([nodes, nodes[:element.refdom.nnodes].mean(axis=0)]).T
    slope = np.stack([np.broadcast_to(element().lbasis(at, i)[1], at.shape).T for i in range(len(nodes))], axis=1)
    jacobian = np.einsum("eka,nkb->enab", place, slope)
    area = np.abs(np.linalg.det(jacobian))
    collapsed = area[:, :-1] < _COLLAPSED * area.mean(axis=1, keepdims=True)
    jacobian[:, :-1][collapsed] = np.repeat(jacobian[:, -1:], len(nodes), axis=1)[collapsed]
    local = np.einsum("nkb,ekp->enbp", slope, value)
    local[:, :-1][collapsed] = np.repeat(local[:, -1:], len(nodes), axis=1)[collapsed]
    return (np.linalg.inv(jacobian).swapaxes(-1, -2) @ local)[:, :-1], collapsed


def contact_pressure(points_m: Array, touches: Touches) -> Array:
    """Pressure (n,), Pa, at points (n, 2), interpolated between facet averages; none outside a touch's samples."""
    return np.sum([np.interp(np.linalg.norm(points_m - np.array([punch.x_m, punch.y_m]), axis=1), touch.radius_m,
                             touch.pressure_Pa, right=0.0) for punch, touch in touches], axis=0)


def surface_displacement(points_m: Array, touches: Touches) -> Array:
    """Displacement (n, 3), m, of points (n, 2) of the surface: the sum over the touches, 0 outside their samples; those
    that share a field count once."""
    return np.sum([displacement(points_m, *touch) for touch in sheet.solutions(touches)], axis=0)


def _in_space(plane: Array) -> Array:
    """Vectors (n, 2) or tensors (n, 2, 2) of the plane with zeros in the third direction."""
    return np.pad(plane, [(0, 0), *[(0, 1)] * (plane.ndim - 1)])
