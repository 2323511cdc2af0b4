"""Quadratic triangles that can follow the potential at the ends of line electrodes, where it starts as a root."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eitsim.cem import SkinMesh
from eitsim.halving import EDGES
from eitsim.unfolded import unfolded

Array = NDArray[np.float64]

# Part of the way along an edge that starts at the end of an electrode at which its middle node lies.
_QUARTER = 0.25
# A node on the rim is nearer to it than this, over its radius.
_ON_RIM = 1e-9


def with_quarter_points(mesh: SkinMesh) -> SkinMesh:
    """The P2 mesh of a disc with middle nodes moved to a quarter of the way from the ends of line electrodes, those two
    that touch have in common too, but where a triangle would fold over.

    Polynomials of an element are then polynomials of the root of the distance from there, and when it is halved the
    parts are graded towards it. Potentials behave so further from the end than z S; nodes on the rim stay there, whose
    curve the elements then follow to third order. The Jacobian is 0 at these ends themselves. Meshes with patches are
    given back as they are. Source: Barsoum, doi:10.1002/nme.1620100103.
    """
    if mesh.under.shape[1] != 3:
        return mesh
    owned = np.column_stack([mesh.under[:, :2].ravel(), np.repeat(mesh.electrode, 2)])
    corner, times = np.unique(owned, axis=0, return_counts=True)
    end = np.zeros(len(mesh.nodes_m), dtype=bool)
    end[corner[times == 1, 0]] = True
    place = mesh.nodes_m @ np.array([1, 1j])
    radius = abs(place[mesh.under[0, 0]])
    rim = np.abs(np.abs(place) - radius) < _ON_RIM * radius
    moved = place.copy()
    for i, j, middle in EDGES:
        for one, other in ((i, j), (j, i)):
            a, b, m = mesh.cells[end[mesh.cells[:, one]] & ~end[mesh.cells[:, other]]][:, [one, other, middle]].T
            along = place[a] * np.exp(1j * _QUARTER * np.angle(place[b] / place[a]))
            straight = (1 - _QUARTER) * place[a] + _QUARTER * place[b]
            moved[m] = np.where(rim[a] & rim[b] & rim[m], along, straight)
    return unfolded(replace(mesh, nodes_m=np.column_stack([moved.real, moved.imag])), mesh.nodes_m)
