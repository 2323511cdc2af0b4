"""How the parameters of a fit answer, to first order, to its data: slopes, what the residuals are worth, gains."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from matcal.fitting.hyperfoam.curves import weighted_design, weighted_model, weighted_stress
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, allowed_exponents
from matcal.fitting.hyperfoam.poisson import PRIOR_NU, lateral_residual
from matcal.laws.law import units, vector, with_vector
from matcal.statistics.residual_correlation import Errors, correlated_errors
from touchcal.arrays import Array

# standard deviations of a prior so wide that it only holds directions that no curve sees: exponents, moduli over mu_0
PRIOR_ALPHA, PRIOR_MODULI = 10.0, 100.0


def free_slopes(fit: Fit) -> Array:
    """d(weighted stress) along the free directions of (mu, alpha), (n, K)."""
    if fit.moves is not None or np.ptp(fit.law.nu):
        return _differences(fit, _along(fit))[:weighted_residual(fit).size]
    law, nu, step = fit.law, float(fit.law.nu[0]), 1e-5
    high, low = (weighted_design(fit.curves, law.alpha + s, nu) for s in (step, -step))
    return np.hstack([weighted_design(fit.curves, law.alpha, nu),
                      law.mu_Pa * (high - low) / (2 * step)]) @ free_directions(fit)


def nu_slopes(fit: Fit) -> Array:
    """d(weighted stress, then lateral strain) with what was fitted of nu, (n + l, 0, 1 or N)."""
    if fit.moves is not None:
        return np.zeros((rows_of(fit), 0))
    n = fit.law.alpha.size
    moves = {None: np.zeros((0, n)), "fit": np.ones((1, n)), "fit-each": np.eye(n)}[fit.nu_fitted]
    return _differences(fit, np.hstack([np.zeros((len(moves), 2 * n)), moves]))


def all_slopes(fit: Fit) -> Array:
    """d(weighted stress, then lateral strain) along the free directions of (mu, alpha), (n + l, K); the lateral strains
    of a law with one nu depend on that alone."""
    if fit.moves is not None or (fit.nu_fitted and np.ptp(fit.law.nu)):
        return _differences(fit, _along(fit))
    return padded(fit, free_slopes(fit))


def fitted_slopes(fit: Fit) -> Array:
    """d(weighted stress, then lateral strain) with all that was fitted, (n + l, K'): the free directions, then nu."""
    return np.hstack([all_slopes(fit), nu_slopes(fit)])


def padded(fit: Fit, columns: Array) -> Array:
    """(n + l, J) columns (n, J) over the stresses, 0 over the lateral strains that nu was fitted to."""
    return np.vstack([columns, np.zeros((rows_of(fit) - columns.shape[0], columns.shape[1]))])


def rows_of(fit: Fit) -> int:
    """Number n + l of stresses, and of lateral strains that nu was fitted to."""
    return sum(r.size for r in misses(fit))


def misses(fit: Fit) -> list[Array]:
    """Law minus record of each curve's weighted stress, then of each lateral record that nu was fitted to."""
    ends = np.cumsum([c.experiment.value.size for c in fit.curves])[:-1]
    lateral = [c for c in fit.curves if fit.sees_lateral and c.experiment.lateral is not None]
    return [*np.split(weighted_residual(fit), ends), *(lateral_residual([c], fit.law) for c in lateral)]


def _along(fit: Fit) -> Array:
    """The free directions as moves (K, k) in all parameters."""
    free = free_directions(fit).T
    return np.hstack([free, np.zeros((len(free), vector(fit.law).size - free.shape[1]))])


def _differences(fit: Fit, moves: Array) -> Array:
    """Slopes (n + l, K) of `misses` along moves (K, k) in all parameters, by central differences."""
    law, step, sizes = fit.law, 1e-5, units(fit.law)

    def at(move: Array) -> Array:
        return np.concatenate(misses(replace(fit, law=with_vector(law, vector(law) + sizes * move))))

    unit = 1 / sizes
    steps = [step / max(float(np.abs(move * unit).max()), 1e-300) for move in moves]
    out = [(at(h * unit * move) - at(-h * unit * move)) / (2 * h) for h, move in zip(steps, moves, strict=True)]
    return np.column_stack(out) if out else np.zeros((rows_of(fit), 0))


def free_directions(fit: Fit) -> Array:
    """(2 N, K) directions in (mu, alpha) that the search was free to take: merged exponents move together; (K, k) ones
    in all parameters of a law without exponents."""
    if fit.moves is not None:
        return fit.moves
    alpha, n = fit.law.alpha, fit.law.alpha.size
    allowed = allowed_exponents(fit.curves, float(fit.law.nu.mean()))
    loose = np.r_[alpha[0] > allowed.low + 1e-3, np.diff(alpha) > allowed.gap + 1e-3]
    if alpha[-1] > allowed.high - 1e-3 and loose.any():
        loose[np.flatnonzero(loose)[-1]] = False
    steps = np.tril(np.ones((n, n)))[:, loose]
    return np.block([[np.eye(n), np.zeros((n, steps.shape[1]))], [np.zeros((n, n)), steps]])


def errors_of(fit: Fit, effect: Array) -> tuple[Errors, ...]:
    """Errors of each curve's weighted stress, misfit among them, then of each lateral record that nu was fitted to,
    when (mu, alpha), what was fitted of nu and nuisances with `effect` (n, J) and a standard normal prior were
    fitted."""
    slopes = np.hstack([fitted_slopes(fit), padded(fit, effect)])
    found = misses(fit)
    prior = np.eye(slopes.shape[1])
    free = slopes.shape[1] - effect.shape[1]
    prior[:free, :free] = prior_precision(fit)
    noise = [float(np.sqrt(np.mean(((c.experiment.noise or 0.0) / c.scale_Pa) ** 2))) for c in fit.curves]
    ends = np.cumsum([r.size for r in found])[:-1]
    return correlated_errors(found, np.split(slopes, ends), prior, noise + [0.0] * (len(found) - len(noise)))


def effective_variance(errors: Sequence[Errors]) -> float:
    """Mean over all points of the variance that independent errors would need for the same effect on the fit."""
    needed = [e.covariance[0, 0] * e.count**2 / e.effective_sample_size for e in errors]
    return float(np.sum(needed) / sum(e.count for e in errors))


def prior_precision(fit: Fit) -> Array:
    """Precision of the wide prior along the free directions, then of what was fitted of nu, as of a uniform one."""
    law = fit.law
    sizes, free = units(law), free_directions(fit)
    sd = np.where(sizes == 1.0, PRIOR_ALPHA, PRIOR_MODULI * sizes)[:len(free)]
    fitted = 0 if fit.nu_fitted is None else 1 if fit.nu_fitted == "fit" else law.nu.size
    return np.asarray(block_diag(free.T @ (free / sd[:, None] ** 2), np.eye(fitted) / PRIOR_NU**2), dtype=float)


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
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    unit, right = normal / np.outer(scale, scale), rows.T / scale[:, None]
    try:
        return np.linalg.solve(unit, right) / scale[:, None]
    except np.linalg.LinAlgError:  # a term of no size, whose exponent nothing sees
        return np.linalg.lstsq(unit, right, rcond=1e-13)[0] / scale[:, None]
