"""Linear solvers as values: a factorisation gives solve(b)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

from eitsim.numerics.work_budget import PRODUCT, charge
from touchcal.arrays import Array

Indices = NDArray[np.int64]
Solve = Callable[[Array], Array]


class Indefinite(ArithmeticError):
    """A matrix that must be positive definite is not."""


def factorise_band(band: Array) -> Solve:
    """Cholesky factors of a symmetric matrix from its lower band (n, width + 1), column j holding rows j onwards. The
    band is overwritten. Indefinite is raised where a pivot is not positive."""
    charge(len(band))
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


def condensed(solve: Solve, inner: Array, across: Array, own: Indices, near: Indices, outer: Indices) -> Solve:
    """Solver of [[A, B], [B', C]] from one of A - B C^-1 B', C of blocks inner (blocks, c, c) of the unknowns own
    (blocks, c), B of blocks across (blocks, n, c) of the places near (blocks, n), -1 for none, among unknowns outer.
    Indefinite where C is not positive; c is 0 or 2."""
    if inner.size and not np.all((inner[:, 0, 0] > 0) & (np.linalg.det(inner) > 0)):
        raise Indefinite("a block of what is eliminated first is not positive")
    inverse = np.linalg.inv(inner)
    passed = across @ inverse

    def whole(b: Array) -> Array:
        out = np.empty_like(b)
        pushed = np.einsum("enc,ec->en", passed, b[own])
        gathered = np.bincount(near.ravel() + 1, pushed.ravel(), len(outer) + 1)[1:]
        out[outer] = found = solve(b[outer] - gathered)
        moved = np.append(found, 0.0)[near]
        out[own] = np.einsum("ecd,ed->ec", inverse, b[own]) - np.einsum("enc,en->ec", passed, moved)
        return out

    return whole


def conjugate_gradients(product: Solve, precondition: Solve, b: Array, tolerance: float, limit: int = 1000,
                        cost: float = PRODUCT) -> Array:
    """Solution of A x = b, A symmetric positive definite given by its product with vectors. Stops where r' P r, r the
    residual and P the preconditioner, is tolerance^2 of what it was, or after `limit` products, with the best x so far.
    cost: work of a product over that of a factorisation. Indefinite is raised where A is not positive along a
    direction."""
    x, r = np.zeros_like(b), b
    z = precondition(r)
    p, now = z, float(r @ z)
    first = now
    for _ in range(limit):
        if now <= tolerance**2 * first:
            break
        charge(cost * len(b))
        ap = product(p)
        curvature = float(p @ ap)
        if curvature <= 0:
            raise Indefinite("a direction of conjugate gradients has negative curvature")
        x, r = x + now / curvature * p, r - now / curvature * ap
        z = precondition(r)
        before, now = now, float(r @ z)
        p = z + now / before * p
    return x
