"""Numbers as they stand on a page: significant digits, a true minus sign, powers of ten, prefixes of units."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float, digits: int = 3) -> str:
    """`value` to `digits` significant digits; ValueError for one that is not finite, so that none reaches a page."""
    value = float(value)
    if not math.isfinite(value):
        raise ValueError(f"a report cannot print {value}: its source holds a value that is not a finite number.")
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = int(exponent)
    if -3 <= power < 5:
        return f"{float(f'{value:.{digits - 1}e}'):.{max(digits - 1 - power, 0)}f}".replace("-", "−")
    return f"{mantissa.replace('-', '−')} × 10{exponent_mark(power)}"


def exponent_mark(power: int) -> str:
    """A whole power as superscript characters."""
    return str(power).translate(_SUPERSCRIPTS)


def percent(fraction: float, digits: int = 2) -> str:
    """A fraction as per cent."""
    return f"{number(100 * fraction, digits)} %"


def interval(lo: float, hi: float, digits: int = 3) -> str:
    """Two ends of an interval; an end below 1e-4 of the other is printed as 0."""
    ends = [0.0 if abs(end) < 1e-4 * max(abs(lo), abs(hi)) else end for end in (lo, hi)]
    return f"{number(ends[0], digits)} to {number(ends[1], digits)}"


def plus_minus(value: float, error: float) -> str:
    """A value and its standard error, both to the second significant digit of the error."""
    if not (math.isfinite(value) and math.isfinite(error) and error > 0):
        return f"{number(value, 4)} ± {number(error, 2)}"
    power = math.floor(math.log10(error))
    if power >= 5 or power < -8:
        return f"{number(value, 4)} ± {number(error, 2)}"
    decimals = max(1 - power, 0)
    return f"{value:.{decimals}f} ± {error:.{decimals}f}".replace("-", "−")


def r_squared(value: float) -> str:
    """R² to four digits, or, close to 1, to the second digit of what it lacks."""
    lack = 1 - value
    if not 0 < lack < 1e-3:
        return number(value, 4)
    return f"{value:.{min(1 - math.floor(math.log10(lack)), 12)}f}"


def counted(count: int, noun: str, plural: str | None = None) -> str:
    """ "1 scene", "2 scenes"."""
    return f"{count} {noun if count == 1 else plural or noun + 's'}"


def volts(values: ArrayLike) -> tuple[float, str]:
    """Factor and unit (V, mV, µV) in which the largest of these voltages has at most three digits before its point."""
    largest = float(np.max(np.abs(values), initial=0.0))
    for factor, unit in ((1.0, "V"), (1e3, "mV")):
        if largest * factor >= 1:
            return factor, unit
    return 1e6, "µV"
