"""Which columns of a file mean what, as the user says with --columns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matcal.readers.recording import QUANTITIES
from matcal.readers.vocabulary import KINDS

EXAMPLE = "--columns \"stress=1:MPa,stretch=2\""


@dataclass(frozen=True)
class Selection:
    """One --columns option: what it applies to, and its choice of sheet and columns."""

    where: str | None  # kind or file name it applies to, None for every file
    # quantity (a key of QUANTITIES) -> (column name or number from 1, unit or None where the file has it)
    columns: Mapping[str, tuple[str, str | None]]
    sheet: str | None = None  # sheet of a workbook, None where the file leaves no choice
    text: str = ""  # the option as it was given
    block: int | None = None  # acquisition block of a controller's file, from 1; None for all of them


def parse_selection(text: str) -> Selection:
    """`[KIND=|FILE=]QUANTITY=COLUMN[:UNIT],...` with COLUMN a name or a number from 1, and perhaps sheet=NAME or
    block=N. Raises ValueError, with an example, for anything else."""
    where, columns, sheet, block = None, {}, None, None
    for k, item in enumerate(text.split(",")):
        parts = [part.strip() for part in item.split("=")]
        if k == 0 and len(parts) == 3:
            where, *parts = parts
        if len(parts) != 2 or not all(parts):
            raise ValueError(f"`columns` '{text}': '{item}' is not QUANTITY=COLUMN[:UNIT]. Example: {EXAMPLE}.")
        key, value = parts
        if key == "sheet":
            sheet = value
            continue
        if key == "block":
            if not value.isdecimal() or int(value) < 1:
                raise ValueError(f"`columns` '{text}': block={value} must be the number of a block, from 1.")
            block = int(value)
            continue
        if key not in QUANTITIES:
            raise ValueError(f"`columns` '{text}': quantity '{key}' is unknown; known: "
                             f"{', '.join(q for q in QUANTITIES if q != 'block')}, sheet and block.")
        if key in columns:
            raise ValueError(f"`columns` '{text}': {key} is given twice.")
        name, colon, unit = value.rpartition(":")
        columns[key] = (name, unit) if colon and name else (value, None)
    return Selection(where, columns, sheet, text, block)


def selections_of(inputs: Sequence[Any], given: Sequence[Selection]) -> list[dict[Path, Selection]]:
    """For each input (kind or None, sources), the selection of each of its files; none for what was read before. A
    selection that names a file goes before one that names a kind, and that before one that names neither; several of
    the same `where` are taken in turn by the inputs that they fit. Raises ValueError where one fits no input."""
    taken: dict[str | None, int] = {}
    out: list[dict[Path, Selection]] = []
    for test in inputs:
        chosen = {}
        kind, sources = test if isinstance(test, tuple) else (None, ())
        for path in (source for source in sources if isinstance(source, Path)):
            for where in (path.name, str(path), kind, None):
                if fitting := [s for s in given if s.where == where]:
                    turn = taken.get(where, 0)
                    taken[where] = turn + 1
                    chosen[path] = fitting[min(turn, len(fitting) - 1)]
                    break
        out.append(chosen)
    used = [id(selection) for chosen in out for selection in chosen.values()]
    if unused := next((s for s in given if id(s) not in used), None):
        raise ValueError(f"`columns` '{unused.text}' fits no file. Begin it with the name of a file or a kind that is "
                         f"given (kinds: {', '.join(KINDS)}), or with neither.")
    return out
