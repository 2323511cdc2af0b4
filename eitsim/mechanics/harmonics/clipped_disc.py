"""A skin pressed near an edge: the whole three-dimensional problem, as Fourier series about the punch's axis.

Unknowns are the amplitudes of what the rim adds to an axisymmetric state on one mesh of the meridian, and to its depth.
The mesh knows no edge: energies are summed over the parts of its circles that lie on the skin, so that all places
share one mesh and the state is exact where no circle is cut. Off the skin the series goes on at will, held by a weak
tie: TIE/2 times the squared gradient of what is added, on cut circles, over mu_0 (a finite cell method: Parvizian,
Duster, Rank, Comput. Mech. 41 (2007) 121, DOI 10.1007/s00466-007-0173-y). Units as in
eitsim.mechanics.axisymmetric.indentation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.axisymmetric.indentation import Equilibrium, IndentationProblem
from eitsim.mechanics.contact.punch_contact import RigidPunch
from eitsim.mechanics.contact.stick_springs import StickSprings, stick_springs
from eitsim.mechanics.harmonics.arcs import AngularQuadrature, OffsetDisc, OffsetOutline, circles, odd
from eitsim.mechanics.harmonics.fourier_fields import Points
from eitsim.mechanics.solid.axisymmetric_assembly import nodal
from matcal.laws.law import Law
from touchcal.arrays import Array

Indices = NDArray[np.int64]

# Stiffness off the skin, over mu_0. It lowers what the rim adds to the depth by 0.5 %.
TIE = 1e-3


@dataclass(frozen=True)
class SurfaceQuadrature:
    """The surface that the punch may touch, at points that stand for circles."""

    nodes: Indices  # (facets, p + 1) nodes
    shape: Array  # (points, p + 1) shape functions at a facet's points
    radius: Array  # (facets points, 1) reference radius
    # (facets points, angles) quadrature weight
    weight: Array
    circles: AngularQuadrature


@dataclass(frozen=True, eq=False)
class CutVolumeQuadrature:
    """A given field that is added to the disc's own, and its own equilibrium with another punch."""

    displacement_gradient: Array  # (points, 9, angles) displacement gradient at the foam's points
    stress: Array  # (points, 9, angles) first Piola stress of that field alone, with the foam's weights
    shift: Array  # (facets points, 3, angles) displacement of the surface that the punch may touch


@dataclass(frozen=True, eq=False)
class ClippedDisc:
    """The discretised problem."""

    # moduli over mu_0
    law: Law
    punch: RigidPunch
    outline: OffsetDisc | OffsetOutline
    foam: Points
    # (points, angles) quadrature weight, and (points,) that of the tie
    weight: Array
    tie: Array
    facing: SurfaceQuadrature
    springs: StickSprings  # what holds the surface where the punch sticks
    columns: Array  # (columns,) radii of the nodes' columns
    order: int  # order of the elements
    base: Array  # (nodes, 3, harmonics) amplitudes of the axisymmetric state
    # its depth, and the force on the punch
    depth: float
    force: float
    held: bool  # whether the depth is kept instead of the force
    fixed: NDArray[np.bool_]  # (harmonics, nodes, 3) amplitudes that are zero, turned as in `turned`
    outside: CutVolumeQuadrature | None = None  # what a neighbour adds; None: nothing

    @property
    def orders(self) -> Indices:
        """(harmonics,) orders of the harmonics."""
        return self.foam.circles.orders

    @property
    def unknowns(self) -> int:
        return int(self.fixed.size - self.fixed.sum())


def clipped_disc(model: IndentationProblem, state: Equilibrium, outline: OffsetDisc | OffsetOutline, harmonics: int,
                 angles: int, reach: float, *, held: bool = False) -> ClippedDisc:
    """Discretise what the edges add to an axisymmetric state: harmonics of orders 0 to harmonics - 1, as many angles on
    half a circle, nothing added from the radius `reach` on; held: at the state's depth instead of its force. The punch
    sticks where the model has springs."""
    kinds, angles = harmonics * (1 + outline.whole_turn), angles * (1 + outline.whole_turn)
    grid, facets = model.grid, model.facets
    near = grid.nodes[grid.elements, 0].max(axis=1) <= reach
    elements, volume = grid.elements[near], grid.weight[near].ravel()
    shape = grid.gradient[near].reshape(volume.size, -1, 3)
    radii, circle = np.unique(np.round(1 / shape[..., 2].sum(axis=1), 10), return_inverse=True)
    around = circles(outline, radii, kinds, angles)
    count = int(elements.max()) + 1
    base = np.zeros((count, 3, kinds))
    base[:, [0, 2], 0] = nodal(grid, state.x[:-1])[:count]
    kept = facets.nodes.max(axis=1) < count
    under = circles(outline, facets.radius[kept].ravel(), kinds, angles)
    facing = SurfaceQuadrature(facets.nodes[kept], facets.shape, facets.radius[kept].reshape(-1, 1),
                               facets.weight[kept].reshape(-1, 1) * under.weight, under)
    foam = Points(shape, np.repeat(elements, grid.weight.shape[1], axis=0), circle, around)
    return ClippedDisc(
        model.law, model.punch, outline, foam, volume[:, None] * around.weight[circle],
        TIE * volume * around.cut[circle], facing, stick_springs(model.springs, facets.radius[kept].shape),
        grid.lines[0][:count // len(grid.lines[1])], grid.order, base, float(state.x[-1]), state.force, held,
        _fixed(grid.nodes[:count], around, count < len(grid.nodes)))


def _fixed(nodes: Array, circles: AngularQuadrature, truncated: bool) -> NDArray[np.bool_]:
    """On the axis a smooth field has u_z of order 0 and u_r = -u_theta of order 1 alone; of order 0 even harmonics have
    no u_theta and odd ones that alone."""
    orders = circles.orders
    out = np.zeros((len(orders), len(nodes), 3), dtype=bool)
    axis = np.flatnonzero(nodes[:, 0] == 0)
    turn = odd(len(orders), circles.whole_turn)
    out[(orders == 0) & ~turn] = [False, True, False]
    out[(orders == 0) & turn] = [True, False, True]
    out[:, axis] |= np.where(orders == 1, False, orders > 0)[:, None, None]
    out[np.ix_(orders == 0, axis)] |= np.array([True, True, False])
    out[np.ix_(orders == 1, axis)] = [True, False, True]
    out[:, nodes[:, 1] == nodes[0, 1]] = True
    if truncated:
        out[:, nodes[:, 0] == nodes[-1, 0]] = True
    return out


def turned(amplitude: Array, orders: Indices) -> Array:
    """Amplitudes (harmonics, nodes, 3) of u_r, u_theta, u_z as those of (u_r +- u_theta)/sqrt(2), u_z from order 1
    on; its own inverse."""
    out, first = amplitude.copy(), int(np.argmax(orders > 0))
    out[first:, :, 0] = (amplitude[first:, :, 0] + amplitude[first:, :, 1]) / np.sqrt(2)
    out[first:, :, 1] = (amplitude[first:, :, 0] - amplitude[first:, :, 1]) / np.sqrt(2)
    return out


def amplitudes(disc: ClippedDisc, x: Array) -> Array:
    """What the unknowns x (unknowns,) add, (nodes, 3, harmonics)."""
    out = np.zeros(disc.fixed.shape)
    out[~disc.fixed] = x
    return np.ascontiguousarray(np.moveaxis(turned(out, disc.orders), 0, 2))


def unknowns_of(disc: ClippedDisc, amplitude: Array) -> Array:
    """The unknowns (unknowns,) of amplitudes (nodes, 3, harmonics); takes forces on amplitudes to those on unknowns."""
    return turned(np.moveaxis(amplitude, 2, 0), disc.orders)[~disc.fixed]
