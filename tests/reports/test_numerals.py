from __future__ import annotations

import math

import pytest

from reports.numerals import counted, interval, number, percent, volts


@pytest.mark.parametrize(("value", "digits", "text"), [
    (0.0, 3, "0"), (3.6461, 3, "3.65"), (3.6461, 4, "3.646"), (-9.53, 3, "−9.53"), (1234.5, 3, "1230"),
    (0.0123, 2, "0.012"), (9.999, 3, "10.0"), (0.00012, 2, "1.2 × 10⁻⁴"), (-2.5e7, 2, "−2.5 × 10⁷"),
    (99999, 2, "1.0 × 10⁵"),
])
def test_numbers_keep_their_significant_digits(value: float, digits: int, text: str) -> None:
    assert number(value, digits) == text


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_never_reaches_a_page(value: float) -> None:
    with pytest.raises(ValueError, match="not a finite number"):
        number(value)


def test_words_around_numbers() -> None:
    assert percent(0.0123) == "1.2 %"
    assert interval(9.4, 9.66) == "9.40 to 9.66"
    assert [counted(n, "touch", "touches") for n in (0, 1, 2)] == ["0 touches", "1 touch", "2 touches"]
    assert counted(2, "scene") == "2 scenes"


@pytest.mark.parametrize(("values", "unit"), [([-2.0, 1.0], "V"), ([0.5], "mV"), ([-3e-5], "µV"), ([0.0], "µV")])
def test_voltages_get_the_unit_that_fits_the_largest(values: list[float], unit: str) -> None:
    factor, name = volts(values)
    assert name == unit
    assert factor == {"V": 1.0, "mV": 1e3, "µV": 1e6}[unit]
