"""The law's part of the posterior: exponents and noise sampled, moduli and nuisances integrated out.

y = A(alpha) mu + V z + e, over the curves' scales, is linear in the moduli mu ~ N(0, (100 mu_0)^2) and in the nuisances
z (contact points, load drifts, stiffness factors of specimens). A shared nu that was fitted is sampled too, on designs
tabulated for a few values of it. Scatter that a file states widens the draws about the fit and is not inferred: each
draw's moduli answer to records moved along it, so that misfit does not choose where in it the law lies. With a
relaxation test the rate effect follows the sampled series exactly in its times and fractions, as that of the fitted law
scaled with the sampled one.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BarycentricInterpolator, CubicSpline

from matcal.fitting.hyperfoam.curves import of_mean_foam, weighted_model
from matcal.fitting.hyperfoam.design_table import Table, tabulate
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, allowed_exponents
from matcal.fitting.hyperfoam.poisson import lateral_cost
from matcal.fitting.hyperfoam.specimen_factors import PRIOR_OMEGA, specimens
from matcal.fitting.hyperfoam.variable_projection import Exponents
from matcal.fitting.relaxation.relaxation_fit import PronyFit
from matcal.fitting.uncertainty.linear_response import PRIOR_MODULI
from matcal.fitting.uncertainty.nu_ridge import Ridge
from matcal.fitting.uncertainty.nuisance import nuisance
from matcal.laws.hyperfoam import Hyperfoam
from matcal.posterior.draws import Draws, foam_draws
from matcal.posterior.record_effects import (
    common_factor,
    contrasts,
    log_omega,
    omega_inside,
    rate_effect,
    rate_spline,
    series_effect,
)
from matcal.statistics.linear_marginals import conditional, log_marginal, triangles
from touchcal.arrays import Array

SPREAD = 0.4  # of the widest start in exponents, ln noise, ln omega
_NU_NODES, _NU_NODES_PER_UNIT, _MOST_NU_NODES = 5, 40, 25  # values of nu that are tabulated, more for a wide range


@dataclass(frozen=True)
class LawPart:
    """Everything that one evaluation of the law's part needs, moduli in units of mu_0."""

    tables: tuple[Table, ...]  # designs on one short basis, one for each tabulated nu
    nu: Array  # those nu; a single one where nu was not fitted
    lateral: CubicSpline | None  # squares of lateral strains against nu; None without a record of them or with nu given
    effect: Array  # (r, J) nuisance effects on that basis
    mean: Array  # (J,) their prior means
    stated: Array  # (r, D) effect of one stated deviation of each curve that states it
    factor: Array  # (r, S - 1) effects of contrasts between the ln s of S specimens; no columns without replicates
    rate: CubicSpline | None  # rate effect: ln tau -> (r,) per unit g/g_inf
    fitted_rate: Array  # (r,) that of the fitted series
    model: Array  # (r,) the fitted law's stress
    allowed: Exponents  # exponents within the prior
    order: int  # their number
    mu_0_Pa: float  # unit of the moduli, Pa
    effective_sample_size: float  # independent points of the residuals
    decisions: tuple[str, ...]  # what was assumed, one sentence each

    @property
    def size(self) -> int:
        """Sampled numbers: exponents, ln sigma, nu where fitted, ln omega with replicates."""
        return self.order + 1 + (self.nu.size > 1) + (self.factor.shape[1] > 0)

    def log_density(self, x: Array, ln_tau: Array | None, g: Array | None, share: float = 1.0) -> Array:
        """(W,) log density at (alpha, ln sigma, nu?, ln omega?) (W, size), moduli and nuisances integrated
        out, for series with (W, M) ln_tau and g; `share` of the points is counted."""
        alpha = x[:, :self.order]
        inside = (alpha[:, 0] > self.allowed.low) & (alpha[:, -1] < self.allowed.high)
        inside &= np.all(np.diff(alpha, axis=1) >= self.allowed.gap, axis=1) & (np.abs(x[:, self.order]) < 20)
        if self.nu.size > 1:
            inside &= (x[:, self.order + 1] > self.nu.min()) & (x[:, self.order + 1] < self.nu.max())
        if self.factor.shape[1]:
            inside &= omega_inside(x[:, -1])
        out = np.full(x.shape[0], -np.inf)
        if inside.any():
            series = (None, None) if ln_tau is None or g is None else (ln_tau[inside], g[inside])
            y, points = x[inside], share * self.effective_sample_size
            out[inside] = log_marginal(_triangles(self, y, *series, points)) - points * y[:, self.order]
            if self.lateral is not None:
                out[inside] -= 0.5 * points * self.lateral(y[:, self.order + 1]) * np.exp(-2 * y[:, self.order])
            if self.factor.shape[1]:
                out[inside] += log_omega(y[:, -1])
        return out

    def draws(self, x: Array, ln_tau: Array | None, g: Array | None, rng: np.random.Generator) -> Draws:
        """Laws at sampled points (W, size), with omega where there are replicates."""
        moved = rng.standard_normal((x.shape[0], self.stated.shape[1])) @ self.stated.T
        solved = conditional(_triangles(self, x, ln_tau, g, self.effective_sample_size, moved), rng)
        nu = x[:, self.order + 1] if self.nu.size > 1 else np.full(x.shape[0], self.nu[0])
        scatter = self.factor.shape[1] > 0
        omega = np.exp(x[:, -1]) if scatter else np.zeros(x.shape[0])
        common = common_factor(omega, self.factor.shape[1] + 1, rng)
        return foam_draws(solved[:, :self.order] * self.mu_0_Pa * common[:, None], x[:, :self.order],
                          np.repeat(nu[:, None], self.order, axis=1), omega=omega if scatter else None)

    def start(self, fit: Fit) -> tuple[Array, Array]:
        """(size,) the fit in the coordinates that are sampled, and the widest spread of starts about it."""
        alpha = fit.law.alpha + 0.01 * np.arange(self.order)
        more = ([float(fit.law.nu[0])] if self.nu.size > 1 else []) + ([np.log(0.05)] if self.factor.shape[1] else [])
        spread = np.full(self.size, SPREAD)
        if self.nu.size > 1:
            spread[self.order + 1] = 0.1 * np.ptp(self.nu)
        return np.r_[alpha, 0.5 * np.log(max(fit.optimum.cost, 1e-14)), more], spread

    @property
    def prior(self) -> str:
        """The prior of everything in the law's self."""
        a = self.allowed
        words = [f"alpha uniform between {a.low:.3g} and {a.high:.3g}, in order, at distances of {a.gap:.2g} at least",
                 f"mu_i normal about 0 with {PRIOR_MODULI:g} mu_0, mu_0 positive", "ln sigma flat",
                 "contact points, load zeros and drifts normal with their own errors"]
        if self.stated.shape[1]:
            words.append("stated scatter normal, about the fit, not inferred")
        if self.nu.size > 1:
            words.append(f"nu uniform between {self.nu.min():.3g} and {self.nu.max():.3g}")
        if self.factor.shape[1]:
            words.append(f"ln of the specimens' stiffness normal with omega, omega half-normal with {PRIOR_OMEGA:g}")
        return "; ".join(words) + f"; {self.effective_sample_size:.0f} effective points"

    @property
    def remedy(self) -> str:
        """What may help chains that do not converge; empty where nothing is known."""
        return "" if self.order == 1 else (
            f"Give --order {self.order - 1}: with fewer terms the exponents are better separated. Or add a test in "
            "another mode.")


def law_part(fit: Fit, points: float, prony: PronyFit | None, ridge: Ridge | None = None) -> LawPart:
    """Tables of a fit whose residuals are worth `points`, and of the nu along the ridge that it leaves open; ValueError
    for a law with unequal nu."""
    fit = replace(fit, curves=tuple(of_mean_foam(c) for c in fit.curves))  # factors are drawn, not taken
    law = fit.law
    if np.ptp(law.nu) > 0:
        raise ValueError(f"`posterior` is built for one nu for all terms, the law has {law.nu.tolist()}. Use `poisson` "
                         "fit or one value.")
    known, differ = nuisance(fit), specimens(fit.curves, law)
    nu = law.nu[:1] if ridge is None else _nu_nodes(ridge)
    allowed = allowed_exponents(fit.curves, float(law.nu[0]))
    times, rate = rate_effect(fit.curves, law, prony)
    more = np.column_stack([known.effect, differ.stated, differ.factor, weighted_model(fit.curves, law)[:, None], rate])
    tables = _tables(fit, nu, (allowed.low, allowed.high), more)
    basis = tables[0].basis
    spline, fitted_rate = rate_spline(times, basis.T @ rate, prony)
    lateral = None
    if ridge is not None and any(c.experiment.lateral is not None for c in fit.curves):
        grid = np.linspace(nu.min(), nu.max(), 33)
        lateral = CubicSpline(grid, [lateral_cost(fit.curves, Hyperfoam(np.ones(1), np.ones(1), np.full(1, v)))
                                     for v in grid])
    factor = basis.T @ differ.factor @ contrasts(differ.factor.shape[1])
    return LawPart(tables, nu, lateral, basis.T @ known.effect, known.mean, basis.T @ differ.stated, factor, spline,
                   fitted_rate, basis.T @ weighted_model(fit.curves, law), allowed, law.alpha.size, law.mu_0_Pa, points,
                   differ.decisions)


def _triangles(part: LawPart, x: Array, ln_tau: Array | None, g: Array | None, points: float,
               moved: Array | float = 0.0) -> Array:
    """Triangular factors of the linear part, for records moved by (W, r)."""
    walkers, order = x.shape[0], part.order
    precision = (np.exp(-x[:, order]) * np.sqrt(points))[:, None, None]
    columns = _columns(part, x) * part.mu_0_Pa
    if part.rate is not None and ln_tau is not None and g is not None:
        extra = series_effect(part.rate, ln_tau, g) - part.fitted_rate
        like = np.einsum("r,wrk->wk", part.model, columns) / (part.model @ part.model)
        columns = columns + extra[:, :, None] * like[:, None, :]
    blocks = [columns, np.broadcast_to(part.effect, (walkers, *part.effect.shape))]
    if part.factor.shape[1]:
        blocks.append(np.exp(x[:, -1])[:, None, None] * part.factor)
    design = np.concatenate(blocks, axis=2) * precision
    spare = part.factor.shape[1]
    root = np.r_[np.full(order, 1 / PRIOR_MODULI), np.ones(part.mean.size + spare)]
    mean = np.r_[np.zeros(order), part.mean, np.zeros(spare)]
    return triangles(design, precision[:, :, 0] * (part.tables[0].target + moved), root, mean)


def _columns(part: LawPart, x: Array) -> Array:
    """(W, r, N) design at each walker's exponents and nu."""
    alpha = x[:, :part.order].ravel()
    shape = (x.shape[0], part.order, -1)
    if part.nu.size == 1:
        return part.tables[0].column(alpha).reshape(shape).transpose(0, 2, 1)
    weight = BarycentricInterpolator(part.nu, np.eye(part.nu.size))(x[:, part.order + 1])
    each = np.stack([t.column(alpha).reshape(shape) for t in part.tables])
    return np.einsum("wk,kwnr->wrn", weight, each)


def _tables(fit: Fit, nu: Array, bounds: tuple[float, float], more: Array) -> tuple[Table, ...]:
    """One table for each nu, all on a basis that holds every one of them."""
    first = tabulate(fit.curves, float(nu[0]), bounds, more)
    if nu.size == 1:
        return (first,)
    others = [tabulate(fit.curves, float(v), bounds, more) for v in nu]
    both = np.column_stack([t.basis for t in others])
    left, size, _ = np.linalg.svd(both, full_matrices=False)
    basis = left[:, size > 1e-9 * size[0]]
    return tuple(Table(basis, CubicSpline(t.column.x, t.column(t.column.x) @ (t.basis.T @ basis)),
                       basis.T @ (t.basis @ t.target)) for t in others)


def _nu_nodes(ridge: Ridge) -> Array:
    """Chebyshev nodes over the nu that the profile leaves open, more of them for a wide range."""
    nu = np.array([node.law.nu[0] for node in ridge.nodes])
    lo, hi = float(nu.min()), float(nu.max())
    count = min(_NU_NODES + int(_NU_NODES_PER_UNIT * (hi - lo)), _MOST_NU_NODES)
    nodes = np.cos(np.pi * np.arange(count) / (count - 1))
    return np.sort((lo + hi) / 2 + (hi - lo) / 2 * nodes)
