"""The part of the posterior of any law: its parameters and the noise sampled, nuisances integrated out.

y = m(theta) + V z + e over the curves' scales, linear in the nuisances z alone (contact points, load drifts, stiffness
factors of specimens). theta are the fitted parameters, moduli in units of mu_0: uniform between bounds of the law that
are finite, else normal and wide, as the intervals of `matcal.fitting.uncertainty` take them. m is worked out at a few
strains of each curve, Chebyshev's nodes, and carried from there to the record. Rate, replicates and stated scatter are
those of `matcal.posterior.hyperfoam_posterior`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BarycentricInterpolator, CubicSpline

from matcal.fitting.hyperfoam.curves import Curve, of_mean_foam, weighted_model, weighted_stress
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit
from matcal.fitting.hyperfoam.specimen_factors import specimens
from matcal.fitting.relaxation.relaxation_fit import PronyFit
from matcal.fitting.uncertainty import linear_response
from matcal.fitting.uncertainty.linear_response import PRIOR_ALPHA, PRIOR_MODULI
from matcal.fitting.uncertainty.nuisance import nuisance
from matcal.laws.deformation_modes import log_stretches, push_forward, second_piola, stacked_second_piola
from matcal.laws.law import Law, expanded, moduli_of, units, vector
from matcal.laws.law_stack import LawStack
from matcal.posterior.draws import Draws
from matcal.posterior.record_effects import (
    common_factor,
    contrasts,
    log_omega,
    omega_inside,
    rate_effect,
    rate_spline,
    series_effect,
)
from matcal.statistics.linear_marginals import log_marginal, triangles
from touchcal.arrays import Array

_FIRST_NODES, _MOST_NODES, _RIGHT = 12, 96, 1e-7  # strains of a curve at first and at most; error over its stress
_SPREAD = 0.4  # widest start in ln noise and ln omega, and over the standard deviations of parameters


@dataclass(frozen=True)
class _Record:
    """How the stresses of a law at a few strains make the weighted stress of a curve."""

    mode: str
    strain: Array  # (m,)
    stretches: Array  # (m, 3) logarithmic ones of the fitted law
    operator: Array  # (r, m C) from second Piola-Kirchhoff stresses at these strains


@dataclass(frozen=True)
class GeneralPart:
    """Everything that one evaluation of the law's part needs."""

    law: Law  # the fitted one
    free: NDArray[np.bool_]  # (K,) which of its parameters are sampled
    units: Array  # (K,) size in which each is sampled
    low: Array  # (K,) bounds of all parameters, in their units
    high: Array
    centre: Array  # (K,) mean and standard deviation of a normal prior, in units; infinite where it is uniform
    width: Array
    records: tuple[_Record, ...]
    target: Array  # (r,) weighted stress on the short basis
    effect: Array  # (r, J) nuisance effects on that basis
    mean: Array  # (J,) their prior means
    stated: Array  # (K, D) change of the parameters with one stated deviation of each curve that states it, in units
    factor: Array  # (r, S - 1) effects of contrasts between the ln s of S specimens; no columns without replicates
    rate: CubicSpline | None  # rate effect: ln tau -> (r,) per unit g/g_inf
    fitted_rate: Array  # (r,) that of the fitted series
    model: Array  # (r,) the fitted law's stress
    deviation: Array  # (K,) about the standard deviations of the parameters, in units
    effective_sample_size: float  # independent points of the residuals
    decisions: tuple[str, ...]  # what was assumed, one sentence each

    @property
    def size(self) -> int:
        """Sampled numbers: parameters, ln sigma, ln omega with replicates."""
        return int(self.free.sum()) + 1 + (self.factor.shape[1] > 0)

    def log_density(self, x: Array, ln_tau: Array | None, g: Array | None, share: float = 1.0) -> Array:
        """As `matcal.posterior.sample.LawPart`, at (theta, ln sigma, ln omega?)."""
        theta, ln_sigma = self._theta(x), x[:, self.free.sum()]
        inside = np.all((theta >= self.low) & (theta <= self.high), axis=1) & (np.abs(ln_sigma) < 20)
        inside &= omega_inside(x[:, -1]) if self.factor.shape[1] else True
        out = np.full(x.shape[0], -np.inf)
        if not inside.any():
            return out
        model = self._stress(theta[inside])
        real = np.all(np.isfinite(model), axis=1)
        there, model, points = np.flatnonzero(inside)[real], model[real], share * self.effective_sample_size
        if self.rate is not None and ln_tau is not None and g is not None:
            extra = series_effect(self.rate, ln_tau[there], g[there]) - self.fitted_rate
            model = model + extra * (model @ self.model / (self.model @ self.model))[:, None]
        precision = np.sqrt(points) * np.exp(-ln_sigma[there])
        blocks = [np.broadcast_to(self.effect, (there.size, *self.effect.shape))]
        if self.factor.shape[1]:
            blocks.append(np.exp(x[there, -1])[:, None, None] * self.factor)
            out[there] = log_omega(x[there, -1])
        else:
            out[there] = 0.0
        design = np.concatenate(blocks, axis=2) * precision[:, None, None]
        mean = np.r_[self.mean, np.zeros(self.factor.shape[1])]
        out[there] += log_marginal(triangles(design, precision[:, None] * (self.target - model), np.ones(mean.size),
                                             mean)) - points * ln_sigma[there]
        out[there] -= 0.5 * np.sum(((theta[there] - self.centre) / self.width) ** 2, axis=1)
        return out

    def draws(self, x: Array, ln_tau: Array | None, g: Array | None, rng: np.random.Generator) -> Draws:
        """Laws at sampled points (W, size), with omega where there are replicates."""
        theta = self._theta(x) + rng.standard_normal((x.shape[0], self.stated.shape[1])) @ self.stated.T
        theta = np.clip(theta, self.low, self.high)
        omega = np.exp(x[:, -1]) if self.factor.shape[1] else None
        scale = np.ones((x.shape[0], self.units.size))
        if omega is not None:
            moduli = [p.name in moduli_of(self.law) for p, _ in expanded(self.law)]
            scale[:, moduli] = common_factor(omega, self.factor.shape[1] + 1, rng)[:, None]
        values = theta * self.units * scale
        columns = {p.name: [k for k, (q, _) in enumerate(expanded(self.law)) if q is p] for p in self.law.parameters}
        return Draws({name: values[:, k] for name, k in columns.items()}, type(self.law), omega=omega)

    def start(self, fit: Fit) -> tuple[Array, Array]:
        """As `matcal.posterior.sample.LawPart`."""
        at, more = (vector(self.law) / self.units)[self.free], self.size - int(self.free.sum())
        return (np.r_[at, 0.5 * np.log(max(fit.optimum.cost, 1e-14)), [np.log(0.05)] * (more - 1)],
                np.r_[_SPREAD * self.deviation[self.free], np.full(more, _SPREAD)])

    @property
    def prior(self) -> str:
        """The prior of everything in the law's part."""
        words = []
        for k, (_, name) in enumerate(expanded(self.law)):
            if not self.free[k]:
                continue
            ends = [f"{end:.3g}" for end in (self.low[k] * self.units[k], self.high[k] * self.units[k])]
            about = (f"normal about {self.centre[k] * self.units[k]:.3g} with {self.width[k]:g}"
                     f"{' mu_0' if self.units[k] != 1 else ''}, " if np.isfinite(self.width[k]) else "uniform ")
            words.append(f"{name} {about}between {ends[0]} and {ends[1]}")
        words += ["ln sigma flat", "contact points, load zeros and drifts normal with their own errors"]
        words += ["stated scatter normal, about the fit, not inferred"] if self.stated.shape[1] else []
        words += ["ln of the specimens' stiffness normal with omega, omega half-normal"] if self.factor.shape[1] else []
        return "; ".join(words) + f"; {self.effective_sample_size:.0f} effective points"

    @property
    def remedy(self) -> str:
        """What may help chains that do not converge."""
        return "Add a test in another mode, or give --poisson a value." if self.free.sum() > 1 else ""

    def _theta(self, x: Array) -> Array:
        """(W, K) all parameters, in their units."""
        theta = np.tile(vector(self.law) / self.units, (x.shape[0], 1))
        theta[:, self.free] = x[:, :self.free.sum()]
        return theta

    def _stress(self, theta: Array) -> Array:
        """(W, r) weighted stress on the short basis; not finite where there is no such law or state."""
        laws = LawStack(self.law, theta * self.units)
        out = sum(stacked_second_piola(laws, r.mode, r.strain, r.stretches).reshape(len(theta), -1) @ r.operator.T
                  for r in self.records)
        return np.where((laws.moduli_at_rest[0] > 0)[:, None], out, np.nan)


def law_part(fit: Fit, points: float, prony: PronyFit | None) -> GeneralPart:
    """The part of a fit whose residuals are worth `points`."""
    fit = replace(fit, curves=tuple(of_mean_foam(c) for c in fit.curves))  # factors are drawn, not taken
    law, known, differ = fit.law, nuisance(fit), specimens(fit.curves, fit.law)
    times, rate = rate_effect(fit.curves, law, prony)
    raw, model = [_record(c, law) for c in fit.curves], weighted_model(fit.curves, law)
    operators = _stacked([r.operator for r in raw])
    more = np.column_stack([weighted_stress(fit.curves), model, known.effect, differ.factor, rate])
    basis = _basis(np.column_stack([*operators, more]))
    records = tuple(replace(r, operator=basis.T @ o) for r, o in zip(raw, operators, strict=True))
    spline, fitted_rate = rate_spline(times, basis.T @ rate, prony)
    named = [p for p, _ in expanded(law)]
    sizes, free = units(law), np.array([p.name not in fit.given for p in named])
    slopes = linear_response.free_slopes(replace(fit, moves=np.eye(free.size)[:, free]))
    ends = np.array([p.bounds for p in named], dtype=float) / sizes[:, None]
    modulus = np.array([p.name in moduli_of(law) for p in named])
    open_ended = ~np.all(np.isfinite(ends), axis=1)
    start = np.array([p.start for p in named])
    wide = np.where(modulus, PRIOR_MODULI, PRIOR_ALPHA)
    stated, deviation = _linear(fit, slopes * sizes[free], differ.stated, free, wide, points)
    factor = basis.T @ differ.factor @ contrasts(differ.factor.shape[1])
    return GeneralPart(law, free, sizes, ends[:, 0], ends[:, 1], np.where(modulus, 0.0, start),
                       np.where(open_ended, wide, np.inf), records, basis.T @ weighted_stress(fit.curves),
                       basis.T @ known.effect, known.mean, stated, factor, spline, fitted_rate, basis.T @ model,
                       deviation, points, differ.decisions)


def _linear(fit: Fit, slopes: Array, stated: Array, free: NDArray[np.bool_], wide: Array, points: float
            ) -> tuple[Array, Array]:
    """(K, D) changes of the parameters with stated deviations and (K,) their standard deviations, to first order."""
    precision = points / max(fit.optimum.cost, 1e-14)
    normal = precision * slopes.T @ slopes + np.diag(wide[free] ** -2.0)
    moved, deviation = np.zeros((free.size, stated.shape[1])), np.zeros(free.size)
    moved[free] = np.linalg.solve(normal, precision * slopes.T @ stated)
    deviation[free] = np.sqrt(np.diag(np.linalg.inv(normal)))
    return moved, deviation


def _record(curve: Curve, law: Law) -> _Record:
    """Nodes of a curve, doubled until they carry the fitted law's stress to the record."""
    kind, e = curve.experiment.kind, curve.experiment.strain
    push = curve.factor * push_forward(kind, e) / curve.scale_Pa[:, None]
    exact, count = curve.model(law) / curve.scale_Pa, _FIRST_NODES
    while True:
        low, high = float(e.min()), float(e.max())
        nodes = (low + high) / 2 + (high - low) / 2 * np.cos(np.pi * np.arange(count) / (count - 1))
        carried = BarycentricInterpolator(nodes, np.eye(count))(e)
        carried = carried if curve.kernel is None else curve.kernel @ carried
        record = _Record(kind, nodes, log_stretches(law, kind, nodes),
                         (carried[:, :, None] * push[:, None, :]).reshape(e.size, -1))
        stress = second_piola(law, kind, nodes).ravel()
        if count >= _MOST_NODES or np.abs(record.operator @ stress - exact).max() < _RIGHT * np.abs(exact).max():
            return record
        count *= 2


def _stacked(operators: Sequence[Array]) -> list[Array]:
    """The operators over the rows of all curves."""
    ends = np.cumsum([0, *(len(o) for o in operators)])
    out = [np.zeros((ends[-1], o.shape[1])) for o in operators]
    for whole, operator, first in zip(out, operators, ends, strict=False):
        whole[first:first + len(operator)] = operator
    return out


def _basis(columns: Array) -> Array:
    """(n, r) orthonormal directions of columns (n, m), each of its own size."""
    size = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(columns[:, size > 0] / size[size > 0], full_matrices=False)
    return left[:, values > 1e-12 * values[0]]
