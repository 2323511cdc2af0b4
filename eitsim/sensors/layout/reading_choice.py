"""A few of many readings that tell a touch best, and the bounds that any readings allow.

The criterion is the mean over places of log det of the Fisher information, which no unit changes. Readings are added
one by one: with C the inverse of the information so far, a reading of derivatives j adds log(1 + j'Cj), and C loses
Cjj'C / (1 + j'Cj). Source: Joshi, Boyd, IEEE Trans. Signal Process. 57 (2009) 451, DOI 10.1109/TSP.2008.2007095.
"""

import numpy as np

from touchcal.arrays import Array, Index


def chosen(by: Array, count: int, prior_sd: Array) -> Index:
    """(count,) the readings in the order in which they are taken, of derivatives (places, readings, q) over the noise;
    prior_sd (q,): what is known before the first of them. ValueError for more than there are."""
    if not 1 <= count <= by.shape[1]:
        raise ValueError(f"{count} readings are to be kept of {by.shape[1]}; keep 1 to all.")
    covariance = np.tile(np.diag(prior_sd**2), (len(by), 1, 1))
    left, taken = np.ones(by.shape[1], bool), []
    for _ in range(count):
        gain = np.sum((by @ covariance) * by, axis=2)
        best = int(np.argmax(np.where(left, np.log1p(gain).mean(axis=0), -np.inf)))
        taken.append(best)
        left[best] = False
        along = (covariance @ by[:, best, :, None])[..., 0]
        covariance -= along[:, :, None] * along[:, None, :] / (1 + gain[:, best, None, None])
    return np.array(taken)


def bounds(by: Array) -> Array:
    """(places, q) least standard deviations of an unbiased estimate from readings of derivatives (places, readings, q)
    over their noise; infinite where the readings do not tell them."""
    information = by.transpose(0, 2, 1) @ by
    scale = np.sqrt(np.maximum(np.einsum("nqq->nq", information), np.finfo(float).tiny))
    part, axes = np.linalg.eigh(information / scale[:, :, None] / scale[:, None, :])
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(part > part.shape[1] * np.finfo(float).eps, 1 / part, np.inf)
        return np.sqrt(np.nansum(axes**2 * inverse[:, None], axis=2)) / scale  # 0 inf: what does not lie on an axis
