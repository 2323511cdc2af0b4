"""Lines above a table that say something about the specimen: `key, value, unit`, and the sizes among them."""

import re
from collections.abc import Iterable, Sequence

import numpy as np

from matcal.readers.cells import Grid, Style, shown
from matcal.readers.recording import SIZES
from matcal.readers.units import si_factor
from matcal.readers.vocabulary import size_of


def metadata_of(rows: Iterable[Sequence[str]]) -> dict[str, str]:
    """Key -> value with its unit, of lines with two cells or more."""
    out = {}
    for row in rows:
        key, *values = [cell for cell in row if cell]
        if values and (key := key.rstrip(" :：")):
            out[shown(key, 80)] = shown(" ".join(values), 200)
    return out


def sizes_of(grid: Grid, rows: Iterable[int]) -> tuple[dict[str, float], list[str]]:
    """Size (a key of SIZES) -> value in SI of the lines that state one, and notes on what was and was not used."""
    out: dict[str, float] = {}
    notes = []
    for n in rows:
        key, *values = [*grid.rows[n], ""]
        size = size_of(key)
        if size is None or not values[0]:
            continue
        value, unit = _value(values[0], grid.style), values[1] if len(values) > 1 else ""
        unit = unit or _unit_in(key) or _unit_in(values[0])
        factor = si_factor(unit.strip("()[]"), size) if unit else None
        name = shown(key.rstrip(" :："))
        if value is None or not np.isfinite(value) or value <= 0 or factor is None:
            why = "its unit is not stated" if value is not None and not unit else "it is no length or area"
            notes.append(f"'{name}' = {shown(values[0])} is not used as a size: {why}.")
        elif size in out and not np.isclose(out[size], value * factor):
            notes.append(f"'{name}' = {shown(values[0])} {unit} left out: another {size} stands above it.")
        else:
            out[size] = value * factor
            notes.append(f"'{name}' = {shown(values[0])} {unit}: the specimen's {size}, as the file states it.")
    return {size: value for size, value in out.items() if 1e-7 < value < 1e3 and size in SIZES}, notes


def _value(cell: str, style: Style) -> float | None:
    return style.number(found[0]) if (found := re.match(r"[-+\d.,]+(?:[eE][-+]?\d{1,3})?", cell)) else None


def _unit_in(text: str) -> str:
    """The unit that a key or a value carries itself: `Durchmesser in mm`, `Width (mm)`, `12.7 mm`."""
    found = re.search(r"(?: in | en |\(|\[|[\d.,]\s?)([^\W\d_]{1,4}(?:\^?2|²)?)\s*[)\]]?\s*[:：]?\s*$", text[:120])
    return found[1] if found else ""
