"""Numbers as the terminal prints them: as many digits as the uncertainty leaves, decimals where they stay readable."""

import math

_SMALLEST, _LARGEST = -4, 7  # values printed with a power of ten: below 1e-4, from 1e7 on
# most significant digits of a value, however small its error, and least where it is above a hundredth of its error
_MOST, _LEAST = 8, 2


def significant(value: float, digits: int = 4, smallest: int = _SMALLEST, largest: int = _LARGEST) -> str:
    """`value` to `digits` significant digits, with a power of ten below 10^smallest and from 10^largest on; ValueError
    for one that is not finite."""
    if not math.isfinite(value):
        raise ValueError(f"{value} cannot be printed as a result: it is not a finite number.")
    if value == 0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    power = _power(rounded)
    if not smallest <= power < largest:
        return f"{value:.{digits - 1}e}"
    return f"{rounded:.{max(digits - 1 - power, 0)}f}"


def counted(count: int, noun: str, plural: str | None = None) -> str:
    """ "1 scene", "2 scenes"."""
    return f"{count} {noun if count == 1 else plural or noun + 's'}"


def percent(fraction: float, digits: int = 3) -> str:
    """A fraction of a stress in per cent; from ten times the stress on as a multiple of it."""
    if fraction < 10:
        return f"{significant(100 * fraction, digits)} %"
    return f"{significant(fraction, 2)} times the stress"


def with_error(value: float, error: float) -> tuple[str, str]:
    """A value and its standard error, both to the second significant digit of the error, or to the second of the value.
    """
    first, second = _rounded((value, error), error)
    return first, second


def within(value: float, lo: float, hi: float) -> tuple[str, str]:
    """A value, and "lo to hi", all to the second significant digit of half the interval's width."""
    middle, low, high = _rounded((value, lo, hi), (hi - lo) / 2)
    return middle, f"{low} to {high}"


def _rounded(values: tuple[float, ...], error: float) -> tuple[str, ...]:
    size = max(abs(v) for v in values)
    if not (math.isfinite(size) and math.isfinite(error)) or error <= 0 or size == 0:
        return tuple(significant(v) for v in values)
    decimals = min(1 - _power(float(f"{error:.1e}")), _MOST - 1 - _power(size))
    if not _SMALLEST <= _power(size) < _LARGEST:
        return tuple(f"{v:.{max(decimals + _power(size), 1)}e}" for v in values)
    own = decimals
    if abs(values[0]) > 10.0**-_LEAST * error:
        own = max(decimals, _LEAST - 1 - _power(values[0]))
    return tuple(f"{round(v, d) + 0.0:.{max(d, 0)}f}" for v, d in zip(values, (own, *[decimals] * len(values)),
                                                                     strict=False))


def _power(value: float) -> int:
    return math.floor(math.log10(abs(value)))
