"""Families combined: weights, none negative and of sum one, that make the mean square of the held-out error least."""

import numpy as np
from scipy.optimize import nnls

from touchcal.arrays import Array, Index

# Rows' worth of evidence that all families are as good as each other: few held-out rows do not choose alone.
PRIOR_ROWS = 20.0
LEAST = 0.02  # a smaller weight is none: a family that costs time and adds nothing is left out


def weights(held_out: Array, target: Array, prior: Array, presses: int | None = None) -> Array:
    """(families,) weights of held-out values (families, n, k) of targets (n, k), of so many presses.

    prior: (families,) weights, up to a factor, of PRIOR_ROWS presses on which families err independently of each other,
    each by its own root mean square where all weigh the same, and less where it weighs more.
    """
    error = (held_out - target).reshape(len(held_out), -1)
    second = error @ error.T / len(target)
    own = np.diag(second) * prior.mean() / prior
    second += np.diag(own) * PRIOR_ROWS / (len(target) if presses is None else presses)
    found = _on_simplex(second)
    found[found < LEAST] = 0
    return found / found.sum()


def combined(held_out: Array, target: Array, prior: Array, blocks: Index,
             press: Index | None = None) -> tuple[Array, Array]:
    """Held-out values combined, (n, k), each block by the weights of the others, and these weights (n, families): what
    a combination does on rows that did not choose it."""
    each = np.empty((len(target), len(held_out)))
    for block in np.unique(blocks):
        gone = blocks == block
        each[gone] = weights(held_out[:, ~gone], target[~gone], prior,
                             None if press is None else len(np.unique(press[~gone])))
    return np.einsum("nf,fnk->nk", each, held_out), each


def _on_simplex(second: Array) -> Array:
    """Minimiser of w^T S w over w >= 0, sum w = 1: with S = L L^T that of |L^T v|^2 + (c (1 - sum v))^2, normed."""
    factor = np.linalg.cholesky(second + 1e-12 * np.trace(second) * np.eye(len(second)))
    size = np.sqrt(np.trace(second))
    found, _ = nnls(np.vstack([factor.T / size, np.ones(len(second))]), np.append(np.zeros(len(second)), 1.0))
    return found / found.sum()
