"""Sparse linear solvers as values: factorise(A) gives solve(b)."""

from __future__ import annotations

import weakref
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.sparse import csc_matrix, csr_matrix, triu
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]
Solve = Callable[[Array], Array]
Factorise = Callable[[csc_matrix], Solve]

# PARDISO's number for such matrices.
_REAL_POSITIVE_DEFINITE = 2


class Indefinite(ArithmeticError):
    """A matrix that must be positive definite is not."""


def factorise(matrix: csc_matrix) -> Solve:
    """Factorise a symmetric positive definite matrix once; solve(b) takes (n,) or (n, k) and gives x of that shape.

    SuperLU without pivoting off the diagonal, minimum-degree ordering.
    """
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve


def factorise_pardiso(matrix: csc_matrix) -> Solve:
    """As `factorise`, by the Cholesky factors of MKL PARDISO; Indefinite where the matrix is not positive definite.

    ValueError where the package pypardiso (extra "pardiso", x86-64 only) is not installed.
    """
    try:
        from pypardiso import PyPardisoSolver  # pyright: ignore[reportMissingImports]
        from pypardiso.pardiso_wrapper import PyPardisoError  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ValueError("factorise_pardiso needs the package pypardiso: pip install 'touchcal[pardiso]' on x86-64, or "
                         "use factorise.") from None
    upper, solver = csr_matrix(triu(matrix)), PyPardisoSolver(mtype=_REAL_POSITIVE_DEFINITE)
    upper.sort_indices()
    try:
        solver.factorize(upper)
    except PyPardisoError:
        raise Indefinite("PARDISO found the matrix not positive definite") from None

    def solve(b: Array) -> Array:
        return solver.solve(upper, np.asfortranarray(b))

    weakref.finalize(solve, solver.free_memory, everything=True)
    return solve


def factorise_band(band: Array) -> Solve:
    """Cholesky factors of a symmetric matrix from its lower band (n, width + 1), column j holding rows j onwards.

    The band is overwritten. Indefinite is raised where a pivot is not positive.
    """
    try:
        factor = cholesky_banded(band.T, overwrite_ab=True, lower=True, check_finite=False)
    except LinAlgError:
        raise Indefinite("a pivot of the Cholesky factorisation is not positive") from None
    return lambda b: cho_solve_banded((factor, True), b, check_finite=False)


def bordered(solve: Solve, border: Array, corner: float) -> Solve:
    """Solver of [[A, border], [border', corner]] from one of A; Indefinite where its Schur complement is not positive.
    """
    column = solve(border)
    schur = corner - float(border @ column)
    if schur <= 0:
        raise Indefinite("the Schur complement of the border is not positive")

    def both(b: Array) -> Array:
        first = solve(b[:-1])
        last = (b[-1] - border @ first) / schur
        return np.append(first - column * last, last)

    return both


def conjugate_gradients(product: Solve, precondition: Solve, b: Array, tolerance: float, limit: int = 1000) -> Array:
    """Solution of A x = b, A symmetric positive definite given by its product with vectors.

    Stops where r' P r, r the residual and P the preconditioner, is tolerance^2 of what it was, or after `limit`
    products, with the best x so far. Indefinite is raised where A is not positive along a direction.
    """
    x, r = np.zeros_like(b), b
    z = precondition(r)
    p, now = z, float(r @ z)
    first = now
    for _ in range(limit):
        if now <= tolerance**2 * first:
            break
        ap = product(p)
        curvature = float(p @ ap)
        if curvature <= 0:
            raise Indefinite("a direction of conjugate gradients has negative curvature")
        x, r = x + now / curvature * p, r - now / curvature * ap
        z = precondition(r)
        before, now = now, float(r @ z)
        p = z + now / before * p
    return x
