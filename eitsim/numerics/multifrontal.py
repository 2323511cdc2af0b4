"""Cholesky factors of a sparse matrix given element by element: dense fronts up a tree of nested dissection.

Each front adds up the matrices of its elements, or what its two children pass on, eliminates the unknowns that occur
nowhere else, and passes on the rest. Source: Duff, Reid, ACM Trans. Math. Softw. 9 (1983) 302,
doi:10.1145/356044.356047.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from eitsim.numerics.linear_solvers import Indefinite, Solve
from eitsim.numerics.nested_dissection import dissect
from eitsim.numerics.work_budget import charge
from touchcal.arrays import Array
from touchcal.jit import compiled

Indices = NDArray[np.int64]

_SYRK, _TRSM, _TRSV = get_blas_funcs(("syrk", "trsm", "trsv"), (np.empty(0),))
(_POTRF,) = get_lapack_funcs(("potrf",), (np.empty(0),))


@dataclass(frozen=True, eq=False)
class Front:
    """One dense front; unknowns by their rank in the order of elimination."""

    first: int  # rank of the first unknown that it eliminates
    pivots: int  # how many it eliminates, from there on
    passed: Indices  # (m,) ranks of those that it passes on, ascending
    elements: Indices  # (e,) elements that it adds up; none where it has children
    place: Indices  # (e, k) places of the elements' unknowns among pivots and passed ones; -1 where fixed
    # (2,) children, and the places (c,) here of what each passes on; none of a leaf
    children: tuple[tuple[int, Indices], ...]


@dataclass(frozen=True, eq=False)
class Tree:
    """Fronts, children before parents."""

    rank: Indices  # (unknowns,) rank of each unknown
    fronts: tuple[Front, ...]

    @property
    def entries(self) -> int:
        """Numbers in the factors."""
        return sum(f.pivots * (f.pivots + len(f.passed)) for f in self.fronts)

    @property
    def operations(self) -> float:
        """Multiplications and additions of a factorisation."""
        sizes = ((float(f.pivots), float(len(f.passed))) for f in self.fronts)
        return sum(p**3 / 3 + p * m * (p + m) for p, m in sizes)


def tree(points: Array, directions: Array, nodes: Indices, unknown: Indices) -> Tree:
    """Fronts of elements at points (elements, d), cut across directions (n, d); nodes (elements, k) of the elements,
    unknown (nodes, c) of the nodes, -1 where fixed."""
    cuts = dissect(points, [nodes], 0, directions)
    first = cuts.first.copy()
    first[-1] += 1
    ordered = unknown[cuts.order]
    free = ordered[ordered >= 0]
    rank = np.empty(len(free), dtype=np.int64)
    rank[free] = np.arange(len(free))
    start = np.append(0, np.cumsum(np.sum(ordered >= 0, axis=1))).tolist()
    pairs = nodes.shape[1] * (nodes.shape[1] - 1) // 2
    leaf_of = np.empty(len(nodes), dtype=np.int64)
    leaf_of[cuts.source // pairs] = np.repeat(np.arange(len(cuts.leaf) - 1), np.diff(cuts.leaf))
    by_leaf, numbers = np.argsort(leaf_of, kind="stable"), unknown[nodes].reshape(len(nodes), -1)
    ranks = np.where(numbers >= 0, rank[numbers], -1)
    owned = iter(np.split(by_leaf, np.searchsorted(leaf_of[by_leaf], np.arange(1, len(cuts.leaf) - 1))))
    fronts: list[Front] = []
    for t, height in enumerate(cuts.height):
        places = cuts.member[cuts.begin[t]:cuts.begin[t + 1]]
        own = np.array([r for p in places.tolist() for r in range(start[p], start[p + 1])], dtype=np.int64)
        pivots = start[first[t + 1]] - start[first[t]]
        elements = next(owned) if height == 0 else np.empty(0, dtype=np.int64)
        place = np.where(ranks[elements] >= 0, np.searchsorted(own, ranks[elements]), -1)
        children = () if height == 0 else (t - (1 << int(height)), t - 1)
        fronts.append(Front(start[first[t]], pivots, own[pivots:], elements, place, tuple(
            (c, np.searchsorted(own, fronts[c].passed)) for c in children)))
    return Tree(rank, tuple(fronts))


def factorise(tree: Tree, matrices: Array) -> Solve:
    """A solver by the Cholesky factors of the sum of elements' matrices (elements, k, k), of which the lower half is
    read. Indefinite is raised where the sum is not positive definite."""
    charge(len(tree.rank))
    factors: list[tuple[Array, Array]] = []
    waiting: dict[int, Array] = {}
    for t, front in enumerate(tree.fronts):
        head, below, rest = _assembled(front, matrices, waiting)
        if front.pivots:
            head, failed = _POTRF(head, lower=1, clean=0, overwrite_a=1)
            if failed:
                raise Indefinite("a pivot of the Cholesky factorisation is not positive")
            if len(front.passed):
                below = _TRSM(1.0, head, below, side=1, lower=1, trans_a=1, overwrite_b=1)
                rest = _SYRK(-1.0, below, beta=1.0, c=rest, lower=1, overwrite_c=1)
        factors.append((head, below))
        waiting[t] = rest
    return lambda b: _solved(tree, factors, b)


def _assembled(front: Front, matrices: Array, waiting: dict[int, Array]) -> tuple[Array, Array, Array]:
    """Lower blocks of a front: pivots, what is passed on by pivots, and what is passed on."""
    p, m = front.pivots, len(front.passed)
    head, below, rest = (np.zeros(shape, order="F") for shape in ((p, p), (m, p), (m, m)))
    for element, place in zip(front.elements, front.place, strict=True):
        _scatter(matrices[element], place, p, head, below, rest)
    for child, place in front.children:
        _scatter(waiting.pop(child), place, p, head, below, rest)
    return head, below, rest


@compiled
def _scatter(matrix, place, pivots, head, below, rest):
    for b in range(len(place)):
        for a in range(b, len(place)):
            i, j = max(place[a], place[b]), min(place[a], place[b])
            if j < 0:
                continue
            if i < pivots:
                head[i, j] += matrix[a, b]
            elif j < pivots:
                below[i - pivots, j] += matrix[a, b]
            else:
                rest[i - pivots, j - pivots] += matrix[a, b]


def _solved(tree: Tree, factors: list[tuple[Array, Array]], b: Array) -> Array:
    x = np.empty_like(b)
    x[tree.rank] = b
    for front, own, (head, below) in _steps(tree, factors):
        x[own] = _TRSV(head, x[own], lower=1)
        x[front.passed] -= below @ x[own]
    for front, own, (head, below) in reversed(list(_steps(tree, factors))):
        x[own] = _TRSV(head, x[own] - below.T @ x[front.passed], lower=1, trans=1)
    return x[tree.rank]


def _steps(tree: Tree, factors: list[tuple[Array, Array]]) -> Iterator[tuple[Front, slice, tuple[Array, Array]]]:
    for front, factor in zip(tree.fronts, factors, strict=True):
        if front.pivots:
            yield front, slice(front.first, front.first + front.pivots), factor
