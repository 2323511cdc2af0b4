"""What each row of a regression misses where all rows of its press are left out, in closed form: with K the covariance
of the rows and w = K^-1 y, rows G miss (K^-1_GG)^-1 w_G, of covariance (K^-1_GG)^-1 (Rasmussen and Williams, Gaussian
processes for machine learning, 2006, equations 5.10 to 5.12, for runs of rows)."""

from collections.abc import Callable

import numpy as np

from touchcal.arrays import Array, Index


def missed(block: Callable[[Index], Array], weighted: Array, press: Index | None) -> tuple[Array, Array]:
    """(n, m) what rows with K^-1 y (n, m) miss without the rows of their press (n,), each row its own where that is
    None, and (n,) the variance of it. block: from rows (k, g) to the blocks (k, g, g) of K^-1."""
    left, variance = np.empty_like(weighted), np.empty(len(weighted))
    for rows in _by_size(np.arange(len(weighted)) if press is None else press):
        covariance = np.linalg.inv(block(rows))
        left[rows] = covariance @ weighted[rows]
        variance[rows] = np.diagonal(covariance, axis1=1, axis2=2)
    return left, variance


def of_matrix(inverse: Array) -> Callable[[Index], Array]:
    """Blocks of K^-1 (n, n)."""
    return lambda rows: inverse[rows[:, :, None], rows[:, None, :]]


def of_axes(axes: Array, inverse: Array) -> Callable[[Index], Array]:
    """Blocks of K^-1 of these eigenvectors (n, n) and inverse eigenvalues (n,)."""
    return lambda rows: (axes[rows] * inverse) @ np.swapaxes(axes[rows], 1, 2)


def _by_size(press: Index) -> list[Index]:
    """Rows (k, g) of all presses of g rows, for each g."""
    order = np.argsort(press, kind="stable")
    _, first, size = np.unique(press[order], return_index=True, return_counts=True)
    return [order[first[size == g][:, None] + np.arange(g)] for g in np.unique(size)]
