"""A material card as input of a finite-element program, with a comment that says what it is and what it is not."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path

import numpy as np

from matcal.card import MaterialCard, as_card, with_moduli
from matcal.laws.conduction_laws import conduction_law
from matcal.laws.conductivity import Conductivity
from matcal.laws.histories.damage import Damage
from matcal.laws.histories.time_temperature import Shift
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.record.cautions import cautions
from matcal.record.exporters.base import UNITS, Material, Target, Units, Written
from matcal.record.exporters.formatting import number
from matcal.record.exporters.programs import target_of

_AIR_KG_PER_M3 = 1.2  # density of air


@dataclass(frozen=True)
class Deck:
    """An exported card."""

    text: str  # the file's text
    warnings: tuple[str, ...]  # what the target does otherwise than the card, one sentence each; in the text too


def export(card: MaterialCard | Path | str, target: str, moduli: str | None = None, units: str = "SI",
           density_kg_per_m3: float | None = None) -> Deck:
    """The card's law as input of a finite-element program, with a comment that says what it is and is not.

    Parameters
    ----------
    card
        A card with a hyperelastic law, or its file.
    target
        One of `programs.targets`: abaqus, calculix, febio, lsdyna, ansys, openradioss.
    moduli
        "instantaneous", "longterm", or None: as the card holds them.
    units
        Units of moduli, times and density: "SI", "mm-t-s" (MPa) or "mm-kg-ms" (GPa).
    density_kg_per_m3
        Mass density at rest; None: no density is written.

    Returns
    -------
    Deck
        `text` of the file, and `warnings` on what the program does otherwise than the card.

    Raises
    ------
    ValueError
        For an unknown target, units or moduli, a card without a hyperelastic law, moduli that need a Prony series the
        card lacks, or a law that the target does not have.

    Examples
    --------
    >>> import matcal
    >>> card = matcal.MaterialCard("foam", matcal.Hyperfoam([12e3], [2.0], [0.0]))
    >>> print(*matcal.export(card, "abaqus").text.splitlines()[-2:], sep="\\n")
    *HYPERFOAM, N=1
    12000.0, 2.0, 0.0
    """
    into = target_of(target)
    if units not in UNITS:
        raise ValueError(f"units '{units}' are unknown; known: {', '.join(UNITS)}.")
    if density_kg_per_m3 is not None and not density_kg_per_m3 > 0:
        raise ValueError(f"the density must be positive, got {density_kg_per_m3:g} kg/m3.")
    if density_kg_per_m3 is not None and density_kg_per_m3 < _AIR_KG_PER_M3:
        raise ValueError(f"a density of {density_kg_per_m3:g} kg/m3 is less than that of air. Give it in kg/m3, "
                         "whatever the units that are written.")
    card = as_card(card)
    law = with_moduli(card, moduli or "card")
    written_as = law if law.name in into.laws and not _kept_neo_hooke(law) else _equal(law, card.name, into)
    material = Material(card.name, written_as, card.prony, UNITS[units], density_kg_per_m3, moduli is not None)
    written = into.write(material)
    if written_as is not law:
        equal = "a hyperfoam, N = 1, alpha = 2" if isinstance(written_as, Hyperfoam) else "Mooney-Rivlin, c_01 = 0"
        written = replace(written, notes=(f"{law.name} at this nu is {equal}.", *written.notes))
    if card.shift is not None:
        written = _with_shift(written, card.shift, into)
    if card.softening is not None:
        written = _softened(written, card.softening, into, UNITS[units])
    warnings = (*written.warnings, *_skin_left_out(card))
    return Deck(into.assemble(list(_comment(card, into, UNITS[units], written, warnings)), written.lines), warnings)


def _with_shift(written: Written, shift: Shift, into: Target) -> Written:
    """The shift of times with temperature after the series, or that the program has none."""
    at = f"{shift.reference_K - 273.15:.4g} C"
    if lines := into.shift(shift) if into.shift is not None and written.shifts else ():
        return replace(written, lines=(*written.lines, *lines), notes=(
            *written.notes, f"Relaxation times are those at {at}; temperatures of the shift are in degrees Celsius."))
    return replace(written, warnings=(*written.warnings, f"The shift of times with temperature is not exported: "
                                      f"{into.title} has no such law for this material here. Times are those at {at}."))


def _softened(written: Written, damage: Damage, into: Target, units: Units) -> Written:
    """The softening after the law, or that the program has none; and set and loop, which none has."""
    warnings = () if not damage.set_share else (f"The set of {damage.set_share:.3g} of the largest strain is not "
                                                f"exported: {into.title} has none next to this law.",)
    if damage.loop_share:
        warnings += ("The loop of a cycle that repeats itself is not exported: "
                     f"{into.title} has no such law next to this one. Unloading there follows what loading again "
                     f"follows, up to {damage.loop_share:.3g} of the stress too stiff.",)
    if into.softening is not None:
        return replace(written, lines=(*written.lines, *into.softening(damage, units.stress)),
                       warnings=(*written.warnings, *warnings))
    return replace(written, warnings=(*written.warnings, "The softening by earlier loading is not exported: "
                                      f"{into.title} has no such law for this material.", *warnings))


def _kept_neo_hooke(law: Law) -> bool:
    return isinstance(law, NeoHooke) and law.incompressible


def _equal(law: Law, name: str, into: Target) -> Law:
    """The law whose energy is that of one which the target does not have; ValueError where there is none."""
    if isinstance(law, NeoHooke) and law.incompressible and "mooney_rivlin" in into.laws:
        return MooneyRivlin(law.mu_Pa / 2, 0.0, 0.5, law.moduli, law.strain_range)
    if isinstance(law, NeoHooke) and law.nu == 0 and "hyperfoam" in into.laws:
        return Hyperfoam(np.array([law.mu_Pa]), np.array([2.0]), np.zeros(1), law.moduli, law.strain_range)
    if law.name in into.similar:
        raise ValueError(f"{into.similar[law.name]} of {into.title} is another law than {law.name} of card '{name}': "
                         "it takes the volume out of the stretches and adds a term of the volume alone, so that "
                         "stresses differ wherever the volume changes. Export the card to febio, which has its law, "
                         f"or fit it with `poisson` 0, where a hyperfoam equals it, or with `law` {into.laws[0]}.")
    raise ValueError(f"the law of card '{name}' is {law.name}, and matcal writes {', '.join(into.laws)} alone for "
                     f"{into.title}. Fit it with one of these as `law`, or enter its parameters by hand.")


def _comment(card: MaterialCard, into: Target, units: Units, written: Written, warnings: tuple[str, ...]
             ) -> Iterator[str]:
    law = card.law.name if card.law else "no law"
    yield f"{card.name}: {law} for {into.title}, written by matcal {metadata.version('touchcal')}"
    yield f"Units: {units.words}"
    yield from written.notes
    ranges = card.law.strain_range if card.law else {}
    if ranges:
        fitted = ", ".join(f"{mode} {lo:g} to {hi:g}" for mode, (lo, hi) in ranges.items())
        yield f"Fitted strains (gamma in shear, J in volumetric): {fitted}; outside them the law extrapolates."
    yield from _intervals(card, units)
    for text in cautions(card):
        yield f"Caution: {text}"
    for text in warnings:
        yield f"Warning: {text}"
    if card.conductivity is not None:
        yield _conductivity(card.conductivity)


def _intervals(card: MaterialCard, units: Units) -> Iterator[str]:
    """What the tests leave open of each derived quantity of the card, stresses in the units that are written."""
    linear, drawn = card.fit.get("derived", {}), card.posterior.get("derived", {})
    rows = {**drawn, **linear}
    nu = card.fit.get("nu", {})
    if isinstance(nu.get("value"), float):
        rows["nu"] = {"value": nu["value"], "lo": nu["interval"][0], "hi": nu["interval"][1]}
    skin = card.fit.get("conductivity", {})
    if card.conductivity is not None and "c0_interval_S_per_m" in skin and "c0_S_per_m" not in rows:
        lo, hi = skin["c0_interval_S_per_m"]
        rows["c0_S_per_m"] = {"value": card.conductivity.c0_S_per_m, "lo": lo, "hi": hi}
    if not rows:
        return
    moduli = card.law.moduli.replace("longterm", "long-term") if card.law else "no"
    yield f"95 % intervals of the card ({moduli} moduli), which this input does not hold:"
    for name, row in rows.items():
        plain = name.removesuffix("_Pa")
        scale, unit = (units.stress, f" {units.stress_name}") if plain != name else (1.0, "")
        value, lo, hi = (f"{scale * row[key]:.6g}" for key in ("value", "lo", "hi"))
        left = ", not determined by the tests" if name in card.fit.get("not_determined", ()) else ""
        yield f"{plain} = {value}{unit} [{lo}, {hi}]{left}"


def _skin_left_out(card: MaterialCard) -> tuple[str, ...]:
    if card.conductivity is None:
        return ()
    return ("The conductivity of the skin is not exported: no target reads conductivity as a function of strain "
            "without a user subroutine. Its law is in the comment.",)


def _conductivity(skin: Conductivity) -> str:
    formula = conduction_law(skin.kind).formula.format(*map(number, [skin.c0_S_per_m, *skin.a]))
    lo, hi = skin.strain_range
    return (f"Skin conductivity in S/m, not part of this input: c(e) = {formula}, nominal strain e fitted from {lo:g} "
            f"to {hi:g} (in Abaqus by a field variable set in the user subroutine USDFLD).")
