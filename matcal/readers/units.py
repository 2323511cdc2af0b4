"""Column names and units as people write them, turned into quantities and SI factors. pint is used here only."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from matcal.readers.recording import QUANTITIES

_ALIASES = {"-": "", "1": "", "none": "", "%": "percent", "mm/mm": "", "m/m": "", "ohm": "ohm", "ohms": "ohm",
            "seconds": "s", "newton": "N"}

# first match wins; each is matched against the whole lower-case name without its unit
_NAMES = (
    ("time", r"(elapsed |test |running )?time|t"),
    ("displacement", r"displacement|crosshead|extension|(crosshead |axial )?position|compressive extension|disp|travel"
                     r"|stroke|deflection|axial displacement"),
    ("force", r"load|force|axial force|axial load|f"),
    ("stretch", r"stretch|lambda|λ|stretch ratio"),
    ("strain", r"(nominal |engineering |compressive |tensile |shear )?strain|eps|epsilon|ε|gamma|γ|e"),
    ("stress", r"(nominal |engineering |compressive |tensile |shear |piola )?stress|sigma|σ|tau|τ|p|pk1"),
    ("current", r"we\(1\)\.current|current|i"),
    ("potential", r"we\(1\)\.potential|potential|voltage|u|v"),
    ("resistance", r"resistance|r"),
    ("conductivity", r"conductivity|c"),
)


@cache
def _pint() -> tuple[Any, Any]:
    import pint

    return pint, pint.UnitRegistry()


@cache
def si_factor(unit: str, quantity: str) -> float | None:
    """Factor from `unit` to SI for `quantity`; None where the unit is unknown or measures something else."""
    text = _ALIASES.get(unit.strip().lower(), unit.strip())
    if not text:
        return 1.0 if not QUANTITIES[quantity] else None
    if not re.fullmatch(r"[^\W\d_]+([ */·^-]*([^\W\d_]+|\d))*", text):
        return None
    pint, registry = _pint()
    try:
        return float(registry.Quantity(1.0, text).to(QUANTITIES[quantity] or "dimensionless").magnitude)
    except (pint.PintError, AttributeError, TypeError, ValueError):
        return None


def quantity_of(name: str) -> str | None:
    """The quantity that a column name (without its unit) stands for, or None."""
    text = re.sub(r"[\s_]+", " ", name.strip().lower())
    return next((quantity for quantity, pattern in _NAMES if re.fullmatch(pattern, text)), None)


def split_name(cell: str) -> tuple[str, str | None]:
    """A header cell as (name, unit or None): `stress (kPa)`, `stress [kPa]`, `stress, kPa`, `stress / kPa`, `P_MPa`."""
    cell = cell.strip()
    for pattern in (r"(.+?)\s*[\(\[]([^()\[\]]*)[\)\]]", r"(.+?)\s*,\s*(\S+)", r"(.+?)\s+/\s*(\S+)"):
        if (found := re.fullmatch(pattern, cell)) and quantity_of(found[1]) is not None:
            return found[1], found[2]
    if (found := re.fullmatch(r"(.+)_([^\W\d_][^_]*)", cell)) and (quantity := quantity_of(found[1])) is not None \
            and si_factor(found[2], quantity) is not None:
        return found[1], found[2]
    return cell, None
