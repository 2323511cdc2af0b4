"""The number that a test is to narrow, by its name, as a function of draws."""

import numpy as np

from matcal.card import MaterialCard
from matcal.laws.deformation_modes import modes_of
from matcal.posterior.derived_quantities import derived_of
from matcal.posterior.drawn_laws import stress_of
from matcal.record.next_test.open_laws import OpenLaw, Predicted
from touchcal.entry_points import added

STRESS = "stress"


def named(quantity: str, card: MaterialCard, laws: tuple[OpenLaw, ...]) -> tuple[str, Predicted]:
    """Name with its unit, and the quantity (D, 1) of draws; ValueError for one that the card does not leave open."""
    kind, _, where = quantity.partition(":")
    if where and kind in (more := added("quantities")):
        return more[kind](where, card)
    if (aim := aim_of(quantity, card)) is not None:
        mode, strain = aim
        return f"{mode} stress at {strain:g}, Pa", lambda draws: stress_of(draws, mode, np.array([strain]))
    known = {name.removesuffix("_Pa"): name for name in _derived_of_all(laws)}
    name = known.get(quantity.removesuffix("_Pa"))
    if name is None:
        raise ValueError(f"`for` '{quantity}' is unknown; known for this card: {', '.join(known)}, "
                         f"{STRESS}:MODE:STRAIN" + "".join(f", {one}:FILE" for one in added("quantities")) + ".")
    return name, lambda draws: derived_of(draws)[name][:, None]


def _derived_of_all(laws: tuple[OpenLaw, ...]) -> list[str]:
    """Names that all laws have; the skin is measured by tests of its own, and scatter is no law's."""
    names = [derived_of(each.draws) for each in laws]
    return [n for n in names[0] if all(n in other for other in names)
            and not n.startswith(("c0_", "a_", "omega", "mu_0_new"))]


def aim_of(quantity: str, card: MaterialCard) -> tuple[str, float] | None:
    """Mode and strain of a stress; None for any other quantity. ValueError where it cannot be read."""
    if not quantity.startswith(f"{STRESS}:"):
        return None
    parts = quantity.split(":")
    try:
        mode, strain = parts[1], float(parts[2])
    except (IndexError, ValueError):
        raise ValueError(f"`for` '{quantity}': write {STRESS}:MODE:STRAIN, for example stress:biaxial:0.5.") from None
    assert card.law is not None
    if mode not in (known := modes_of(card.law)) or len(parts) > 3:
        raise ValueError(f"`for` '{quantity}': mode '{mode}' is unknown for this law; known: {', '.join(known)}.")
    return mode, strain
