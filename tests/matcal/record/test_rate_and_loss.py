"""Mind names the tests that a series did not correct for rate, with the size, and what a cycle loses."""

from pathlib import Path

import numpy as np
import pytest

import matcal
from matcal.fitting.calibrate import calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.laws.deformation_modes import hereditary_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.record.cautions import cautions
from matcal.record.write import make_card
from matcal.reduction.experiment import Experiment

FAST = Hyperfoam(np.array([18e3, 2e3]), np.array([8.0, -1.8]), np.zeros(2), "instantaneous")
SERIES = Prony(np.array([0.2, 0.1]), np.array([1.0, 20.0]))


def _tests(clock: bool, facts: dict[str, float]) -> list[Experiment]:
    hold_s = np.r_[np.linspace(0, 1, 60), 1 + np.geomspace(0.01, 50, 80)]
    held = -0.5 * np.minimum(hold_s, 1.0)
    time = np.linspace(0, 60, 80)
    strain = -0.01 * time
    return [Experiment("uniaxial", strain, hereditary_stress(FAST, SERIES, "uniaxial", time, strain),
                       time if clock else None, facts=facts),
            Experiment("relaxation", held, hereditary_stress(FAST, SERIES, "uniaxial", hold_s, held), hold_s)]


@pytest.mark.thorough
@pytest.mark.parametrize(("clock", "facts", "words"), [
    (True, {}, None), (False, {}, "uniaxial_1 has no clock"),
    (False, {"clock_left_out_s": 60.0}, "its loading begins under stress")])
def test_a_test_that_is_not_corrected_for_rate_is_named_with_the_size(clock: bool, facts: dict[str, float],
                                                                      words: str | None) -> None:
    found = calibrate(_tests(clock, facts), FitOptions(order=2, prony_terms=2))
    card = make_card(found, [], 0)
    said = [sentence for sentence in cautions(card) if "corrected for rate" in sentence]
    assert len(said) == (words is not None)
    assert words is None or (words in said[0] and "%" in said[0])
    assert any("No time column" in decision for decision in found.decisions) == (words is not None and not facts)


@pytest.mark.parametrize(("loadings", "seconds", "said"), [(1.0, 60.0, False), (5.0, 60.0, True), (5.0, 1e5, False)])
def test_what_earlier_cycles_left_unrelaxed_is_said_with_its_size(loadings: float, seconds: float, said: bool) -> None:
    """Not of a first loading, nor where cycles are far slower than the series."""
    found = calibrate(_tests(True, {"loadings": loadings, "loading_s": seconds}), FitOptions(order=2, prony_terms=2))
    assert any("left unrelaxed" in sentence for sentence in cautions(make_card(found, [], 0))) == said


@pytest.mark.thorough
def test_what_a_cycle_loses_stands_in_mind() -> None:
    card = matcal.fit("uniaxial=data_raw/mts_uniaxial.txt", "data_raw/specimen.toml").card
    share = card.fit["uniaxial_1"].get("loss_share", 0.0)
    assert any("a cycle loses" in sentence for sentence in cautions(card)) == (share > 0.02)
    rows = {**card.fit, "uniaxial_1": {**card.fit["uniaxial_1"], "loss_share": 0.05, "residual_strain": 0.01}}
    (said,) = [s for s in cautions(matcal.MaterialCard("a", card.hyperfoam, fit=rows)) if "a cycle loses" in s]
    assert "5" in said
    assert "set of 0.010" in said


@pytest.mark.thorough
def test_the_published_compression_without_its_clock() -> None:
    folder = Path(__file__).parents[4] / "shared" / "cases" / "attack" / "07"
    if not folder.is_dir():
        pytest.skip("the case's files are not here")
    card = matcal.fit([folder / "e_uniaxial.csv", folder / "b_relaxation.csv"]).card
    assert any("uniaxial_1 has no clock" in sentence for sentence in cautions(card))
