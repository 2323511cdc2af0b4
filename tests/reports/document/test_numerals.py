import math

import pytest

from reports.document.numerals import (
    in_figure,
    number,
    pascals,
    plus_minus,
    r_squared,
    typeset,
    volts,
    within,
)


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


@pytest.mark.parametrize(("value", "text"), [(0.5, "0.5000"), (-3.25, "−3.2500"), (0.9991, "0.9991"), (1.0, "1.0000"),
                                             (0.99994, "0.9999"), (0.999999999948, "> 0.9999")])
def test_r_squared_has_four_places_and_never_reads_one_where_it_is_not(value: float, text: str) -> None:
    assert r_squared(value) == text


@pytest.mark.parametrize(("value", "error", "text"), [(9.5123, 4.6, "9.5 ± 4.6"), (-17.0, 0.0123, "−17.000 ± 0.012"),
                                                      (1234.5, 120.0, "1230 ± 120"), (2.0, 0.0, "2.000 ± 0")])
def test_a_value_ends_where_its_error_does(value: float, error: float, text: str) -> None:
    assert plus_minus(value, error) == text


def test_an_interval_gives_the_digits_of_its_value() -> None:
    assert within(9750.11, 9639.7, 9860.5) == ("9750", "9640 to 9860")
    assert within(-9.5123, -9.6, -9.4) == ("−9.51", "−9.60 to −9.40")
    assert within(2.5e8, 2.4e8, 2.6e8) == ("2.50 × 10⁸", "2.40 × 10⁸ to 2.60 × 10⁸")
    assert within(1.0, 1.0, 1.0) == ("1.000", "1.000 to 1.000")


@pytest.mark.parametrize(("words", "text"), [("strain -0.5 to -0.3", "strain −0.5 to −0.3"), ("1e-05 s", "1 × 10⁻⁵ s"),
                                             ("ISO 3386-1, x-y", "ISO 3386-1, x-y"),
                                             ("3 kJ/m3 (70%), 20 um", "3 kJ/m³ (70 %), 20 µm"),
                                             ("g_i >= 0, 1 +- 2", "gᵢ ≥ 0, 1 ± 2"),
                                             ("mu_0 of alpha and nu = 0", "μ₀ of α and ν = 0"),
                                             ("--nu 0.3, mu_0_Pa, alpha_1, drum", "--nu 0.3, mu_0_Pa, alpha_1, drum")])
def test_signs_and_powers_are_set(words: str, text: str) -> None:
    assert typeset(words) == text


def test_a_power_in_a_figure_is_one_that_its_font_has() -> None:
    assert in_figure(f"RMSE {number(4.1e-6, 2)} mm") == "RMSE 4.1 × $10^{-6}$ mm"
    assert in_figure("10 mm²") == "10 mm²"
    assert in_figure("x₀/r, a₁₂ (–)") == "x$_{0}$/r, a$_{12}$ (–)"


@pytest.mark.parametrize(("value", "unit"), [(123.0, "Pa"), (9.5e3, "kPa"), (2e8, "MPa"), (0.0, "Pa"), (0.3, "Pa")])
def test_stresses_get_the_unit_that_fits_the_largest(value: float, unit: str) -> None:
    assert pascals([value, -value / 2])[1] == unit


@pytest.mark.parametrize(("values", "unit"), [([-2.0, 1.0], "V"), ([0.5], "mV"), ([-3e-5], "µV"), ([0.0], "µV")])
def test_voltages_get_the_unit_that_fits_the_largest(values: list[float], unit: str) -> None:
    factor, name = volts(values)
    assert name == unit
    assert factor == {"V": 1.0, "mV": 1e3, "µV": 1e6}[unit]
