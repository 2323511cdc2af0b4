"""A preconditioner of the clipped disc that takes each harmonic by itself: one banded Cholesky factor a harmonic.

Where nothing depends on the angle, harmonics do not know of each other: harmonic m has the matrix
sum B_m' C B_m with B_m = B_0 + m B_1, so three bands give them all. C is the mean tangent over the part of a circle
on the skin. That part itself is taken into account by the Gram matrix G of the harmonics on it, which is far from
unity: amplitudes are scaled by (G + tie)^-1/2, column by column, before and after.
"""

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.harmonics.arcs import circles
from eitsim.mechanics.harmonics.clipped_disc import TIE, ClippedDisc, turned
from eitsim.mechanics.harmonics.fourier_fields import operators
from eitsim.mechanics.solid.spatial_response import UPPER
from eitsim.numerics.linear_solvers import Solve, bordered, factorise_band
from touchcal.arrays import Array

Indices = NDArray[np.int64]

# The tie that is added to G, over the disc's own, by trial: fewest iterations at gaps of 0.5 to 8 mm.
_STIFFER = 30.0
# (u_r + u_theta)/sqrt(2), (u_r - u_theta)/sqrt(2), u_z
_TURN = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, np.sqrt(2)]]) / np.sqrt(2)


def preconditioner(disc: ClippedDisc, tangent: Array, bearing: Array) -> Solve:
    """Approximate inverse of the Hessian with the depth last, from its tangents (points, 45) and those of the contact
    (facets points, 3, 3), summed over the angles. Indefinite where a mean one is not positive definite."""
    share = disc.foam.circles.inside[disc.foam.circle, None]
    tangent = tangent / np.where(share > 0, share, 1.0)
    bearing = bearing / disc.facing.circles.inside[:, None, None]
    bearing = bearing.reshape(len(disc.facing.nodes), -1, 3, 3) * np.array([[1, 0, 1], [0, 1, 0], [1, 0, 1]])
    bands = _bands(disc, tangent, bearing)
    solves = [factorise_band(_held(band, disc.fixed[m])) for m, band in enumerate(bands)]
    border = np.zeros(disc.base.shape[:2])
    np.add.at(border, disc.facing.nodes, np.einsum("fpi,pa->fai", bearing[..., 2], disc.facing.shape))
    border[disc.fixed[0]] = 0.0
    corner = 1.0 if disc.held else float(bearing[..., 2, 2].sum())
    solves[0] = bordered(solves[0], border.ravel() * (not disc.held), corner)
    even, odd = _roots(disc)

    def solve(b: Array) -> Array:
        at = np.zeros(disc.fixed.shape)
        at[~disc.fixed] = b[:-1]
        at = _scaled(disc, even, odd, at).reshape(len(at), -1)
        first = solves[0](np.append(at[0], b[-1]))
        at = np.stack([first[:-1], *(s(a) for s, a in zip(solves[1:], at[1:], strict=True))])
        return np.append(_scaled(disc, even, odd, at.reshape(disc.fixed.shape))[~disc.fixed], first[-1])

    return solve


def _bands(disc: ClippedDisc, tangent: Array, bearing: Array) -> list[Array]:
    """Lower bands of all harmonics, the amplitudes turned from harmonic 1 on."""
    points = (disc.order + 1) ** 2
    full = np.empty((len(tangent), 9, 9))
    full[:, UPPER[0], UPPER[1]] = tangent
    full[:, UPPER[1], UPPER[0]] = tangent
    full += disc.tie[:, None, None] * np.eye(9)
    still, turning = operators(disc.foam.shape)
    width = 3 * disc.order * (len(disc.base) // len(disc.columns) + 1) + 2

    def band(nodes: Indices, local: Array) -> Array:
        numbers = (nodes[:, :, None] * 3 + np.arange(3)).reshape(len(nodes), -1)
        row, column = np.broadcast_arrays(numbers[:, :, None], numbers[:, None, :])
        lower = row >= column
        place = column[lower] * (width + 1) + (row - column)[lower]
        size = 3 * len(disc.base)
        out = np.zeros(size * (width + 1))
        np.add.at(out, place, local.reshape(row.shape)[lower])
        return out.reshape(size, width + 1)

    def elements(left: Array, right: Array) -> Array:
        stressed = full @ right.reshape(len(full), 9, -1)
        shape = (len(full) // points, points * 9, -1)
        return np.swapaxes(left.reshape(shape), 1, 2) @ stressed.reshape(shape)

    def under(turn: Array) -> Array:
        return np.einsum("fpij,pa,pb->faibj", turn @ bearing @ turn, disc.facing.shape, disc.facing.shape)

    nodes, facets = disc.foam.nodes[::points], disc.facing.nodes
    first = band(nodes, elements(still, still)) + band(facets, under(np.eye(3)))
    still, turning = still @ _TURN, turning @ _TURN
    mixed = elements(still, turning)
    zeroth = band(nodes, elements(still, still)) + band(facets, under(_TURN))
    linear, square = band(nodes, mixed + np.swapaxes(mixed, 1, 2)), band(nodes, elements(turning, turning))
    return [first if m == 0 else zeroth + m * linear + m * m * square for m in disc.orders.tolist()]


def _held(band: Array, fixed: NDArray[np.bool_]) -> Array:
    """The band with unit rows and columns where an amplitude (nodes, 3) is zero."""
    size, width = band.shape
    fixed = np.append(fixed.ravel(), np.zeros(width, dtype=bool))
    gone = fixed[:size, None] | fixed[np.arange(size)[:, None] + np.arange(width)]
    band = np.where(gone, 0.0, band)
    band[fixed[:size], 0] = 1.0
    return band


def _roots(disc: ClippedDisc) -> tuple[Array, Array]:
    """(G + tie)^-1/2 (columns, harmonics, harmonics) of the even and of the odd harmonics; unity on whole circles."""
    count = len(disc.fixed)
    around = circles(disc.outline, disc.columns, count, 2 * disc.weight.shape[1])
    tie = _STIFFER * TIE * np.eye(count)

    def root(table: Array) -> Array:
        value, vector = np.linalg.eigh((table * around.weight[:, None]) @ np.swapaxes(table, 1, 2) + tie)
        whole = ~around.cut[:, None, None]
        return np.where(whole, np.eye(count), (vector / np.sqrt(value)[:, None]) @ np.swapaxes(vector, 1, 2))

    return root(around.cosine), root(around.sine)


def _scaled(disc: ClippedDisc, even: Array, odd: Array, amplitude: Array) -> Array:
    count, columns = len(amplitude), len(even)
    at = turned(np.where(disc.fixed, 0.0, amplitude), disc.orders).reshape(count, columns, -1, 3)
    at = np.moveaxis(at, 0, 1)
    out = np.empty_like(at)
    for table, parts in ((even, slice(0, 3, 2)), (odd, slice(1, 2))):
        values = at[..., parts]
        out[..., parts] = (table @ values.reshape(columns, count, -1)).reshape(values.shape)
    return np.where(disc.fixed, 0.0, turned(np.moveaxis(out, 1, 0).reshape(amplitude.shape), disc.orders))
