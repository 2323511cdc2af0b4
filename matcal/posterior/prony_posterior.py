"""The series' part of the posterior: ln tau, g and the noise sampled, sizes and doubtful numbers integrated out.

Each compared stress is sum_k A_k w (g_inf S_0k + sum g_i D_k(tau_i)) + V z + e, linear in the sizes A of the columns of
the instantaneous curve (`matcal.fitting.relaxation.instantaneous_curve`) and in what the test doubts of itself (contact
point, load drift), z ~ N(0, 1). Given the series the sizes have a flat prior over the stress that they make, so that no
series is favoured for the scale or the number of its columns.
"""

from dataclasses import dataclass

import numpy as np

from matcal.fitting.relaxation.hold_table import HoldTable
from matcal.fitting.relaxation.prony_search import LEAST_RATIO, residual, vector_of
from matcal.fitting.relaxation.relaxation_fit import PronyFit
from matcal.statistics.linear_marginals import log_marginal, triangles
from touchcal.arrays import Array

_HELD = 1e-2  # precision that holds a size where no record sees it, over that of a size as large as the fitted ones


@dataclass(frozen=True)
class SeriesPart:
    """Everything that one evaluation of the series' part needs."""

    tables: tuple[HoldTable, ...]  # tests on their bases, with the effects of what they doubt
    sizes: tuple[Array, ...]  # (K,) scale of the sizes of each test
    bounds: tuple[float, float]  # ln of the shortest and longest time
    terms: int  # number of terms
    count: float  # residuals
    effective_sample_size: float  # the independent ones that they are worth

    @property
    def size(self) -> int:
        """Sampled numbers: ln tau, g, ln of the noise over the stated one."""
        return 2 * self.terms + 1


def series_part(prony: PronyFit) -> SeriesPart:
    """Tables of the tests that a series was fitted to."""
    tables = prony.tables()
    count = float(sum(t.basis.shape[0] for t in tables))
    low, high = np.log(prony.bounds_s)
    sizes = tuple(np.full(c.size, np.abs(c).max()) for c in prony.sizes)
    return SeriesPart(tables, sizes, (float(low), float(high)), prony.prony.g.size, count,
                      min(prony.effective_sample_size, count))


def log_series(part: SeriesPart, x: Array, share: float = 1.0) -> Array:
    """(W,) log density at (ln tau, g, ln noise) (W, size), sizes and doubts integrated out."""
    m = part.terms
    ln_tau, g, ln_noise = x[:, :m], x[:, m:2 * m], x[:, -1]
    inside = (ln_tau[:, 0] > part.bounds[0]) & (ln_tau[:, -1] < part.bounds[1]) & (np.abs(ln_noise) < 15)
    inside &= np.all(np.diff(ln_tau, axis=1) >= np.log(LEAST_RATIO), axis=1)
    inside &= np.all(g >= 0, axis=1) & (g.sum(axis=1) < 1)
    out = np.full(x.shape[0], -np.inf)
    if inside.any():
        y = x[inside]
        taken = sum(c.size for c in part.sizes)  # points that the sizes take up, on top of those left to judge by
        effective = min(part.effective_sample_size + taken, part.count)
        precision = np.exp(-y[:, -1]) * np.sqrt(share * effective / part.count)
        out[inside] = -share * part.effective_sample_size * y[:, -1]
        for table, sizes in zip(part.tables, part.sizes, strict=True):
            r = _triangles(table, sizes, y[:, :m], y[:, m:2 * m], precision)
            diagonal = np.abs(np.einsum("wkk->wk", r)[:, :sizes.size])
            out[inside] += log_marginal(r) + np.log(diagonal).sum(axis=1)
    return out


def start_series(part: SeriesPart, prony: PronyFit) -> Array:
    """(size,) the fit in the coordinates that are sampled."""
    vector = vector_of(prony.prony)
    miss = residual(part.tables, vector)
    noise = max(float(np.sqrt(miss @ miss / part.count)), 1e-6)
    return np.r_[np.log(prony.prony.tau_s), prony.prony.g, np.log(noise)]


def prior_words(part: SeriesPart) -> str:
    """The prior of everything in the series' part."""
    low, high = np.exp(part.bounds)
    return (f"ln tau uniform between {low:.3g} and {high:.3g} s, in order, at ratios of {LEAST_RATIO:g} at least; g "
            f"uniform over g_i >= 0 with a sum below 1; sizes of the instantaneous curve flat over the stress that "
            f"they make; ln of their noise flat; {part.effective_sample_size:.0f} effective points in the holds")


def _triangles(table: HoldTable, sizes: Array, ln_tau: Array, g: Array, precision: Array) -> Array:
    share = g / (1 - g.sum(axis=1, keepdims=True))
    unit = sizes * (1 - g.sum(axis=1))[:, None, None] * table.unit(ln_tau, share)
    doubt = np.broadcast_to(table.more, (g.shape[0], *table.more.shape))
    columns = np.concatenate([unit, doubt], axis=2) * precision[:, None, None]
    width = columns.shape[2]
    root = np.r_[np.full(sizes.size, _HELD), np.ones(width - sizes.size)]
    return triangles(columns, precision[:, None] * table.target, root, np.zeros(width))
