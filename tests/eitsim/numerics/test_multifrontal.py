"""Sparse Cholesky factors: the dense solution, fixed unknowns left out, and matrices that are not positive."""

import numpy as np
import pytest

from eitsim.numerics.linear_solvers import Indefinite
from eitsim.numerics.multifrontal import Tree, factorise, tree

RNG = np.random.default_rng(3)


def _boxes(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Middles (n^3, 3) and nodes (n^3, 8) of a block of boxes."""
    number = np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
    corners = [number[i:n + i, j:n + j, k:n + k].ravel() for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    return np.argwhere(np.ones((n, n, n))).astype(float), np.column_stack(corners)


def _problem(n: int) -> tuple[Tree, np.ndarray, np.ndarray]:
    middles, nodes = _boxes(n)
    fixed = np.zeros((nodes.max() + 1, 3), dtype=bool)
    fixed[:(n + 1) ** 2] = True
    unknown = np.where(fixed, -1, np.cumsum(~fixed).reshape(fixed.shape) - 1)
    half = RNG.normal(size=(len(nodes), 24, 24))
    return tree(middles, np.eye(3), nodes, unknown), half @ half.swapaxes(1, 2) + np.eye(24), unknown[nodes]


def _dense(matrices: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    numbers, size = unknown.reshape(len(unknown), -1), unknown.max() + 1
    out = np.zeros((size + 1, size + 1))
    for matrix, own in zip(matrices, numbers, strict=True):
        out[np.ix_(own, own)] += matrix
    return out[:-1, :-1]


@pytest.mark.parametrize("n", [1, 3, 5])
def test_the_solution_is_the_dense_one(n: int) -> None:
    order, matrices, unknown = _problem(n)
    load = RNG.normal(size=unknown.max() + 1)
    assert factorise(order, matrices)(load) == pytest.approx(np.linalg.solve(_dense(matrices, unknown), load), rel=1e-9)


def test_a_matrix_that_is_not_positive_is_refused() -> None:
    order, matrices, _ = _problem(3)
    with pytest.raises(Indefinite):
        factorise(order, matrices - 200 * np.eye(24))


def test_entries_and_operations_are_those_of_a_dense_matrix_where_all_meet() -> None:
    order, _, unknown = _problem(1)
    size = unknown.max() + 1
    assert (order.entries, order.operations) == (size**2, pytest.approx(size**3 / 3))
