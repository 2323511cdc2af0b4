"""A layer under any number of rigid punches: energy of layer, contacts and dead forces, and its minimum.

Unknowns x are the free displacements and, last, the punches' depths. Lengths are in thicknesses, stresses in mu_0,
forces in mu_0 H^2. A punch whose force is given has its depth as an unknown; one whose depth is given keeps it.
Newton's steps are found by conjugate gradients, preconditioned by the factors of an earlier step while these serve.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact import stick_springs
from eitsim.mechanics.contact.punch_contact import ContactState, RigidPunch, spatial_contact
from eitsim.mechanics.contact.stick_springs import StickSprings
from eitsim.mechanics.general.layer import solid_assembly
from eitsim.mechanics.general.layer.grips import Grip, springs_on
from eitsim.mechanics.general.meshing.wedge import Facets
from eitsim.mechanics.general.meshing.wedge_mesh import WedgeMesh
from eitsim.numerics.linear_solvers import Solve, bordered, conjugate_gradients
from eitsim.numerics.multifrontal import Tree, factorise, tree
from eitsim.numerics.newton import Minimum, System, minimise
from matcal.laws.law import Law
from touchcal.arrays import Array

# Distance from a punch's edge, thicknesses, out to which the surface may touch it.
_REACH = 1.0
# Norm of the gradient over the forces' at which a solution is accepted.
TOLERANCE = 1e-6
_AROUND = np.arange(8) * np.pi / 8
# Relative residual of the linear solves, at least and at most, and the operations of a factorisation that take the time
# of a product, for each number in the factors.
_LEAST, _MOST, _OPERATIONS = 1e-3, 0.03, 50.0


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a punch stands in space."""

    origin: Array  # (3,) its lowest point at depth 0
    axes: Array  # (3, 3) its axes in rows, the last one away from the layer
    first: float = 0.0  # depth at which it begins to touch


@dataclass(frozen=True, eq=False)
class Press:
    """One punch and what is given of it."""

    rigid: RigidPunch
    axis: Array  # (2,) coordinates of the place under it
    force: float | None  # None where the depth is kept
    # the force, or about the one that the depth takes, by which residuals are measured
    scale: float
    grip: Grip | None = None  # what holds the layer where the punch sticks or rubs
    pose: Pose | None = None  # None: upright on a flat layer

    def seen(self, points: Array, depth: float) -> Array:
        """Points (..., 3) of the layer from the punch's lowest point at a depth, along its axes."""
        if self.pose is None:
            return points - np.append(self.axis, -depth)
        return (points - self.pose.origin) @ self.pose.axes.T + np.array([0.0, 0.0, depth])

    def past(self, moved: Array, depth: float) -> Array:
        """Displacements (..., 3) of the layer along the punch's axes, as seen from it."""
        return (moved if self.pose is None else moved @ self.pose.axes.T) + np.array([0.0, 0.0, depth])

    def load(self, on: Array, back: float) -> tuple[Array, float]:
        """A load (f, k, 3) along the punch's axes, and by the depth, in space."""
        return (on if self.pose is None else on @ self.pose.axes), back

    def stiffness(self, blocks: Array, edge: Array, corner: float) -> tuple[Array, Array, float]:
        """A stiffness (f, k, 3, k, 3) along the punch's axes, its border and corner by the depth, in space."""
        if self.pose is None:
            return blocks, edge, corner
        turn = self.pose.axes
        return np.einsum("faibj,ik,jl->fakbl", blocks, turn, turn, optimize=True), edge @ turn, corner


@dataclass(frozen=True, eq=False)
class LayerProblem:
    """The discretised layer and what presses it."""

    law: Law  # moduli over mu_0
    mesh: WedgeMesh
    presses: tuple[Press, ...]

    @cached_property
    def bearings(self) -> tuple[tuple[int, Facets], ...]:
        """The facets that each punch may touch, with its number: those nearer to it than to any other."""
        found = []
        for faces in (self.mesh.around, self.mesh.flat):
            middle = self.mesh.coordinates[faces.nodes].mean(axis=1)[:, :2]
            away = np.array([np.linalg.norm(middle - p.axis, axis=1) - p.rigid.profile.radius for p in self.presses])
            owner = np.where(away.min(axis=0) < _REACH, away.argmin(axis=0), -1)
            found += [(k, part_of(faces, np.flatnonzero(owner == k))) for k in range(len(self.presses))
                      if np.any(owner == k)]
        return tuple(found)

    @cached_property
    def springs(self) -> tuple[StickSprings | None, ...]:
        """What holds each of these bearings."""
        return tuple(None if (grip := self.presses[k].grip) is None else
                     springs_on(grip, faces, self.mesh.coordinates, self.presses[k].axis) for k, faces in self.bearings)

    @cached_property
    def tree(self) -> Tree:
        """The order of elimination, by cuts through the punches' axes, along and about them."""
        middle = self.mesh.coordinates[self.mesh.elements].mean(axis=1)
        away = np.min([np.linalg.norm(middle[:, :2] - p.axis, axis=1) for p in self.presses], axis=0)
        level = np.array([[np.cos(a), np.sin(a), 0.0, 0.0] for a in _AROUND])
        steep = np.array([[0, 0, 1.0, 0], [0, 0, 0, 1.0], [0, 0, 1, 1], [0, 0, 1, -1]])
        points = np.column_stack([middle, away])
        return tree(points, np.vstack([level, steep]), self.mesh.elements, self.mesh.unknown)

    @property
    def products(self) -> int:
        """Products with the matrix, each with a solution by its factors, that take about as long as a factorisation."""
        return max(int(self.tree.operations / (_OPERATIONS * self.tree.entries)), 4)

    @property
    def scale(self) -> float:
        return float(np.linalg.norm([p.scale for p in self.presses]))


def part_of(faces: Facets, which: NDArray[np.int64]) -> Facets:
    """Some facets (n,) of all."""
    return replace(faces, element=faces.element[which], local=faces.local[which], nodes=faces.nodes[which],
                   ends=faces.ends[which], weight=faces.weight[which])


def contacts(model: LayerProblem, moved: Array, depths: Array) -> Iterator[tuple[int, Facets, ContactState]]:
    """Number of the punch, facets, and their contact state, where nodes are displaced by (nodes, 3)."""
    where = model.mesh.nodes + moved
    for k, faces in model.bearings:
        press = model.presses[k]
        seen = press.seen(faces.shape @ where[faces.nodes], depths[k])
        yield k, faces, spatial_contact(press.rigid, seen)


def held(model: LayerProblem, moved: Array, depths: Array) -> Iterator[tuple[int, Facets, StickSprings, Array]]:
    """Of each bearing that is held its punch, facets, springs, and displacement (points, 3, 1) as seen from it."""
    for (k, faces), springs in zip(model.bearings, model.springs, strict=True):
        if springs is not None:
            past = model.presses[k].past(faces.shape @ moved[faces.nodes], depths[k])
            yield k, faces, springs, past.reshape(-1, 3, 1)


def split(model: LayerProblem, x: Array) -> tuple[Array, Array]:
    """Displacements (nodes, 3) and depths (punches,)."""
    return solid_assembly.nodal(model.mesh, x[:model.mesh.unknowns]), x[model.mesh.unknowns:]


def energy(model: LayerProblem, x: Array) -> float:
    """Energy at x; infinite where the layer is turned inside out."""
    moved, depths = split(model, x)
    stored = solid_assembly.energy(model.law, model.mesh, moved)
    if not np.isfinite(stored):
        return np.inf
    for k, faces, at in contacts(model, moved, depths):
        stored += contact.energy(model.presses[k].rigid, faces, at)
    for _, faces, springs, seen in held(model, moved, depths):
        stored += float(faces.weight.ravel() @ stick_springs.potential(springs, seen)[:, 0])
    return stored - sum(p.force * depth for p, depth in zip(model.presses, depths.tolist(), strict=True)
                        if p.force is not None)


def system(model: LayerProblem, x: Array, negative_curvature_scale: float = 1.0, earlier: list[Solve] | None = None
           ) -> System:
    """Gradient of the energy at x and a function that solves with its Hessian, negative parts scaled: by its factors,
    or by conjugate gradients with `earlier` ones, which are dropped where they no longer serve, and not used where the
    gradient vanishes."""
    moved, depths = split(model, x)
    push, matrices = solid_assembly.forces_and_matrices(model.law, model.mesh, moved, negative_curvature_scale)
    count = len(model.presses)
    reaction, corner, border = np.zeros(count), np.zeros(count), np.zeros((count, *push.shape))
    for k, faces, (on, back), (blocks, edge, stiff) in _loads(model, moved, depths, negative_curvature_scale):
        reaction[k], corner[k] = reaction[k] + back, corner[k] + stiff
        np.add.at(push, faces.nodes, on)
        np.add.at(border[k], faces.nodes, edge)
        place = (3 * faces.local[:, :, None] + np.arange(3)).reshape(len(faces.local), -1)
        size = place.shape[1]
        np.add.at(matrices, (faces.element[:, None, None], place[:, :, None], place[:, None]),
                  blocks.reshape(-1, size, size))
    kept = np.array([p.force is None for p in model.presses])
    force = np.array([p.force or 0.0 for p in model.presses])
    free = model.mesh.unknown >= 0

    gradient, edges = np.append(push[free], np.where(kept, 0.0, reaction - force)), border[:, free] * ~kept[:, None]
    corner, factors = np.where(kept, 1.0, corner), [] if earlier is None else earlier
    size = float(np.linalg.norm(gradient)) / model.scale

    def factorised() -> Solve:
        if factors and size > TOLERANCE:
            step = _approached(model, matrices, edges, corner, factors, gradient, min(max(size, _LEAST), _MOST))
            return lambda _: step
        factors.clear()
        solve = factorise(model.tree, matrices)
        for k in range(count):
            solve = bordered(solve, np.append(edges[k], np.zeros(k)), corner[k])
        factors.append(solve)
        return solve

    return gradient, factorised


def _approached(model: LayerProblem, matrices: Array, edges: Array, corner: Array, factors: list[Solve], b: Array,
                tolerance: float) -> Array:
    """About the solution of the bordered system by earlier factors, which are dropped where it takes as long as new
    ones."""
    where, unknowns, most = model.mesh.unknown[model.mesh.elements], model.mesh.unknowns, model.products
    where = np.where(where < 0, unknowns, where).reshape(len(matrices), -1)
    made = 0

    def product(y: Array) -> Array:
        nonlocal made
        made += 1
        along, depths = np.append(y[:unknowns], 0.0), y[unknowns:]
        each = (matrices @ along[where][..., None])[..., 0]
        out = np.bincount(where.ravel(), each.ravel(), unknowns + 1)[:unknowns]
        return np.append(out + depths @ edges, edges @ along[:unknowns] + corner * depths)

    step = conjugate_gradients(product, factors[0], b, tolerance, most, 1 / most)
    if made == most:
        factors.clear()
    return step


def _loads(model: LayerProblem, moved: Array, depths: Array, negative_curvature_scale: float
           ) -> Iterator[tuple[int, Facets, tuple[Array, float], tuple[Array, Array, float]]]:
    """Number of the punch, facets, and first and second derivatives of the energy of what acts on them."""
    for k, faces, at in contacts(model, moved, depths):
        press = model.presses[k]
        yield (k, faces, press.load(*contact.forces(press.rigid, faces, at)),
               press.stiffness(*contact.stiffness(press.rigid, faces, at, negative_curvature_scale)))
    for k, faces, springs, seen in held(model, moved, depths):
        press, tangent = model.presses[k], stick_springs.tangent(
            springs, seen, negative_curvature_scale).reshape(*faces.weight.shape, 3, 3)
        yield (k, faces, press.load(*_pull(faces, springs, seen)),
               press.stiffness(*contact.assemble_stiffness(faces, tangent)))


def _pull(faces: Facets, springs: StickSprings, seen: Array, *, elastic: bool = False) -> tuple[Array, float]:
    """Derivatives of the springs' energy by the facets' nodes and the depth; elastic: without those that slip."""
    pull = stick_springs.pull(springs, seen, elastic=elastic)
    return contact.assemble_load(faces, pull.reshape(*faces.weight.shape, 3))


def solve(model: LayerProblem, start: Array, tolerance: float = TOLERANCE) -> Minimum:
    """The equilibrium from a start x; NotConverged as `minimise`."""
    factors: list[Solve] = []
    return minimise(lambda x: energy(model, x), lambda x, scale: system(model, x, scale, factors), start,
                    scale=model.scale, tolerance=tolerance)


def reactions(model: LayerProblem, x: Array) -> Array:
    """Forces (punches,) of the layer on the punches."""
    out = np.zeros(len(model.presses))
    for k, _, (_, back), _ in _loads(model, *split(model, x), 1.0):
        out[k] += back
    return out


def corrected_depths(model: LayerProblem, minimum: Minimum) -> Array:
    """Depths (punches,), to first order without the contacts' penetration: less the derivative of the complementary
    energy of all contacts by the forces."""
    moved, depths = split(model, minimum.x)
    slope = np.zeros((len(model.mesh.nodes), 3))
    by_depth = np.zeros(len(depths))
    loads = [(k, faces, contact.complementary_forces(model.presses[k].rigid, faces, at))
             for k, faces, at in contacts(model, moved, depths)]
    loads += [(k, faces, _pull(faces, springs, seen, elastic=True))
              for k, faces, springs, seen in held(model, moved, depths)]
    for k, faces, load in loads:
        push, back = model.presses[k].load(*load)
        np.add.at(slope, faces.nodes, push)
        by_depth[k] += back
    out, whole = depths.copy(), np.append(slope[model.mesh.unknown >= 0], by_depth)
    for k, press in enumerate(model.presses):
        if press.force is not None:
            unit = np.zeros(len(whole))
            unit[len(whole) - len(depths) + k] = 1.0
            out[k] -= float(whole @ minimum.solve(unit))
    return out
