"""Figure of the derived quantities over the whole-parameter draws of a card."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from matcal.card import MaterialCard
from matcal.laws.conductivity import drawn_conductivity
from matcal.posterior.drawn_laws import moduli_of, stress_of
from matcal.posterior.draws import Draws, read_draws
from reports.calibration.card_record import Array
from reports.calibration.first_page import PLATEAU_STRAIN
from reports.document import style
from reports.document.numerals import counted, number, pascals, within
from reports.document.page import ReportFigure

_SUBSCRIPTS = str.maketrans({"₀": "$_0$"})  # subscripts of captions, as the figures' mathematics has them


def draws_of(path: Path, card: MaterialCard) -> tuple[Draws | None, str]:
    """The draws of a card, or why there are none."""
    if not card.posterior:
        return None, "The card has no posterior; matcal fit --posterior samples one."
    file = path.parent / str(card.posterior["file"])
    if not file.is_file():
        return None, f"The posterior {card.posterior['file']} that the card names is not next to it."
    return read_draws(path), ""


def derived(draws: Draws, card: MaterialCard) -> ReportFigure:
    """Histograms of the derived quantities over the draws, each with its middle 95 %."""
    quantities = _quantities(draws, card)
    alpha = draws.law.get("alpha", np.empty((len(draws), 0)))
    count = len(quantities) + (alpha.shape[1] > 0)
    columns = count if count <= 4 else 3
    figure = style.sheet(38 * -(-count // columns))
    panels = list(figure.subplots(-(-count // columns), columns, squeeze=False).flat)
    for axes, column in zip(panels, quantities.values(), strict=False):
        _histogram(axes, column)
    if alpha.shape[1]:
        _exponents(panels[len(quantities)], alpha)
    for axes in panels[count:]:
        axes.axis("off")
    said = "; ".join(f"{column.words} {_middle(column.values)} {column.unit}".replace(" –", "")
                     for column in quantities.values())
    spans = ", ".join(_middle(column) for column in alpha.T)
    caption = (f"Posterior over {counted(len(draws), 'draw')}, 95 % shaded: {said}."
               + (f" The exponents run over {spans}." if spans else "") + _checked(card))
    data = pd.DataFrame({name: column.values for name, column in quantities.items()}
                        | {f"alpha_{i + 1}": column for i, column in enumerate(alpha.T)})
    return ReportFigure("posterior", figure, caption, {"posterior": data})


@dataclass(frozen=True)
class _Column:
    """A derived quantity over the draws."""

    words: str  # what it is, for a caption and an axis
    unit: str
    values: Array  # (D,) in that unit


def _quantities(draws: Draws, card: MaterialCard) -> dict[str, _Column]:
    """Name with unit -> what the draws say of it."""
    out = _foam_quantities(draws) if draws.law else {}
    if draws.g is not None:
        out["g_infinity"] = _Column("Long-term share of the modulus", "–", 1 - draws.g.sum(axis=1))
    if (drawn := draws.conductivity_S_per_m) is not None and card.conductivity is not None:
        out["c0_S_per_m"] = _Column("Unstrained conductivity c₀", "S/m", drawn[:, 0])
        out["c_at_minus_half_S_per_m"] = _Column("Conductivity at −0.5", "S/m", drawn_conductivity(
            card.conductivity.kind, drawn, [-0.5])[:, 0])
    return out


def _foam_quantities(draws: Draws) -> dict[str, _Column]:
    mu_0, plateau = moduli_of(draws)[0], -stress_of(draws, "uniaxial", [PLATEAU_STRAIN])[:, 0]
    (factor, unit), (second, other) = pascals(mu_0), pascals(plateau)
    return {f"mu_0_{unit}": _Column("Initial shear modulus μ₀", unit, factor * mu_0),
            f"plateau_{other}": _Column("Plateau stress at 40 % strain", other, second * plateau)}


def _histogram(axes: Axes, column: _Column) -> None:
    lo, hi = np.quantile(column.values, [0.025, 0.975])
    axes.axvspan(lo, hi, color=style.ACCENT, alpha=0.12, lw=0)
    axes.hist(column.values, bins=30, histtype="stepfilled", color=style.ACCENT)
    axes.locator_params(axis="x", nbins=4)
    style.label(axes, f"{column.words.translate(_SUBSCRIPTS)} ({column.unit})", "Draws (–)")


def _exponents(axes: Axes, alpha: Array) -> None:
    edges = np.linspace(alpha.min(), alpha.max(), 60)
    for i in range(alpha.shape[1]):
        axes.hist(alpha[:, i], bins=list(edges), histtype="step", color=style.SERIES[i % 4], ls=style.DASHES[i % 4],
                  label=f"α$_{i + 1}$")
    axes.legend()
    style.label(axes, "Exponents (–)", "Draws (–)")


def _middle(values: Array) -> str:
    """The middle 95 % of some draws."""
    lo, middle, hi = np.quantile(values, [0.025, 0.5, 0.975])
    return within(float(middle), float(lo), float(hi))[1]


def _checked(card: MaterialCard) -> str:
    checks = card.posterior.get("checks", {})
    if not {"rhat", "ess"} <= checks.keys():
        return ""
    state = "The chains converged" if checks.get("converged") else "The chains did NOT converge"
    return f" {state}: R-hat {number(checks['rhat'], 4)}, effective sample size {number(checks['ess'], 2)}."
