"""Units as people write them, turned into SI factors. pint is used here only, for units that are not `_PLAIN`."""

import re
from functools import cache
from typing import Any

from matcal.readers.modulus_words import modulus_of
from matcal.readers.recording import QUANTITIES, SIZES
from matcal.readers.vocabulary import quantity_of, true_quantity

_NUMBERS = {"-", "1", "none", "mm/mm", "m/m", "in/in", "cycles", "cycle", "ratio"}
# tried, in lower case, where a unit is not one as it stands: mPa is a millipascal, but Mpa is meant as MPa
_ALIASES = {"ohms": "ohm", "seconds": "s", "sec": "s", "sec.": "s", "sek": "s", "sek.": "s", "newton": "N", "n": "N",
            "kn": "kN", "pa": "Pa", "kpa": "kPa", "mpa": "MPa", "mm.": "mm", "秒": "s", "毫米": "mm", "牛": "N",
            "牛顿": "N", "千牛": "kN", "兆帕": "MPa", "千帕": "kPa", "帕": "Pa"}
# usual units -> (SI unit, factor), for which pint, which takes longer to load than most files to read, is not asked
_PLAIN = {"s": ("s", 1.0), "sec": ("s", 1.0), "m": ("m", 1.0), "mm": ("m", 1e-3), "N": ("N", 1.0), "kN": ("N", 1e3),
          "Pa": ("Pa", 1.0), "kPa": ("Pa", 1e3), "MPa": ("Pa", 1e6), "A": ("A", 1.0), "V": ("V", 1.0),
          "ohm": ("ohm", 1.0), "S/m": ("S/m", 1.0)}
_FACTOR = r"[^\W\d_]{1,14}(?:\^?-?\d)?"
_UNIT = re.compile(rf"{_FACTOR}(?:\s?[*/·]\s?{_FACTOR}){{0,3}}")
_SI = QUANTITIES | SIZES
# SI unit -> units of the same dimension that test files have
COMMON = {"s": ("s", "ms", "min", "h"), "m": ("m", "cm", "mm", "um", "in"), "N": ("N", "mN", "kN", "lbf", "kgf"),
          "Pa": ("Pa", "kPa", "MPa", "GPa", "N/mm2", "psi"), "A": ("A", "mA", "uA"), "V": ("V", "mV"),
          "ohm": ("ohm", "kohm", "Mohm"), "S/m": ("S/m", "S/cm"), "": ("-", "%", "mm/mm")}


@cache
def _pint() -> tuple[Any, Any]:
    import pint

    return pint, pint.UnitRegistry()


@cache
def si_factor(unit: str, quantity: str) -> float | None:
    """Factor from `unit` to SI for `quantity` (of QUANTITIES or SIZES); None where the unit is unknown or measures
    something else."""
    text = unit.strip().replace("²", "2").replace("³", "3")
    if not text or text.lower() in _NUMBERS:
        return 1.0 if not _SI[quantity] else None
    if text == "%":
        text = "percent"
    value = _factor(text, quantity)
    return _factor(_ALIASES[text.lower()], quantity) if value is None and text.lower() in _ALIASES else value


def _factor(text: str, quantity: str) -> float | None:
    if text in _PLAIN:
        si, factor = _PLAIN[text]
        return factor if si == _SI[quantity] else None
    if not _UNIT.fullmatch(text):
        return None
    powers = re.sub(r"([^\W\d_])\^?(-?\d)", r"\1**(\2)", text).replace("·", "*")
    pint, registry = _pint()
    try:
        return float(registry.Quantity(1.0, powers).to(_SI[quantity] or "dimensionless").magnitude)
    except (pint.PintError, AttributeError, TypeError, ValueError, ArithmeticError):
        return None


def measures(unit: str) -> list[str]:
    """The quantities that a unit could be of; none for a bare number or an unknown unit."""
    return [q for q in QUANTITIES if QUANTITIES[q] and si_factor(unit, q) is not None]


def modulus_by_unit(name: str, unit: str | None) -> str | None:
    """`modulus` for the letter E with a unit of stress, which without one is a strain; else None."""
    return "modulus" if name.strip() == "E" and unit and si_factor(unit, "modulus") is not None else None


@cache
def is_common(unit: str) -> bool:
    """Whether a unit is one that test files have, of whatever quantity, in any case and spelling."""
    plain = unit.strip().lower()
    known = {other.lower() for units in COMMON.values() for other in units}
    return plain in known or plain in _NUMBERS or plain in _ALIASES or plain in ("µm", "μm", "mv", "µa", "n/mm²", "ω")


def split_name(cell: str) -> tuple[str, str | None]:
    """A header cell as (name, unit or None): `stress (kPa)`, `stress [kPa]`, `stress, kPa`, `stress / kPa`,
    `stress in kPa`, `P_MPa`, `F/N`; the symbol s with a unit of length, as DIN has it, is named travel."""
    cell = cell.strip()[:200]
    if modulus_of(cell.lower()) == "normalised":
        return cell, None
    if (found := re.fullmatch(r"([EG](?:\(t\))?)(?:\s*[(\[,_/]\s*|\sin\s)([^()\[\]\s]+)[)\]]?", cell)) \
            and si_factor(found[2], "modulus") is not None:
        return found[1], found[2]
    for pattern in (r"([^(\[]+?)\s*[(\[]([^()\[\]]*)[)\]]", r"(WE\(1\)\.\w+)\s*[(\[]([^()\[\]]*)[)\]]",
                    r"([^,]+?)\s*,\s*(\S+)", r"([^/]+?)\s+/\s*(\S+)", r"(.+?)\s+in\s+(\S+)"):
        if (found := re.fullmatch(pattern, cell)) and (quantity_of(found[1]) or true_quantity(found[1])):
            return found[1], found[2]
    if (found := re.fullmatch(r"s(?:\s*/\s*|\s*[(\[]|\s+in\s+)([^()\[\]]+)[)\]]?", cell)) \
            and si_factor(found[1], "displacement") is not None:
        return "travel", found[1]
    if (found := re.fullmatch(r"([^(\[]+?)\s*[(\[]([^()\[\]]*)[)\]]", cell)) and measures(found[2]):
        return found[1], found[2]
    for pattern in (r"(.+)_([^\W\d_][^_]*)", r"([^/]+)/(.+)"):
        if (found := re.fullmatch(pattern, cell)) and (quantity := quantity_of(found[1])) is not None \
                and si_factor(found[2], quantity) is not None:
            return found[1], found[2]
    return cell, None
