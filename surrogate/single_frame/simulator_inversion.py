"""One touch from one frame with the simulator itself as the forward map: Levenberg-Marquardt on whitened residuals.

Unknowns are (x, y, log d, load g) under the Gaussian prior of a learned map's training touches. Derivatives are the
simulator's adjoint ones at the start, on a skin with an outline those of the learned map, and follow by secants
(Broyden, Math. Comp. 19 (1965) 577): one scene a step.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from surrogate.bounds.fisher_information import Slopes
from surrogate.forward_map.forward_map import ForwardMap, linearise
from surrogate.forward_map.inversion.multipole_location import on_range
from surrogate.forward_map.load_coordinates import to_touch, to_unknown, touch_slope
from surrogate.single_frame.simulator_likelihood import Simulator, Unknowns, slopes_at, solved, unknowns_of
from surrogate.statistics.conformal import COVERAGE, normal
from surrogate.statistics.levenberg_marquardt import inverse
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# Most scenes solved after the first, and the step, in standard deviations of the answer, that is not worth one.
STEPS, CLOSE = 8, 0.05
DAMPING, WORSE = 1e-8, 100.0  # damping at the start, and what a step that is no gain multiplies it by
KNOWN = 1e-4  # standard deviation of log d where the punch is known


@dataclass(frozen=True, eq=False)
class Direct:
    """The most probable touch by the simulator."""

    touch: Array  # (4,) x, y, d in mm, F in N
    # (4, 4) covariance, widened by the misfit where that exceeds 1; and were material and simulator exact
    covariance: Array
    own: Array
    misfit: float  # squared residual over what noise, material and the simulator's error explain, a degree of freedom
    residual_V: Array  # (readings,) what is left of the signal, V
    signal_V: Array  # (readings,) the simulator's signal there, V
    unknowns: Unknowns  # what readings may be off by
    slope: Array  # (readings, 4) their derivatives by the touch
    # relative error of the simulator's signal, with the bounds of what its plan leaves out, which no interval counts
    error_estimate: float
    simulations: int  # scenes solved (and derivatives once)
    cpu_s: float  # CPU time, s
    converged: bool  # whether it ended within CLOSE of the minimum


@dataclass(frozen=True, eq=False)
class _Minimum:
    state: Array
    residual: Array
    jacobian: Array
    solves: int
    close: bool


def direct(simulator: Simulator, forward: ForwardMap, signal_V: Array, noise_V: float, start: Array, *,
           known_d: bool = False) -> Direct:
    """Invert one signal (readings,), V, from a start (4,) in mm and N; NotConverged where that cannot be solved.

    known_d: whether the start's diameter is that of the punch.
    """
    begun = time.process_time()
    first, slopes = solved(simulator, start), _slopes(simulator, forward, start)
    unknowns = unknowns_of(first, slopes, noise_V)
    whiten = unknowns.whitening
    state = (to_unknown(start[None], forward.p0)[0] - forward.mean) / forward.sd
    centre, width = np.zeros(4), np.ones(4)
    if known_d:
        centre[2], width[2] = state[2], KNOWN / forward.sd[2]

    def residual(z: Array, found_V: Array) -> Array:
        return np.concatenate([whiten @ (found_V - signal_V), (z - centre) / width])

    def residual_at(z: Array) -> Array:
        try:
            return residual(z, solved(simulator, _touch(forward, z)).signal_V)
        except NotConverged:
            return np.full(len(signal_V) + 4, np.inf)

    jacobian = np.vstack([whiten @ slopes.touch @ _by_state(forward, state), np.diag(1 / width)])
    end = _descend(residual_at, lambda z: _within(forward, z), state, residual(state, first.signal_V), jacobian)
    left, by_state = (np.asarray(np.linalg.solve(whiten, part[:-4]), np.float64)
                      for part in (end.residual, end.jacobian))
    misfit = float(np.sum(end.residual[:-4] ** 2)) / (len(signal_V) - 4)
    to_mm = _by_state(forward, end.state)
    own = np.asarray(np.vstack([by_state / unknowns.white_V, np.diag(1 / width)]), np.float64)
    return Direct(_touch(forward, end.state), _covariance(end.jacobian, to_mm) * max(misfit, 1.0),
                  _covariance(own, to_mm), misfit, left, signal_V + left, unknowns, by_state @ np.linalg.inv(to_mm),
                  first.error_estimate, end.solves + 1, time.process_time() - begun, end.close)


def _slopes(simulator: Simulator, forward: ForwardMap, touch: Array) -> Slopes:
    """Derivatives at a touch (4,); on a skin with an outline the learned map's by the touch, and none by the
    material."""
    if forward.ring.sheet is None:
        return slopes_at(simulator, touch)
    here = to_unknown(touch[None], forward.p0)
    by_touch = linearise(forward, here).jacobian[0] @ np.linalg.inv(touch_slope(here, forward.p0)[0])
    return Slopes(by_touch, np.zeros((len(by_touch), 0)))


def _descend(residual_at: Callable[[Array], Array], within: Callable[[Array], Array], state: Array, residual: Array,
             jacobian: Array) -> _Minimum:
    """Down from a state (4,) of residual (r,) and Jacobian (r, 4) until the next step would be shorter than CLOSE."""
    damping = DAMPING
    for done in range(STEPS):
        normal = jacobian.T @ jacobian
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), jacobian.T @ residual)
        step = within(state + step) - state
        if np.linalg.norm(jacobian @ step) < CLOSE:
            return _Minimum(state, residual, jacobian, done, True)
        found = residual_at(state + step)
        better = found @ found < residual @ residual
        if np.all(np.isfinite(found)):
            jacobian = jacobian + np.outer(found - residual - jacobian @ step, step) / (step @ step)
        if better:
            state, residual = state + step, found
        damping = damping / 10 if better else damping * WORSE
    return _Minimum(state, residual, jacobian, STEPS, False)


def _touch(forward: ForwardMap, state: Array) -> Array:
    return to_touch((forward.mean + forward.sd * state)[None], forward.p0)[0]


def _by_state(forward: ForwardMap, state: Array) -> Array:
    """(4, 4) derivative of the touch by the scaled state."""
    return touch_slope((forward.mean + forward.sd * state)[None], forward.p0)[0] * forward.sd


def _covariance(jacobian: Array, to_mm: Array) -> Array:
    return to_mm @ inverse((jacobian.T @ jacobian)[None])[0] @ to_mm.T


def _within(forward: ForwardMap, state: Array) -> Array:
    return (on_range(forward, (forward.mean + forward.sd * state)[None])[0] - forward.mean) / forward.sd


def relative_curvature(forward: ForwardMap, touch: Array, covariance: Array, whiten: Array) -> float:
    """How far from straight readings are over a touch's own interval; where they bend, one covariance is too narrow:
    departure of the map's readings from their tangent at the ends of the 90 % interval along the longest axis of the
    covariance, the larger of both, over the normal factor: 1 where readings bend by what one standard deviation of the
    touch changes them by, 0 where they are linear (Bates, Watts, J. R. Statist. Soc. B 42 (1980) 1).

    touch (4,) and covariance (4, 4) in mm and N; whiten (readings, readings) makes residuals standard normal.
    """
    here = to_unknown(touch[None], forward.p0)
    to_unknowns = np.linalg.inv(touch_slope(here, forward.p0)[0])
    spread = to_unknowns @ covariance @ to_unknowns.T
    size, axes = np.linalg.eigh(spread / np.outer(forward.sd, forward.sd))
    step = normal(COVERAGE) * np.sqrt(size[-1]) * axes[:, -1] * forward.sd
    found = linearise(forward, np.vstack([here, here + step, here - step]))
    tangent = whiten @ found.jacobian[0] @ step
    moved = (found.signal_V[1:] - found.signal_V[0]) @ whiten.T
    left = moved - np.array([[1.0], [-1.0]]) * tangent
    return float(np.linalg.norm(left, axis=1).max() / normal(COVERAGE))
