"""Touches from readings: Levenberg-Marquardt on the learned forward map, many frames at once, with covariance.

Unknowns are (x, y, log d, log F) and one standard normal doubt for each multipole strength, so the map's own error is
marginalised. The training touches give a Gaussian prior; what stays undetermined falls back on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surrogate import multipole
from surrogate.forward_map import ForwardMap, linearise, log_dipole, to_touch

Array = NDArray[np.float64]

# Candidate places, diameters and forces of the global start; the best PLACES places go on, each with every diameter.
GRID_PLACES, GRID_FORCES, PLACES = 500, 12, 2
DIAMETERS = (0.15, 0.85)
# Steps of every start, and of the best start of each frame after that.
SHORT, LONG = 12, 100
# Frames solved together, to bound the memory.
BATCH = 256
# Least d log p_1 / d log F that the force is corrected by.
MIN_SLOPE = 0.05
# How far beyond the training touches a solution may go: mm in radius, and in log d and log F.
MARGIN_MM, MARGIN_LOG = 10.0, 0.3
# Part of the span of the training touches by which one still counts as among them.
SLACK = 0.02


@dataclass(frozen=True)
class Inversion:
    """Most probable touches."""

    # (n, 4) x, y, d in mm, F in N
    touch: Array
    # (n, 4, 4) covariance of (x, y, log d, log F), widened by the misfit where that exceeds 1
    covariance: Array
    # (n,) squared residual over what noise and the map's error explain, a degree of freedom
    misfit: Array
    # (n,) whether the solution's radius, d and F lie among those of the training touches
    inside: NDArray[np.bool_]


@dataclass(frozen=True)
class _Problem:
    signal: Array
    # (n,) standard deviation of each reading, V
    sd: Array


def invert(forward: ForwardMap, signal_V: Array, noise_V: float = 0.0) -> Inversion:
    """Invert signals (n, readings) in V under white noise of standard deviation noise_V on each reading."""
    parts = [_invert(forward, signal_V[i:i + BATCH], noise_V) for i in range(0, len(signal_V), BATCH)]
    return Inversion(*(np.concatenate([getattr(part, name) for part in parts])
                       for name in ("touch", "covariance", "misfit", "inside")))


def _invert(forward: ForwardMap, signal: Array, noise_V: float) -> Inversion:
    sd = np.sqrt(noise_V**2 + forward.floor**2 * np.sum(signal**2, axis=1))
    starts = _starts(forward, signal)
    frames = np.repeat(np.arange(len(signal)), len(starts) // len(signal))
    state, cost = _minimise(forward, _Problem(signal[frames], sd[frames]), starts, SHORT)
    best = np.argmin(cost.reshape(len(signal), -1), axis=1) + np.arange(len(signal)) * (len(starts) // len(signal))
    problem = _Problem(signal, sd)
    return _finish(forward, problem, _minimise(forward, problem, state[best], LONG)[0])


def _finish(forward: ForwardMap, problem: _Problem, state: Array) -> Inversion:
    residual, jacobian = _residuals(forward, problem, state)
    readings = problem.signal.shape[1]
    misfit = np.sum(residual[:, :readings] ** 2, axis=1) / (readings - state.shape[1])
    scaled = np.linalg.inv(np.einsum("nkp,nkq->npq", jacobian, jacobian))[:, :4, :4]
    covariance = scaled * np.outer(forward.sd, forward.sd) * np.maximum(misfit, 1.0)[:, None, None]
    touch = to_touch(_unknown(forward, state))
    extent = np.column_stack([np.hypot(touch[:, 0], touch[:, 1]), touch[:, 2:]])
    lowest, highest = np.r_[0.0, forward.bounds[0, 1:]], forward.bounds[1]
    slack = SLACK * (highest - lowest)
    inside = np.all((extent >= lowest - slack) & (extent <= highest + slack), axis=1)
    return Inversion(touch, covariance, misfit, inside)


def _starts(forward: ForwardMap, signal: Array) -> Array:
    """(n PLACES len(DIAMETERS), 7) states: the places whose dipole patterns match best, forces by the signal's size."""
    place = _grid(forward)
    z = (place[:, 0] + 1j * place[:, 1]) / forward.ring.radius_mm
    pattern = multipole.basis(*multipole.patterns(forward.ring, forward.field, z, 1))[..., 0] * forward.sign
    size = np.linalg.norm(pattern, axis=1)
    match = signal @ (pattern / size[:, None]).T
    chosen = np.argsort(-match, axis=1)[:, :PLACES]
    strength = np.take_along_axis(match, chosen, axis=1) / size[chosen]
    log_d = np.log(forward.bounds[0, 1]) + np.array(DIAMETERS) * np.log(forward.bounds[1, 1] / forward.bounds[0, 1])
    log_f = np.linspace(np.log(forward.bounds[0, 2]), np.log(forward.bounds[1, 2]), GRID_FORCES)
    states = np.empty((len(signal), PLACES, len(log_d), 4))
    states[..., :2] = place[chosen][:, :, None]
    states[..., 2] = log_d
    table = _dipole_table(forward, place, log_d, log_f)[chosen]
    wanted = np.log(np.maximum(strength, np.finfo(float).tiny))
    states[..., 3] = log_f[np.argmin(np.abs(table - wanted[..., None, None]), axis=-1)]
    scaled = (states.reshape(-1, 4) - forward.mean) / forward.sd
    return np.column_stack([scaled, np.zeros((len(scaled), multipole.ORDERS))])


def _grid(forward: ForwardMap) -> Array:
    """(GRID_PLACES, 2) places spread evenly over the disc of the training touches (a sunflower spiral), mm."""
    i = np.arange(GRID_PLACES) + 0.5
    angle = np.pi * (1 + np.sqrt(5)) * i
    return (forward.bounds[1, 0] * np.sqrt(i / GRID_PLACES) * np.array([np.cos(angle), np.sin(angle)])).T


def _dipole_table(forward: ForwardMap, place: Array, log_d: Array, log_f: Array) -> Array:
    """(places, diameters, forces) log dipole strength."""
    shape = (len(place), len(log_d), len(log_f))
    unknown = np.empty((*shape, 4))
    unknown[..., :2] = place[:, None, None]
    unknown[..., 2], unknown[..., 3] = log_d[:, None], log_f
    return log_dipole(forward, unknown.reshape(-1, 4))[0].reshape(shape)


def _minimise(forward: ForwardMap, problem: _Problem, state: Array, iterations: int) -> tuple[Array, Array]:
    """Levenberg-Marquardt on every row at once; returns the states and half their squared residuals."""
    damping = np.full(len(state), 1e-2)
    residual, jacobian = _residuals(forward, problem, state)
    cost = 0.5 * np.sum(residual**2, axis=1)
    active = np.arange(len(state))
    for _ in range(iterations):
        normal = np.einsum("nkp,nkq->npq", jacobian[active], jacobian[active])
        gradient = np.einsum("nkp,nk->np", jacobian[active], residual[active])
        diagonal = np.einsum("npp->np", normal)
        damped = normal + (damping[active, None] * diagonal)[:, None, :] * np.eye(normal.shape[1])
        trial = _moved(forward, state[active], -np.linalg.solve(damped, gradient[..., None])[..., 0])
        part = _Problem(problem.signal[active], problem.sd[active])
        new_residual, new_jacobian = _residuals(forward, part, trial)
        new_cost = 0.5 * np.sum(new_residual**2, axis=1)
        better = new_cost < cost[active]
        gain = cost[active] - new_cost
        damping[active] *= np.where(better, 0.1, 10.0)
        accepted = active[better]
        state[accepted], cost[accepted] = trial[better], new_cost[better]
        residual[accepted], jacobian[accepted] = new_residual[better], new_jacobian[better]
        active = active[~((better & (gain < 1e-6 * (1 + new_cost))) | (damping[active] > 1e8))]
        if not len(active):
            break
    return state, cost


def _residuals(forward: ForwardMap, problem: _Problem, state: Array) -> tuple[Array, Array]:
    """Residuals (n, readings + 7) and Jacobian (n, readings + 7, 7): readings over their sd, then prior and doubts."""
    here = linearise(forward, _unknown(forward, state))
    scale = problem.sd[:, None]
    doubt = state[:, 4:]
    misfit = (here.signal_V + np.einsum("nkp,np->nk", here.doubt, doubt) - problem.signal) / scale
    jacobian = np.concatenate([here.jacobian * forward.sd, here.doubt], axis=2) / scale[..., None]
    identity = np.broadcast_to(np.eye(state.shape[1]), (len(state), state.shape[1], state.shape[1]))
    return np.column_stack([misfit, state]), np.concatenate([jacobian, identity], axis=1)


def _moved(forward: ForwardMap, state: Array, step: Array) -> Array:
    """States after a step, the force corrected so that the dipole strength changes as the step says to first order.

    Punches of different d and F but one dipole strength look nearly alike; the correction bends the step along them.
    """
    before, slope = log_dipole(forward, _unknown(forward, state))
    wanted = before + np.einsum("np,np->n", slope, step[:, :4] * forward.sd)
    trial = _within(forward, state + step)
    for _ in range(2):
        now, slope = log_dipole(forward, _unknown(forward, trial))
        trial[:, 3] += np.clip((wanted - now) / np.maximum(slope[:, 3], MIN_SLOPE), -1, 1) / forward.sd[3]
        trial = _within(forward, trial)
    return trial


def _unknown(forward: ForwardMap, state: Array) -> Array:
    return forward.mean + forward.sd * state[:, :4]


def _within(forward: ForwardMap, state: Array) -> Array:
    """States held to the training touches and a margin about them."""
    unknown = _unknown(forward, state)
    radius = np.hypot(unknown[:, 0], unknown[:, 1])
    limit = min(forward.bounds[1, 0] + MARGIN_MM, 0.97 * forward.ring.radius_mm)
    unknown[:, :2] *= np.minimum(1.0, limit / np.maximum(radius, 1e-12))[:, None]
    lo, hi = np.log(forward.bounds[:, 1:]) + np.array([[-MARGIN_LOG], [MARGIN_LOG]])
    unknown[:, 2:] = np.clip(unknown[:, 2:], lo, hi)
    return np.column_stack([(unknown - forward.mean) / forward.sd, state[:, 4:]])
