"""Numbers as they stand on a page: significant digits, a true minus sign, powers of ten, prefixes of units."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from touchcal import number_words

# how names and signs that programs print in ASCII stand on a page
_ASCII = ((r"\bmu_0\b", "μ₀"), (r"\bmu_i\b", "μᵢ"), (r"\bE_0\b", "E₀"), (r"\bg_i\b", "gᵢ"), (r"\bln tau\b", "ln τ"),
          (r"\bln sigma\b", "ln σ"), (r"(?<![-\w])alpha\b(?!_)", "α"), (r"(?<![-\w])nu (?== )", "ν "), (">=", "≥"),
          ("<=", "≤"), (r"\+-", "±"), (r"(?<=\d)%", " %"), (r"(?<=\d )um\b", "µm"), (r"\bm3\b", "m³"))
_DIGITS, _RAISED, _LOWERED = "-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "₀₁₂₃₄₅₆₇₈₉"
_SUPERSCRIPTS = str.maketrans(_DIGITS, _RAISED)


def number(value: float, digits: int = 3) -> str:
    """`value` to `digits` significant digits; ValueError for one that is not finite, so that none reaches a page."""
    return typeset(number_words.significant(float(value), digits, -3, 5))


def percent(fraction: float, digits: int = 2) -> str:
    """A fraction as per cent."""
    return f"{number(100 * fraction, digits)} %"


def interval(lo: float, hi: float, digits: int = 3) -> str:
    """Two ends of an interval; an end below 1e-4 of the other is printed as 0."""
    ends = [0.0 if abs(end) < 1e-4 * max(abs(lo), abs(hi)) else end for end in (lo, hi)]
    return f"{number(ends[0], digits)} to {number(ends[1], digits)}"


def within(value: float, lo: float, hi: float) -> tuple[str, str]:
    """A value and its interval "lo to hi", all to the second significant digit of half the interval's width."""
    middle, ends = number_words.within(value, lo, hi)
    return typeset(middle), typeset(ends)


def typeset(words: str) -> str:
    """Words with true signs, symbols and powers of ten, a minus sign before each number that is negative."""
    for ascii_words, sign in _ASCII:
        words = re.sub(ascii_words, sign, words)
    words = re.sub(r"(\d)e([+-]\d+)", lambda m: f"{m[1]} × 10{str(int(m[2])).translate(_SUPERSCRIPTS)}", words)
    return re.sub(r"(?<![\w.)-])-(?=\d)", "−", words)


def in_figure(words: str) -> str:
    """Words with powers of ten and lowered digits as the figures' mathematics has them, since their font lacks a raised
    minus and these digits."""
    plain = str.maketrans(_RAISED + _LOWERED, _DIGITS + _DIGITS[1:])
    words = re.sub(f"([{_LOWERED}]+)", lambda m: f"$_{{{m[1].translate(plain)}}}$", words)
    return re.sub(f"10([{_RAISED}]+)", lambda m: f"$10^{{{m[1].translate(plain)}}}$", words)


def plus_minus(value: float, error: float) -> str:
    """A value and its standard error, both to the second significant digit of the error."""
    middle, own = number_words.with_error(value, error)
    return typeset(f"{middle} ± {own}")


def r_squared(value: float) -> str:
    """R² to four places; where these would read 1, that it is above 0.9999."""
    return "> 0.9999" if 0.99995 <= value < 1 else typeset(f"{value:.4f}")


counted = number_words.counted


def prefixed(values: ArrayLike, unit: str,
             prefixes: Sequence[str] = ("G", "M", "k", "", "m", "µ")) -> tuple[float, str]:
    """Factor and unit in which the largest of these values has one to three digits before its point, where it can."""
    largest = float(np.max(np.abs(np.asarray(values, dtype=float)), initial=0.0))
    powers = {"G": 9, "M": 6, "k": 3, "": 0, "m": -3, "µ": -6}
    chosen = next((p for p in prefixes if largest >= 0.9995 * 10 ** powers[p]), prefixes[-1])
    return 10.0 ** -powers[chosen], chosen + unit


def volts(values: ArrayLike) -> tuple[float, str]:
    """Factor and unit (V, mV, µV) in which the largest of these voltages has at most three digits before its point."""
    return prefixed(values, "V", ("", "m", "µ"))


def pascals(values: ArrayLike) -> tuple[float, str]:
    """Factor and unit (GPa, MPa, kPa, Pa) in which the largest of these stresses reads best."""
    return prefixed(values, "Pa", ("G", "M", "k", ""))
