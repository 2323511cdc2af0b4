"""A followed touch as an inversion gives it: the punch is one of those known, or any within the training range.

Given the diameter the rest of a normal state is its regression on it. So known punches, each of nearly the same prior
probability, are weighed by the likelihood of their diameters under the filter, against a punch of any diameter, and the
touch is the mean over all of these.
"""

import numpy as np

from surrogate.forward_map.forward_map import ForwardMap, extent
from surrogate.forward_map.inversion.invert import Inversion, Peak
from surrogate.forward_map.inversion.reading_covariance import truncated_normal_mean
from surrogate.forward_map.inversion.touch_filter import Followed
from surrogate.forward_map.load_coordinates import to_touch, touch_slope
from touchcal.arrays import Array

LOG_D = 2  # place of log d in a state
LEAST = 1e-12  # variance of log d, at least


def inversion(forward: ForwardMap, touch: Followed) -> Inversion:
    """The touch (x, y, d, F), one row, with covariances about it; its noise is what does not come from constants."""
    k, own = forward.materials, len(forward.ring.read) + forward.own
    material = touch.shared[:, own:own + k]
    noise = touch.covariance - touch.shared @ touch.shared.T
    weight, states, narrowed = _punches(forward, touch)
    touches, slopes = to_touch(states, forward.p0), touch_slope(states, forward.p0)
    mean = weight @ touches
    off = touches - mean
    between = np.einsum("k,kp,kq->pq", weight, off, off)

    def carried(covariance: Array) -> Array:
        return np.einsum("k,kpq,kqr,ksr->ps", weight, slopes, narrowed @ covariance @ narrowed.transpose(0, 2, 1),
                         slopes)

    widened = max(touch.misfit, 1.0)
    joint = np.eye(4 + k)
    joint[:4, :4] = carried(touch.covariance) * widened + between
    joint[:4, 4:] = np.einsum("k,kpq,kqm->pm", weight, slopes, narrowed @ material)
    joint[4:, :4] = joint[:4, 4:].T
    known = carried(touch.covariance - material @ material.T) * widened + between
    whole, reached = joint[None, :4, :4], extent(mean[None])
    inside = np.all((reached >= np.r_[0.0, forward.bounds[0, 1:]]) & (reached <= forward.bounds[1]), axis=1)
    sd = np.sqrt(np.diag(joint)[None, :4])
    return Inversion(mean[None], whole, np.zeros((1, k)), Peak(joint[None], known[None], carried(noise)[None]),
                     np.array([touch.misfit]), inside, np.zeros(1, bool), None, sd, sd)


def _punches(forward: ForwardMap, touch: Followed) -> tuple[Array, Array, Array]:
    """Probabilities (k,) of a punch of any diameter and of each known one, the states (k, 4) with it, and matrices
    (k, 4, 4) that take out of a covariance what its diameter told."""
    lowest, highest = np.log(forward.bounds[:, 1])
    covariance = touch.covariance + np.diag([0.0, 0.0, LEAST, 0.0])
    free = truncated_normal_mean(touch.mean[None], covariance[None], LOG_D, lowest, highest)[0]
    log_d = np.log(forward.known_mm)
    other = 1 / (forward.rows + 2) if len(log_d) else 1.0
    variance, along = covariance[LOG_D, LOG_D], covariance[:, LOG_D] / covariance[LOG_D, LOG_D]
    log_weight = np.r_[np.log(other / (highest - lowest)) if highest > lowest else 0.0,
                       np.full(len(log_d), np.log((1 - other) / max(len(log_d), 1)))]
    log_weight[1:] -= 0.5 * ((log_d - touch.mean[LOG_D]) ** 2 / variance + np.log(2 * np.pi * variance))
    weight = np.exp(log_weight - log_weight.max())
    states = np.vstack([free, touch.mean + (log_d - touch.mean[LOG_D])[:, None] * along])
    taken = np.eye(4) - np.outer(along, np.eye(4)[LOG_D])
    return weight / weight.sum(), states, np.concatenate([np.eye(4)[None], np.repeat(taken[None], len(log_d), axis=0)])
