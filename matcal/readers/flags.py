"""The --columns option that would read a given file, guessed from its names and numbers."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from matcal.readers.grid import Grid
from matcal.readers.recording import QUANTITIES
from matcal.readers.units import measures, si_factor
from matcal.readers.words import quantity_of

if TYPE_CHECKING:
    from matcal.readers.columns import Header

_UNITS = {"Pa": "MPa", "m": "mm", "N": "N", "s": "s", "A": "A", "V": "V", "ohm": "ohm", "S/m": "S/m"}
_PAIRS = (("stretch", "stress"), ("strain", "stress"), ("displacement", "force"), ("time", "current"))


def flag_for(grid: Grid, header: Header) -> str:
    """`--columns "..."` with quantities that the names suggest, else a guess from the numbers, as one sentence."""
    guess = _from_names(header) or _from_units(header) or _from_numbers(grid, header)
    items = ",".join(f"{quantity}={n + 1}{_unit(header, quantity, n)}" for quantity, n in guess.items())
    where = grid.path.name if not re.search(r"[,=\"]", grid.path.name) else ""
    return f"--columns \"{where}{'=' if where else ''}{items}\" (columns by number or name)."


def _unit(header: Header, quantity: str, column: int) -> str:
    own = header.cells[column][1] if column < len(header.cells) else None
    if own is not None and si_factor(own, quantity) is not None and own.strip():
        return ""
    if not QUANTITIES[quantity]:
        return ""
    units = [unit for _, unit in header.cells if unit and si_factor(unit, quantity) is not None]
    return f":{units[0] if units else _UNITS[QUANTITIES[quantity]]}"


def _from_names(header: Header) -> dict[str, int]:
    """The first columns, side by side, whose last words name two quantities that belong together, and their scatter."""
    words = [_last_words(name) for name, _ in header.cells]
    for pair in _PAIRS:
        for n, quantity in enumerate(words):
            if quantity == pair[0]:
                near = [m for m in (n + 1, n - 1, n + 2) if 0 <= m < len(words) and words[m] == pair[1]]
                if near:
                    scatter = near[0] + 1 if near[0] + 1 < len(words) and words[near[0] + 1] == "deviation" else None
                    return {pair[0]: n, pair[1]: near[0]} | ({} if scatter is None else {"deviation": scatter})
    return {}


def _last_words(name: str) -> str | None:
    """The quantity that a name, or its end, stands for."""
    words = re.split(r"[\s_\-.:]+", re.sub(r"\s*[(\[][^()\[\]]*[)\]]\s*$", "", name))
    return next((found for k in range(min(len(words), 8)) if (found := quantity_of(" ".join(words[k:])))), None)


def _from_units(header: Header) -> dict[str, int]:
    """Columns by what their units measure, where these tell two quantities that belong together apart."""
    found: dict[str, int] = {}
    for n, (_, unit) in enumerate(header.cells):
        for quantity in measures(unit) if unit else []:
            if quantity in ("displacement", "force", "stress", "time", "current"):
                found.setdefault(quantity, n)
    pair = {"displacement", "force"}
    return {q: n for q, n in found.items() if q in pair or q == "time"} if pair <= set(found) else {}


def _from_numbers(grid: Grid, header: Header) -> dict[str, int]:
    """Of two columns, the one that begins near 1 as the stretch, or else the first as the strain; the other as stress.

    A guess that shows how the option is written; only the user knows.
    """
    size = max(len(header.cells), 2)
    first = grid.rows[header.rows.start] if header.rows else []
    begins = [grid.number(cell) for cell in first[:2]]
    stretch = next((n for n, value in enumerate(begins) if value is not None and 0.9 <= value <= 1.1), None)
    if stretch is None:
        return {"strain": 0, "stress": 1}
    other = 1 - stretch if size == 2 else next(n for n in range(size) if n != stretch)
    return dict(sorted({"stretch": stretch, "stress": other}.items(), key=lambda item: item[1]))
