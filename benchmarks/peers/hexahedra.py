"""A layer in space under a rigid round punch, solved once more: triquadratic bricks of scikit-fem, law in closed form.

Mesh, elements, stress, contact and iteration are its own; only the elimination is the project's. The law is neo-Hooke,
P = mu (F - F^-T) + lambda ln J F^-T. The punch is a flat disc, or a point, thickened by a radius. Half or a quarter of
the layer is solved, cut planes being planes of symmetry; an egg is met to first order in how deep a point lies in it,
which the penalty keeps below 0.01 mm. Lengths in mm, stresses over mu.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from skfem import Basis, ElementHex2, FacetBasis, MeshHex, MeshHex2

from eitsim.numerics.multifrontal import factorise, tree

PENALTY = 2e3  # Contact pressure over penetration, mu/mm.
ITERATIONS, TOLERANCE = 60, 1e-6
HALVED = 12  # Iterations from which steps are halved: points of contact come and go in turn.
LONGEST = 0.3  # Longest step of a node, mm.


@dataclass(frozen=True)
class RoundedDisc:
    """A punch: a disc of a radius, thickened by another; a ball where the first is 0."""

    disc: float
    thickened: float

    def gap(self, seen: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Penetration (...), negative outside, and its derivative (..., 3), of points (..., 3) seen from the lowest
        point on the axis."""
        seen = seen - self.thickened * axis
        along = seen @ axis
        across = seen - along[..., None] * axis
        radius = np.linalg.norm(across, axis=-1)
        nearest = across * np.minimum(1.0, self.disc / np.maximum(radius, 1e-300))[..., None]
        away = seen - nearest
        length = np.maximum(np.linalg.norm(away, axis=-1), 1e-12)
        return self.thickened - length, -away / length[..., None]


@dataclass(frozen=True)
class Egg:
    """A punch: half an ellipsoid towards +x, half of another towards -x; upright it lies on the layer."""

    sharp: float  # half length towards +x
    blunt: float  # towards -x
    half_width: float  # across and in height

    def gap(self, seen: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As of a disc."""
        ways = np.stack([np.array([axis[2], 0.0, -axis[0]]), np.array([0.0, 1.0, 0.0]), axis])  # own x, y, z
        own = seen @ ways.T - np.array([0.0, 0.0, self.half_width])
        half = np.stack(np.broadcast_arrays(np.where(own[..., 0] > 0, self.sharp, self.blunt), self.half_width,
                                            self.half_width), axis=-1)
        level, slope = np.linalg.norm(own / half, axis=-1), own / half**2
        steep = np.maximum(np.linalg.norm(slope, axis=-1), 1e-12)
        return level * (1 - level) / steep, -(slope / steep[..., None]) @ ways


@dataclass(frozen=True, eq=False)
class Pressed:
    """What is found at a depth."""

    force: float  # along the punch's axis, of the whole layer, mu mm^2
    points: np.ndarray  # (n, 3) places of the surface
    normals: np.ndarray  # (n, 3)
    areas: np.ndarray  # (n,)
    gradient: np.ndarray  # (n, 3, 3) F there
    unknowns: int


def press(place: Callable[[np.ndarray], np.ndarray], lines: tuple[np.ndarray, np.ndarray, np.ndarray],
          punch: RoundedDisc | Egg, nu: float, depths: np.ndarray, tilt: float = 0.0) -> Pressed:
    """Press a punch to depths one after another, from where it begins to touch at the origin, its axis leaning by an
    angle towards x. The layer is a grid of lines u, v and w, the last from the bottom to 0, placed into space, (n, 3)
    to (n, 3); v = 0 and, if it is the first of u, u = 0 are planes of symmetry."""
    straight = MeshHex2.from_mesh(MeshHex.init_tensor(*lines))
    flat = straight.doflocs
    mesh = MeshHex2(np.ascontiguousarray(place(flat.T).T), straight.t)
    basis = Basis(mesh, ElementHex2(), intorder=4)
    top = FacetBasis(mesh, ElementHex2(), intorder=5, facets=straight.facets_satisfying(lambda x: np.isclose(x[2], 0)))
    laid = Basis(straight, ElementHex2(), intorder=1)
    nodes, where = basis.element_dofs.T, np.empty((basis.N, 3))
    where[laid.element_dofs.T] = np.stack([laid.doflocs[:, one].T for one in laid.element_dofs.T])
    fixed = np.repeat((where[:, 2] == lines[2][0])[:, None], 3, axis=1)
    fixed[:, 1] |= np.abs(where[:, 1]) < 1e-9
    if lines[0][0] == 0:
        fixed[:, 0] |= np.abs(where[:, 0]) < 1e-9
    unknown = np.where(fixed, -1, np.cumsum(~fixed).reshape(fixed.shape) - 1)
    slope = np.stack([np.moveaxis(np.asarray(one.grad), 0, -1) for (one,) in basis.basis], axis=2)  # (e, q, a, j)
    shape = np.stack([np.broadcast_to(np.asarray(one), top.dx.shape) for (one,) in top.basis], axis=-1)  # (f, p, a)
    on = top.mesh.f2t[0, top.find]
    middle = mesh.doflocs.T[mesh.t[:8].T].mean(axis=1)
    angle = np.arange(8) * np.pi / 8
    ways = np.vstack([np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), [[0, 0, 1.0]]])
    order = tree(middle, ways, nodes, unknown)
    axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    at_rest = np.asarray(top.global_coordinates()).transpose(1, 2, 0)
    moved = np.zeros((basis.N, 3))
    first = _first(at_rest, punch, axis)
    for depth in depths:
        moved, force = _equilibrium(moved, nodes, unknown, slope, basis.dx, shape, top.dx, on, order, at_rest, punch,
                                    axis, first - depth, 2 * nu / (1 - 2 * nu))
    by_place = np.stack([np.moveaxis(np.asarray(one.grad), 0, -1) for (one,) in top.basis], axis=2)
    gradient = np.eye(3) + np.einsum("fai,fpaj->fpij", moved[nodes[on]], by_place)
    normal = np.moveaxis(np.asarray(top.normals), 0, -1)
    return Pressed(force * (4 if lines[0][0] == 0 else 2), at_rest.reshape(-1, 3), normal.reshape(-1, 3),
                   top.dx.ravel(), gradient.reshape(-1, 3, 3), int(unknown.max()) + 1)


def _first(points: np.ndarray, punch: RoundedDisc | Egg, axis: np.ndarray) -> float:
    low, high = -5.0, 5.0
    while high - low > 1e-10:
        middle = (low + high) / 2
        low, high = (middle, high) if punch.gap(points - middle * axis, axis)[0].max() > 0 else (low, middle)
    return high


def _equilibrium(moved, nodes, unknown, slope, weight, shape, area, on, order, at_rest, punch, axis, height, bulk):
    free = unknown >= 0
    for n in range(ITERATIONS):
        f = np.eye(3) + np.einsum("eai,eqaj->eqij", moved[nodes], slope)
        inverse = np.swapaxes(np.linalg.inv(f), 2, 3)
        volume = bulk * np.log(np.linalg.det(f))
        stress = f - inverse + volume[..., None, None] * inverse
        push = np.zeros_like(moved)
        np.add.at(push, nodes, np.einsum("eqij,eqaj,eq->eai", stress, slope, weight))
        pulled = np.einsum("eqij,eqaj->eqai", inverse, slope)  # F^-T grad N
        matrix = np.einsum("eqaj,eqbj,eq->eab", slope, slope, weight)[:, :, None, :, None] * np.eye(3)[:, None]
        matrix = matrix + np.einsum("eqak,eqbi,eq->eaibk", pulled, pulled, weight * (1 - volume), optimize=True)
        matrix += bulk * np.einsum("eqai,eqbk,eq->eaibk", pulled, pulled, weight, optimize=True)
        points = at_rest + np.einsum("fpa,fai->fpi", shape, moved[nodes[on]])
        gap, normal = punch.gap(points - height * axis, axis)
        pressure = PENALTY * np.maximum(gap, 0.0) * area
        np.add.at(push, nodes[on], np.einsum("fp,fpi,fpa->fai", pressure, normal, shape))
        stiff = np.einsum("fp,fpi,fpk,fpa,fpb->faibk", PENALTY * (gap > 0) * area, normal, normal, shape, shape,
                          optimize=True)
        np.add.at(matrix, on, stiff)
        reaction = float(np.einsum("fp,fpi,i->", pressure, normal, axis))
        if np.linalg.norm(push[free]) < TOLERANCE * max(abs(reaction), 1.0) and reaction:
            return moved, abs(reaction)
        size = matrix.shape[1] * 3
        step = np.zeros_like(moved)
        step[free] = factorise(order, np.ascontiguousarray(matrix.reshape(-1, size, size)))(push[free])
        length = min(1.0 if n < HALVED else 0.5, LONGEST / np.abs(step).max())
        while np.linalg.det(np.eye(3) + np.einsum("eai,eqaj->eqij", (moved - length * step)[nodes], slope)).min() <= 0:
            length /= 2
        moved = moved - length * step
    raise RuntimeError("no equilibrium of the bricks was found")
