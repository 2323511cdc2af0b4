"""The deformed surface of a layer as a field: what a skin on it takes, at any place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.general.meshing.surface_places import Places, places
from eitsim.mechanics.general.meshing.wedge import shapes
from eitsim.mechanics.general.meshing.wedge_mesh import WedgeMesh
from touchcal.arrays import Array

_TOGETHER = 20_000  # Places that are looked at together.


@dataclass(frozen=True, eq=False)
class LayerField:
    """How the surface is deformed at places (n, 2), m, of the untouched skin, by coordinates as it was laid out; as it
    was where the mesh ends. Vectors are along two tangents and the normal there."""

    mesh: WedgeMesh
    moved: Array  # (nodes, 3) displacements, thicknesses
    thickness_m: float
    # one a punch: closed curves (k, 2), m, on the untouched skin, outside which nothing touches it; empty where nothing
    # does
    contact_curves_m: tuple[Array, ...]

    def metric(self, points_m: Array) -> tuple[Array, Array]:
        """In-plane right Cauchy-Green tensor (..., 2, 2) of the surface, and stretch (...) normal to it, J over the
        areal stretch, at points (..., 2)."""
        return metric_of(self.deformation_gradient(points_m))

    def deformation_gradient(self, points_m: Array) -> Array:
        """F (..., 3, 3) at the surface; the identity where the mesh ends."""
        def at(found: Places) -> Array:
            inside = found.element >= 0
            nodes = self.mesh.elements[found.element[inside]]
            _, slope = shapes(found.reference[inside])
            jacobian = np.einsum("nai,nad->nid", self.mesh.nodes[nodes], slope)
            by_reference = np.einsum("nai,nad->nid", self.moved[nodes], slope)
            out = np.tile(np.eye(3), (len(inside), 1, 1))
            turn = self._turn(found, inside)
            out[inside] += np.swapaxes(turn, 1, 2) @ by_reference @ np.linalg.inv(jacobian) @ turn
            return out

        return self._by_parts(points_m, at, (3, 3))

    def displacement(self, points_m: Array) -> Array:
        """Displacement (..., 3), m, of the surface; none where the mesh ends."""
        def at(found: Places) -> Array:
            inside = found.element >= 0
            value, _ = shapes(found.reference[inside])
            out = np.zeros((len(inside), 3))
            moved = np.einsum("na,nai->ni", value, self.moved[self.mesh.elements[found.element[inside]]])
            out[inside] = np.einsum("nij,ni->nj", self._turn(found, inside), moved)
            return out * self.thickness_m

        return self._by_parts(points_m, at, (3,))

    def _turn(self, found: Places, inside: NDArray[np.bool_]) -> Array:
        return self.mesh.layout.turn(found.points[inside])

    def _by_parts(self, points_m: Array, at, shape: tuple[int, ...]) -> Array:
        points = np.reshape(points_m, (-1, 2)) / self.thickness_m
        parts = [at(places(self.mesh, points[k:k + _TOGETHER])) for k in range(0, len(points), _TOGETHER)]
        return np.concatenate([np.empty((0, *shape)), *parts]).reshape(*np.shape(points_m)[:-1], *shape)


def metric_of(f: Array) -> tuple[Array, Array]:
    """In-plane metric (..., 2, 2) and stretch (...) normal to the surface of gradients F (..., 3, 3) along two
    tangents and the normal."""
    along = f[..., :2]
    metric = np.swapaxes(along, -1, -2) @ along
    areal = np.sqrt(metric[..., 0, 0] * metric[..., 1, 1] - metric[..., 0, 1] ** 2)
    return metric, np.linalg.det(f) / areal
