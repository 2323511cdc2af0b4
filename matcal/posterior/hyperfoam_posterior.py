"""The law's part of the posterior: exponents and noise sampled, moduli and nuisances integrated out.

y = A(alpha) mu + V z + e, over the curves' scales, is linear in the moduli mu ~ N(0, (100 mu_0)^2) and in the nuisances
z (contact points, load drifts, stiffness factors of specimens). A shared nu that was fitted is sampled too, on designs
tabulated for a few values of it. Scatter that a file states widens the draws about the fit and is not inferred: each
draw's moduli answer to records moved along it, so that misfit does not choose where in it the law lies. With a
relaxation test the rate effect follows the sampled series exactly in its times and fractions, as that of the fitted law
scaled with the sampled one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BarycentricInterpolator, CubicSpline

from matcal.fitting.hyperfoam.curves import Curve, of_mean_foam, weighted_model
from matcal.fitting.hyperfoam.design_table import Table, tabulate
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, allowed_exponents
from matcal.fitting.hyperfoam.poisson import lateral_cost
from matcal.fitting.hyperfoam.specimen_factors import PRIOR_OMEGA, specimens
from matcal.fitting.hyperfoam.variable_projection import Exponents
from matcal.fitting.relaxation.relaxation_fit import PronyFit
from matcal.fitting.uncertainty.linear_response import PRIOR_MODULI
from matcal.fitting.uncertainty.nu_ridge import Ridge
from matcal.fitting.uncertainty.nuisance import nuisance
from matcal.laws.deformation_modes import push_forward, second_piola
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony, decaying
from matcal.statistics.linear_marginals import conditional, log_marginal, triangles
from touchcal.arrays import Array

_NU_NODES, _NU_NODES_PER_UNIT, _MOST_NU_NODES = 5, 40, 25  # values of nu that are tabulated, more for a wide range
_PER_DECADE = 12  # relaxation times, in each decade, at which the rate effect is tabulated


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


def law_part(fit: Fit, points: float, prony: PronyFit | None, ridge: Ridge | None = None) -> LawPart:
    """Tables of a fit whose residuals are worth `points`, and of the nu along the ridge that it leaves open; ValueError
    for a law with unequal nu."""
    fit = replace(fit, curves=tuple(of_mean_foam(c) for c in fit.curves))  # factors are drawn, not taken
    law = fit.law
    if np.ptp(law.nu) > 0:
        raise ValueError(f"--posterior is built for one nu for all terms, the law has {law.nu.tolist()}. Use --poisson "
                         "fit or one value.")
    known, differ = nuisance(fit), specimens(fit.curves, law)
    nu = law.nu[:1] if ridge is None else _nu_nodes(ridge)
    allowed = allowed_exponents(fit.curves, float(law.nu[0]))
    times, rate = _rate_effect(fit.curves, law, prony)
    more = np.column_stack([known.effect, differ.stated, differ.factor, weighted_model(fit.curves, law)[:, None], rate])
    tables = _tables(fit, nu, (allowed.low, allowed.high), more)
    basis = tables[0].basis
    held = basis.T @ rate
    spline = CubicSpline(np.log(times), held.T) if prony is not None and np.any(rate) else None
    fitted_rate = series_effect(spline, np.log(prony.prony.tau_s)[None], prony.prony.g[None])[0] \
        if spline is not None and prony is not None else np.zeros(basis.shape[1])
    lateral = None
    if ridge is not None and any(c.experiment.lateral is not None for c in fit.curves):
        grid = np.linspace(nu.min(), nu.max(), 33)
        lateral = CubicSpline(grid, [lateral_cost(fit.curves, Hyperfoam(np.ones(1), np.ones(1), np.full(1, v)))
                                     for v in grid])
    factor = basis.T @ differ.factor @ _contrasts(differ.factor.shape[1])
    return LawPart(tables, nu, lateral, basis.T @ known.effect, known.mean, basis.T @ differ.stated, factor, spline,
                   fitted_rate, basis.T @ weighted_model(fit.curves, law), allowed, law.alpha.size, law.mu_0_Pa, points,
                   differ.decisions)


def log_law(part: LawPart, x: Array, ln_tau: Array | None, g: Array | None, share: float = 1.0) -> Array:
    """(W,) log density at (alpha, ln sigma, nu?, ln omega?) (W, size), moduli and nuisances integrated out, for series
    with (W, M) ln_tau and g; `share` of the points is counted."""
    alpha = x[:, :part.order]
    inside = (alpha[:, 0] > part.allowed.low) & (alpha[:, -1] < part.allowed.high)
    inside &= np.all(np.diff(alpha, axis=1) >= part.allowed.gap, axis=1) & (np.abs(x[:, part.order]) < 20)
    if part.nu.size > 1:
        inside &= (x[:, part.order + 1] > part.nu.min()) & (x[:, part.order + 1] < part.nu.max())
    if part.factor.shape[1]:
        inside &= (x[:, -1] > -12) & (x[:, -1] < 2)
    out = np.full(x.shape[0], -np.inf)
    if inside.any():
        series = (None, None) if ln_tau is None or g is None else (ln_tau[inside], g[inside])
        y, points = x[inside], share * part.effective_sample_size
        out[inside] = log_marginal(_triangles(part, y, *series, points)) - points * y[:, part.order]
        if part.lateral is not None:
            out[inside] -= 0.5 * points * part.lateral(y[:, part.order + 1]) * np.exp(-2 * y[:, part.order])
        if part.factor.shape[1]:
            out[inside] += y[:, -1] - 0.5 * np.exp(2 * y[:, -1]) / PRIOR_OMEGA**2
    return out


def draw_law(part: LawPart, x: Array, ln_tau: Array | None, g: Array | None,
             rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Moduli (Pa) and exponents (W, N), nu (W,) and omega (W,), 0 without replicates, at sampled points."""
    moved = rng.standard_normal((x.shape[0], part.stated.shape[1])) @ part.stated.T
    solved = conditional(_triangles(part, x, ln_tau, g, part.effective_sample_size, moved), rng)
    nu = x[:, part.order + 1] if part.nu.size > 1 else np.full(x.shape[0], part.nu[0])
    omega = np.exp(x[:, -1]) if part.factor.shape[1] else np.zeros(x.shape[0])
    common = omega / np.sqrt(part.factor.shape[1] + 1) * rng.standard_normal(x.shape[0])
    return solved[:, :part.order] * part.mu_0_Pa * np.exp(-common)[:, None], x[:, :part.order], nu, omega


def start_law(part: LawPart, fit: Fit) -> Array:
    """(size,) the fit in the coordinates that are sampled."""
    alpha = fit.law.alpha + 0.01 * np.arange(part.order)
    more = ([float(fit.law.nu[0])] if part.nu.size > 1 else []) + ([np.log(0.05)] if part.factor.shape[1] else [])
    return np.r_[alpha, 0.5 * np.log(max(fit.optimum.cost, 1e-14)), more]


def prior_words(part: LawPart) -> str:
    """The prior of everything in the law's part."""
    a = part.allowed
    words = [f"alpha uniform between {a.low:.3g} and {a.high:.3g}, in order, at distances of {a.gap:.2g} at least",
             f"mu_i normal about 0 with {PRIOR_MODULI:g} mu_0, mu_0 positive", "ln sigma flat",
             "contact points, load zeros and drifts normal with their own errors"]
    if part.stated.shape[1]:
        words.append("stated scatter normal, about the fit, not inferred")
    if part.nu.size > 1:
        words.append(f"nu uniform between {part.nu.min():.3g} and {part.nu.max():.3g}")
    if part.factor.shape[1]:
        words.append(f"ln of the specimens' stiffness normal with omega, omega half-normal with {PRIOR_OMEGA:g}")
    return "; ".join(words) + f"; {part.effective_sample_size:.0f} effective points"


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


def _contrasts(count: int) -> Array:
    """(S, S - 1) orthonormal differences of S numbers. What S factors have in common scales the law and nothing else:
    no test sees it, it is independent of the differences, and it is drawn from its prior."""
    if not count:
        return np.zeros((0, 0))
    return np.linalg.qr(np.column_stack([np.ones(count), np.eye(count)[:, 1:]]))[0][:, 1:]


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


def _rate_effect(curves: Sequence[Curve], law: Hyperfoam, prony: PronyFit | None) -> tuple[Array, Array]:
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
