"""How the parameters of a fit answer, to first order, to its data: slopes, what the residuals are worth, gains."""

from collections.abc import Sequence

import numpy as np

from matcal.fitting.hyperfoam.curves import weighted_design, weighted_model, weighted_stress
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, allowed_exponents
from matcal.statistics.residual_correlation import Errors, correlated_errors
from touchcal.arrays import Array

# standard deviations of a prior so wide that it only holds directions that no curve sees: exponents, moduli over mu_0
PRIOR_ALPHA, PRIOR_MODULI = 10.0, 100.0


def free_slopes(fit: Fit) -> Array:
    """d(weighted stress) along the free directions of (mu, alpha), (n, K)."""
    law, nu, step = fit.law, float(fit.law.nu[0]), 1e-5
    high, low = (weighted_design(fit.curves, law.alpha + s, nu) for s in (step, -step))
    return np.hstack([weighted_design(fit.curves, law.alpha, nu),
                      law.mu_Pa * (high - low) / (2 * step)]) @ free_directions(fit)


def free_directions(fit: Fit) -> Array:
    """(2 N, K) directions in (mu, alpha) that the search was free to take: merged exponents move together."""
    alpha, n = fit.law.alpha, fit.law.alpha.size
    allowed = allowed_exponents(fit.curves)
    loose = np.r_[alpha[0] > allowed.low + 1e-3, np.diff(alpha) > allowed.gap + 1e-3]
    if alpha[-1] > allowed.high - 1e-3 and loose.any():
        loose[np.flatnonzero(loose)[-1]] = False
    steps = np.tril(np.ones((n, n)))[:, loose]
    return np.block([[np.eye(n), np.zeros((n, steps.shape[1]))], [np.zeros((n, n)), steps]])


def errors_of(fit: Fit, effect: Array) -> tuple[Errors, ...]:
    """Errors of each curve's weighted stress, misfit among them, when (mu, alpha) and nuisances with `effect` (n, J)
    and a standard normal prior were fitted."""
    ends = np.cumsum([c.experiment.value.size for c in fit.curves])[:-1]
    slopes = np.hstack([free_slopes(fit), effect])
    free = slopes.shape[1] - effect.shape[1]
    prior = np.eye(slopes.shape[1])
    prior[:free, :free] = prior_precision(fit)
    noise = [float(np.sqrt(np.mean(((c.experiment.noise or 0.0) / c.scale_Pa) ** 2))) for c in fit.curves]
    return correlated_errors(np.split(weighted_residual(fit), ends), np.split(slopes, ends), prior, noise)


def propagated(errors: Sequence[Errors], gain: Array) -> Array:
    """(K, K) covariance of gain @ errors for gain (K, n) over the points of all curves."""
    ends = np.cumsum([e.count for e in errors])[:-1]
    return np.sum([e.of(g) for e, g in zip(errors, np.split(gain, ends, axis=1), strict=True)], axis=0)


def effective_variance(errors: Sequence[Errors]) -> float:
    """Mean over all points of the variance that independent errors would need for the same effect on the fit."""
    needed = [e.covariance[0, 0] * e.count**2 / e.effective_sample_size for e in errors]
    return float(np.sum(needed) / sum(e.count for e in errors))


def prior_precision(fit: Fit) -> Array:
    """Precision of the wide prior along the free directions."""
    law = fit.law
    sd = np.r_[np.full(law.mu_Pa.size, PRIOR_MODULI * law.mu_0_Pa), np.full(law.alpha.size, PRIOR_ALPHA)]
    free = free_directions(fit)
    return free.T @ (free / sd[:, None] ** 2)


def weighted_residual(fit: Fit) -> Array:
    """(n,) law minus record over the scales of the curves."""
    return weighted_model(fit.curves, fit.law) - weighted_stress(fit.curves)


def joint_gain(slopes: Array, effect: Array, variance: float, hold: Array) -> Array:
    """(K + J, n + J) least-squares gain of free parameters and nuisances on data and prior rows of one variance."""
    columns, numbers = slopes.shape[1], effect.shape[1]
    prior = np.hstack([np.zeros((numbers, columns)), np.sqrt(variance) * np.eye(numbers)])
    rows = np.vstack([np.hstack([slopes, effect]), prior])
    normal = rows.T @ rows
    normal[:columns, :columns] += variance * hold
    scale = np.sqrt(np.diag(normal))
    return np.linalg.solve(normal / np.outer(scale, scale), rows.T / scale[:, None]) / scale[:, None]
