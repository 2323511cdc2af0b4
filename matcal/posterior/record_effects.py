"""What moves the records of a fit besides its law: rate, replicates' factors, and the priors of both, for any law."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from matcal.fitting.hyperfoam.curves import Curve
from matcal.fitting.hyperfoam.specimen_factors import PRIOR_OMEGA
from matcal.fitting.relaxation.relaxation_fit import PronyFit
from matcal.laws.deformation_modes import push_forward, second_piola
from matcal.laws.law import Law
from matcal.laws.prony import Prony, decaying
from touchcal.arrays import Array

_PER_DECADE = 12  # relaxation times, in each decade, at which the rate effect is tabulated
_LN_OMEGA = (-12.0, 2.0)  # bounds of the logarithm of the scatter between specimens


def contrasts(count: int) -> Array:
    """(S, S - 1) orthonormal differences of S numbers. What S factors have in common scales the law and nothing else:
    no test sees it, it is independent of the differences, and it is drawn from its prior."""
    if not count:
        return np.zeros((0, 0))
    return np.linalg.qr(np.column_stack([np.ones(count), np.eye(count)[:, 1:]]))[0][:, 1:]


def rate_effect(curves: Sequence[Curve], law: Law, prony: PronyFit | None) -> tuple[Array, Array]:
    """Times (T,) and the fitted law's weighted stress (n, T) that relaxes with each, per unit g/g_inf."""
    n = sum(c.experiment.value.size for c in curves)
    if prony is None:
        return np.ones(1), np.zeros((n, 0))
    low, high = np.log10(prony.bounds_s)
    times = np.logspace(low, high, int(np.ceil((high - low) * _PER_DECADE)) + 2)
    parts = []
    for curve in curves:
        e, kind = curve.experiment.strain, curve.experiment.kind
        if curve.kernel is None or curve.experiment.time_s is None:
            parts.append(np.zeros((e.size, times.size)))
            continue
        slow = decaying(Prony(np.zeros(times.size), times), curve.experiment.time_s, second_piola(law, kind, e))
        parts.append(np.sum(push_forward(kind, e) * slow, axis=-1).T / curve.scale_Pa[:, None])
    return times, np.concatenate(parts)


def series_effect(rate: CubicSpline, ln_tau: Array, g: Array) -> Array:
    """(W, r) sum of g_i/g_inf times the effect of tau_i."""
    share = g / (1 - g.sum(axis=1, keepdims=True))
    return np.einsum("wm,wmr->wr", share, rate(ln_tau))


def rate_spline(times: Array, effect: Array, prony: PronyFit | None) -> tuple[CubicSpline | None, Array]:
    """ln tau -> (r,) effect (r, T) per unit g/g_inf, None where nothing relaxes; and (r,) that of the fitted series."""
    if prony is None or not np.any(effect):
        return None, np.zeros(effect.shape[0])
    spline = CubicSpline(np.log(times), effect.T)
    return spline, series_effect(spline, np.log(prony.prony.tau_s)[None], prony.prony.g[None])[0]


def omega_inside(ln_omega: Array) -> NDArray[np.bool_]:
    """(W,) whether the scatter between specimens lies within its bounds."""
    return (ln_omega > _LN_OMEGA[0]) & (ln_omega < _LN_OMEGA[1])


def log_omega(ln_omega: Array) -> Array:
    """(W,) log prior of ln omega, omega half-normal."""
    return ln_omega - 0.5 * np.exp(2 * ln_omega) / PRIOR_OMEGA**2


def common_factor(omega: Array, specimens: int, rng: np.random.Generator) -> Array:
    """(W,) draws of what the factors of the specimens have in common, of which no test says anything."""
    return np.exp(-omega / np.sqrt(specimens) * rng.standard_normal(omega.size))
