"""Sparse linear solvers as values: factorise(A) gives solve(b)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]
Solve = Callable[[Array], Array]


def factorise(matrix: csc_matrix) -> Solve:
    """Factorise a symmetric positive definite matrix once; solve(b) takes (n,) or (n, k) and gives x of that shape.

    SuperLU without pivoting off the diagonal, minimum-degree ordering.
    """
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve
