"""Posterior of the conductivity: exact in the coefficients but for their positivity, noise level inferred.

b ~ N(centre, v C + Z) cut off where the law is not above its floor, v the variance of the noise over its estimate,
with density v^(-1 - k/2) exp(-k/(2 v)) before that (k points to spare, flat prior of ln v), Z what an uncertain strain
zero adds. Many chains side by side: hit and run for b (a random direction, along which b is a normal number cut to the
part that stays positive) by turns with a Metropolis step for ln v.

Source: Smith, Oper. Res. 32 (1984) 1296, DOI 10.1287/opre.32.6.1296 (hit and run).
"""

import numpy as np
from scipy.special import ndtr, ndtri

from matcal.fitting.conductivity_fit import FLOOR, LOWEST_STRAIN, ConductivityFit, coefficients
from matcal.fitting.conductivity_laws import numbers_of
from matcal.laws.conduction_laws import conduction_law
from matcal.laws.conductivity import drawn_conductivity
from touchcal.arrays import Array

_CHAINS, _BURN, _STRIDE = 20, 300, 40  # chains, steps before draws are kept, steps between two kept draws


def skin_chains(fit: ConductivityFit, count: int, rng: np.random.Generator) -> Array:
    """(chains, steps, 1 + m) draws of c_0 (1, a), S/m, at least `count` in all."""
    kept = -(-count // _CHAINS)
    b = np.tile(coefficients(fit.law), (_CHAINS, 1))
    ln_v = np.zeros(_CHAINS)
    noise, zero = fit.covariance - fit.zero_covariance, fit.zero_covariance
    out = np.empty((_CHAINS, kept, b.shape[1]))
    for step in range(_BURN + kept * _STRIDE):
        root = np.asarray(np.linalg.cholesky(np.exp(ln_v)[:, None, None] * noise + zero), dtype=float)
        b = _hit_and_run(fit, b, root, rng)
        ln_v = _noise_step(fit, b, ln_v, noise, zero, rng)
        if step >= _BURN and (step - _BURN) % _STRIDE == _STRIDE - 1:
            out[:, (step - _BURN) // _STRIDE] = b
    return numbers_of(conduction_law(fit.law.kind), out)


def conductivity_draws(fit: ConductivityFit, count: int, rng: np.random.Generator) -> Array:
    """(count, 1 + m) draws of c_0 (1, a), S/m, positive from LOWEST_STRAIN to the end of the data."""
    chains = skin_chains(fit, count, rng)
    return chains.transpose(1, 0, 2).reshape(-1, chains.shape[-1])[:count]


def skin_checks(fit: ConductivityFit, chains: Array) -> dict[str, float]:
    """Worst R-hat, least effective sample size and longest autocorrelation time, in kept draws, of the conductivity at
    no strain, in deep compression and at the data's end."""
    import arviz
    import emcee

    values = drawn_conductivity(fit.law.kind, chains, [0.0, LOWEST_STRAIN, fit.law.strain_range[1]])
    data = arviz.convert_to_dataset({"c": values})
    longest = float(np.max(emcee.autocorr.integrated_time(np.moveaxis(values, 0, 1), tol=0, has_walkers=True)))
    return {"rhat": float(np.max(np.asarray(arviz.rhat(data)["c"]))),  # pyright: ignore[reportIndexIssue]
            "ess": float(np.min(np.asarray(arviz.ess(data)["c"]))),  # pyright: ignore[reportIndexIssue]
            "autocorrelation_steps": max(longest, 1.0), "steps_kept": float(chains.shape[1])}


def prior_words(fit: ConductivityFit) -> str:
    """The prior of the skin."""
    where = f" where it stays above {FLOOR:.0%} of its median from a strain of {LOWEST_STRAIN:g} on"
    return (f"coefficients of the conductivity flat{where if fit.positive[0].size else ''}, ln of its noise flat, "
            f"{fit.effective_sample_size:.0f} effective points to spare")


def _hit_and_run(fit: ConductivityFit, b: Array, root: Array, rng: np.random.Generator) -> Array:
    columns, floor = fit.positive
    unit = rng.normal(size=b.shape)
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    way = np.einsum("cij,cj->ci", root, unit)
    slope, room = way @ columns, b @ columns - floor
    with np.errstate(divide="ignore", invalid="ignore"):
        end = -room / slope
    low = np.max(np.where(slope > 0, end, -np.inf), axis=1, initial=-np.inf)
    high = np.min(np.where(slope < 0, end, np.inf), axis=1, initial=np.inf)
    mean = np.einsum("ci,ci->c", unit, np.linalg.solve(root, (fit.centre - b)[..., None])[..., 0])
    step = mean + _cut_normal(np.minimum(low, 0.0) - mean, np.maximum(high, 0.0) - mean, rng)
    return b + step[:, None] * way


def _noise_step(fit: ConductivityFit, b: Array, ln_v: Array, noise: Array, zero: Array,
                rng: np.random.Generator) -> Array:
    trial = ln_v + 2.4 * np.sqrt(2 / (fit.effective_sample_size + b.shape[1])) * rng.normal(size=ln_v.size)
    gain = _log_density(fit, b, trial, noise, zero) - _log_density(fit, b, ln_v, noise, zero)
    return np.where(np.log(rng.uniform(size=ln_v.size)) < gain, trial, ln_v)


def _log_density(fit: ConductivityFit, b: Array, ln_v: Array, noise: Array, zero: Array) -> Array:
    root = np.linalg.cholesky(np.exp(ln_v)[:, None, None] * noise + zero)
    off = np.linalg.solve(root, (b - fit.centre)[..., None])[..., 0]
    size = np.log(np.einsum("cii->ci", root)).sum(axis=1)
    return -0.5 * np.sum(off**2, axis=1) - size - 0.5 * fit.effective_sample_size * (ln_v + np.exp(-ln_v))


def _cut_normal(low: Array, high: Array, rng: np.random.Generator) -> Array:
    """Standard normal numbers between low and high (C,), by the distribution function on the side where it is small."""
    flip = low > 0
    a, b = np.where(flip, -high, low), np.where(flip, -low, high)
    drawn = np.clip(ndtri(rng.uniform(ndtr(a), np.maximum(ndtr(b), ndtr(a)))), a, b)
    return np.where(flip, -drawn, drawn)
