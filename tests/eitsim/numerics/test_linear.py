"""A band matrix is factorised in place of a sparse one."""

import numpy as np
import pytest
from scipy.sparse import csc_matrix, diags, kronsum
from scipy.sparse.linalg import spsolve

from eitsim.numerics.linear_solvers import Indefinite, factorise_band


def laplacian(n: int = 12) -> csc_matrix:
    line = diags([-1.0, 2.01, -1.0], [-1, 0, 1], shape=(n, n))
    return csc_matrix(kronsum(line, line))


def band_of(dense: np.ndarray, width: int) -> np.ndarray:
    band = np.zeros((len(dense), width + 1))
    for k in range(width + 1):
        band[: len(dense) - k, k] = np.diagonal(dense, -k)
    return band


def test_a_band_gives_what_the_sparse_matrix_gives():
    matrix = laplacian()
    b = np.random.default_rng(2).normal(size=matrix.shape[0])
    np.testing.assert_allclose(factorise_band(band_of(matrix.toarray(), 12))(b), spsolve(matrix, b), rtol=0, atol=1e-12)


def test_a_band_that_is_not_definite_is_refused():
    with pytest.raises(Indefinite):
        factorise_band(band_of(laplacian().toarray() - 3 * np.eye(144), 12))
