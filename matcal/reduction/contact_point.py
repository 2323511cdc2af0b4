"""Where a specimen begins to carry load, and what the load cell reads before."""

from dataclasses import dataclass

import numpy as np

from matcal.statistics.block_means import block_means, sample_noise
from touchcal.arrays import Array

_TOE = 0.005  # half width of the toe that is left out, of the length
# strains over which the load curve is read, the first that fixes the contact well enough, and how well that is
_REACHES, _WELL = (0.10, 0.20, 0.40), 0.0025
_FEWEST = 8  # samples that a curve needs
_BLOCKS, _CONTACTS, _BENDS = 40, 41, 7  # block means that the curve is read from, contacts tried at once, bends tried
# prior of the bend (see `find_contact`) over the first reach, log-uniform between these, and as the square of a longer
# reach; below 1 intervals proved too narrow
_LEAST_BEND, _MOST_BEND = 1.0, 1e3
# noise of a block mean at least, of the load at the end of the reach, so that no peak is narrower than the first grid
_LEAST_NOISE = 5e-4
# what no curve shows, of the length: relaxation faster than the toe, and its tail (measured on noise-free records)
_UNSEEN = 3e-4


@dataclass(frozen=True)
class Contact:
    """The start of the specimen's own deformation."""

    travel_m: float  # travel at which an ideal, flat specimen would have been touched, m
    sd_m: float  # its standard deviation: the noise of the load and the unknown shape of the curve, m
    zero_N: float  # load reading without specimen, N
    zero_sd_N: float  # standard deviation of that reading, N: noise of the load over the root of the samples behind it
    reach: float = 0.0  # strain over which the load curve was read


@dataclass(frozen=True)
class _Means:
    """Block means of one record: first that of all samples before contact, then those of the curve."""

    position: Array  # (m,) travel past the toe, over the reach
    load: Array  # (1 + m,) load over its size at the end of the reach
    variance: Array  # (1 + m,) variance of `load`


def find_contact(travel: Array, load: Array, rest: int, length_m: float, latest_m: float) -> Contact:
    """Posterior mean and standard deviation of the travel x_0 at which load = zero + s(x - x_0) begins, x > x_0.

    `travel` (n,), m, of the specimen's end and `load` (n,), N, through the loading, of which the first `rest` samples
    stand still. The curve is s(u) = a u + b u^2 + q w(u), u = (x - x_0)/reach, with w the twice integrated Wiener
    process (E w''(1)^2 = 1): a smooth curve of unknown shape, whose third derivative is as large as q times the load at
    the end of the reach. zero, a and b have flat priors, q a log-uniform one from 1 to 1000 (times the square of the
    reach over 10 %), x_0 a flat one between 0 and `latest_m` and 1 % of strain more; all but x_0 are integrated out. A
    specimen that is not quite flat lands gradually, so samples within 0.5 % of strain of the contact are left out (toe
    compensation); which they are follows from the contact of the round before. The reach is 10 % of strain, or 20 or
    40 % where the noise asks for it. ValueError where fewer than 8 samples show the curve.
    Source: G. Wahba, J. R. Stat. Soc. B 40 (1978) 364, for the process behind smoothing splines.
    """
    travel = np.concatenate([np.full(rest, -np.inf), travel[rest:]])
    noise = max(sample_noise(load), 1e-9 * float(np.ptp(load)))
    limit = latest_m + 0.01 * length_m
    found: list[Contact] = []
    for reach in _REACHES:
        if (contact := _within(travel, load, noise, length_m, limit, reach)) is None:
            continue
        found.append(contact)
        if found[-1].sd_m < _WELL * length_m or travel[-1] < found[-1].travel_m + reach * length_m:
            break
    if not found:
        raise ValueError(f"fewer than {_FEWEST} samples show how the load rises")
    return min(found, key=lambda contact: contact.sd_m)


def _within(travel: Array, load: Array, noise: float, length_m: float, limit: float, reach: float) -> Contact | None:
    """The contact from the curve up to `reach`, the samples of the toe chosen again until they stay."""
    at, sd, zero = limit / 2, limit, float(load[0])
    for _ in range(6):
        before = travel < max(at - _TOE * length_m, 0.0)
        before[0] = True
        curve = (travel > at + _TOE * length_m) & (travel < at + reach * length_m)
        if np.count_nonzero(curve) < _FEWEST:
            return None
        zero = float(load[before].mean())
        last, means = at, _means(travel[curve], load[curve], load[before], noise)
        at, sd = _posterior(means, length_m, limit, reach)
        if abs(at - last) < 1e-4 * length_m:
            break
    return Contact(at, float(np.hypot(sd, _UNSEEN * length_m)), zero,
                   noise / np.sqrt(np.count_nonzero(before)), reach)


def _means(travel: Array, load: Array, before: Array, noise: float) -> _Means:
    size = max(1, load.size // _BLOCKS)
    edges = np.arange(0, load.size + 1, size)
    x, y = block_means(travel, edges), block_means(load, edges)
    zero = float(before.mean())
    top = max(float(np.abs(y[-5:] - zero).mean()), noise)
    of_means = max(noise / np.sqrt(size), _LEAST_NOISE * top)
    if (seen := sample_noise(y)) > 1.5 * of_means:
        of_means = seen
    variance = np.concatenate([[of_means**2 * size / before.size], np.full(y.size, of_means**2)])
    return _Means(x, np.concatenate([[0.0], y - zero]) / top, variance / top**2)


def _posterior(means: _Means, length_m: float, limit: float, reach: float) -> tuple[float, float]:
    """Mean and standard deviation of the contact, m, on a grid that closes in on it."""
    lo, hi = 0.0, limit
    mean, sd = 0.0, limit
    for _ in range(6):
        grid = np.linspace(lo, hi, _CONTACTS)
        weight = _weights(means, grid, length_m, reach)
        mean = float(weight @ grid)
        sd = float(np.sqrt(weight @ (grid - mean) ** 2))
        step = float(grid[1] - grid[0])
        if sd > 3 * step or step < 1e-6 * length_m:
            break
        lo, hi = max(0.0, mean - 5 * max(sd, step)), min(limit, mean + 5 * max(sd, step))
    return mean, max(sd, step)


def _weights(means: _Means, grid: Array, length_m: float, reach: float) -> Array:
    """(k,) posterior weights of the contacts `grid` (k,): bend, zero, slope and curvature integrated out."""
    u = (means.position - grid[:, None]) / (reach * length_m)
    k, m = u.shape
    rows = np.zeros((k, m + 1, 4))
    rows[..., 0], rows[..., 3] = 1.0, means.load
    rows[:, 1:, 1], rows[:, 1:, 2] = u, u**2
    covariance = np.zeros((k, m + 1, m + 1))
    covariance[:, 1:, 1:] = _bends_together(np.maximum(u, 0.0))
    bends = np.geomspace(_LEAST_BEND, _MOST_BEND, _BENDS) * (reach / _REACHES[0]) ** 2
    evidence = np.array([_log_evidence(q**2 * covariance + np.diag(means.variance), rows) for q in bends])
    weight = np.exp(evidence - evidence.max()).sum(axis=0)
    return weight / weight.sum()


def _bends_together(u: Array) -> Array:
    """(k, m, m) covariance of the twice integrated Wiener process, int_0^min (u - s)^2 (v - s)^2/4 ds."""
    low = np.minimum(u[:, :, None], u[:, None, :])
    separation = np.abs(u[:, :, None] - u[:, None, :])
    return low**3 * (low**2 / 5 + separation * low / 2 + separation**2 / 3) / 4


def _log_evidence(covariance: Array, rows: Array) -> Array:
    """(k,) logarithm of the likelihood of the last column of `rows` (k, n, p + 1), the others' factors integrated."""
    root = np.linalg.cholesky(covariance)
    white = np.linalg.solve(root, rows)
    # the triangle's last diagonal entry is the norm of the residual, the others those of the factors integrated out
    diagonal = np.abs(np.diagonal(np.linalg.qr(white, mode="r"), axis1=1, axis2=2))
    return (-diagonal[:, -1] ** 2 / 2 - np.log(diagonal[:, :-1]).sum(axis=1)
            - np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1))
