"""Units and header cells as people write them: factors to SI, and the name and the unit of a cell."""

import math
import re
import unicodedata
from functools import cache

from matcal.readers.dynamic_words import CELSIUS, FAHRENHEIT, KELVIN, is_stiffness
from matcal.readers.recording import QUANTITIES, SIZES
from matcal.readers.unit_table import (
    ANGLE,
    ANGULAR,
    FORCE,
    MASS,
    ONE,
    OTHERS,
    PRESSURE,
    SI,
    STIFFNESS,
    Dimensions,
    G,
    plain_unit,
    readings,
)
from matcal.readers.vocabulary import (
    dynamic_quantity,
    is_compression_ratio,
    is_symbol,
    quantities_of,
    quantity_of,
    relative_of,
    relaxing_of,
    true_quantity,
    unused_of,
)

_NUMBERS = {"-", "--", "–", "—", "1", "none", "ratio", "unitless", "dimensionless", "n/a"}
_COUNTS = {"cycles", "cycle", "count", "counts", "segments", "#"}  # units of a cycle or a block
_UNITS_OF = {**QUANTITIES, **SIZES}
# SI unit -> units of the same dimension that test files have
COMMON = {"s": ("s", "ms", "min", "h"), "m": ("m", "cm", "mm", "um", "in"), "N": ("N", "mN", "kN", "lbf", "kgf"),
          "Pa": ("Pa", "kPa", "MPa", "GPa", "N/mm2", "psi"), "A": ("A", "mA", "uA"), "V": ("V", "mV"),
          "ohm": ("ohm", "kohm", "Mohm"), "S/m": ("S/m", "S/cm"), "": ("-", "%", "mm/mm"), "Hz": ("Hz", "rad/s"),
          "K": ("C", "K", "F"), "1/Pa": ("1/Pa", "1/MPa")}
_INSIDE = r"[(\[（]([^()\[\]（）]*)[)\]）]"  # one pair of brackets with no other inside


@cache
def si_factor(unit: str, quantity: str) -> float | None:
    """Factor from `unit` to SI for `quantity` (of QUANTITIES or SIZES); None where the unit is unknown or measures
    something else. A mass counts as its weight where a force is measured, an angle as a shear."""
    needed = SI[_UNITS_OF[quantity]]
    text = plain_unit(unit).lower()
    if quantity == "temperature":
        return 1.0 if text in (*KELVIN, *CELSIUS, *FAHRENHEIT) else None
    if not text or text in _NUMBERS or (quantity in ("cycle", "block") and text in _COUNTS):
        return 1.0 if needed == ONE else None
    for factor, dimensions in readings(unit):
        if dimensions == needed or (quantity == "strain" and dimensions == ANGLE):
            return factor
        if quantity == "loss_tangent" and dimensions == ANGLE:
            return factor
        if quantity == "frequency" and dimensions == ANGULAR:
            return factor / (2 * math.pi)
        if needed in (FORCE, PRESSURE) and _weight(dimensions) == needed:
            return factor * G
    return None


def weighs(unit: str) -> bool:
    """Whether a unit is one of mass, so that a force in it is a weight."""
    return any(dimensions == MASS for _, dimensions in readings(unit)[:1])


def measures(unit: str) -> list[str]:
    """The quantities that a unit could be of; none for a bare number or an unknown unit."""
    return [q for q in QUANTITIES if QUANTITIES[q] and si_factor(unit, q) is not None]


def modulus_by_unit(name: str, unit: str | None) -> str | None:
    """`modulus` for the letter E with a unit of stress, which without one is a strain, `compliance` for J or D with a
    unit of it; else None."""
    quantity = {"E": "modulus", "J": "compliance", "D": "compliance"}.get(name.strip())
    return quantity if quantity and unit and si_factor(unit, quantity) is not None else None


@cache
def measured(unit: str) -> str | None:
    """What a unit measures where no quantity of a test has it, in words (`a temperature`); None for any other."""
    return next((OTHERS[dimensions] for _, dimensions in readings(unit) if dimensions in OTHERS), None)


@cache
def is_common(unit: str) -> bool:
    """Whether a unit is one that test files have, of whatever quantity, in any case and spelling."""
    known = {other.lower() for units in COMMON.values() for other in units}
    return plain_unit(unit).lower() in known | _NUMBERS or bool(measures(unit))


def is_unit(text: str) -> bool:
    """Whether a text is a unit, of whatever it may be, or says that there is none."""
    return plain_unit(text).lower() in _NUMBERS | _COUNTS or bool(readings(text))


@cache
def quantity_in(name: str, unit: str | None) -> str | None:
    """The quantity of a column by its name and its unit: `Tension` in V is a potential and in MPa a stress, `T` is a
    time only in a unit of time. None where the name is unknown, or is a letter and the unit is of something else."""
    if name.strip() == "T" and (unit is None or si_factor(unit, "time") is None):
        return None
    if relaxing_of(name) == "compliance":
        return None
    found = quantities_of(name)
    fitting = [quantity for quantity in found if unit and si_factor(unit, quantity) is not None]
    if fitting or not found:
        return fitting[0] if fitting else None
    return None if unit and is_symbol(name) and readings(unit) else found[0]


def dynamic_in(name: str, unit: str | None) -> str | None:
    """The quantity of a column of a dynamic test, where its unit, if it has one, is of that quantity; else None."""
    quantity = dynamic_quantity(name)
    return quantity if quantity and (not unit or factor_for(name, unit, quantity) is not None) else None


def factor_for(name: str, unit: str, quantity: str) -> float | None:
    """`si_factor` for a column by its name: of a stiffness where that stands for a modulus."""
    if quantity in ("storage", "loss", "complex_modulus") and is_stiffness(name):
        return next((factor for factor, dimensions in readings(unit) if dimensions == STIFFNESS), None)
    return si_factor(unit, quantity)


def unused_in(name: str, unit: str | None) -> str | None:
    """What a column holds that is known and that no test uses (`a temperature`), by its name or its unit, or None."""
    if (word := unused_of(name)) is not None:
        return word
    if name.strip() == "T" and (unit is None or si_factor(unit, "time") is None):
        return "a temperature"
    return measured(unit) if unit and quantity_in(name, unit) is None else None


def _weight(dimensions: Dimensions) -> Dimensions | None:
    length, mass, time, current, temperature, angle = dimensions
    return (length + 1, mass, time - 2, current, temperature, angle) if mass == 1 else None


def _known(name: str) -> bool:
    known = (dynamic_quantity, true_quantity, unused_of, relative_of, relaxing_of)
    return bool(quantities_of(name)) or any(of(name) is not None for of in known)


@cache
def split_name(cell: str) -> tuple[str, str | None]:
    """A header cell as (name, unit or None): `stress (kPa)`, `stress [kPa]`, `stress, kPa`, `stress / kPa`,
    `stress in kPa`, `P_MPa`, `F/N`, `Load N`; brackets that name a channel stay with the name, and the symbol s with a
    unit of length, as DIN has it, is named travel."""
    cell = re.sub(r"(?<=[^\d\s.])\.\d{1,2}$", "", cell.strip()[:200])  # what pandas adds to a name that stands twice
    if relative_of(cell) is not None or relaxing_of(cell) == "normalised" or dynamic_quantity(cell) == "loss_tangent":
        return cell, None
    if cell.lower().endswith(" ratio") and is_compression_ratio(cell):
        return cell, None
    if (found := re.fullmatch(r"([EG](?:\(t\))?)(?:\s*[(\[,_/]\s*|\sin\s)([^()\[\]\s]+)[)\]]?", cell)) \
            and si_factor(found[2], "modulus") is not None:
        return found[1], found[2]
    if (found := re.fullmatch(r"s(?:\s*/\s*|\s*[(\[]|\s+in\s+)([^()\[\]]+)[)\]]?", cell)) \
            and si_factor(found[1], "displacement") is not None:
        return "travel", found[1]
    if found := re.fullmatch(rf"(.*\S)\s*{_INSIDE}", cell):
        return _bracketed(cell, found[1], found[2].strip())
    for pattern in (r"([^,]+?)\s*[,，;:]\s*(\S+(?: vs\.? .*)?)", r"(.+?)\s+/\s*(\S+)", r"(.+?)\s+in\s+(\S+)"):
        if (found := re.fullmatch(pattern, cell)) and _known(found[1]):
            return found[1], found[2]
    for pattern in (r"(.+)_([^\W\d_][^_]*|%)", r"([^/]+)/(.+)", r"(.*[^\d\s])\s+([^\W\d_]\S*|%)"):
        if (found := re.fullmatch(pattern, cell)) and _suits(found[1], found[2]):
            return found[1], found[2]
    return cell, None


def _bracketed(cell: str, name: str, inner: str) -> tuple[str, str | None]:
    """A cell that ends in brackets: with a unit in them, or with the channel that it comes from."""
    if is_unit(inner) or not _names_a_channel(inner):
        return (name, inner) if _known(name) or readings(inner) else (cell, None)
    return cell, None


def _names_a_channel(text: str) -> bool:
    words = re.sub(r"[\d.]+", " ", unicodedata.normalize("NFKC", text)).strip()
    return not words or ":" in text or quantity_of(text) is not None or quantity_of(f"{text} force") is not None


def _suits(name: str, unit: str) -> bool:
    """Whether a text is a unit of what a name stands for."""
    if unit.lower() == "strain":
        return False
    if any(si_factor(unit, quantity) is not None for quantity in quantities_of(name)):
        return True
    if relaxing_of(name) == "modulus" and si_factor(unit, "modulus") is not None:
        return True
    if (dynamic := dynamic_quantity(name)) is not None and factor_for(name, unit, dynamic) is not None:
        return True
    return (unused_of(name) is not None or name.strip() == "T") and measured(unit) is not None
