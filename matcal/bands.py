"""Stress in every mode and conductivity, each with its 95 % band, for the folder beside a card.

A band comes from the posterior's draws where there are any, otherwise from the linearised covariance of the fit. Modes
that were not fitted are given over the principal stretches that the fitted ones reached, and marked as extrapolated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from matcal.conductivity import outside
from matcal.modes import MODES, nominal_stress

if TYPE_CHECKING:
    from matcal.conductivity_fit import ConductivityFit
    from matcal.draws import Draws
    from matcal.hyperfoam import Hyperfoam
    from matcal.uncertainty import Uncertainty

Array = NDArray[np.float64]
Ranges = Mapping[str, tuple[float, float]]

# points of each mode; strains that no band leaves
_POINTS, _LOWEST, _HIGHEST = 81, -0.9, 3.0


def spans(fitted: Ranges) -> dict[str, tuple[float, float]]:
    """mode -> strains over which its band is given: those fitted in it and those of equal principal stretch."""
    least, most = _stretches(fitted)
    alike = {"shear": (0.0, max(most - 1 / most, 1 / least - least)), "volumetric": (least, max(most, 1.0))}
    out = {}
    for mode in MODES:
        lo, hi = alike.get(mode, (least - 1, most - 1))
        own = fitted.get(mode, (lo, hi))
        out[mode] = max(min(lo, own[0]), _LOWEST), min(max(hi, own[1]), _HIGHEST)
    return out


def stress_bands(law: Hyperfoam, uncertainty: Uncertainty, wider: Hyperfoam | None,
                 draws: Draws | None) -> pd.DataFrame:
    """Rows (mode, strain, stress_Pa, stress_lo_Pa, stress_hi_Pa, extrapolated) of a long-term law in all modes."""
    from matcal.draws import stress_band

    tables = []
    for mode, span in spans(law.strain_range).items():
        strain = _grid(mode, span)
        stress = nominal_stress(law, mode, strain)
        low, high = (stress_band(draws, mode, strain) if draws is not None else
                     _linear_band(law, uncertainty, wider, mode, strain))
        lo, hi = law.strain_range.get(mode, (np.inf, -np.inf))
        tables.append(pd.DataFrame({"mode": mode, "strain": strain, "stress_Pa": stress, "stress_lo_Pa": low,
                                    "stress_hi_Pa": high, "extrapolated": (strain < lo) | (strain > hi)}))
    return pd.concat(tables, ignore_index=True)


def conductivity_band(fit: ConductivityFit, draws: Draws | None) -> pd.DataFrame:
    """Rows (strain, conductivity_S_per_m, its _lo and _hi, extrapolated) from deep compression to the data's end."""
    from matcal.conductivity_fit import LOWEST_STRAIN, conductivity_draws, powers

    law = fit.law
    strain = np.linspace(LOWEST_STRAIN, max(law.strain_range[1], 0.0), _POINTS)
    drawn = draws.conductivity_S_per_m if draws is not None else None
    if drawn is None:
        drawn = conductivity_draws(fit, 400, np.random.default_rng(0))
    low, high = np.quantile(powers(strain) @ drawn.T, [0.025, 0.975], axis=1)
    middle = powers(strain) @ (law.c0_S_per_m * np.r_[1.0, law.a])
    return pd.DataFrame({"strain": strain, "conductivity_S_per_m": middle, "conductivity_lo_S_per_m": low,
                         "conductivity_hi_S_per_m": high, "extrapolated": outside(law, strain)})


def _stretches(fitted: Ranges) -> tuple[float, float]:
    """Least and largest principal stretch that the fitted modes reached."""
    ends: list[float] = [1.0]
    for mode, (lo, hi) in fitted.items():
        if mode == "shear":
            gamma = max(abs(lo), abs(hi))
            most = gamma / 2 + np.hypot(1.0, gamma / 2)
            ends += [most, 1 / most]
        else:
            ends += [lo ** (1 / 3), hi ** (1 / 3)] if mode == "volumetric" else [1 + lo, 1 + hi]
    return min(ends), max(ends)


def _grid(mode: str, span: tuple[float, float]) -> Array:
    """Strains over a span, the state of rest among them."""
    rest = 1.0 if mode == "volumetric" else 0.0
    return np.unique(np.r_[np.linspace(*span, _POINTS), rest])


def _linear_band(law: Hyperfoam, uncertainty: Uncertainty, wider: Hyperfoam | None, mode: str,
                 strain: ArrayLike) -> tuple[Array, Array]:
    """Ends of the band, Pa, from the covariance of (mu, alpha), and from what one more term would change."""
    stress, slopes = nominal_stress(law, mode, strain), _slopes(law, mode, strain)
    form = 0.0 if wider is None else nominal_stress(wider, mode, strain) - stress
    sd = np.sqrt(np.einsum("in,ij,jn->n", slopes, uncertainty.covariance, slopes).clip(0) + form**2)
    known = uncertainty.derived["mu_0_Pa"]
    half = (known.hi - known.lo) / (2 * known.sd) * sd
    return stress - half, stress + half


def _slopes(law: Hyperfoam, mode: str, strain: ArrayLike) -> Array:
    """(2 N, n) slopes of the stress in (mu, alpha), by central differences."""
    n = law.mu_Pa.size
    steps = np.diag(np.r_[np.full(n, 1e-4 * law.mu_0_Pa), np.full(n, 1e-5)])

    def at(step: Array) -> Array:
        return nominal_stress(replace(law, mu_Pa=law.mu_Pa + step[:n], alpha=law.alpha + step[n:]), mode, strain)

    return np.stack([(at(row) - at(-row)) / (2 * row.max()) for row in steps])
