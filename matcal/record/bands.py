"""Stress in every mode and conductivity, each with its 95 % band, for the folder next to a card.

A band comes from the posterior's draws where there are any, otherwise from the linearised covariance of the fit. Modes
that were not fitted are given over the principal stretches that the fitted ones reached, and marked as extrapolated.
Outside the tests a nu that was assumed counts as one more standard deviation: what the law fitted with another says.
Bands are then of ln stress away from zero, for a stress that may be half as large may be twice as large.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from matcal.laws.conductivity import drawn_conductivity, outside
from matcal.laws.deformation_modes import MODES, existing, modes_of, nominal_stress
from matcal.statistics.block_means import sample_noise
from touchcal.arrays import Array

if TYPE_CHECKING:
    from matcal.fitting.conductivity_fit import ConductivityFit
    from matcal.fitting.hyperfoam.curves import Curve
    from matcal.fitting.uncertainty.intervals import Uncertainty
    from matcal.laws.law import Law
    from matcal.posterior.draws import Draws

Ranges = Mapping[str, tuple[float, float]]
# name -> column (n,) of a table
Columns = Mapping[str, NDArray[Any]]

_POINTS, _LOWEST, _HIGHEST, _LEAST_VOLUME = 81, -0.9, 3.0, 0.1  # points of each mode; strains that no band leaves


def spans(fitted: Ranges, modes: Sequence[str] = MODES) -> dict[str, tuple[float, float]]:
    """mode -> strains over which its band is given. A fitted mode has its own strains and up to a quarter of their
    width more, any other mode those of the principal stretches that the fitted ones reached; a fitted mode goes no
    further than these either."""
    least, most = _stretches(fitted)
    identical = {"shear": (0.0, max(most - 1 / most, 1 / least - least)), "volumetric": (least, max(most, 1.0))}
    out = {}
    for mode in modes:
        lo, hi = identical.get(mode, (least - 1, most - 1))
        if mode in fitted:
            low, high = fitted[mode]
            reach = 0.25 * (high - low)
            lo, hi = min(low, max(lo, low - reach)), max(high, min(hi, high + reach))
        out[mode] = max(lo, _LOWEST if mode != "volumetric" else _LEAST_VOLUME), min(hi, _HIGHEST)
    return out


def stress_bands(law: Law, source: Draws | Uncertainty, about: Uncertainty | None = None) -> Columns:
    """Rows (mode, strain, stress_Pa, stress_lo_Pa, stress_hi_Pa, extrapolated) of a long-term law in all modes, without
    those where a law near nu = 0.5 has no finite stress, or where free faces find no place. `about` says what an
    assumed nu hides outside the tests."""
    tables = []
    for mode, span in spans(law.strain_range, modes_of(law)).items():
        strain = np.unique(np.r_[np.linspace(*span, _POINTS), 1.0 if mode == "volumetric" else 0.0])
        strain = strain[existing(law, mode, strain)]
        stress, low, high, outer = band_in(law, mode, strain, source, about)
        table = {"mode": np.full(strain.size, mode), "strain": strain, "stress_Pa": stress, "stress_lo_Pa": low,
                 "stress_hi_Pa": high, "extrapolated": outer}
        finite = np.isfinite(stress) & np.isfinite(low) & np.isfinite(high)
        tables.append({name: column[finite] for name, column in table.items()})
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


def band_in(law: Law, mode: str, strain: Array, source: Draws | Uncertainty, about: Uncertainty | None = None
            ) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Stress of one mode at strains (n,), the ends of its band, all (n,), Pa, and which rows lie outside the tests."""
    lo, hi = law.strain_range.get(mode, (np.inf, -np.inf))
    outer = (strain < lo) | (strain > hi)
    with np.errstate(over="ignore", invalid="ignore"):
        stress, ends = nominal_stress(law, mode, strain), _band(source, mode, strain)
        if about is not None and about.other_nu is not None:
            ends = with_other_nu(stress, ends, nominal_stress(about.other_nu, mode, strain), about.reach, outer)
    return stress, *ends, outer


def with_other_nu(stress: Array, ends: tuple[Array, Array], other: Array, reach: float,
                  outer: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Ends (n,) of a band about a stress, Pa, those of rows `outer` wider by `reach` times what the law of another nu
    changes; away from zero these are normal in ln stress, x of the stress at one standard deviation being (1 + x)^reach
    at `reach` of them."""
    more, size = reach * np.abs(other - stress), np.maximum(np.abs(stress), np.finfo(float).tiny)
    low, high = np.minimum(*ends), np.maximum(*ends)
    below, above = np.hypot(stress - low, more), np.hypot(high - stress, more)
    further = size * np.expm1(reach * np.log1p(np.where(stress < 0, below, above) / (reach * size)))
    return (np.where(outer, stress - np.where(stress < 0, further, below), low),
            np.where(outer, stress + np.where(stress < 0, above, further), high))


def share_inside(curve: Curve, law: Law, source: Draws | Uncertainty) -> float:
    """Share of a curve's measured points within the 95 % band of the law along the curve's own history, that band being
    as much wider as 95 % of the noise of single points."""
    experiment = curve.experiment
    strain, value = experiment.strain, experiment.value
    noise = 1.96 * sample_noise(value, 4) + 1e-9 * float(np.abs(value).max())
    longterm, own = nominal_stress(law, experiment.kind, strain), curve.model(law)
    ends = np.stack(_band(source, experiment.kind, strain)) * np.divide(own, longterm, np.ones_like(own),
                                                                        where=longterm != 0)
    return float(np.mean((value >= ends.min(axis=0) - noise) & (value <= ends.max(axis=0) + noise)))


def _band(source: Draws | Uncertainty, mode: str, strain: Array) -> tuple[Array, Array]:
    from matcal.posterior.drawn_laws import stress_band
    from matcal.posterior.draws import Draws

    return stress_band(source, mode, strain) if isinstance(source, Draws) else _linear_band(source, mode, strain)


def conductivity_band(fit: ConductivityFit, draws: Draws | None) -> Columns:
    """Rows (strain, conductivity_S_per_m, its _lo and _hi, extrapolated) from deep compression to the data's end."""
    from matcal.fitting.conductivity_fit import LOWEST_STRAIN
    from matcal.fitting.conductivity_laws import others, values_of
    from matcal.posterior.conductivity_posterior import conductivity_draws

    law = fit.law
    strain = np.linspace(LOWEST_STRAIN, max(law.strain_range[1], 0.0), _POINTS)
    drawn = draws.conductivity_S_per_m if draws is not None else None
    if drawn is None:
        drawn = conductivity_draws(fit, 400, np.random.default_rng(0))
    low, high = np.quantile(drawn_conductivity(law.kind, drawn, strain), [0.025, 0.975], axis=0)
    outer = outside(law, strain)
    ends = [(value, value) for value in values_of(others(map(asdict, fit.compared), law.kind), strain)]
    if fit.cubic is not None:
        own = conductivity_band(fit.cubic, None)
        ends.append((own["conductivity_lo_S_per_m"], own["conductivity_hi_S_per_m"]))
    for least, most in ends:  # outside the tests, of the cubic and of all that count
        low, high = np.where(outer, np.minimum(low, least), low), np.where(outer, np.maximum(high, most), high)
    return {"strain": strain, "conductivity_S_per_m": values_of([law], strain)[0], "conductivity_lo_S_per_m": low,
            "conductivity_hi_S_per_m": high, "extrapolated": outer}


def conductivity_at(band: Any, strain: float) -> tuple[float, float, float]:
    """Conductivity and the ends of its band, S/m, at a strain, linear between the rows of `conductivity_band`."""
    columns = ("conductivity_S_per_m", "conductivity_lo_S_per_m", "conductivity_hi_S_per_m")
    value, low, high = (float(np.interp(strain, band["strain"], band[name])) for name in columns)
    return value, low, high


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


def _linear_band(about: Uncertainty, mode: str, strain: Array) -> tuple[Array, Array]:
    """Ends of the band, Pa, from the covariance of (mu, alpha), and from what one more term would change."""
    from matcal.fitting.uncertainty.intervals import intervals

    found = intervals(about, lambda law: {str(k): float(s) for k, s in enumerate(nominal_stress(law, mode, strain))})
    return np.array([row.lo for row in found.values()]), np.array([row.hi for row in found.values()])
