"""What a calibration prints: digits that the uncertainty leaves, cautions, results before decisions, any width."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from matcal.card import MaterialCard, write_card
from matcal.cli.summary import print_columns, print_fit
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.laws.stability import stability
from matcal.posterior.drawn_laws import stress_band
from matcal.posterior.draws import foam_draws
from matcal.record.bands import conductivity_at, spans, stress_bands
from matcal.record.cautions import cautions
from touchcal.number_words import percent, significant, with_error, within

LAW = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3), "longterm",
                {"uniaxial": (-0.8, 0.0), "shear": (0.0, 1.0)})
SKIN = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
ROW = {"n": 60, "weight": 0.5, "unit": "Pa", "rms": 13.2, "r2": 0.99999, "source": ["a.txt"], "strain_range": [-0.8, 0]}


def fitted(**fit: Any) -> MaterialCard:
    """A card with two fitted tests and decisions by test and stage."""
    part = {"uniaxial_1": ROW | {"kind": "uniaxial", "relative_rms": 0.0018},
            "shear_1": ROW | {"kind": "shear", "relative_rms": 0.0017}} | fit
    provenance = {"files": [{"name": "a.txt", "sha256": "0" * 64}], "cpu_s": {"all": 1.0},
                  "decisions": ["uniaxial_1: toe cut.", "shear_1: drift taken off.", "Order 3, by BIC."],
                  "decisions_of": {"uniaxial_1": 1, "shear_1": 1, "law": 1}}
    return MaterialCard("foam", LAW, Prony(np.array([0.15]), np.array([0.3])), SKIN, part, provenance=provenance)


DERIVED = {"mu_0_Pa": {"value": 9750.11, "sd": 56.0, "lo": 9639.7, "hi": 9860.5}}


@pytest.mark.parametrize(("value", "error", "words"), [(9494.98, 4600.2, ("9500", "4600")),
                                                       (0.2096, 0.11557, ("0.21", "0.12")), (-1e9, 3e7, None)])
def test_a_value_is_printed_to_its_error(value: float, error: float, words: tuple[str, str] | None) -> None:
    printed = with_error(value, error)
    assert printed == words if words else float(printed[0]) == value


@given(st.floats(-1e9, 1e9), st.floats(1e-9, 1e9), st.floats(0.1, 1.0))
def test_no_digit_that_matters_is_lost(value: float, width: float, share: float) -> None:
    lo, hi = value - share * width, value + width
    assume(hi - lo > 1e-6 * abs(value))
    middle, ends = within(value, lo, hi)
    half_a_digit = 0.05 * (hi - lo) / 2 * (1 + 1e-9)
    resolution = max(half_a_digit, 1e-7 * max(abs(lo), abs(hi)))
    for text, number in zip((middle, *ends.split(" to ")), (value, lo, hi), strict=True):
        assert abs(float(text) - number) <= resolution


def test_numbers_read_well() -> None:
    assert [significant(v) for v in (0.0, 9750.112, 0.00012345, 1.5e8, 1234567.0)] == \
        ["0", "9750", "0.0001234", "1.500e+08", "1235000"]
    assert (percent(0.0018), percent(17.4)) == ("0.180 %", "17 times the stress")
    with pytest.raises(ValueError, match="not a finite number"):
        significant(float("nan"))


def test_cautions_name_what_spoils_the_numbers() -> None:
    card = replace(fitted(), stability=stability(LAW), provenance={"synthetic": True})
    said = " ".join(cautions(card))
    for words in ("synthetic", "Drucker stability is lost inside the fitted strains: uniaxial -0.546 to -0.306",
                  "One specimen", "tension only"):
        assert words in said, words
    assert "Ellipticity" not in said
    assert cautions(replace(card, conductivity=None, stability={}, provenance={}))[0].startswith("One specimen")


@pytest.mark.parametrize(("change", "words"), [
    ({"posterior": {"checks": {"converged": False, "rhat": 2.4, "ess": 30.0}}}, "did not converge (R-hat 2.400"),
    ({"prony": None}, "not corrected for the rate"),
    ({"law": None}, "without a stress-strain curve"),
    ({"law": replace(LAW, strain_range={"uniaxial": (-0.8, 0.0)})}, "Only uniaxial loading was fitted")])
def test_each_lack_is_said(change: dict[str, Any], words: str) -> None:
    card = replace(fitted(prony={"tau_sd_s": [0.2]}), **change)
    assert words in " ".join(cautions(card))


def test_poor_fits_and_predictions_are_said() -> None:
    card = fitted(uniaxial_1=ROW | {"kind": "uniaxial", "relative_rms": 0.2}, derived=DERIVED,
                  prony={"tau_sd_s": [0.2]},
                  predicted=[{"kind": "uniaxial", "source": ["t.csv"], "relative_rms": {"combined": 0.7}}])
    card = replace(card, posterior={"checks": {}, "derived": {"mu_0_Pa": {"median": 1e4, "lo": 9900.0, "hi": 1.1e4}}})
    said = " ".join(cautions(card))
    for words in ("uniaxial_1 by 20 %", "t.csv (uniaxial) by 70 %", "0.3 s", "differ by more", "mu_0_Pa"):
        assert words in said, words


@pytest.mark.parametrize("columns", [80, 120])
def test_results_come_first_and_fit_the_line(tmp_path: Path, capsys, monkeypatch, columns: int) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    card = fitted(derived=DERIVED, parameters={}, prony={"g_sd": [0.003], "tau_sd_s": [0.008]},
                  conductivity={"c0_sd_S_per_m": 0.0097, "a_sd": [0.0061, 0.039, 0.065]},
                  orders=[{"order": 2, "rms": 0.07, "bic": -2000.0, "confluence": ""},
                          {"order": 3, "rms": 0.001, "bic": -5000.0, "confluence": "two exponents merge " * 3}])
    write_card(card, tmp_path / "card.json")
    print_fit(replace(card, stability=stability(LAW)), tmp_path / "card.json", verbose=True)
    text = capsys.readouterr().out
    places = [text.index(words) for words in ("mu_0_Pa", "Mind", "Errors of the fit", "Stability of the law",
                                              "Order of the law", "Decisions", "Next", "matcal report")]
    assert places == sorted(places)
    tables = text[:text.index("Decisions")].splitlines()
    assert max(len(line.rstrip()) for line in tables if "!" not in line) <= columns
    for cell in ("9640 to 9860", "30.0000   0.0097", "-2.0000   0.0061", "two exponents merge"):
        assert cell in text, cell
    assert "\x1b" not in text


def test_a_pipe_gets_whole_sentences(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    card = fitted()
    long = "Order 3, " + "for many reasons " * 20
    card = replace(card, provenance={**card.provenance, "decisions": [*card.provenance["decisions"][:2], long]})
    write_card(card, tmp_path / "card.json")
    print_fit(card, tmp_path / "card.json", verbose=True)
    assert f"  - {long}".rstrip() in [line.rstrip() for line in capsys.readouterr().out.splitlines()]


def test_predictions_are_printed_as_columns(capsys) -> None:
    print_columns({"strain": [-0.1, -0.5], "stress_Pa": [-1611.9, -4222.0], "moduli": "longterm"}, "uniaxial, foam")
    text = capsys.readouterr().out
    assert re.search(r"-0\.5\s+-4222", text)
    assert "moduli: longterm" in text


def test_bands_reach_what_was_tested_and_mark_what_was_not() -> None:
    rng = np.random.default_rng(1)
    mu, alpha = LAW.mu_Pa * (1 + 0.02 * rng.normal(size=(40, 1))), np.repeat(LAW.alpha[None], 40, axis=0)
    draws = foam_draws(mu, alpha, np.zeros((40, 3)))
    bands = stress_bands(LAW, draws)
    assert set(bands["mode"]) == {"uniaxial", "biaxial", "planar", "shear", "volumetric"}
    column = {name: values[bands["mode"] == "shear"] for name, values in bands.items()}
    low, high = stress_band(draws, "shear", column["strain"])
    assert np.allclose(column["stress_lo_Pa"], low)
    assert np.allclose(column["stress_hi_Pa"], high)
    assert np.array_equal(column["extrapolated"], column["strain"] > 1)
    assert np.all(bands["extrapolated"][bands["mode"] == "planar"])
    for mode, (lo, hi) in spans({"shear": (-0.15, 0.15)}).items():
        assert lo < (1.0 if mode == "volumetric" else 0.0) <= hi or mode == "shear"


def test_a_band_is_read_between_its_rows() -> None:
    import pandas as pd

    band = pd.DataFrame({"strain": [-1.0, 0.0], "conductivity_S_per_m": [60.0, 30.0],
                         "conductivity_lo_S_per_m": [50.0, 29.0], "conductivity_hi_S_per_m": [70.0, 31.0]})
    assert conductivity_at(band, -0.5) == (45.0, 39.5, 50.5)
