"""Bands and figures from whole-parameter draws of a card."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from matcal.card import MaterialCard
from matcal.draws import Draws, law_of, quantiles, read_draws, stress_band
from matcal.modes import nominal_stress
from reports import style
from reports.calibration_tables import PLATEAU_STRAIN
from reports.card_record import Array
from reports.numerals import counted, interval, number
from reports.page import Plate

# (n,) strains, lower and upper end of a 95 % band
Band = tuple[Array, Array, Array]


def draws_of(path: Path, card: MaterialCard) -> tuple[Draws | None, str]:
    """The draws of a card, or why there are none."""
    if not card.posterior:
        return None, "The card has no posterior; `matcal fit --posterior` samples one."
    file = path.parent / str(card.posterior["file"])
    if not file.is_file():
        return None, f"The posterior {card.posterior['file']} that the card names is not beside it."
    return read_draws(path), ""


def stress(draws: Draws, mode: str, lo: float, hi: float) -> Band:
    """95 % band of the long-term stress in a mode, Pa."""
    strain = np.linspace(lo, hi, 60)
    return strain, *stress_band(draws, mode, strain)


def conductivity(draws: Draws, lo: float, hi: float) -> Band | None:
    """95 % band of the conductivity, S/m; None where it was not drawn."""
    coefficients = draws.conductivity_S_per_m
    if coefficients is None:
        return None
    strain = np.linspace(lo, hi, 80)
    powers = np.vander(strain, 4, increasing=True)
    return strain, *quantiles(lambda k: powers @ coefficients[k], len(draws))


def derived(draws: Draws, card: MaterialCard) -> Plate:
    """Histograms of modulus, plateau stress and exponents over the draws."""
    mu_0 = draws.mu_Pa.sum(axis=1) / 1e3
    plateau = np.array([-float(nominal_stress(law_of(draws, k), "uniaxial", PLATEAU_STRAIN))
                        for k in range(len(draws))]) / 1e3
    figure = style.sheet(50)
    first, second, third = figure.subplots(1, 3)
    for axes, values, name in ((first, mu_0, "μ$_0$, long-term (kPa)"), (second, plateau, "Plateau stress (kPa)")):
        axes.hist(values, bins=30, histtype="stepfilled", color=style.ACCENT)
        style.label(axes, name, "Draws (–)")
    edges = np.linspace(draws.alpha.min(), draws.alpha.max(), 60)
    for i in range(draws.alpha.shape[1]):
        third.hist(draws.alpha[:, i], bins=list(edges), histtype="step", color=style.SERIES[i % 4],
                   ls=style.DASHES[i % 4], label=f"α$_{i + 1}$")
    third.legend()
    style.label(third, "Exponents (–)", "Draws (–)")
    spans = ", ".join(_middle(draws.alpha[:, i], 2) for i in range(draws.alpha.shape[1]))
    caption = (f"Posterior over {counted(len(draws), 'draw')}: at 95 % μ₀ lies within {_middle(mu_0, 4)} kPa and the "
               f"plateau stress within {_middle(plateau, 4)} kPa, while the exponents run over {spans}."
               + _checked(card))
    data = pd.DataFrame({"mu_0_kPa": mu_0, "plateau_kPa": plateau}
                        | {f"alpha_{i + 1}": draws.alpha[:, i] for i in range(draws.alpha.shape[1])})
    return Plate("posterior", figure, caption, {"posterior": data})


def _middle(values: Array, digits: int) -> str:
    """The middle 95 % of some draws."""
    lo, hi = np.quantile(values, [0.025, 0.975])
    return interval(float(lo), float(hi), digits)


def _checked(card: MaterialCard) -> str:
    checks = card.posterior.get("checks", {})
    if not {"rhat", "ess"} <= checks.keys():
        return ""
    state = "The chains converged" if checks.get("converged") else "The chains did NOT converge"
    return f" {state}: R-hat {number(checks['rhat'], 4)}, effective sample size {number(checks['ess'], 2)}."
