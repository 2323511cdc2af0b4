"""Covariance of readings from few frames: a sum of foreseen patterns, and what the frames show over these.

The covariance is sum_j theta_j B_j, theta_j >= 0, of foreseen B_j, by least squares in units of T^(1/2), T the sum
found before (one Fisher scoring of the normal likelihood: Anderson, Ann. Stat. 1 (1973) 135). Each reading has a
variance of its own where the frames' variances scatter by more than chance. In units of that sum further directions are
those whose sample variance exceeds what white noise gives (Marchenko, Pastur, Math. USSR Sb. 1 (1967) 457), less what
noise adds to it (Baik, Silverstein, J. Multivariate Anal. 97 (2006) 1382).
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls

from touchcal.arrays import Array

SCORINGS = 3
SMALL = 1e-6  # part of the mean variance that each reading keeps whatever is found
CUT = 4.0  # standard deviations at which readings are cut that tell further directions, so that one spike makes none
CLEAR = 1.1  # sample variance over the largest of white noise from which a direction is one


def covariance(frames: Array, degrees: float, foreseen: Sequence[Array]) -> Array:
    """(p, p) covariance of frames (n, p) of mean zero and so many degrees of freedom; foreseen (p, p) may hold the
    identity."""
    sample = frames.T @ frames / degrees
    found = _with_own_variances(_summed(sample, foreseen), frames, degrees)
    root, inverse = _roots(found)
    return root @ _with_directions(frames @ inverse, degrees) @ root


def _summed(sample: Array, foreseen: Sequence[Array]) -> Array:
    held = SMALL * float(np.mean(np.diag(sample))) * np.eye(len(sample))
    found = float(np.diag(sample).mean()) * np.eye(len(sample))
    for _ in range(SCORINGS):
        inverse = _roots(found)[1]
        columns = np.stack([(inverse @ one @ inverse).ravel() for one in foreseen])
        size = np.linalg.norm(columns, axis=1)
        columns /= size[:, None]
        products, along = columns @ columns.T, columns @ (inverse @ sample @ inverse).ravel()
        lower = np.linalg.cholesky(products + 1e-10 * np.eye(len(size)))
        part = nnls(lower.T, np.linalg.solve(lower, along))[0] / size
        found = np.asarray(np.tensordot(part, np.stack(foreseen), 1) + held, np.float64)
    return found


def _with_own_variances(found: Array, frames: Array, degrees: float) -> Array:
    """With the variances of single readings as far as those of frames (n, p) scatter by more than chance, of their
    fourth moment, makes them."""
    variance = np.maximum(np.sum(frames**2, axis=0) / degrees, np.finfo(float).tiny)
    log = np.log(variance / np.diag(found))
    by_chance = (max(float(np.mean(frames**4 / variance**2)), 3.0) - 1) / degrees
    more = max(float(np.mean(log**2)) - 1.5 * by_chance, 0.0)
    factor = np.exp(0.5 * log * more / (more + by_chance))
    return np.asarray(found * np.outer(factor, factor), np.float64)


def _with_directions(white: Array, degrees: float) -> Array:
    """(p, p) covariance of frames (n, p) that are white but for some directions."""
    p = white.shape[1]
    cut = np.clip(white, -CUT, CUT)
    part, axes = np.linalg.eigh(cut.T @ cut / degrees)
    ratio, rest = p / degrees, 1.0
    for _ in range(10):
        kept = np.flatnonzero(part > CLEAR * rest * (1 + np.sqrt(ratio)) ** 2)[-min(p, len(white)) // 2:]
        half = part[kept] + rest - rest * ratio
        size = (half + np.sqrt(np.maximum(half**2 - 4 * part[kept] * rest, 0.0))) / 2
        before, rest = rest, float((part.sum() - size.sum()) / (p - len(kept)))
        if abs(rest - before) < 1e-3 * before:
            break
    more = axes[:, kept] * np.maximum(size - rest, 0.0) @ axes[:, kept].T
    return (np.eye(p) * rest + more) * (np.mean(white**2) / np.mean(cut**2))


def _roots(matrix: Array) -> tuple[Array, Array]:
    """Symmetric root and inverse root of a positive matrix."""
    part, axes = np.linalg.eigh(matrix)
    part = np.sqrt(np.maximum(part, np.finfo(float).eps * part[-1]))
    return (axes * part) @ axes.T, (axes / part) @ axes.T
