"""Numbers that enter a model linearly, integrated out of it exactly, and drawn again given the rest.

y = A x + noise with unit variance and x ~ N(mean, 1/root^2): the triangular factor R of [A | y] with the prior as
further rows holds the marginal density, -r_last^2/2 - sum ln |r_ii|, and the conditional draws, R x = r + N(0, 1).
"""

import numpy as np

from touchcal.arrays import Array


def triangles(columns: Array, target: Array, root: Array, mean: Array) -> Array:
    """(W, K + 1, K + 1) triangular factors for columns (W, r, K), target (W, r), and a prior of root precision (K,)
    and mean (K,)."""
    walkers, rows, width = columns.shape
    system = np.zeros((walkers, rows + width, width + 1))
    system[:, :rows, :width], system[:, :rows, width] = columns, target
    system[:, rows + np.arange(width), np.arange(width)] = root
    system[:, rows:, width] = root * mean
    return np.asarray(np.linalg.qr(system, mode="r"), dtype=float)


def log_marginal(r: Array) -> Array:
    """(W,) logarithm of the density with x integrated out, but for a constant."""
    diagonal = np.abs(np.einsum("wkk->wk", r))
    return -0.5 * diagonal[:, -1] ** 2 - np.log(diagonal[:, :-1]).sum(axis=1)


def conditional(r: Array, rng: np.random.Generator) -> Array:
    """(W, K) one draw of x for each factor."""
    width = r.shape[1] - 1
    noise = rng.normal(size=(r.shape[0], width))
    return np.asarray(np.linalg.solve(r[:, :width, :width], (r[:, :width, width] + noise)[..., None])[..., 0], float)
