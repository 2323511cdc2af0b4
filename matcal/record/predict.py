"""What a card predicts in each mode, with the band of its draws, and where its law is stable."""

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from matcal.card import MaterialCard, as_card, require, with_moduli
from matcal.fitting.conductivity_laws import others, values_of
from matcal.laws.conductivity import conductivity, outside
from matcal.laws.deformation_modes import MODES, nominal_stress
from matcal.laws.histories.strain_paths import follow
from matcal.laws.histories.time_temperature import decades
from matcal.laws.known_laws import law_of
from matcal.laws.prony import Prony, relaxation
from matcal.laws.stability import stability
from matcal.posterior.draws import Draws, card_of, quantiles, read_draws
from matcal.record.bands import with_other_nu

PREDICTED = (*MODES, "relaxation", "conductivity")


def predict(card: MaterialCard | Path | str, mode: str, at: ArrayLike, *,
            temperature_C: float | None = None) -> dict[str, Any]:
    """Nominal stress, relaxation or conductivity of a card, with the 95 % band of its draws.

    Stress is that of the card's own moduli, without any loading history; a mode that was not fitted is extrapolated
    throughout.

    Parameters
    ----------
    card
        A card or its file, next to which the draws of its posterior lie.
    mode
        One of `PREDICTED`: uniaxial, biaxial, planar, shear, volumetric, relaxation, conductivity.
    at
        (n,) nominal strains (gamma in shear, J in volumetric), or times in s for relaxation.
    temperature_C
        Of a relaxation, by the shift that the card has; None: the temperature of its series.

    Returns
    -------
    dict
        Columns (n,): `strain` or `time_s`; `stress_Pa`, `normalised_stress` or `conductivity_S_per_m`, with `_lo` and
        `_hi` where the card has draws; for conductivity the least and the largest of the cubic and of the laws that
        predict a part of the tests about as well as the best; `extrapolated`, whether a row lies outside what was
        fitted, where the card says what that was. For stress also `moduli`, a word.

    Raises
    ------
    ValueError
        For an unknown mode, where the card lacks the part, or where the law gives no finite value.

    Examples
    --------
    >>> import matcal
    >>> card = matcal.MaterialCard("foam", matcal.Hyperfoam([12e3], [2.0], [0.0]))
    >>> matcal.predict(card, "uniaxial", [-0.5])["stress_Pa"].round()
    array([-18000.])
    """
    check_mode(mode)
    card, at = as_card(card), np.array(at, dtype=float, ndmin=1)
    if temperature_C is not None:
        card = at_temperature(card, mode, temperature_C)
    if mode == "relaxation":
        require(card, "prony", "a relaxation")
        where, name, stem = "time_s", "normalised_stress", "normalised_stress{}"
    elif mode == "conductivity":
        require(card, "conductivity", "a conductivity")
        where, name, stem = "strain", "conductivity_S_per_m", "conductivity{}_S_per_m"
    else:
        require(card, "law", "a stress")
        where, name, stem = "strain", "stress_Pa", "stress{}_Pa"
    with np.errstate(over="ignore", invalid="ignore"):
        columns: dict[str, Any] = {where: at, name: _value(card, mode, at)}
    if not np.all(np.isfinite(columns[name])):
        raise ValueError(f"{where} {at[~np.isfinite(columns[name])][0]:g}: the law gives no finite {name} there. Stay "
                         "near what was fitted.")
    draws = _draws(card)
    if draws is not None and _drawn(draws, name):
        low, high = quantiles(lambda k: _value(card_of(draws, card, k), mode, at), len(draws))
        if name == "stress_Pa":
            low, high = _over_nu(card, mode, columns, (low, high))
        columns |= {stem.format("_lo"): low, stem.format("_hi"): high}
    elif name == "stress_Pa" and (band := laws_band(card, mode, at)) is not None:
        columns |= {"stress_lo_Pa": band[0], "stress_hi_Pa": band[1]}
    if (skin := card.conductivity) and mode == "conductivity" and (
            rows := others(card.fit.get("conductivity", {}).get("laws", ()), skin.kind, cubic=True)):
        each = [columns[name], *values_of(rows, at)]
        columns |= {"lowest_of_laws_S_per_m": np.min(each, axis=0), "highest_of_laws_S_per_m": np.max(each, axis=0)}
    if (rows := _extrapolated(card, mode, at)) is not None:
        columns["extrapolated"] = rows
    if card.law is not None and name == "stress_Pa":
        columns["moduli"] = card.law.moduli
    return columns


def follow_path(card: MaterialCard | Path | str, mode: str, strain: ArrayLike,
                time_s: ArrayLike | None = None) -> dict[str, Any]:
    """Nominal stress of a card along a path of loading and unloading from rest.

    The law relaxes by the card's series where there are times, and is softened by the path itself where the card has a
    softening.

    Parameters
    ----------
    card
        A card with a law, or its file.
    mode
        uniaxial, biaxial, planar or shear.
    strain
        (n,) nominal strains in order, compression negative (gamma in shear).
    time_s
        (n,) times, s, that do not decrease; None: without relaxation, with the card's own moduli.

    Returns
    -------
    dict
        Columns (n,): `time_s` where given, `strain`, `stress_Pa`.

    Raises
    ------
    ValueError
        For an unknown mode, the volumetric one, times that do not match, or a card without a law.

    Examples
    --------
    >>> import matcal
    >>> soft = matcal.Damage(r=2.0, m_Pa=100.0)
    >>> card = matcal.MaterialCard("foam", matcal.Hyperfoam([12e3], [2.0], [0.0]), softening=soft)
    >>> matcal.follow_path(card, "uniaxial", [0.0, -0.25, -0.5, -0.25])["stress_Pa"].round()
    array([     0.,  -7000., -18000.,  -3500.])
    """
    card, strain = as_card(card), np.array(strain, dtype=float, ndmin=1)
    if mode not in MODES:
        raise ValueError(f"mode '{mode}' has no path; known: {', '.join(m for m in MODES if m != 'volumetric')}.")
    law, prony = require(card, "law", "a path"), card.prony if time_s is not None else None
    if prony is not None:
        law = with_moduli(card, "instantaneous")
    out = {} if time_s is None else {"time_s": np.array(time_s, dtype=float, ndmin=1)}
    stress = follow(law, mode, strain, card.softening, out.get("time_s"), prony)
    return {**out, "strain": strain, "stress_Pa": stress}


def at_temperature(card: MaterialCard, mode: str, temperature_C: float) -> MaterialCard:
    """The card with the times of its series, and those that were seen, as they are at another temperature."""
    if mode != "relaxation":
        raise ValueError(f"`temperature` {temperature_C:g}: a card shifts the times of a relaxation, not a {mode}. "
                         "Leave it out.")
    prony = require(card, "prony", "a relaxation")
    factor = 10 ** float(decades(require(card, "shift", "another temperature"), temperature_C + 273.15))
    found = dict(card.fit.get("prony", {}))
    if "seen_s" in found:
        found["seen_s"] = [factor * t for t in found["seen_s"]]
    return replace(card, prony=Prony(prony.g, factor * prony.tau_s), fit={**card.fit, "prony": found})


def laws_band(card: MaterialCard, mode: str, at: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Ends of the band over all laws that were compared for the card, Pa; None where it holds none."""
    rows = card.fit.get("laws")
    if not rows or card.law is None:
        return None
    from matcal.fitting.law_ranking import Ranked, band_over

    laws = [Ranked(law_of(row["law"], [np.ravel(value).tolist() for value in row["parameters"].values()]),
                   np.array(row["covariance"], dtype=float), row["fitted"], row["predicted"], (), (), row["weight"])
            for row in rows]
    return band_over(laws, mode, at)


def _over_nu(card: MaterialCard, mode: str, columns: Mapping[str, Any], ends: tuple[np.ndarray, np.ndarray]
             ) -> tuple[np.ndarray, np.ndarray]:
    """Ends of a band of stress, wider outside the tests where the card's nu was assumed."""
    outer = _extrapolated(card, mode, columns["strain"])
    if (kept := card.fit.get("other_nu")) is None or outer is None or card.law is None:
        return ends
    other = nominal_stress(law_of(card.law.name, kept["parameters"]), mode, columns["strain"])
    return with_other_nu(columns["stress_Pa"], ends, other, kept["reach"], outer)


def check(card: MaterialCard | Path | str) -> dict[str, Any]:
    """Where along each mode the card's law is not Drucker stable or loses ellipticity.

    Parameters
    ----------
    card
        A card with a hyperelastic law, or its file.

    Returns
    -------
    dict
        Criterion -> mode -> {stable, unstable_strain [[lo, hi], ...], scanned [lo, hi]}; `data`: what the fitted
        records themselves say, a list, where the card holds it.

    Raises
    ------
    ValueError
        Where the card has no hyperelastic law.

    Examples
    --------
    >>> import matcal
    >>> card = matcal.MaterialCard("foam", matcal.Hyperfoam([12e3], [2.0], [0.0]))
    >>> matcal.check(card)["drucker"]["uniaxial"]["stable"]
    True
    """
    card = as_card(card)
    found = stability(require(card, "law", "a stability check"))
    data = card.fit.get("data_stability", [])
    return found | ({"data": data} if data else {})


def check_mode(mode: str) -> None:
    """ValueError for a mode that no card predicts."""
    if mode not in PREDICTED:
        raise ValueError(f"mode '{mode}' is unknown; known: {', '.join(PREDICTED)}.")


def fitted_range(card: MaterialCard, mode: str) -> tuple[float, float] | None:
    """Strains, or times in s for relaxation, over which a mode was fitted; None where the card does not say."""
    if mode == "relaxation":
        if seen := card.fit.get("prony", {}).get("seen_s"):
            return float(seen[0]), float(seen[1])
        ends = [row["time_s"] for row in card.fit.values()
                if isinstance(row, Mapping) and row.get("kind") == "relaxation" and row.get("time_s") is not None]
        return (0.0, max(ends)) if ends else None
    if mode == "conductivity":
        return card.conductivity.strain_range if card.conductivity is not None else None
    return card.law.strain_range.get(mode) if card.law is not None else None


def beyond(card: MaterialCard, mode: str, columns: Mapping[str, Any]) -> list[str]:
    """One sentence where rows of `predict` lie outside what was fitted: how many, and by how much."""
    outside_it = columns.get("extrapolated")
    if outside_it is None or not np.any(outside_it):
        return []
    rows = f"{np.sum(outside_it)} of {outside_it.size} rows are extrapolated"
    ends = fitted_range(card, mode)
    if ends is None:
        return [f"{rows}: no {mode} test was fitted; the law says this from {', '.join(_fitted_modes(card))} alone. "
                f"Compare with a test: matcal fit ... --predict {mode}=FILE."]
    at = columns["time_s" if mode == "relaxation" else "strain"]
    far = max(ends[0] - at.min(), at.max() - ends[1])
    unit = " s" if mode == "relaxation" else ""
    return [f"{rows}: fitted from {ends[0]:.4g} to {ends[1]:.4g}{unit}, the farthest is {far:.3g}{unit} outside."]


def _fitted_modes(card: MaterialCard) -> list[str]:
    return [*card.law.strain_range] if card.law is not None else []


def _extrapolated(card: MaterialCard, mode: str, at: np.ndarray) -> np.ndarray | None:
    """(n,) whether a row lies outside what was fitted; None where the card does not say what was."""
    if mode == "conductivity":
        return outside(card.conductivity, at) if card.conductivity is not None else None
    low, high = fitted_range(card, mode) or (np.inf, -np.inf)
    said = low < high or (mode in MODES and bool(_fitted_modes(card)))
    return (at < low) | (at > high) if said else None


def _drawn(draws: Draws, name: str) -> bool:
    """Whether the draws hold the part that a prediction is made of."""
    part = {"stress_Pa": draws.law or None, "normalised_stress": draws.g,
            "conductivity_S_per_m": draws.conductivity_S_per_m}
    return part[name] is not None


def _value(card: MaterialCard, mode: str, at: np.ndarray) -> np.ndarray:
    if mode == "relaxation" and card.prony is not None:
        return relaxation(card.prony, at)
    if mode == "conductivity" and card.conductivity is not None:
        return conductivity(card.conductivity, at)
    assert card.law is not None
    return nominal_stress(card.law, mode, at)


def _draws(card: MaterialCard) -> Draws | None:
    """The card's draws; None without a posterior, or, said on standard error, without its file."""
    if not card.posterior:
        return None
    if not card.posterior.get("checks", {}).get("converged", True):
        print("matcal: the card's posterior did not converge; do not use its band.", file=sys.stderr)
    try:
        return read_draws(card)
    except ValueError as error:
        print(f"matcal: no band. {error}", file=sys.stderr)
        return None
