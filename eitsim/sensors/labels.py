"""Labels of recorded presses: a CSV with `touch` and any of x_mm, y_mm, d_mm, F_N, depth_mm, z_mm; where frames of one
press have names of their own, `press` names that."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eitsim.sensors.recording import touch_name
from touchcal.arrays import Array, Index
from touchcal.csv_numbers import csv_rows, finite, too_wide
from touchcal.errors import InputFileError, unknown_key

NAMES = ("x_mm", "y_mm", "d_mm", "F_N", "depth_mm", "z_mm")
# Other units that labels are often in, and how many of the unit of NAMES one of them is.
_OTHER_UNITS = {"mm": {"um": 1e-3, "cm": 10.0, "m": 1000.0, "in": 25.4},
                "N": {"mN": 1e-3, "kN": 1000.0, "g": 9.80665e-3, "gf": 9.80665e-3, "kg": 9.80665, "kgf": 9.80665}}
OTHER_UNITS = {f"{name.rpartition('_')[0]}_{unit}": (name, factor) for name in NAMES
               for unit, factor in _OTHER_UNITS[name.rpartition("_")[2]].items()}
TOUCH, PRESS = "touch", "press"
PLACE = NAMES[:2]


@dataclass(frozen=True, eq=False)
class Labels:
    """What is known of some touches."""

    touch: NDArray[np.str_]  # (n,) name of each touch, all different
    names: tuple[str, ...]  # some of NAMES
    values: Array  # (n, len(names)) in the units of the names
    press: NDArray[np.str_] | None = None  # (n,) name of the press that each belongs to; None: not said


def labels_of(labels: Labels, rows: Index) -> Labels:
    """The labels of some of the touches, in this order."""
    return Labels(labels.touch[rows], labels.names, labels.values[rows],
                  None if labels.press is None else labels.press[rows])


def places_of(labels: Labels) -> Array:
    """(n, 2) x and y, mm; ValueError where they are not labelled."""
    if any(name not in labels.names for name in PLACE):
        raise ValueError(f"the labels are {', '.join(labels.names)}; places need {' and '.join(PLACE)}.")
    return labels.values[:, [labels.names.index(name) for name in PLACE]]


def spans(labels: Labels) -> dict[str, tuple[float, float]]:
    """The least and the largest of each label, in the unit of its name.

    >>> spans(Labels(np.array(["a", "b"]), ("x_mm",), np.array([[3.0], [-1.0]])))
    {'x_mm': (-1.0, 3.0)}
    """
    return {name: (float(column.min()), float(column.max()))
            for name, column in zip(labels.names, labels.values.T, strict=True)}


def unit_of(name: str) -> str:
    """The unit of a label, which ends its name."""
    return name.rpartition("_")[2]


def read_labels(path: Path | str) -> Labels:
    """Read a CSV of labels, a row a touch: `touch` and any of NAMES, in the units of the names, and `press` where
    several touches are frames of one press.

    InputFileError names the line and column of what is no label.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import surrogate
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "touches.csv"
    ...     _ = path.write_text("touch,x_mm,y_mm,depth_mm\\na,1,2,10\\nb,3,4,15\\n")
    ...     labels = surrogate.read_labels(path)
    >>> labels.names, labels.values.shape
    (('x_mm', 'y_mm', 'depth_mm'), (2, 3))
    """
    path = Path(path)
    rows = csv_rows(path, "one row a touch")
    if not rows:
        raise InputFileError(path, f"the file is empty. Expected a header of {TOUCH} and any of {', '.join(NAMES)}.")
    header = rows[0][1]
    _check_header(path, rows[0][0], header)
    if len(rows) < 2:
        raise InputFileError(path, "a header without touches; give one row a touch below it.")
    touches = named_once(path, header, checked(path, header, rows[1:]))
    names = tuple(name for name in NAMES if name in header)
    values = [[finite(path, line, name, cells[header.index(name)]) for name in names] for line, cells in rows[1:]]
    press = [cells[header.index(PRESS)] for _, cells in rows[1:]] if PRESS in header else None
    return Labels(touches, names, np.array(values),
                  None if press is None else _presses(path, [line for line, _ in rows[1:]], press))


def checked(path: Path, header: list[str], rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Rows of as many cells as the header, each with the name of a touch; InputFileError where one is not."""
    for line, cells in rows:
        if len(cells) != len(header):
            raise InputFileError(path, f"{len(cells)} columns, expected {len(header)} as in the header."
                                       f"{too_wide(len(cells), len(header))}", line=line)
        if not cells[header.index(TOUCH)]:
            raise InputFileError(path, "touch is empty; name each touch as the recording does.", line=line)
    return rows


def named_once(path: Path, header: list[str], rows: list[tuple[int, list[str]]]) -> NDArray[np.str_]:
    """(n,) names of touches; InputFileError where one stands twice."""
    seen: dict[str, int] = {}
    for line, cells in rows:
        name = touch_name(cells[header.index(TOUCH)])
        if name in seen:
            raise InputFileError(path, f"touch '{name[:20]}' stands in line {seen[name]} too; label a touch once.",
                                 line=line)
        seen[name] = line
    return np.array([*seen], np.str_)


def _check_header(path: Path, line: int, header: list[str]) -> None:
    known = (TOUCH, PRESS, *NAMES)
    if other := [name for name in header if name in OTHER_UNITS]:
        asked = ", ".join(f"{OTHER_UNITS[name][0]} ({OTHER_UNITS[name][1]:g} times as large)" for name in other)
        raise InputFileError(path, f"{', '.join(other)} in a unit that labels do not take; give {asked}.", line=line)
    if odd := [name for name in header if name not in known]:
        said = unknown_key(odd[0][:20], known, what="column")
        raise InputFileError(path, f"{said} Leave it out where it is no label.", line=line)
    if len(set(header)) < len(header):
        raise InputFileError(path, f"the header names {', '.join(header)}: one of them twice.", line=line)
    if TOUCH not in header or not {*NAMES} & {*header}:
        raise InputFileError(path, f"the header names {', '.join(header)}; expected {TOUCH} and any of "
                                   f"{', '.join(NAMES)}.", line=line)


def _presses(path: Path, lines: list[int], names: list[str]) -> NDArray[np.str_]:
    for line, name in zip(lines, names, strict=True):
        if not name:
            raise InputFileError(path, "press is empty; name the press of each touch, or leave the column out.",
                                 line=line)
    return np.array([touch_name(name) for name in names], dtype=np.str_)
