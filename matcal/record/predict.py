"""What a card predicts in each mode, with the band of its draws."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from matcal.card import MaterialCard, require
from matcal.laws.conductivity import conductivity, outside
from matcal.laws.deformation_modes import MODES, nominal_stress
from matcal.laws.prony import relaxation
from matcal.posterior.draws import Draws, card_of, quantiles, read_draws

PREDICTED = (*MODES, "relaxation", "conductivity")


def prediction(card: MaterialCard, path: Path, mode: str, at: np.ndarray) -> dict[str, Any]:
    """Columns of a prediction at strains or times (n,), with the 95 % band of the card's draws beside its `path`, and
    which rows lie outside what was fitted, where the card says what that was.

    Stress is that of the card's own moduli, without any loading history; a mode that was not fitted is extrapolated
    throughout. ValueError where the card lacks the part.
    """
    if mode == "relaxation":
        require(card, "prony", "a relaxation")
        where, name, stem = "time_s", "normalised_stress", "normalised_stress{}"
    elif mode == "conductivity":
        require(card, "conductivity", "a conductivity")
        where, name, stem = "strain", "conductivity_S_per_m", "conductivity{}_S_per_m"
    else:
        require(card, "hyperfoam", "a stress")
        where, name, stem = "strain", "stress_Pa", "stress{}_Pa"
    columns: dict[str, Any] = {where: at, name: _value(card, mode, at)}
    draws = _draws(card, path)
    if draws is not None and _drawn(draws, name):
        low, high = quantiles(lambda k: _value(card_of(draws, card, k), mode, at), len(draws))
        columns |= {stem.format("_lo"): low, stem.format("_hi"): high}
    if (beyond := _extrapolated(card, mode, at)) is not None:
        columns["extrapolated"] = beyond
    if card.hyperfoam is not None and name == "stress_Pa":
        columns["moduli"] = card.hyperfoam.moduli
    return columns


def _extrapolated(card: MaterialCard, mode: str, at: np.ndarray) -> np.ndarray | None:
    """(n,) whether a row lies outside what was fitted; None where the card does not say what was."""
    if mode == "relaxation":
        ends = [row["time_s"] for row in card.fit.values()
                if isinstance(row, Mapping) and row.get("kind") == "relaxation" and row.get("time_s") is not None]
        return at > max(ends) if ends else None
    if mode == "conductivity":
        return outside(card.conductivity, at) if card.conductivity is not None else None
    ranges = card.hyperfoam.strain_range if card.hyperfoam is not None else {}
    low, high = ranges.get(mode, (np.inf, -np.inf))
    return (at < low) | (at > high) if ranges else None


def _drawn(draws: Draws, name: str) -> bool:
    """Whether the draws hold the part that a prediction is made of."""
    part = {"stress_Pa": draws.mu_Pa if draws.mu_Pa.shape[1] else None, "normalised_stress": draws.g,
            "conductivity_S_per_m": draws.conductivity_S_per_m}
    return part[name] is not None


def _value(card: MaterialCard, mode: str, at: np.ndarray) -> np.ndarray:
    if mode == "relaxation" and card.prony is not None:
        return relaxation(card.prony, at)
    if mode == "conductivity" and card.conductivity is not None:
        return conductivity(card.conductivity, at)
    assert card.hyperfoam is not None
    return nominal_stress(card.hyperfoam, mode, at)


def _draws(card: MaterialCard, path: Path) -> Draws | None:
    """The card's draws; None without a posterior, or, said on standard error, without its file."""
    if not card.posterior:
        return None
    if not card.posterior.get("checks", {}).get("converged", True):
        print("matcal: the card's posterior did not converge; do not use its band.", file=sys.stderr)
    try:
        return read_draws(path)
    except ValueError as error:
        print(f"matcal: no band. {error}", file=sys.stderr)
        return None
