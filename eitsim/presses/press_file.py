"""Force against depth of presses on a layer: a CSV, and the punch in words."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from eitsim.scene.profiles.registry import profiles
from eitsim.scene.scene import Punch
from touchcal.arrays import Array
from touchcal.csv_numbers import csv_rows
from touchcal.errors import InputFileError

_COLUMNS = ("depth_mm", "F_N")
_FEWEST, _MOST = 8, 40  # rows of a press, and points that it is thinned to


@dataclass(frozen=True, eq=False)
class Press:
    """One press of a punch from above the surface."""

    name: str
    punch: Punch
    depth_m: Array  # (n,) from where the machine took contact to be, increasing
    force_N: Array  # (n,)


def punch_of(words: str) -> Punch:
    """The punch of "flat 14", "flat 14 0.5" or "sphere 10": profile, diameter and fillet in mm.

    >>> import eitsim
    >>> eitsim.punch_of("flat 14 0.5").diameter_m
    0.014
    """
    profile, *sizes = words.split()
    try:
        numbers = [1e-3 * float(size) for size in sizes]
    except ValueError:
        numbers = []
    if profile not in profiles() or not 1 <= len(numbers) <= 2 or min(numbers) <= 0:
        raise ValueError(f"punch '{words}': write its profile ({', '.join(profiles())}), its diameter and, where it is "
                         "not 0.5 mm, its fillet in mm, for example \"flat 14\" or \"flat 14 0.2\".")
    punch = Punch(profile=profile, diameter_m=numbers[0])
    return replace(punch, fillet_m=numbers[1]) if len(numbers) == 2 else punch


def read_presses(path: Path | str, punch: Punch) -> tuple[Press, ...]:
    """The presses of one punch in a CSV with columns depth_mm and F_N and, where there are several, `press`.

    Rows after a press's deepest are its unloading and are left out; the others are averaged to at most 40 points.
    InputFileError names the line or column that is missing or wrong.

    >>> import eitsim
    >>> (press,) = eitsim.read_presses("examples/press_flat.csv", eitsim.punch_of("flat 14"))
    >>> press.depth_m.shape == press.force_N.shape
    True
    """
    path = Path(path)
    rows = csv_rows(path, "depth_mm and F_N, a row a point")
    if not rows or any(name not in rows[0][1] for name in _COLUMNS):
        raise InputFileError(path, f"the header must name {' and '.join(_COLUMNS)}, and press where there are several "
                                   f"presses; it holds {', '.join(rows[0][1]) if rows else 'nothing'}.")
    header, found = rows[0][1], {}
    for line, cells in rows[1:]:
        try:
            row = dict(zip(header, cells, strict=True))
            depth, force = (float(row[name]) for name in _COLUMNS)
        except ValueError:
            raise InputFileError(path, f"expected a number in each of {', '.join(_COLUMNS)}, and as many cells as the "
                                       "header has.", line=line) from None
        found.setdefault(row.get("press", ""), []).append((1e-3 * depth, force))
    return tuple(_press(path, name, np.array(points), punch) for name, points in found.items())


def _press(path: Path, name: str, points: Array, punch: Punch) -> Press:
    label = f"{path.stem}{f', press {name}' if name else ''}"
    loading = points[:int(np.argmax(points[:, 0])) + 1]
    loading = loading[np.argsort(loading[:, 0], kind="stable")]
    if len(loading) < _FEWEST or loading[-1, 1] <= 0:
        raise InputFileError(path, f"{label} has {len(loading)} points up to its deepest, with a force of "
                                   f"{loading[-1, 1]:g} N there; {_FEWEST} and a positive force are needed. Depth and "
                                   "force count into the layer.")
    parts = np.array_split(loading, min(_MOST, len(loading)))
    return Press(label, punch, *np.array([part.mean(axis=0) for part in parts]).T)


def check_presses(presses: Sequence[Press], thickness_m: float) -> None:
    """ValueError for none, or for one that reaches further than the layer is thick."""
    if not presses:
        raise ValueError("no presses are given.")
    for press in presses:
        if press.depth_m[-1] >= 0.8 * thickness_m:
            raise ValueError(f"{press.name} reaches {1e3 * press.depth_m[-1]:g} mm into a layer of "
                             f"{1e3 * thickness_m:g} mm; up to 0.8 of it is read. Check units, or leave rows out.")
