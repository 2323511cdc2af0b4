"""Cubic conductivity c(e) fitted with its noise, kept positive wherever a touch may take it.

The tests stretch the skin while touches compress it, so the cubic is used far outside its data: that it stays above a
small floor from a strain of -0.9 on is part of the prior (see `matcal.posterior.conductivity_posterior` for its band).
Source: paper, figure 6c; Lawson & Hanson, Solving Least Squares Problems (1974), chapter 23 (least distance).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from matcal.fitting.conductivity_laws import OtherLaw, other_laws
from matcal.fitting.hyperfoam.constrained_moduli import nearest
from matcal.laws.conductivity import Conductivity
from matcal.reduction.experiment import Experiment
from matcal.statistics.residual_correlation import Errors, correlated_errors, propagated
from touchcal.arrays import Array

# lowest strain in use, and the least conductivity allowed from there on, as a share of the data's median
LOWEST_STRAIN, FLOOR = -0.9, 0.01
_GRID = 181
# least points to spare in Student's law: errors' sizes are averaged already, see `statistics.residual_correlation`
_LEAST_SPARE = 16.0


@dataclass(frozen=True)
class ConductivityFit:
    """A fitted cubic and how well the data determine it."""

    law: Conductivity  # fitted law, positive from LOWEST_STRAIN to the end of the data
    centre: Array  # (4,) unconstrained estimate of c_0 (1, a_1, a_2, a_3), S/m
    covariance: Array  # (4, 4) its covariance, the errors correlated as the residuals show and not below the noise
    zero_covariance: Array  # the part of it from an uncertain strain zero, whose size the residuals do not show
    positive: tuple[Array, float]  # (4, m) columns p(e) where p(e) . b >= floor is asked, and that floor, S/m
    chi_square: float | None  # sum of squared residuals over the noise; None where no noise is known
    freedom: int  # its degrees of freedom
    effective_sample_size: float  # independent points that the errors are worth, less the four coefficients
    relative_rms: tuple[float, ...]  # rms(residual)/rms(value), each experiment
    decisions: tuple[str, ...]  # what was decided, one sentence each
    others: tuple[OtherLaw, ...] = ()  # the cubic and other laws, by how they predict a part that was kept out


def fit_conductivity(experiments: Sequence[Experiment]) -> ConductivityFit:
    """Cubic with least noise-weighted squares over all conductivity tests, at least FLOOR of the median from
    LOWEST_STRAIN on. Raises ValueError for fewer than five points or a value that is not positive."""
    e, c = (np.concatenate([getattr(x, name) for x in experiments]) for name in ("strain", "value"))
    where = ", ".join(s for x in experiments for s in x.source) or "conductivity"
    if e.size < 5 or np.unique(e).size < 4 or np.any(c <= 0):
        raise ValueError(f"{where}: a cubic needs at least five positive conductivities at four strains, got {e.size} "
                         f"points, the least {c.min() if c.size else 0:g} S/m.")
    known = all(x.noise is not None for x in experiments)
    basis = powers(e)
    sd = np.concatenate([_deviation(x) for x in experiments]) if known else _likelier_size(basis, c)
    centre = _least(basis, c, sd)
    freedom = e.size - 4
    errors = _errors(experiments, (basis @ centre - c) / sd, basis / sd[:, None], 1.0 if known else 0.0)
    spare = max(sum(x.effective_sample_size for x in errors) - 4, min(_LEAST_SPARE, max(1.0, freedom)))
    gain = np.asarray(np.linalg.pinv(basis / sd[:, None]), dtype=float)
    covariance = propagated(errors, gain)
    zero = _zero_covariance(experiments, gain, sd, centre)
    covariance += zero
    positive = (powers(np.linspace(LOWEST_STRAIN, max(float(e.max()), 0.0), _GRID)).T, FLOOR * float(np.median(c)))
    best = nearest(basis / sd[:, None], centre, positive[0].T, positive[1])
    law = Conductivity(float(best[0]), best[1:] / best[0], (float(e.min()), float(e.max())))
    rms = tuple(float(np.sqrt(np.mean((powers(x.strain) @ best - x.value) ** 2) / np.mean(x.value**2)))
                for x in experiments)
    chi_square = float(np.sum(((basis @ best - c) / sd) ** 2)) if known else None
    return ConductivityFit(law, centre, covariance, zero, positive, chi_square, freedom,
                           spare, rms,
                           _sentences(law, not np.allclose(best, centre), chi_square, freedom),
                           other_laws(experiments))


def _least(basis: Array, value: Array, sd: Array) -> Array:
    return np.asarray(np.linalg.lstsq(basis / sd[:, None], value / sd, rcond=None)[0], dtype=float)


def _likelier_size(basis: Array, value: Array) -> Array:
    """(n,) relative size of unknown noise: the same at every point, or that of the value, whichever is likelier."""
    sizes = np.ones(value.size), value / float(np.exp(np.mean(np.log(value))))
    squares = [float(np.sum(((basis @ _least(basis, value, sd) - value) / sd) ** 2)) for sd in sizes]
    return sizes[int(np.argmin(squares))]


def _errors(experiments: Sequence[Experiment], residual: Array, slopes: Array, least: float) -> tuple[Errors, ...]:
    """Errors of each test, in the order of its points, correlated as its residuals (n,) show."""
    ends = np.cumsum([x.strain.size for x in experiments])[:-1]
    tiny = 1e-12 * slopes.T @ slopes / max(float(np.mean(residual**2)), 1e-300)
    return correlated_errors(np.split(residual, ends), np.split(slopes, ends), tiny, [least] * len(experiments))


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
