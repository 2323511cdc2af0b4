"""A followed touch as an inversion gives it: the mean over its filters, and covariances about it."""

import numpy as np

from surrogate.forward_map.forward_map import ForwardMap, within_bounds
from surrogate.forward_map.inversion.invert import Inversion, Peak
from surrogate.forward_map.inversion.touch_filter import Followed, best
from surrogate.forward_map.load_coordinates import to_touch, touch_slope
from touchcal.arrays import Array


def inversion(forward: ForwardMap, touch: Followed) -> Inversion:
    """The touch (x, y, d, F), one row; its noise is what does not come from constants of the map or the sensor."""
    k, own = forward.materials, len(forward.ring.read) + forward.own
    material, weight = touch.shared[..., own:own + k], np.exp(touch.log_weight)
    touches, slopes = to_touch(touch.mean, forward.p0), touch_slope(touch.mean, forward.p0)
    mean = weight @ touches
    off = touches - mean
    between = np.einsum("k,kp,kq->pq", weight, off, off)

    def carried(covariance: Array) -> Array:
        return np.einsum("k,kpq,kqr,ksr->ps", weight, slopes, covariance, slopes)

    misfit = touch.misfit[best(touch)]
    widened = max(misfit, 1.0)
    joint = np.eye(4 + k)
    joint[:4, :4] = carried(touch.covariance) * widened + between
    joint[:4, 4:] = np.einsum("k,kpq,kqm->pm", weight, slopes, material)
    joint[4:, :4] = joint[:4, 4:].T
    known = carried(touch.covariance - material @ material.transpose(0, 2, 1)) * widened + between
    # which of the filters is right is open by noise
    noise = carried(touch.covariance - touch.shared @ touch.shared.transpose(0, 2, 1)) + between
    sd = np.sqrt(np.diag(joint)[None, :4])
    return Inversion(mean[None], joint[None, :4, :4], np.zeros((1, k)), Peak(joint[None], known[None], noise[None]),
                     np.array([misfit]), np.ones(1), np.zeros((1, 0)),
                     within_bounds(forward, mean[None]), np.zeros(1, bool), None, sd, sd,
                     np.zeros((2, 1, 4)), np.zeros(1, bool))
