"""Labels of touches that come several at once: a row a touch with `place`, or x_mm and y_mm, several rows of one
`touch` where several press together; or a row a frame with a column of 0 and 1 a place."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eitsim.sensors.labels import NAMES, OTHER_UNITS, PLACE, PRESS, TOUCH, checked, named_once
from eitsim.sensors.recording import touch_name
from touchcal.arrays import Array, Mask
from touchcal.csv_numbers import csv_rows, finite
from touchcal.errors import InputFileError

NAMED, POINTS, FORCE = "place", "points", "F_N"
_FORMS = (f"Expected {TOUCH}, {NAMED} (or {', '.join(PLACE)}) and {FORCE} where it is known, a row a place that is "
          f"pressed; or {TOUCH} and a column of 0 and 1 a place.")


@dataclass(frozen=True, eq=False)
class TouchSets:
    """Which places some touches press, several at once."""

    touch: NDArray[np.str_]  # (n,) name of each touch, all different
    places: tuple[str, ...]  # k names
    down: Mask  # (n, k) whether a touch presses a place
    at_mm: Array | None = None  # (k, 2) x and y of the places, mm, where they are given
    force_N: Array | None = None  # (n, k) force on each place, 0 where it is not pressed, where it is given


def holds_several(path: Path | str) -> bool:
    """Whether a CSV of labels says which places are pressed at once: it has a column `place`, or one of 0 and 1 of a
    place, or names a touch twice. InputFileError where it is no text."""
    rows = csv_rows(Path(path), "one row a touch")
    header = rows[0][1] if rows else []
    if TOUCH not in header:
        return False
    whole = [cells for _, cells in rows[1:] if len(cells) == len(header)]
    column = [touch_name(cells[header.index(TOUCH)]) for cells in whole]
    return NAMED in header or ({*PLACE} <= {*header} and len({*column}) < len(column)) or any(
        {cells[header.index(name)] for cells in whole} <= {"0", "1", "0.0", "1.0"} for name in _columns(header))


def read_touch_sets(path: Path | str) -> TouchSets:
    """Read a CSV of labels of several touches at once, in any of the forms above.

    InputFileError names the line and column of what is no label.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import surrogate
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "touches.csv"
    ...     _ = path.write_text("touch,place\\n1,A\\n2,A\\n2,B\\n")
    ...     sets = surrogate.read_touch_sets(path)
    >>> sets.places, sets.down.tolist()
    (('A', 'B'), [[True, False], [True, True]])
    """
    path = Path(path)
    rows = csv_rows(path, "one row a touch")
    header = rows[0][1] if rows else []
    if TOUCH not in header or len({*header}) < len(header) or len(rows) < 2:
        raise InputFileError(path, f"the header names {', '.join(header) or 'nothing'}, with {max(len(rows) - 1, 0)} "
                                   f"rows below it. {_FORMS}")
    rows = checked(path, header, rows[1:])
    return _of_columns(path, header, rows) if _columns(header) else _of_rows(path, header, rows)


def _columns(header: list[str]) -> list[str]:
    """The columns of a header that name places."""
    singles = {NAMED, *NAMES, *OTHER_UNITS}
    return [] if singles & {*header} else [name for name in header if name and name not in (TOUCH, PRESS, POINTS)]


def _of_columns(path: Path, header: list[str], rows: list[tuple[int, list[str]]]) -> TouchSets:
    """Labels of a row a frame."""
    places = _columns(header)
    down = np.array([[finite(path, line, name, cells[header.index(name)]) for name in places] for line, cells in rows])
    for (line, _), row in zip(rows, down, strict=True):
        if odd := [name for name, value in zip(places, row, strict=True) if value not in (0, 1)]:
            raise InputFileError(path, f"{odd[0]} is {row[places.index(odd[0])]:g}, and a column that names a place "
                                       f"holds 0 or 1. {_FORMS}", line=line)
        _check_any(path, line, row)
    if POINTS in header:
        for (line, cells), row in zip(rows, down, strict=True):
            if finite(path, line, POINTS, cells[header.index(POINTS)]) != row.sum():
                raise InputFileError(path, f"{POINTS} is {cells[header.index(POINTS)]}, and {row.sum():.0f} places are "
                                           "1. Correct one of them.", line=line)
    return TouchSets(named_once(path, header, rows), tuple(places), down == 1)


def _of_rows(path: Path, header: list[str], rows: list[tuple[int, list[str]]]) -> TouchSets:
    """Labels of a row a place that is pressed."""
    by = (NAMED,) if NAMED in header else PLACE
    known = (TOUCH, PRESS, NAMED, *PLACE, FORCE)
    if (odd := [name for name in header if name not in known]) or not {*by} <= {*header}:
        raise InputFileError(path, f"the header names {', '.join(odd or header)}. {_FORMS}")
    touches = list(dict.fromkeys(touch_name(cells[header.index(TOUCH)]) for _, cells in rows))
    named = {cells[header.index(NAMED)] for _, cells in rows} - {""} if NAMED in header else set()
    keys: dict[tuple[str, ...], int] = {(name,): column for column, name in enumerate(sorted(named))}
    at: dict[int, list[float]] = {}
    cell: dict[tuple[int, int], float] = {}
    for line, cells in rows:
        place = [finite(path, line, name, cells[header.index(name)]) for name in PLACE if name in header]
        key = (cells[header.index(NAMED)],) if NAMED in header else tuple(f"{value:g}" for value in place)
        if not key[0]:
            raise InputFileError(path, f"{NAMED} is empty; name the place that is pressed.", line=line)
        column = keys.setdefault(key, len(keys))
        if at.setdefault(column, place) != place:
            raise InputFileError(path, f"{NAMED} '{key[0][:20]}' is at another x_mm, y_mm than before; give each place "
                                       "one.", line=line)
        row = touches.index(touch_name(cells[header.index(TOUCH)]))
        if (row, column) in cell:
            raise InputFileError(path, f"touch '{touches[row][:20]}' presses the place {' '.join(key)} twice; label "
                                       "each place of a touch once.", line=line)
        force = finite(path, line, FORCE, cells[header.index(FORCE)]) if FORCE in header else 1.0
        if force <= 0:
            raise InputFileError(path, f"{FORCE} is {force:g}; a place that is pressed has a force above 0.", line=line)
        cell[row, column] = force
    force_N = np.zeros((len(touches), len(keys)))
    for (row, column), value in cell.items():
        force_N[row, column] = value
    at_mm = np.array([at[column] for column in range(len(keys))]) if {*PLACE} <= {*header} else None
    return TouchSets(np.array(touches, np.str_), tuple(" ".join(key) for key in keys), force_N > 0, at_mm,
                     force_N if FORCE in header else None)


def _check_any(path: Path, line: int, row: Array) -> None:
    if not row.any():
        raise InputFileError(path, "no place is 1; leave untouched frames out of the labels, their touch empty in the "
                                   "recording.", line=line)
