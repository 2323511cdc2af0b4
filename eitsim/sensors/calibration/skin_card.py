"""The material card of a skin that labelled presses were fitted to, with draws of what they leave open.

It lies next to the calibrated sensor's file and serves as any card does; `[material]` draws of a sweep take its draws.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from eitsim.sensors.calibration.calibrate import FittedSkin
from eitsim.sensors.calibration.skin_law import changed
from matcal.card import MaterialCard, with_moduli, write_card
from matcal.posterior.draws import FILE, Draws, write_draws

_DRAWS = 200
_SIGNIFICANT = "{:+.3g} +- {:.2g} (prior {:.2g})"


def card_path(sensor: Path) -> Path:
    """Where the card of a calibrated sensor's file lies."""
    return sensor.with_suffix(".card.json")


def write_skin_card(skin: FittedSkin, sensor: Path, seed: int = 0) -> Path:
    """Write the card of a skin and its draws next to the calibrated sensor's file; the card's path."""
    path = card_path(sensor)
    folder = path.with_suffix(".d")
    folder.mkdir(exist_ok=True)
    write_draws(skin_draws(skin, seed), folder / FILE, {}, about={"presses": skin.presses})
    write_card(replace(skin_card(skin), posterior={"file": f"{folder.name}/{FILE}", "n": _DRAWS, "checks": {}}), path)
    return path


def remove_skin_card(sensor: Path) -> bool:
    """Remove the card and draws that an earlier fit wrote next to a sensor's file; whether there was one."""
    path = card_path(sensor)
    folder = path.with_suffix(".d")
    there = path.exists()
    path.unlink(missing_ok=True)
    (folder / FILE).unlink(missing_ok=True)
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()
    return there


def skin_card(skin: FittedSkin) -> MaterialCard:
    """The card with the fitted laws; what its own tests gave, and draws of that, stay with the card of the fit."""
    fit, known = skin.fit, skin.card.provenance
    spread = zip(fit.names, fit.value, np.sqrt(np.diag(fit.covariance)), fit.prior_sd, strict=True)
    words = [f"{name} {_SIGNIFICANT.format(*numbers)}" for name, *numbers in spread]
    decision = (f"conductivity and moduli of card '{skin.card.name}' fitted to {skin.presses} labelled presses of one "
                f"sensor: {', '.join(words)}; kept: {', '.join(fit.kept) or 'none'}")
    found = {key: value for key, value in known.items() if key != "decisions_of"}
    return replace(changed(skin.card, fit.values), fit={}, posterior={}, data=None, file=None,
                   provenance=found | {"decisions": [*known.get("decisions", ()), decision]})


def skin_draws(skin: FittedSkin, seed: int = 0) -> Draws:
    """Draws of conductivity and long-term moduli by the presses; exponents, ratios, Prony series and c0 as the card has
    them, and moduli too where it cannot say what is left of instantaneous ones."""
    fit, card = skin.fit, skin.card
    chance = np.random.default_rng(seed)
    values = chance.multivariate_normal(fit.value, fit.covariance, _DRAWS, method="svd")
    cards = [changed(card, dict(zip(fit.names, one.tolist(), strict=True))) for one in values]
    laws = [one.conductivity for one in cards if one.conductivity is not None]
    conductivity = np.array([law.c0_S_per_m * np.r_[1.0, law.a] for law in laws])
    if card.law is None or (card.law.moduli == "instantaneous" and card.prony is None):
        return Draws({}, conductivity_S_per_m=conductivity)
    laws = [with_moduli(one, "longterm") for one in cards]
    drawn = {p.name: np.array([np.ravel(getattr(law, p.name)) for law in laws]) for p in card.law.parameters}
    return Draws(drawn, type(card.law), conductivity_S_per_m=conductivity)
