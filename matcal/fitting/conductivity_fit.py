"""Conductivity c(e) fitted with its noise, kept positive wherever a touch may take it.

The tests stretch the skin while touches compress it, so the law is used far outside its data: that it stays above a
small floor from a strain of -0.9 on, where its form alone does not say so, is part of the prior (see
`matcal.posterior.conductivity_posterior` for its band).
Source: paper, figure 6c; Lawson & Hanson, Solving Least Squares Problems (1974), chapter 23 (least distance).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from matcal.fitting.conductivity_laws import ComparedLaw, chosen, compared_laws, least, linked, numbers_of
from matcal.fitting.fit_options import AUTO
from matcal.fitting.hyperfoam.constrained_moduli import nearest
from matcal.laws.conduction_laws import CUBIC, ConductionLaw, conduction_law
from matcal.laws.conductivity import Conductivity, drawn_conductivity
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
    """A fitted law of conduction and how well the data determine it."""

    law: Conductivity  # fitted law, positive from LOWEST_STRAIN to the end of the data
    centre: Array  # (1 + m,) unconstrained estimate b of c_0 (1, a), S/m, of a logarithmic law (ln c_0, a)
    covariance: Array  # (1 + m, 1 + m) its covariance, errors correlated as the residuals show, not below the noise
    zero_covariance: Array  # the part of it from an uncertain strain zero, whose size the residuals do not show
    positive: tuple[Array, float]  # (1 + m, k) columns p(e) where p(e) . b >= floor is asked, and that floor, S/m
    chi_square: float | None  # sum of squared residuals over the noise; None where no noise is known
    freedom: int  # its degrees of freedom
    effective_sample_size: float  # independent points that the errors are worth, less the coefficients
    relative_rms: tuple[float, ...]  # rms(residual)/rms(value), each experiment
    decisions: tuple[str, ...]  # what was decided, one sentence each
    compared: tuple[ComparedLaw, ...] = ()  # every law, by how it predicts a part that was kept out
    cubic: "ConductivityFit | None" = None  # where the law is another one, the cubic that outside the tests may hold


def fit_conductivity(experiments: Sequence[Experiment], kind: str = AUTO) -> ConductivityFit:
    """The law of a kind, AUTO of `matcal.fitting.conductivity_laws.chosen`, with least noise-weighted squares over all
    conductivity tests, at least FLOOR of the median from LOWEST_STRAIN on. Raises ValueError for fewer than five points
    or a value that is not positive."""
    e, c = (np.concatenate([getattr(x, name) for x in experiments]) for name in ("strain", "value"))
    where = ", ".join(s for x in experiments for s in x.source) or "conductivity"
    if e.size < 5 or np.unique(e).size < 4 or np.any(c <= 0):
        raise ValueError(f"{where}: a law needs at least five positive conductivities at four strains, got {e.size} "
                         f"points, the least {c.min() if c.size else 0:g} S/m.")
    compared = compared_laws(experiments)
    asked, kind = kind != AUTO, chosen(compared) if kind == AUTO else kind
    law = conduction_law(kind)
    known = all(x.noise is not None for x in experiments)
    basis = law.basis(e)
    value, sd = linked(law, c, np.concatenate([_deviation(x) for x in experiments]) if known else
                       _likelier_size(law, basis, c))
    centre = least(basis, value, sd)
    freedom = e.size - centre.size
    errors = _errors(experiments, (basis @ centre - value) / sd, basis / sd[:, None], 1.0 if known else 0.0)
    spare = max(sum(x.effective_sample_size for x in errors) - centre.size, min(_LEAST_SPARE, max(1.0, freedom)))
    gain = np.asarray(np.linalg.pinv(basis / sd[:, None]), dtype=float)
    covariance = propagated(errors, gain)
    zero = _zero_covariance(experiments, gain / sd, law, centre)
    covariance += zero
    positive = _positive(law, e, c)
    best = nearest(basis / sd[:, None], centre, positive[0].T, positive[1]) if positive[0].size else centre
    numbers = numbers_of(law, best)
    fitted = Conductivity(float(numbers[0]), numbers[1:] / numbers[0], (float(e.min()), float(e.max())), kind)
    rms = tuple(float(np.sqrt(np.mean((drawn_conductivity(kind, numbers, x.strain) - x.value) ** 2)
                              / np.mean(x.value**2))) for x in experiments)
    chi_square = float(np.sum(((basis @ best - value) / sd) ** 2)) if known else None
    return ConductivityFit(fitted, centre, covariance, zero, positive, chi_square, freedom, spare, rms,
                           _sentences(fitted, asked, not np.allclose(best, centre), chi_square, freedom), compared,
                           None if kind == CUBIC else fit_conductivity(experiments, CUBIC))


def coefficients(law: Conductivity) -> Array:
    """What the basis of a conductivity's law is multiplied by: c_0 (1, a) or (ln c_0, a)."""
    if conduction_law(law.kind).logarithmic:
        return np.r_[np.log(law.c0_S_per_m), law.a]
    return law.c0_S_per_m * np.r_[1.0, law.a]


def _positive(law: ConductionLaw, e: Array, c: Array) -> tuple[Array, float]:
    """Columns and floor of `ConductivityFit.positive`; none of a law that is positive by its form."""
    if law.logarithmic:
        return np.empty((law.basis(np.zeros(1)).shape[1], 0)), 0.0
    return law.basis(np.linspace(LOWEST_STRAIN, max(float(e.max()), 0.0), _GRID)).T, FLOOR * float(np.median(c))


def _likelier_size(law: ConductionLaw, basis: Array, c: Array) -> Array:
    """(n,) relative size of unknown noise: the same at every point, or that of the value, whichever is likelier."""
    sizes = np.ones(c.size), c / float(np.exp(np.mean(np.log(c))))
    squares = [float(np.sum(((basis @ least(basis, value, sd) - value) / sd) ** 2))
               for value, sd in (linked(law, c, size) for size in sizes)]
    return sizes[int(np.argmin(squares))]


def _errors(experiments: Sequence[Experiment], residual: Array, slopes: Array, least: float) -> tuple[Errors, ...]:
    """Errors of each test, in the order of its points, correlated as its residuals (n,) show."""
    ends = np.cumsum([x.strain.size for x in experiments])[:-1]
    tiny = 1e-12 * slopes.T @ slopes / max(float(np.mean(residual**2)), 1e-300)
    return correlated_errors(np.split(residual, ends), np.split(slopes, ends), tiny, [least] * len(experiments))


def _zero_covariance(experiments: Sequence[Experiment], gain: Array, law: ConductionLaw, centre: Array) -> Array:
    """What the uncertain strain zero (clock, grips) of each test adds to the covariance; gain (1 + m, n) by values."""
    total, first = np.zeros((centre.size, centre.size)), 0
    numbers = numbers_of(law, centre)
    for experiment in experiments:
        e, a = experiment.strain, numbers[1:] / numbers[0]
        slope = law.slope(a, e) / law.ratio(a, e) if law.logarithmic else numbers[0] * law.slope(a, e)
        effect = gain[:, first:first + e.size] @ (experiment.facts.get("strain_zero_sd", 0.0) * slope)
        total += np.outer(effect, effect)
        first += e.size
    return total


def _deviation(experiment: Experiment) -> Array:
    count = np.ones(experiment.value.size) if experiment.samples is None else experiment.samples
    return float(experiment.noise or 0.0) / np.sqrt(count)


def _sentences(law: Conductivity, asked: bool, held: bool, chi_square: float | None, freedom: int) -> tuple[str, ...]:
    lo, hi = law.strain_range
    out = [f"Conductivity fitted by the {law.kind} law for strains {lo:.3g} to {hi:.3g}"]
    out[0] += ", positive at all of them." if conduction_law(law.kind).logarithmic else (
        f" and kept above {FLOOR:.0%} of its median down to {LOWEST_STRAIN:g}"
        + ("; that bound holds the fit." if held else "; the data alone satisfy it."))
    if law.kind != CUBIC and not asked:
        out.append(f"The {law.kind} law was chosen: it fits as well as the cubic, and of the third of the points "
                   "farthest from rest, kept out, the cubic predicts more than twice as badly.")
    if lo > -0.01:
        out.append("All conductivity data are tensile: every compressed skin is an extrapolation; its band holds only "
                   "if the law does.")
    if chi_square is None:
        out.append("The conductivity file states no noise: it is taken from the residuals of the law.")
    else:
        out.append(f"Conductivity chi-square {chi_square:.0f} for {freedom} degrees of freedom.")
    return tuple(out)
