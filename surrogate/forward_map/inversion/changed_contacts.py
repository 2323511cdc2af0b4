"""Contacts that changed between the untouched and the touched frame: none of them or one, and what that leaves open.

A contact impedance may change by some per cent in minutes, which the scatter of untouched frames does not show, and a
touch that is fitted to the change is off. A change of one electrode adds a c to the readings, of a direction c that
its place tells and an unknown a ~ N(0, CHANGED^2), in standard deviations of the noise. With residuals r of a fit of
Jacobian J and normal matrix N, s^2 = c'c - c'J N^-1 J'c and t = c'r / s, the odds of a change over none are
exp(t^2 l / 2) / (1 + CHANGED^2 s^2)^(1/2), l = CHANGED^2 s^2 / (1 + CHANGED^2 s^2), and the fit is moved by
N^-1 J'c t l / s. The touch is the mean over all of them (Hoeting, Madigan, Raftery, Volinsky, Stat. Sci. 14 (1999)
382), each electrode as likely as any other, and none as likely as all of them together.
"""

from functools import lru_cache

import numpy as np

from surrogate.data.sensor_ring import MODES, Ring
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.inversion.reading_covariance import Uncertainty, whitened
from surrogate.statistics.levenberg_marquardt import inverse
from touchcal.arrays import Array

CHANGED = 4.0  # standard deviation of a change along its direction, in those of the noise
FAR = 2.0  # times that from which a residual is no contact's: the map does not explain the frame, which is flagged


def directions(ring: Ring) -> Array:
    """(readings, electrodes) directions in which the contact impedance of each electrode changes the readings, by what
    it shunts: the product of the fields along it by the driven and by the read pair. No columns on a skin with an
    outline."""
    if ring.sheet is not None:
        return np.zeros((len(ring.read), 0))
    mode, turns = np.arange(1, MODES + 1), ring.angle_rad[:, None] - ring.angle_rad
    along = np.sin(turns[..., None] * mode) @ ring.modes**2
    return ((along[:, ring.source] - along[:, ring.sink]) * (along[:, ring.read] - along[:, ring.ground])).T


def moved(forward: ForwardMap, sd: Uncertainty, residual: Array, jacobian: Array) -> tuple[Array, Array]:
    """Shifts (n, p) of fitted states and what is added to their covariances (n, p, p), of whitened residuals (n,
    readings + priors), model less signal, and their Jacobians (n, readings + priors, p)."""
    known, normal = _directions(forward), jacobian.transpose(0, 2, 1) @ jacobian
    if not known.shape[1]:
        return np.zeros(jacobian.shape[::2]), np.zeros_like(normal)
    residual, jacobian = residual[:, :len(known)], jacobian[:, :len(known)]
    seen = whitened(sd, np.broadcast_to(known, (len(residual), *known.shape)))
    seen = seen / np.linalg.norm(seen, axis=1, keepdims=True)
    across = jacobian.transpose(0, 2, 1) @ seen
    gain = inverse(normal) @ across
    left = 1 - np.einsum("npk,npk->nk", across, gain)  # s^2
    size = -np.einsum("nrk,nr->nk", seen, residual) / left
    widened = 1 + CHANGED**2 * left
    part = 1 - 1 / widened
    log_odds = 0.5 * size**2 * left * part - 0.5 * np.log(widened) - np.log(known.shape[1])
    most = np.maximum(log_odds.max(axis=1, keepdims=True), 0.0)
    odds = np.exp(log_odds - most)
    weight = odds / (odds.sum(axis=1, keepdims=True) + np.exp(-most))
    weight *= np.abs(size) < FAR * CHANGED
    size *= part
    shift = -np.einsum("nk,npk->np", weight * size, gain)
    second = np.einsum("nk,npk,nqk->npq", weight * (CHANGED**2 / widened + size**2), gain, gain)
    return shift, second - shift[:, :, None] * shift[:, None, :]


@lru_cache(maxsize=8)
def _directions(forward: ForwardMap) -> Array:
    return directions(forward.ring)
