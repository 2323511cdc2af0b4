"""Posterior of one touch with the simulator's likelihood: the learned map, corrected by a few scenes about that frame.

f(u) = map(u) + [sim - map](u0) + D (u - u0) + r(log d), u0 the touch that direct inversion finds, D the difference of
the derivatives there, and r what scenes at other diameters of the ridge still miss, linear between these. Scenes that
it was not made from tell its error.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from surrogate.forward_map.forward_map import ForwardMap, linearise
from surrogate.forward_map.inversion.invert import invert
from surrogate.forward_map.load_coordinates import to_unknown, touch_slope
from surrogate.single_frame.posterior import Posterior, sampled
from surrogate.single_frame.simulator_inversion import Direct, direct
from surrogate.single_frame.simulator_likelihood import Simulator, solved
from touchcal.arrays import Array

# Quantiles of the diameter, among draws, whose touches are solved to correct the map, and to tell what it still misses.
SOLVED, HELD_OUT = (0.03, 0.25, 0.75, 0.97), (0.12, 0.9)
# What the map misses at solved touches, in standard deviations of the readings, that is not worth drawing again for.
SMALL = 0.2
LOG_D = 2  # place of log d among the unknowns


@dataclass(frozen=True, eq=False)
class Correction:
    """What is added to the learned map's signals about one touch."""

    centre: Array  # (4,) the touch as (x, y, log d, g)
    offset: Array  # (readings,) V there
    slope: Array  # (readings, 4) V per unit of each
    log_d: Array  # (k,) log d, increasing
    more_V: Array  # (k, readings) V more there

    def at(self, unknown: Array) -> tuple[Array, Array]:
        """(n, readings) V, and (n, readings, 4) its derivatives, at touches (n, 4) as (x, y, log d, g)."""
        at = np.clip(unknown[:, LOG_D], self.log_d[0], self.log_d[-1])
        right = np.clip(np.searchsorted(self.log_d, at), 1, len(self.log_d) - 1)
        width = np.diff(self.log_d)[right - 1]
        share = ((at - self.log_d[right - 1]) / width)[:, None]
        more = (1 - share) * self.more_V[right - 1] + share * self.more_V[right]
        slope = np.repeat(self.slope[None], len(unknown), axis=0)
        between = (at == unknown[:, LOG_D])[:, None]
        slope[..., LOG_D] += np.where(between, self.more_V[right] - self.more_V[right - 1], 0.0) / width[:, None]
        return self.offset + (unknown - self.centre) @ self.slope.T + more, slope


@dataclass(frozen=True, eq=False)
class SimulatedPosterior:
    """A posterior by the simulator, and what it rests on."""

    posterior: Posterior
    # what the corrected map misses of scenes that it was not made from, at most, in standard deviations of the readings
    held_out_error: float
    simulations: int  # scenes solved


def simulated_posterior(simulator: Simulator, forward: ForwardMap, signal_V: Array, noise_V: float,
                        seed: int = 0) -> SimulatedPosterior:
    """The posterior of one signal (readings,), V, under white noise and what is left open of the material.

    NotConverged where a scene of it cannot be solved.
    """
    begun = time.process_time()
    free = replace(forward, known_mm=np.zeros(0))
    own = direct(simulator, forward, signal_V, noise_V, invert(free, signal_V[None], noise_V).touch[0])
    whiten = own.unknowns.whitening
    correction = _about(forward, own)
    found = sampled(forward, signal_V, whiten, own.touch, seed, correction=correction)
    touches = _spread(found, SOLVED)
    missed = _missed(simulator, forward, correction, touches)
    if np.linalg.norm(missed @ whiten.T, axis=1).max() > SMALL:
        correction = _with_missed(forward, correction, touches, missed)
        found = sampled(forward, signal_V, whiten, own.touch, seed, correction=correction)
    left = _missed(simulator, forward, correction, _spread(found, HELD_OUT)) @ whiten.T
    return SimulatedPosterior(replace(found, cpu_s=time.process_time() - begun),
                              float(np.linalg.norm(left, axis=1).max()),
                              own.simulations + len(SOLVED) + len(HELD_OUT))


def _about(forward: ForwardMap, own: Direct) -> Correction:
    """Of value and slope, at the touch that direct inversion found."""
    centre = to_unknown(own.touch[None], forward.p0)
    here = linearise(forward, centre)
    slope = own.slope @ touch_slope(centre, forward.p0)[0] - here.jacobian[0]
    log_d = centre[0, LOG_D] + np.array([0.0, 1.0])
    return Correction(centre[0], own.signal_V - here.signal_V[0], slope, log_d, np.zeros((2, len(own.signal_V))))


def _spread(found: Posterior, quantiles: tuple[float, ...]) -> Array:
    """Draws (k, 4) whose diameters are at these quantiles."""
    order = np.argsort(found.draws[:, 2])
    return found.draws[order[np.round(np.array(quantiles) * (len(order) - 1)).astype(int)]]


def _missed(simulator: Simulator, forward: ForwardMap, correction: Correction, touches: Array) -> Array:
    """(k, readings) V of the simulator's signals that the corrected map misses."""
    unknown = to_unknown(touches, forward.p0)
    foreseen = linearise(forward, unknown).signal_V + correction.at(unknown)[0]
    return np.array([solved(simulator, touch).signal_V for touch in touches]) - foreseen


def _with_missed(forward: ForwardMap, correction: Correction, touches: Array, missed: Array) -> Correction:
    """With what it misses at touches (k, 4), none at its centre."""
    log_d = np.append(to_unknown(touches, forward.p0)[:, LOG_D], correction.centre[LOG_D])
    kept, first = np.unique(log_d.round(9), return_index=True)
    if len(kept) < 2:
        return correction
    return replace(correction, log_d=kept, more_V=np.vstack([missed, np.zeros(missed.shape[1])])[first])
