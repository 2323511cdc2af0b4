"""Cubic conductivity c(e) fitted with its noise, kept positive wherever a touch may take it.

The tests stretch the skin while touches compress it, so the cubic is used far outside its data: that it stays above a
small floor from a strain of -0.9 on is part of the prior (see `matcal.posterior.conductivity_posterior` for its band).
Source: paper, figure 6c; Lawson & Hanson, Solving Least Squares Problems (1974), chapter 23 (least distance).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from matcal.fitting.hyperfoam.constrained_moduli import nearest
from matcal.laws.conductivity import Conductivity
from matcal.reduction.experiment import Experiment
from matcal.statistics.residual_correlation import integrated_autocorrelation_time
from touchcal.arrays import Array

# lowest strain in use, and the least conductivity allowed from there on, as a share of the data's median
LOWEST_STRAIN, FLOOR = -0.9, 0.01
_GRID = 181


@dataclass(frozen=True)
class ConductivityFit:
    """A fitted cubic and how well the data determine it."""

    law: Conductivity  # fitted law, positive from LOWEST_STRAIN to the end of the data
    centre: Array  # (4,) unconstrained estimate of c_0 (1, a_1, a_2, a_3), S/m
    covariance: Array  # (4, 4) its covariance, widened where residuals are larger than the noise or correlated
    zero_covariance: Array  # the part of it from an uncertain strain zero, whose size the residuals do not show
    positive: tuple[Array, float]  # (4, m) columns p(e) where p(e) . b >= floor is asked, and that floor, S/m
    chi_square: float | None  # sum of squared residuals over the noise; None where no noise is known
    freedom: int  # its degrees of freedom
    effective_sample_size: float  # independent points that the residuals are worth, less the four coefficients
    relative_rms: tuple[float, ...]  # rms(residual)/rms(value), each experiment
    decisions: tuple[str, ...]  # what was decided, one sentence each


def fit_conductivity(experiments: Sequence[Experiment]) -> ConductivityFit:
    """Cubic with least noise-weighted squares over all conductivity tests, at least FLOOR of the median from
    LOWEST_STRAIN on. Raises ValueError for fewer than five points or a value that is not positive."""
    e, c = (np.concatenate([getattr(x, name) for x in experiments]) for name in ("strain", "value"))
    where = ", ".join(s for x in experiments for s in x.source) or "conductivity"
    if e.size < 5 or np.unique(e).size < 4 or np.any(c <= 0):
        raise ValueError(f"{where}: a cubic needs at least five positive conductivities at four strains, got {e.size} "
                         f"points, the least {c.min() if c.size else 0:g} S/m.")
    known = all(x.noise is not None for x in experiments)
    sd = np.concatenate([_deviation(x) for x in experiments]) if known else np.ones(e.size)
    basis = powers(e)
    centre = np.asarray(np.linalg.lstsq(basis / sd[:, None], c / sd, rcond=None)[0], dtype=float)
    residual = (basis @ centre - c) / sd
    order = np.argsort(e, kind="stable")
    freedom = e.size - 4
    wider = integrated_autocorrelation_time(residual[order])
    spread = float(residual @ residual) / freedom * wider
    gain = np.asarray(np.linalg.pinv(basis / sd[:, None]), dtype=float)
    covariance = gain @ gain.T * (max(1.0, spread) if known else spread)
    zero = _zero_covariance(experiments, gain, sd, centre)
    covariance += zero
    positive = (powers(np.linspace(LOWEST_STRAIN, max(float(e.max()), 0.0), _GRID)).T, FLOOR * float(np.median(c)))
    best = nearest(basis / sd[:, None], centre, positive[0].T, positive[1])
    law = Conductivity(float(best[0]), best[1:] / best[0], (float(e.min()), float(e.max())))
    rms = tuple(float(np.sqrt(np.mean((powers(x.strain) @ best - x.value) ** 2) / np.mean(x.value**2)))
                for x in experiments)
    chi_square = float(np.sum(((basis @ best - c) / sd) ** 2)) if known else None
    return ConductivityFit(law, centre, covariance, zero, positive, chi_square, freedom,
                           max(e.size / wider - 4, 1.0), rms,
                           _sentences(law, not np.allclose(best, centre), chi_square, freedom))


def _zero_covariance(experiments: Sequence[Experiment], gain: Array, sd: Array, centre: Array) -> Array:
    """What the uncertain strain zero (clock, grips) of each test adds to the covariance."""
    total, first = np.zeros((4, 4)), 0
    for experiment in experiments:
        e = experiment.strain
        shift = experiment.facts.get("strain_zero_sd", 0.0) * (powers(e)[:, :3] @ (centre[1:] * [1, 2, 3]))
        rows = slice(first, first + e.size)
        effect = gain[:, rows] @ (shift / sd[rows])
        total += np.outer(effect, effect)
        first += e.size
    return total


def powers(strain: ArrayLike) -> Array:
    """(n, 4) powers 1, e, e^2, e^3."""
    return np.vander(np.asarray(strain, dtype=float), 4, increasing=True)


def _deviation(experiment: Experiment) -> Array:
    count = np.ones(experiment.value.size) if experiment.samples is None else experiment.samples
    return float(experiment.noise or 0.0) / np.sqrt(count)


def _sentences(law: Conductivity, held: bool, chi_square: float | None, freedom: int) -> tuple[str, ...]:
    lo, hi = law.strain_range
    out = [f"Conductivity fitted for strains {lo:.3g} to {hi:.3g} and kept above {FLOOR:.0%} of its median down to "
           f"{LOWEST_STRAIN:g}" + ("; that bound holds the fit." if held else "; the data alone satisfy it.")]
    if lo > -0.01:
        out.append("All conductivity data are tensile: every compressed skin is an extrapolation; its band holds only "
                   "if the cubic does.")
    if chi_square is None:
        out.append("The conductivity file states no noise: it is taken from the residuals of the cubic.")
    else:
        out.append(f"Conductivity chi-square {chi_square:.0f} for {freedom} degrees of freedom.")
    return tuple(out)
