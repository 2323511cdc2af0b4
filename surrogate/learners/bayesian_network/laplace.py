"""The Laplace approximation of a regularised network: effective parameters, evidence, draws of the weights.

H = beta J'J + alpha I is half the Hessian of beta E_D + alpha E_W. J J' has the eigenvalues of J'J other than 0, so the
smaller of the two is formed, once for each set of weights, and serves every alpha, beta and damping.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.linalg import cho_solve, cholesky, lapack, solve_triangular

from surrogate.learners.bayesian_network import layer
from touchcal.arrays import Array

ROUNDING = 1e-14  # part of its mean diagonal that a matrix may lose to rounding


@dataclass(frozen=True)
class Curvature:
    """The smaller of J J' and J'J at some weights."""

    gram: Array  # (m, m) its lower triangle
    rows: int  # number of rows n
    count: int  # number of weights p; J J' is held where n < p

    @property
    def dual(self) -> bool:
        return self.rows < self.count


def curvature(w: Array, x: Array) -> Curvature:
    """J J' or J'J of weights (p,) on inputs (n, q)."""
    if len(x) < len(w):
        return Curvature(np.asfortranarray(layer.kernel(w, x)), len(x), len(w))
    return Curvature(layer.normal(w, x), len(x), len(w))


def factor(of: Curvature, beta: float, shift: float) -> Array:
    """Lower Cholesky factor of beta gram + shift I, the shift at least what rounding may take from the matrix."""
    matrix = beta * of.gram
    diagonal = np.einsum("ii->i", matrix)
    diagonal += max(shift, ROUNDING * float(diagonal.mean()))
    return cholesky(matrix, lower=True, overwrite_a=True, check_finite=False)


def solve(lower: Array, right: Array) -> Array:
    """(L L')^-1 right."""
    return cho_solve((lower, True), right, check_finite=False)


def effective_parameters(of: Curvature, alpha: float, beta: float) -> tuple[float, float]:
    """gamma = p - alpha tr H^-1, and N - gamma without cancellation where N < p; the trace is |L^-1|^2."""
    lower = factor(of, beta, alpha)
    inverse, _ = lapack.dtrtri(lower, lower=1, overwrite_c=1)  # pyright: ignore[reportAttributeAccessIssue]
    lost = alpha * float(np.vdot(inverse, inverse))
    if of.dual:
        return of.rows - lost, lost
    gamma = of.count - lost
    return gamma, of.rows - gamma


def log_evidence(of: Curvature, alpha: float, beta: float, cost: float) -> float:
    """log of the evidence at weights of this cost, without the constant -N/2 log pi (MacKay 1992, section 4)."""
    n, p = of.rows, of.count
    log_det = 2 * float(np.log(factor(of, beta, alpha).diagonal()).sum()) + max(p - n, 0) * math.log(alpha)
    return -cost - 0.5 * log_det + 0.5 * p * math.log(alpha) + 0.5 * n * math.log(beta)


def draws(w: Array, x: Array, alpha: float, beta: float, count: int, rng: Generator) -> Array:
    """(count, p) departures from the weights, normal with covariance (2H)^-1.

    Where J J' is held, by Matheron's rule: a draw of the prior, less what rows with a draw of the noise tell of it.
    """
    of = curvature(w, x)
    lower = factor(of, beta, alpha)
    normal = rng.standard_normal((count, of.count)) / math.sqrt(2)
    if not of.dual:
        return solve_triangular(lower, normal.T, lower=True, trans=1).T
    prior = normal / math.sqrt(alpha)
    noise = rng.standard_normal((count, of.rows)) / math.sqrt(2 * beta)
    seen = np.stack([layer.times_jacobian(w, x, one) for one in prior]) + noise
    known = beta * solve(lower, seen.T).T
    return prior - np.stack([layer.times_transpose(w, x, one) for one in known])
