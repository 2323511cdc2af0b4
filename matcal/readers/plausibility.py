"""Whether columns can hold what their names say: swapped columns and wrong units are refused by name."""

import re

import numpy as np

from matcal.readers.cells import Grid, shown
from matcal.readers.recording import QUANTITIES
from matcal.readers.shear_angle import gamma_of, is_angle, is_tensorial
from matcal.readers.vocabulary import is_compression_ratio
from touchcal.arrays import Array
from touchcal.errors import InputFileError

# above this a strain without a unit may as well be a percentage, and above the next no unit fixes it
_LARGEST_STRAIN, _IMPOSSIBLE_STRAIN = 3.0, 20.0
# quantity -> magnitude in SI that no test of a soft foam reaches
_LARGEST = {"displacement": 10.0, "force": 1e8, "stress": 1e12, "modulus": 1e14, "deviation": 1e12, "pressure": 1e12,
            "current": 1e6, "potential": 1e9, "resistance": 1e20, "conductivity": 1e12, "volume_ratio": 100.0,
            "relative_resistance": 1e12, "cycle": 1e12, "block": 1e12, "lateral": 20.0, "lateral_stretch": 20.0}
# quantity -> magnitude in SI that any test of a soft foam exceeds somewhere
_SMALLEST = {"displacement": 1e-12, "force": 1e-12, "stress": 1e-9, "strain": 1e-12}
_AT_REST = 0.1  # from the first row of a compression ratio to the state of rest
# fewer rows do not show equal steps; a column within this share of its range of equal steps has them, one above the
# next has not
_ENOUGH, _EQUAL, _CURVED = 10, 1e-4, 0.02


def check_credible(grid: Grid, line: int, values: dict[str, Array], names: dict[str, str], units: dict[str, str],
                   said: list[str], warned: list[str], flag: str, exchanged: str, percent: str, *,
                   chosen: bool) -> None:
    """Turn a stretch below 0 into a strain, a lateral stretch into a strain and an angle into gamma, in place, with
    what was decided (`said`) and what is to be minded (`warned`); InputFileError where a column
    cannot be what it is called. With columns `chosen` by the user, only what no unit fixes is refused. `flag` is the
    option that takes columns as named, `exchanged` the one that exchanges strain and load, `percent` the one that reads
    the strain in per cent."""
    _ratios(values, names, units, said)
    if "strain" in values and is_compression_ratio(names["strain"]):
        values["strain"] = _compressed(grid, line, values, shown(names["strain"]), units["strain"], said, percent)
    _angles(grid, line, values, names, units, said, warned)
    for quantity, column in values.items():
        reach = float(np.max(np.abs(column)))
        value = f"{reach:.3g} {QUANTITIES[quantity]}".strip()
        said_of = (f"reaches {value}, which no {quantity} does" if reach > _LARGEST.get(quantity, np.inf) else
                   f"nowhere exceeds {value}, too little for any {quantity}" if 0 < reach < _SMALLEST.get(quantity, 0.0)
                   else "")
        if said_of:
            raise InputFileError(grid.path, f"column '{shown(names[quantity])}' {said_of}. Check its unit and that "
                                            f"columns are not exchanged: {exchanged}", line=line)
    for quantity in {"strain", "stretch"} & set(values):
        _check_strain(grid, line, values[quantity], quantity, names, units, said, exchanged, percent, chosen)
    if not chosen:
        _check_steps(grid, line, values, names, flag, exchanged)


def _ratios(values: dict[str, Array], names: dict[str, str], units: dict[str, str], said: list[str]) -> None:
    if "stretch" in values and "strain" not in values and np.any(values["stretch"] <= 0):
        said.append(f"column '{shown(names['stretch'])}' has values at or below 0, which no stretch has: read as "
                    "strain.")
        for table in (values, names, units):
            table["strain"] = table.pop("stretch")  # type: ignore[assignment]
    if "lateral_stretch" in values:
        said.append(f"column '{shown(names['lateral_stretch'])}' is the lateral stretch: lateral strain = stretch - 1.")
        values["lateral_stretch"] = values["lateral_stretch"] - 1
        for table in (values, names, units):
            table["lateral"] = table.pop("lateral_stretch")  # type: ignore[assignment]


def _compressed(grid: Grid, line: int, values: dict[str, Array], name: str, unit: str, said: list[str],
                percent: str) -> Array:
    """The strain (n,) of a compression ratio, which begins at 0, or is 1 - strain and begins at 1, with the sign of its
    load; InputFileError where it begins at neither end."""
    ratio = values["strain"]
    rest, reach = float(ratio[0]), float(np.max(np.abs(ratio)))
    load = next((values[q] for q in ("stress", "force") if q in values), None)
    sign = -1.0 if load is not None and load[np.argmax(np.abs(load))] < 0 else 1.0
    ratio = ratio * (np.sign(ratio[np.argmax(np.abs(ratio))]) or 1.0)
    if abs(rest) <= _AT_REST and reach < 1:
        said.append(f"column '{name}' begins at {rest:.3g}: change of height over the height at rest.")
        return sign * ratio
    if abs(rest - 1) <= _AT_REST and ratio.min() > 0 and reach <= 1 + _AT_REST:
        said.append(f"column '{name}' begins at {rest:.3g} and falls: height over the height at rest, 1 - strain.")
        return sign * (1 - ratio)
    raise InputFileError(grid.path, f"column '{name}' begins at {rest:.3g} and reaches {reach:.3g}"
                                    f"{'' if unit else ' and has no unit'}. As a strain it begins at 0, as the height "
                                    "over that at rest at 1. Name it strain or stretch; in per cent it is given with "
                                    f"{percent}", line=line)


def _angles(grid: Grid, line: int, values: dict[str, Array], names: dict[str, str], units: dict[str, str],
            said: list[str], warned: list[str]) -> None:
    if "strain" in values and is_tensorial(names["strain"]):
        values["strain"] = 2 * values["strain"]
        warned.append(f"Column '{shown(names['strain'])}' is a component of the strain tensor by its name: gamma is "
                      "twice it, and was taken so. If it is gamma itself, name it gamma.")
    if "strain" not in values or not is_angle(units["strain"]):
        return
    try:
        values["strain"], decided, minded = gamma_of(values["strain"], units["strain"], shown(names["strain"]))
    except ValueError as error:
        raise InputFileError(grid.path, str(error), line=line) from None
    said.append(decided)
    warned += [minded] if minded else []


def _check_strain(grid: Grid, line: int, column: Array, quantity: str, names: dict[str, str], units: dict[str, str],
                  said: list[str], exchanged: str, percent: str, chosen: bool) -> None:
    name, reach, unit = shown(names[quantity]), float(np.max(np.abs(column))), units[quantity]
    if reach > _IMPOSSIBLE_STRAIN and np.ptp(column) == 0:
        raise InputFileError(grid.path, f"column '{name}' is {column[0]:g} in every row, which no {quantity} is: a "
                                        "channel without a sensor. Choose another column.", line=line)
    if reach > _IMPOSSIBLE_STRAIN:
        problem = f"reaches {reach:g}" if unit else f"reaches {reach:g} and has no unit"
        share = reach <= 100 * _IMPOSSIBLE_STRAIN and unit != "%"
        fix = " ".join([f"if it is in per cent, give {percent}"] * share
                       + [f"{'If' if share else 'if'} columns are exchanged, give {exchanged}"]
                       * (not share or not chosen))
        raise InputFileError(grid.path, f"column '{name}' {problem}, which no {quantity} does. Write its unit, % or -, "
                                        f"below its name, or, {fix}", line=line)
    if not unit and reach > _LARGEST_STRAIN and not chosen:
        raise InputFileError(grid.path, f"column '{name}' reaches {reach:g} and has no unit. Write its unit, % or -, "
                                        f"below its name, or, if it is in per cent, give {percent}", line=line)
    sheared = is_angle(unit) or re.search(r"gamma|γ|shear|schub|scher|剪切", names[quantity].lower())
    if quantity == "strain" and float(column.min()) <= -1 and not sheared:
        raise InputFileError(grid.path, f"column '{name}' falls to {column.min():.4g}: at -1 nothing is left of the "
                                        "specimen, and a shear strain is called gamma. "
                                        + ("" if unit else f"If it is in per cent, give {percent} ")
                                        + f"Check its unit and that columns are not exchanged: {exchanged}", line=line)
    if not unit:
        said.append(f"column '{name}' has no unit: read as a plain ratio.")


def _check_steps(grid: Grid, line: int, values: dict[str, Array], names: dict[str, str], flag: str,
                 exchanged: str) -> None:
    """A table is written over equal steps of strain; a "stress" in equal steps next to a curved "strain" is that."""
    measure = next((q for q in ("strain", "stretch") if q in values), None)
    if measure is None or "stress" not in values or "displacement" in values or values["stress"].size < _ENOUGH:
        return
    if _bend(values["stress"]) < _EQUAL and _bend(values[measure]) > _CURVED:
        raise InputFileError(grid.path, f"'{shown(names['stress'])}' advances in equal steps while "
                                        f"'{shown(names[measure])}' does not: the columns look exchanged. If they are, "
                                        f"give {exchanged} If they are not, give {flag}", line=line)


def _bend(column: Array) -> float:
    """How far a column is from equal steps between its ends, as a share of its range; infinite where it has none."""
    reach = float(np.ptp(column))
    line = np.linspace(column[0], column[-1], column.size)
    return float(np.max(np.abs(column - line))) / reach if reach > 0 else np.inf
