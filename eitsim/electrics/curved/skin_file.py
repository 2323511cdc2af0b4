"""Fields on the skin of a curved body under touches, at corners and middles of its triangles, and their VTU file."""

from collections.abc import Mapping
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.cem.assembly import (
    Array,
    SkinMesh,
    centred,
    potentials,
    quadrature_points,
    tangent_axes,
    tangent_frames,
)
from eitsim.electrics.curved.facets import CORNERS, slopes
from eitsim.electrics.curved.touched_sheet import sheet_tensors, surface_stretches
from eitsim.electrics.mesh.p2_triangles import EDGES
from eitsim.scene.results import SpaceField
from eitsim.scene.scene import Skin
from matcal.laws.conductivity import Conductivity

_NODES = np.vstack([CORNERS, *((CORNERS[a] + CORNERS[b])[None] / 2 for a, b, _ in EDGES)])  # of a triangle


def curved_skin_fields(mesh: SkinMesh, z: Array, skin: Skin, law: Conductivity, field: SpaceField,
                       currents_A: Mapping[int, Array]) -> tuple[Array, NDArray[np.int64], dict[str, Array]]:
    """Points (n, 3) of the untouched surface, m, cells (t, 6), and point fields; each triangle has its own points.

    displacement_m; largest_in_plane_strain, the larger principal stretch less 1; sheet_conductance_S (n, 9), the tensor
    c t J_s C_s^-1 on the untouched surface, row by row; electrode, its number from 1, 0 on none; and of each pattern
    driven by currents (electrodes,), A, potential_V_<pattern>, the mean of the electrodes being 0 V.
    """
    corners = mesh.nodes_m[mesh.cells]
    one, other = np.einsum("tkx,pkb->btpx", corners, slopes(_NODES))
    frames = tangent_axes(one, other)
    metric, _ = surface_stretches(field, corners, frames)
    along = frames[..., :2]
    tensor = along @ sheet_tensors(field, corners, frames, skin, law) @ np.swapaxes(along, -1, -2)
    key = {tuple(cell): k for cell, k in zip(mesh.under.tolist(), mesh.electrode.tolist(), strict=True)}
    covered = np.array([1.0 + key.get(tuple(cell), -1) for cell in mesh.cells.tolist()])
    sheet = sheet_tensors(field, quadrature_points(mesh), tangent_frames(mesh), skin, law)
    potential = centred(mesh, potentials(mesh, sheet, z))[:len(mesh.nodes_m)]
    points = corners.reshape(-1, 3)
    fields = {"displacement_m": field.displacement(points),
              "largest_in_plane_strain": np.sqrt(np.linalg.eigvalsh(metric)[..., -1]).ravel() - 1,
              "sheet_conductance_S": tensor.reshape(-1, 9), "electrode": np.repeat(covered, 6)}
    digits = max([2, *(len(str(k)) for k in currents_A)])
    fields |= {f"potential_V_{k:0{digits}d}": (potential @ driven)[mesh.cells.ravel()]
               for k, driven in currents_A.items()}
    return points, np.arange(len(points)).reshape(-1, 6), fields


def write_curved_skin(path: Path | str, points_m: Array, cells: NDArray[np.int64], fields: Mapping[str, Array]) -> None:
    """Write fields as a VTU file; "Warp By Vector" with displacement_m shows the deformed skin."""
    meshio.Mesh(points_m, [("triangle6", cells)], point_data=dict(fields)).write(path, file_format="vtu")
