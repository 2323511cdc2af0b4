"""The quantities that a surrogate reads from voltages: name, column of the data set, unit, and what they are of."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from touchcal.arrays import Array


class Role(Enum):
    """What a quantity is of: models differ in how they read them."""

    PLACE = "place of the touch"
    HEIGHT = "third coordinate of its place, on a curved skin"
    LOAD = "its punch and force"
    RESPONSE = "what follows mechanically from the touch"


@dataclass(frozen=True)
class Output:
    """One predicted quantity."""

    name: str  # name on the command line and in results
    column: str  # column of the data set
    unit: str  # unit of the column, one of SI
    role: Role


# Every quantity, those of a touch itself first; a further one is a line here.
ALL = (Output("x0", "x_mm", "mm", Role.PLACE), Output("y0", "y_mm", "mm", Role.PLACE),
       Output("d", "d_mm", "mm", Role.LOAD), Output("F", "F_N", "N", Role.LOAD),
       Output("sigma_max", "sigma_max_kPa", "kPa", Role.RESPONSE),
       Output("sigma_ave", "sigma_ave_kPa", "kPa", Role.RESPONSE),
       Output("A_c", "A_c_mm2", "mm2", Role.RESPONSE), Output("delta_max", "delta_max_mm", "mm", Role.RESPONSE),
       Output("z0", "z_mm", "mm", Role.HEIGHT))
NAMES = tuple(output.name for output in ALL)
PLACES = tuple(output.name for output in ALL if output.role in (Role.PLACE, Role.HEIGHT))
RESPONSES = tuple(output.name for output in ALL if output.role is Role.RESPONSE)
TOUCHES = tuple(output.name for output in ALL if output.role in (Role.PLACE, Role.LOAD))
TOUCH = len(TOUCHES)  # numbers of a touch itself on a flat skin, the first of all
ROUNDING = 1e-9  # part of a value by which rounding may move it past an end of a range
# Unit of a column -> the SI unit, and how many of it one is.
SI = {"mm": ("m", 1e-3), "N": ("N", 1.0), "kPa": ("Pa", 1e3), "mm2": ("m2", 1e-6)}


def chosen(choice: str | Sequence[str], known: Sequence[str] = NAMES) -> tuple[str, ...]:
    """Names of a choice (a list, or separated by commas; "all" that are known), in the order of NAMES; ValueError lists
    them all."""
    if choice == "all":
        return tuple(known)
    requested = [name.strip() for name in choice.split(",")] if isinstance(choice, str) else choice
    if unknown := [name for name in requested if name not in NAMES]:
        raise ValueError(f"output '{unknown[0]}' is unknown; known: all, {', '.join(NAMES)}.")
    return tuple(name for name in NAMES if name in requested)


def lowest(value: Array, below: Array, sized: ArrayLike) -> Array:
    """Lower ends of intervals of values, each so far below; none below 0 where it is a size or a force, as `sized`
    (broadcast) says, unless the value is."""
    return np.where(sized, np.maximum(value - below, np.minimum(value, 0.0)), value - below)


def of(name: str) -> Output:
    """The output of this name; KeyError for another."""
    return {output.name: output for output in ALL}[name]
