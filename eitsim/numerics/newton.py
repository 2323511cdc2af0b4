"""Minimisation of an energy by Newton's method with damped negative curvature and Armijo's rule."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eitsim.numerics.linear_solvers import Indefinite, Solve
from eitsim.numerics.work_budget import used_up
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# gradient (n,) at x and a function that factorises the Hessian there; Indefinite is raised by the latter
System = tuple[Array, Callable[[], Solve]]

_ARMIJO = 1e-4
_HALVINGS = 30
# Descents smaller than this part of the energy drown in rounding; the full step is taken then.
_ROUNDING = 1e-13
# Share of the negative curvature: least that is kept, factor where the Hessian is indefinite, factors after a long and
# after a short step, and the step length that divides them. Found by trial on touches of 8 to 18 mm, 0.1 to 8 N.
_LEAST, _INDEFINITE, _AFTER_LONG, _AFTER_SHORT, _LONG = 0.02, 1 / 3, 2.0, 1 / 4, 0.5
# Most doublings of a full step where the Hessian is damped, since steps along negative curvature come out short, and
# the further descent, over that so far, for which one is made.
_DOUBLINGS, _PAYS = 10, 0.5
# Ratio of two residuals below which iterations go on past their limit.
_CLOSING = 0.1
# Relative residual below which an indefinite Hessian means a saddle of the energy.
_SADDLE = 1e-3


@dataclass(frozen=True)
class Minimum:
    """A converged minimum."""

    x: Array  # (n,) where it is
    solve: Solve  # solves with the Hessian there, or within a relative residual `near`
    residuals: tuple[float, ...]  # norm of the gradient over its scale after each iteration


def minimise(energy: Callable[[Array], float], system: Callable[[Array, float], System], start: Array, *,
             scale: float, tolerance: float = 1e-10, limit: int = 100, near: float = 0.0) -> Minimum:
    """Local minimum of energy(x) from start, at which |gradient| <= tolerance scale and the Hessian is positive.

    system(x, share) gives the gradient and the Hessian whose possibly negative parts are scaled by share: an indefinite
    Hessian and short steps lower it, long steps raise it back to 1. More than `limit` iterations are made only while
    each gradient is less than a tenth of the one before, none once the work is used up that `work.bounded` allows.
    From a relative residual `near` on one Hessian serves while it takes each gradient to less than a tenth.
    NotConverged carries the last x and the residuals.
    """
    x, value, share, damped, residuals, kept = start, energy(start), 1.0, False, [], []
    if not np.isfinite(value):
        raise NotConverged("the start is not admissible: it turns the foam inside out.", estimate=start)
    while len(residuals) < limit or residuals[-1] < _CLOSING * residuals[-2:][0]:
        if used_up():
            raise NotConverged(f"Newton's method was stopped after {len(residuals)} iterations.", estimate=x,
                               residuals=tuple(residuals))
        gradient, solve, share = _definite(system, x, share, residuals, kept, scale)
        residuals.append(float(np.linalg.norm(gradient)) / scale)
        if residuals[-1] <= tolerance and share == 1:
            return Minimum(x, solve, tuple(residuals))
        damped, step = share < 1, -solve(gradient)
        kept = [solve] if share == 1 and residuals[-1] <= near else []
        del solve  # its memory, before the next takes as much and where the traceback of a failure would hold it
        length, reached = _descend(energy, x, value, gradient, step, residuals)
        if damped and length == 1:
            length, reached = _lengthened(energy, x, step, value, reached)
        x, value = x + length * step, reached
        share = min(1.0, _AFTER_LONG * max(share, _LEAST)) if length >= _LONG else _AFTER_SHORT * share
    near_saddle = "; it nears an equilibrium that is not stable" if damped and residuals[-1] < _SADDLE else ""
    raise NotConverged(f"Newton's method did not converge in {len(residuals)} iterations (relative residual "
                       f"{residuals[-1]:.1e}{near_saddle}).", estimate=x, residuals=tuple(residuals))


def _definite(system: Callable[[Array, float], System], x: Array, share: float,
              residuals: list[float], kept: list[Solve], scale: float) -> tuple[Array, Solve, float]:
    """Gradient, solve and the share at which the Hessian is positive definite; the solve that was kept, if there is
    one, where its step took the gradient to less than a tenth."""
    while True:
        gradient, factorise = system(x, share)
        if kept and float(np.linalg.norm(gradient)) < _CLOSING * residuals[-1] * scale:
            return gradient, kept[0], share
        kept.clear()
        try:
            return gradient, factorise(), share
        except Indefinite:
            del factorise
            if share == 0:
                raise NotConverged("the tangent stays indefinite without its negative modes.", estimate=x,
                                   residuals=tuple(residuals)) from None
            share = _INDEFINITE * share if share > _LEAST else 0.0


def _descend(energy: Callable[[Array], float], x: Array, value: float, gradient: Array, step: Array,
             residuals: list[float]) -> tuple[float, float]:
    """Length of a step that lowers the energy enough, and the energy there."""
    slope, length = float(gradient @ step), 1.0
    for _ in range(_HALVINGS):
        reached = energy(x + length * step)
        if reached <= value + _ARMIJO * length * slope or (-slope < _ROUNDING * abs(value) and np.isfinite(reached)):
            return length, reached
        length /= 2
    raise NotConverged("no step along the Newton direction lowers the energy.", estimate=x, residuals=tuple(residuals))


def _lengthened(energy: Callable[[Array], float], x: Array, step: Array, start: float,
                value: float) -> tuple[float, float]:
    """Length of a full step from energy start to value, doubled while as much of it again pays, and the energy there.
    """
    length = 1.0
    for _ in range(_DOUBLINGS):
        reached = energy(x + 2 * length * step)
        if not value - reached > _PAYS * max(start - value, 0.0):
            break
        length, value = 2 * length, reached
    return length, value
