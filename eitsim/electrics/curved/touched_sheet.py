"""A sheet in space whose conductance follows what touches do to the body under it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from eitsim.electrics.cem.assembly import Array, SkinMesh, quadrature_points, tangent_axes, tangent_frames
from eitsim.electrics.curved.adapted_sheet import SheetReadings, solve_sheet
from eitsim.electrics.curved.facets import Facets
from eitsim.electrics.curved.rounds import Ball, refined_at
from eitsim.scene.results import SpaceField
from eitsim.scene.scene import Skin
from eitsim.sheet.sheet_conductance import NEAR_RANGE, conductance_of, driving_strain, untouched_conductance
from matcal.laws.conductivity import Conductivity

_ALONG = 2.0  # Length of the first triangles at a contact's end over that over which strains fall there.


@dataclass(frozen=True)
class ContactEnd:
    """Where strains are steep: the sheet cut by a ball's surface."""

    centre_m: tuple[float, ...]  # (3,) m
    radius_m: float  # of the ball, m
    steep_m: float  # length over which strains fall there, m


def solve_touched(facets: Facets, z: Array, skin: Skin, law: Conductivity, field: SpaceField,
                  ends: Sequence[ContactEnd], readings: float, signal: float) -> SheetReadings:
    """Readings of a sheet untouched, and with the conductance that a field in space gives it: on triangles cut small at
    the ends of contacts, then halved as `solve_sheet` does; z (electrodes,), Ohm m^2."""
    facets = refined_at(facets, [Ball(np.asarray(end.centre_m), end.radius_m, _edges_around(end)) for end in ends])
    return solve_sheet(facets, z, partial(_at_rest, untouched_conductance(law, skin)),
                       partial(_pressed, field, skin, law), readings, signal)


def _edges_around(end: ContactEnd) -> int:
    return max(16, int(np.ceil(2 * np.pi * end.radius_m / (_ALONG * end.steep_m))))


def _at_rest(sheet_S: float, mesh: SkinMesh, facets: Facets, parts: int) -> Array:
    return np.full(len(mesh.cells), sheet_S)


def _pressed(field: SpaceField, skin: Skin, law: Conductivity, mesh: SkinMesh, facets: Facets, parts: int) -> Array:
    return sheet_tensors(field, quadrature_points(mesh), tangent_frames(mesh), skin, law)


def sheet_tensors(field: SpaceField, points_m: Array, frames: Array, skin: Skin, law: Conductivity) -> Array:
    """Conductance (..., 2, 2), S, c t J_s C_s^-1 of a sheet at points (..., 3), m, along the first two columns of
    orthonormal frames (..., 3, 3) whose third is its normal."""
    return conductance_of(*surface_stretches(field, points_m, frames), skin, law)


def surface_stretches(field: SpaceField, points_m: Array, frames: Array) -> tuple[Array, Array]:
    """In-plane metric (..., 2, 2) and normal stretch (...), det F over the areal one, of a sheet; frames as in
    `sheet_tensors`."""
    f = field.deformation_gradient(points_m.reshape(-1, 3)).reshape(*points_m.shape, 3)
    along = f @ frames[..., :2]
    metric = np.swapaxes(along, -1, -2) @ along
    areal = np.linalg.norm(np.cross(along[..., 0], along[..., 1]), axis=-1)
    return metric, np.linalg.det(f) / areal


def strained_outside(mesh: SkinMesh, field: SpaceField, skin: Skin, law: Conductivity) -> float:
    """Fraction of the sheet whose driving strain lies outside the fitted range by more than NEAR_RANGE, at the middles
    of its triangles."""
    corners = mesh.nodes_m[mesh.cells[:, :3]]
    along, across = (corners[:, k] - corners[:, 0] for k in (1, 2))
    metric, normal = surface_stretches(field, corners.mean(axis=1), tangent_axes(along, across))
    first, second = np.sqrt(np.moveaxis(np.linalg.eigvalsh(metric), -1, 0))
    strain = driving_strain(skin.strain, first, second, normal)
    far = np.abs(strain - np.clip(strain, *law.strain_range)) > NEAR_RANGE
    area = np.linalg.norm(np.cross(along, across), axis=1)
    return float(area[far].sum() / area.sum())
