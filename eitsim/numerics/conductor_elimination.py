"""Elimination in networks of conductors: of a symmetric matrix with zero row sums, kept as its off-diagonal entries.

A network joins unknowns i, j by weights w_ij; its matrix A has A_ij = -w_ij and rows that sum to zero. Eliminating k
adds w_ik w_kj / sum_j w_kj to w_ij, so that pivots are sums of weights and never what is left of a diagonal: where the
weights are positive nothing is subtracted, and no digits are lost, however stiff the network is. Source: Grassmann,
Taksar, Heyman, Oper. Res. 33 (1985) 1107, doi:10.1287/opre.33.5.1107; front by front as Duff, Reid, ACM Trans. Math.
Softw. 9 (1983) 302, doi:10.1145/356044.356047.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.numerics.nested_dissection import Dissection, Indices
from touchcal.arrays import Array
from touchcal.jit import compiled


class Detached(ArithmeticError):
    """Nothing joins an unknown, or a part of the network about it, to the last unknown."""

    def __init__(self, unknown: int) -> None:
        super().__init__(f"nothing joins unknown {unknown} to the last one")
        self.unknown = unknown


@dataclass(frozen=True, eq=False)
class Elimination:
    """A network with all unknowns but the last eliminated."""

    dissection: Dissection
    weights: Array  # (pairs,) weights of the pairs of unknowns, 1/Ohm
    # weights of each front's eliminated unknowns to its members, (eliminated, members) row by row, front after front
    rows: Array
    inverse: Array  # (size - 1,) reciprocals of the pivots


def eliminate(dissection: Dissection, weights: Array) -> Elimination:
    """Eliminate all unknowns but the last. Weights (pairs,) as dissection.pairs. Detached where a pivot is not
    positive; ValueError where there are not as many weights as pairs."""
    row_start = _rows_of(dissection)[0]
    rows = np.empty(row_start[-1])
    return Elimination(dissection, weights, rows, _eliminated(dissection, weights, row_start, rows))


def solve(elimination: Elimination, currents: Array) -> Array:
    """Potentials (size, k) for currents (size, k) into the unknowns, the last one at 0 whatever its current is."""
    order = elimination.dissection.order
    out = np.empty_like(currents)
    out[order] = _substituted(elimination, currents[order], np.ones(len(elimination.dissection.height), dtype=bool))
    return out


def solve_between(elimination: Elimination, into: Indices, currents: Array, asked: Indices) -> Array:
    """Potentials (asked, k) of some unknowns, as `solve`, for currents (into, k) into some, each given once."""
    dissection = elimination.dissection
    place = dissection.place
    x, leads = np.zeros((len(place), currents.shape[1])), np.zeros(len(dissection.height), dtype=bool)
    x[place[into]] = currents
    leads[np.searchsorted(dissection.first, place[asked], side="right").clip(max=len(leads)) - 1] = True
    return _substituted(elimination, x, leads)[place[asked]]


def _substituted(elimination: Elimination, x: Array, leads: NDArray[np.bool_]) -> Array:
    """Currents x (size, k), in the order of elimination, made potentials: those of fronts that are marked."""
    dissection = elimination.dissection
    row_start, largest = _rows_of(dissection)
    _substitute(dissection.height, dissection.first, dissection.begin, dissection.member, row_start, elimination.rows,
                elimination.inverse, np.empty((largest, x.shape[1])), np.empty((largest, x.shape[1])), leads, x)
    return x


def impedance_alone(dissection: Dissection, weights: Array, count: int) -> Array:
    """Impedance matrix (count, count), Ohm, of the last unknowns for currents that sum to zero; its rows do too. No
    front is kept but the root, which takes a fraction of the memory of `eliminate`; errors as there."""
    members, pivots = np.diff(dissection.begin), np.diff(dissection.first)
    rows, nowhere = np.empty(int((pivots * members).max())), np.zeros(len(pivots) + 1, dtype=np.int64)
    inverse = _eliminated(dissection, weights, nowhere, rows)
    return _between_last(dissection, rows[:pivots[-1] * members[-1]], inverse, count)


def _between_last(dissection: Dissection, rows: Array, inverse: Array, count: int) -> Array:
    members = int(dissection.begin[-1] - dissection.begin[-2])
    rows = rows.reshape(-1, members)[members - count:, members - count:]
    inverse = inverse[len(inverse) - (count - 1):]
    y = np.eye(count) - 1 / count
    for k in range(count - 1):
        y[k + 1:] += (rows[k, k + 1:] * inverse[k])[:, None] * y[k]
    y = y[:-1] * np.sqrt(inverse)[:, None]
    return y.T @ y


def residual(elimination: Elimination, currents: Array, potentials: Array) -> Array:
    """What currents (size, k) exceed those that flow at given potentials (size, k), summed from their differences."""
    out = currents.copy()
    _leave(elimination.dissection.pairs, elimination.weights, potentials, out)
    return out


def _eliminated(dissection: Dissection, weights: Array, row_start: Indices, rows: Array) -> Array:
    """Reciprocals of the pivots; fills the rows of each front from its start on."""
    if weights.shape != dissection.source.shape:
        raise ValueError(f"an order of elimination for {len(dissection.source)} pairs of unknowns got {len(weights)} "
                         "weights; take the order of this very mesh.")
    passed_start, most = _passed_on(dissection.height, np.diff(dissection.begin) - np.diff(dissection.first))
    largest = _rows_of(dissection)[1]
    inverse = np.empty(len(dissection.order) - 1)
    stopped = _eliminate(dissection.height, dissection.first, dissection.begin, dissection.into, dissection.source,
                         dissection.target, dissection.leaf, row_start, passed_start, weights, np.empty(largest**2),
                         rows, inverse, np.empty(most))
    if stopped >= 0:
        raise Detached(int(dissection.order[stopped]))
    return inverse


def _rows_of(dissection: Dissection) -> tuple[Indices, int]:
    """Where the rows of each front begin, and the members of the largest one."""
    members = np.diff(dissection.begin)
    return np.append(0, np.cumsum(np.diff(dissection.first) * members)), int(members.max())


@compiled
def _passed_on(height, left):
    """Where what each front passes on begins, in the place of what its children passed on, of the unknowns that are
    left in each; and the most that is passed on at a time."""
    start, most = np.zeros(len(height), np.int64), 0
    for t in range(len(height)):
        if height[t] > 0:
            start[t] = start[t - (1 << height[t])]
        elif t > 0:
            start[t] = start[t - 1] + left[t - 1] * (left[t - 1] - 1) // 2
        most = max(most, start[t] + left[t] * (left[t] - 1) // 2)
    return start, most


@compiled
def _eliminate(height, first, begin, into, source, target, leaf_start, row_start, passed_start, weights, work, rows,
               inverse, passed):
    """All fronts; -1, or the place of the first pivot that is not positive."""
    leaf = 0
    for t in range(len(height)):
        size, pivots = begin[t + 1] - begin[t], first[t + 1] - first[t]
        leaf += height[t] == 0
        front = work[:size * size].reshape(size, size)
        front[:] = 0.0
        if height[t] == 0:
            for e in range(leaf_start[leaf - 1], leaf_start[leaf]):
                work[target[e]] += weights[source[e]]
        else:
            for child in (t - (1 << height[t]), t - 1):
                place = into[begin[child] + first[child + 1] - first[child]:begin[child + 1]]
                _add(front, place, passed[passed_start[child]:])
        stopped = _factorise(front, pivots, inverse[first[t]:first[t + 1]])
        if stopped >= 0:
            return first[t] + stopped
        for k in range(pivots * size):
            rows[row_start[t] + k] = work[k]
        e = passed_start[t]
        for i in range(pivots, size):
            for j in range(i + 1, size):
                passed[e] = front[i, j]
                e += 1
    return -1


@compiled
def _add(front, place, passed):
    """Add what a child passes on; places ascend, so that the upper triangle stays above."""
    e = 0
    for i in range(len(place)):
        row = front[place[i]]
        for j in range(i + 1, len(place)):
            row[place[j]] += passed[e]
            e += 1


@compiled
def _factorise(front, pivots, inverse):
    """Eliminate the first unknowns of a front, four at a time, in its upper triangle; -1 or the pivot that fails."""
    size = len(front)
    for k in range(0, pivots, 4):
        stop = min(k + 4, pivots)
        for a in range(k, stop):
            row = front[a]
            for q in range(k, a):
                c, above = front[q, a] * inverse[q], front[q]
                for j in range(a + 1, size):
                    row[j] += c * above[j]
            pivot = row[a + 1:].sum()
            if not 0.0 < pivot < np.inf:
                return a
            inverse[a] = 1 / pivot
        if stop == k + 4:
            _update_by_four(front, k, inverse)
        else:
            for q in range(k, stop):
                above = front[q]
                for i in range(stop, size):
                    c, row = above[i] * inverse[q], front[i]
                    for j in range(i + 1, size):
                        row[j] += c * above[j]
    return -1


@compiled
def _update_by_four(front, k, inverse):
    """Take four pivots from the rows below, two rows at a time, so that the pivots' rows are read half as often."""
    size, last = len(front), len(front) - 1
    d0, d1, d2, d3 = inverse[k], inverse[k + 1], inverse[k + 2], inverse[k + 3]
    r0, r1, r2, r3 = front[k], front[k + 1], front[k + 2], front[k + 3]
    for i in range(k + 4, last, 2):
        a0, a1, a2, a3, row = r0[i] * d0, r1[i] * d1, r2[i] * d2, r3[i] * d3, front[i]
        b0, b1, b2, b3, other = r0[i + 1] * d0, r1[i + 1] * d1, r2[i + 1] * d2, r3[i + 1] * d3, front[i + 1]
        row[i + 1] += a0 * r0[i + 1] + a1 * r1[i + 1] + a2 * r2[i + 1] + a3 * r3[i + 1]
        for j in range(i + 2, size):
            p, q, r, s = r0[j], r1[j], r2[j], r3[j]
            row[j] += a0 * p + a1 * q + a2 * r + a3 * s
            other[j] += b0 * p + b1 * q + b2 * r + b3 * s


@compiled
def _substitute(height, first, begin, member, row_start, all_rows, inverse, local, sums, leads, x):
    """Currents x (size, k), in the order of elimination, become potentials: down the tree, where there are currents,
    then up, on the way to fronts that are marked."""
    for t in range(len(height)):
        if height[t] > 0:
            leads[t] |= leads[t - (1 << height[t])] | leads[t - 1]
        size, pivots = begin[t + 1] - begin[t], first[t + 1] - first[t]
        if not x[first[t]:first[t + 1]].any():
            continue
        rows = all_rows[row_start[t]:row_start[t + 1]].reshape(pivots, size)
        _pass_on(rows, inverse[first[t]:first[t + 1]], x[first[t]:first[t + 1]], local[:pivots], sums[:size])
        for i in range(pivots, size):
            for v in range(x.shape[1]):
                x[member[begin[t] + i], v] += sums[i, v]
    x[-1] = 0.0
    for t in range(len(height) - 1, -1, -1):
        if not leads[t]:
            continue
        size, pivots = begin[t + 1] - begin[t], first[t + 1] - first[t]
        rows = all_rows[row_start[t]:row_start[t + 1]].reshape(pivots, size)
        local[:pivots] = 0.0
        for i in range(pivots, size):
            for v in range(x.shape[1]):
                local[i, v] = x[member[begin[t] + i], v]
        _take_up(rows, inverse[first[t]:first[t + 1]], local[:size], sums[:pivots], x[first[t]:first[t + 1]])


@compiled
def _pass_on(rows, inverse, current, scaled, passed):
    """Currents (pivots, k) with those that come from pivots before, and what all pass on to the members (size, k)."""
    for k in range(len(rows)):
        for v in range(current.shape[1]):
            scaled[k, v] = inverse[k] * current[k, v]
        for j in range(k + 1, len(rows)):
            for v in range(current.shape[1]):
                current[j, v] += rows[k, j] * scaled[k, v]
    np.dot(rows.T, scaled, passed)


@compiled
def _take_up(rows, inverse, known, sums, potential):
    """Potentials (pivots, k) where currents are, from those of the members (size, k) that are known, 0 for the pivots.
    """
    np.dot(rows, known, sums)
    for k in range(len(rows) - 1, -1, -1):
        for j in range(k + 1, len(rows)):
            for v in range(potential.shape[1]):
                sums[k, v] += rows[k, j] * potential[j, v]
        for v in range(potential.shape[1]):
            potential[k, v] = (potential[k, v] + sums[k, v]) * inverse[k]


@compiled
def _leave(pairs, weights, x, current):
    """Take from the currents what flows from each unknown to the others of its pairs."""
    for e in range(len(pairs)):
        i, j, w = pairs[e, 0], pairs[e, 1], weights[e]
        for v in range(x.shape[1]):
            flow = w * (x[i, v] - x[j, v])
            current[i, v] -= flow
            current[j, v] += flow
