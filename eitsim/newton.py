"""Minimisation of an energy by Newton's method with damped negative curvature and Armijo's rule."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.linear import Indefinite, Solve
from matcal.errors import NotConverged

Array = NDArray[np.float64]
# gradient (n,) at x and a function that factorises the Hessian there; Indefinite is raised by the latter
System = tuple[Array, Callable[[], Solve]]

_ARMIJO = 1e-4
_HALVINGS = 30
# Descents smaller than this part of the energy drown in rounding; the full step is taken then.
_ROUNDING = 1e-13
# Share of the negative curvature below which none is kept.
_LEAST_SHARE = 0.02


@dataclass(frozen=True)
class Minimum:
    """A converged minimum."""

    # (n,) where it is
    x: Array
    # solves with the exact Hessian there
    solve: Solve
    # norm of the gradient over its scale after each iteration
    residuals: tuple[float, ...]


def minimise(energy: Callable[[Array], float], system: Callable[[Array, float], System], start: Array, *,
             scale: float, tolerance: float = 1e-10, limit: int = 200) -> Minimum:
    """Local minimum of energy(x) from start, at which |gradient| <= tolerance scale and the Hessian is positive.

    system(x, share) gives the gradient and the Hessian whose possibly negative parts are scaled by share. An
    indefinite Hessian lowers share at once, a definite one raises it back to 1. NotConverged carries the last x and
    the residuals.
    """
    x, value, share, residuals = start, energy(start), 1.0, []
    for _ in range(limit):
        gradient, solve, used = _definite(system, x, share)
        residuals.append(float(np.linalg.norm(gradient)) / scale)
        if residuals[-1] <= tolerance and used == 1:
            return Minimum(x, solve, tuple(residuals))
        share = min(1.0, 4 * max(used, _LEAST_SHARE))
        x, value = _descend(energy, x, value, gradient, -solve(gradient), residuals)
    raise NotConverged(f"Newton's method did not converge in {limit} iterations (relative residual "
                       f"{residuals[-1]:.1e}).", estimate=x, residuals=tuple(residuals))


def _definite(system: Callable[[Array, float], System], x: Array, share: float) -> tuple[Array, Solve, float]:
    """Gradient, solve and the share at which the Hessian is positive definite."""
    while True:
        gradient, factorise = system(x, share)
        try:
            return gradient, factorise(), share
        except Indefinite:
            if share == 0:
                raise NotConverged("the tangent stays indefinite without its negative modes.", estimate=x) from None
            share = share / 4 if share > _LEAST_SHARE else 0.0


def _descend(energy: Callable[[Array], float], x: Array, value: float, gradient: Array, step: Array,
             residuals: list[float]) -> tuple[Array, float]:
    """Next x and its energy along a descent direction."""
    slope, length = float(gradient @ step), 1.0
    for _ in range(_HALVINGS):
        trial = x + length * step
        reached = energy(trial)
        if reached <= value + _ARMIJO * length * slope or (
                -slope < _ROUNDING * abs(value) and np.isfinite(reached)):
            return trial, reached
        length /= 2
    raise NotConverged("no step along the Newton direction lowers the energy.", estimate=x, residuals=tuple(residuals))
