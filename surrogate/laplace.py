"""The Laplace approximation of a regularised network: effective parameters, evidence, variance of the output.

H = beta J'J + alpha I is half the Hessian of beta E_D + alpha E_W; whichever of the N x N and p x p matrices is smaller
is factorised.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from surrogate import network

# Part of its mean diagonal that a matrix may lose to rounding.
ROUNDING = 1e-14


def effective_parameters(w: Tensor, x: Tensor, alpha: float, beta: float) -> tuple[float, float]:
    """gamma, and N - gamma without cancellation where N < p."""
    trace = float(torch.cholesky_inverse(_normal_factor(w, x, alpha, beta)).diagonal().sum())
    if len(x) < len(w):
        return len(x) - alpha * trace, alpha * trace
    gamma = len(w) - alpha * trace
    return gamma, len(x) - gamma


def log_evidence(w: Tensor, x: Tensor, alpha: float, beta: float, cost: float) -> float:
    """log of the evidence at weights of this cost, without the constant -N/2 log pi (MacKay 1992, section 4)."""
    n, p = len(x), len(w)
    diagonal = _normal_factor(w, x, alpha, beta).diagonal()
    log_det = 2 * float(diagonal.log().sum()) + max(p - n, 0) * math.log(alpha)
    return -cost - 0.5 * log_det + 0.5 * p * math.log(alpha) + 0.5 * n * math.log(beta)


def _normal_factor(w: Tensor, x: Tensor, alpha: float, beta: float) -> Tensor:
    """Cholesky factor of beta J J' + alpha I where N < p, else of beta J'J + alpha I."""
    if len(x) < len(w):
        return factor(beta * network.kernel(w, x, x), alpha)
    j = network.jacobian(w, x)
    return factor(beta * j.T @ j, alpha)


def factor(matrix: Tensor, shift: float) -> Tensor:
    """Lower Cholesky factor of a matrix plus shift I, the shift at least what rounding may take from the matrix."""
    least = ROUNDING * float(matrix.diagonal().mean())
    return torch.linalg.cholesky(matrix + max(shift, least) * torch.eye(len(matrix), dtype=matrix.dtype))


def output_variance(w: Tensor, x: Tensor, alpha: float, beta: float, at: Tensor) -> Tensor:
    """(m,) Laplace variance of the output at inputs (m, q) for training inputs x (n, q): j'(2H)^-1 j + 1 / (2 beta)."""
    lower = _normal_factor(w, x, alpha, beta)
    if len(x) < len(w):
        half = torch.linalg.solve_triangular(lower, network.kernel(w, x, at), upper=False)
        spread = (network.self_kernel(w, at) - beta * (half**2).sum(0)) / alpha
    else:
        half = torch.linalg.solve_triangular(lower, network.jacobian(w, at).T, upper=False)
        spread = (half**2).sum(0)
    return 0.5 * spread.clamp(min=0.0) + 0.5 / beta
