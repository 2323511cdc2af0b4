"""Search for the series that fits tabulated holds best: ordered times, non-negative shares, amplitudes solved for.

A series is searched as (ln tau_1, ln of the ratios of neighbouring times, g_i/g_inf), which is ordered by itself.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares, nnls

from matcal.fitting.relaxation.hold_table import HoldTable
from matcal.laws.prony import Prony
from touchcal.arrays import Array

LEAST_RATIO = 2.0  # ratio that neighbouring times keep
_GRID, _PER_DECADE = 9, 2  # times from which starts are combined, at least in all and in each decade
_BEAM = 6  # combinations that are kept while they grow
_TURNS = 20  # of sizes and shares of several tests


def series_at(vector: Array) -> Prony:
    """(ln tau_1, ln of ratios, g_i/g_inf) -> series."""
    terms = vector.size // 2
    q = np.maximum(vector[terms:], 0.0)
    return Prony(q / (1 + q.sum()), np.exp(np.cumsum(vector[:terms])))


def vector_of(prony: Prony) -> Array:
    """Series -> (ln tau_1, ln of ratios, g_i/g_inf)."""
    return np.r_[np.diff(np.log(prony.tau_s), prepend=0.0), prony.g / prony.g_infinity]


def residual(tables: Sequence[HoldTable], vector: Array) -> Array:
    """Weighted residual on the bases of all tests at (ln tau_1, ln of ratios, g_i/g_inf), sizes of columns solved for.
    """
    terms = vector.size // 2
    ln_tau, share = np.cumsum(vector[:terms])[None], np.maximum(vector[terms:], 0.0)[None]
    out = []
    for table in tables:
        q = np.linalg.qr(table.unit(ln_tau, share)[0])[0]
        out.append(q @ (q.T @ table.target) - table.target)
    return np.concatenate(out)


def search_series(tables: Sequence[HoldTable], first: Array, bounds_s: tuple[float, float],
                  last: float | None = None) -> tuple[float, Array]:
    """Sum of squares and vector of the best series near `first`; ln of the longest time kept at `last` if given."""
    terms = first.size // 2
    least, most = np.log(bounds_s)
    low = np.r_[least, np.full(terms - 1, np.log(LEAST_RATIO)), np.zeros(terms)]
    high = np.r_[most, np.full(terms - 1, most - least), np.full(terms, 50.0)]

    def penalised(vector: Array) -> Array:
        end = float(np.sum(vector[:terms]))
        inside = np.r_[np.minimum(np.cumsum(vector[:terms]), most), vector[terms:]]
        held = np.r_[np.diff(inside[:terms], prepend=0.0), inside[terms:]]
        over = end - last if last is not None else max(end - most, 0.0)
        return np.r_[residual(tables, held), 1e3 * over]

    out = least_squares(penalised, np.clip(first, low, high), bounds=(low, high),
                        x_scale=np.r_[np.ones(terms), np.full(terms, 0.2)], xtol=1e-9, ftol=1e-11, max_nfev=100)
    found = np.r_[np.diff(np.minimum(np.cumsum(out.x[:terms]), most), prepend=0.0), out.x[terms:]]
    return float(np.sum(residual(tables, found) ** 2)), found


def series_with(tables: Sequence[HoldTable], times_s: Array) -> Array:
    """Vector of the best series with these times: non-negative shares alone are searched."""
    terms, ln_tau = times_s.size, np.log(times_s)
    basis = [np.column_stack([t.rest.sum(axis=1), t.slow(ln_tau).sum(axis=2).T]) for t in tables]
    scale = [float(np.linalg.norm(t.target) / np.linalg.norm(b[:, 0])) for t, b in zip(tables, basis, strict=True)]
    found = nnls(np.vstack([s * b for s, b in zip(scale, basis, strict=True)]),
                 np.concatenate([t.target * np.sign(t.target @ b[:, 0]) for t, b in zip(tables, basis, strict=True)]),
                 maxiter=100 * terms)[0]
    first = np.r_[np.diff(ln_tau, prepend=0.0), np.maximum(found[1:] / max(found[0], 1e-6 * found.sum()), 0.0)]
    if len(tables) == 1 and tables[0].rest.shape[1] == 1:
        return first
    out = least_squares(lambda q: residual(tables, np.r_[first[:terms], q]), np.clip(first[terms:], 1e-9, 1e6),
                        bounds=(0.0, np.inf), xtol=1e-9, ftol=1e-11, max_nfev=100)
    return np.r_[first[:terms], out.x]


def best_series(tables: Sequence[HoldTable], terms: int, bounds_s: tuple[float, float], hold_s: float,
                leading: Sequence[HoldTable] = ()) -> Array:
    """Vector of the best series of `terms` from the best combinations of times on a grid, by the first table or by
    those that are `leading`."""
    starts = _starts(leading or tables[:1], terms, bounds_s, hold_s)
    return min((search_series(tables, first, bounds_s) for first in starts), key=lambda pair: pair[0])[1]


def _starts(tables: Sequence[HoldTable], terms: int, bounds_s: tuple[float, float], hold_s: float,
            count: int = 3) -> list[Array]:
    """Good combinations of times on a grid, grown one time at a time, each with its non-negative shares."""
    least, most = 1.5 * bounds_s[0], 0.7 * hold_s
    grid = np.geomspace(least, max(most, 4 * least), max(_GRID, int(_PER_DECADE * np.log10(most / least)) + 1))
    columns, target = _at_one_size([_on_grid(t, grid) for t in tables], [t.target for t in tables])
    kept: list[tuple[int, ...]] = [()]
    for _ in range(terms):
        grown = sorted({tuple(sorted({*old, k})) for old in kept for k in range(grid.size) if k not in old})
        misses = [nnls(columns[:, [0, *(k + 1 for k in chosen)]], target)[1] for chosen in grown]
        kept = [grown[i] for i in np.argsort(misses, kind="stable")[:_BEAM]]
    out = []
    for chosen in kept[:count]:
        share = nnls(columns[:, [0, *(k + 1 for k in chosen)]], target)[0]
        out.append(np.r_[np.diff(np.log(grid[list(chosen)]), prepend=0.0), share[1:] / max(share[0], 1e-12)])
    return out


def _on_grid(table: HoldTable, times_s: Array) -> Array:
    """(r, 1 + t) columns of one curve, that which follows the test best without relaxation: at rest, and relaxing."""
    curve = np.linalg.lstsq(table.rest, table.target, rcond=None)[0]
    return np.column_stack([table.rest @ curve, (table.slow(np.log(times_s)) @ curve).T])


def _at_one_size(columns: Sequence[Array], targets: Sequence[Array]) -> tuple[Array, Array]:
    """Columns of all tests, each at the size at which all have the same non-negative shares, found by turns."""
    target, scaled = np.concatenate(targets), list(columns)
    for _ in range(_TURNS if len(columns) > 1 else 0):
        share = nnls(np.vstack(scaled), target)[0]
        sizes = [float(t @ (c @ share) / max((c @ share) @ (c @ share), 1e-300))
                 for c, t in zip(scaled, targets, strict=True)]
        scaled = [size / sizes[0] * c for c, size in zip(scaled, sizes, strict=True)]
    return np.vstack(scaled), target
