"""What Mind says of records that look wrong together: units, sizes, rubber with nu = 0, bands that miss the record."""

import re
from dataclasses import replace

import numpy as np
import pytest

from matcal.card import MaterialCard
from matcal.fitting.calibrate import calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.hyperfoam.curves import weigh
from matcal.fitting.hyperfoam.hyperfoam_fit import fit
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.posterior.hyperfoam_posterior import law_part
from matcal.record.cautions import cautions, unstable_inside
from matcal.record.fit_summary import summary
from matcal.reduction.experiment import Experiment

LAW = Hyperfoam([12000.0, 8000.0], [4.0, -1.5], [0.0, 0.0])
E, GAMMA = np.linspace(-0.6, 0, 121), np.linspace(0, 0.8, 81)


def card_of(uniaxial: np.ndarray | float = 1.0, shear: np.ndarray | float = 1.0, order: int = 2,
            strain: np.ndarray = E) -> MaterialCard:
    """The card of a law's stresses, multiplied point by point."""
    found = calibrate([Experiment("uniaxial", strain, uniaxial * nominal_stress(LAW, "uniaxial", strain)),
                       Experiment("shear", GAMMA, shear * nominal_stress(LAW, "shear", GAMMA))], FitOptions(order))
    assert found.fit is not None
    return MaterialCard("foam", found.fit.law, fit=summary(found))


def test_a_consistent_foam_raises_no_doubt() -> None:
    rng = np.random.default_rng(0)
    card = card_of(1 + 0.003 * rng.normal(size=E.size), 1 + 0.003 * rng.normal(size=GAMMA.size))
    assert not any(word in said for said in cautions(card) for word in ("check", "nu = 0", "band"))
    assert min(card.fit[label]["inside_band"] for label in ("uniaxial_1", "shear_1")) > 0.9


@pytest.mark.parametrize(("uniaxial", "shear", "says"), [
    (1000.0, 1000.0, r"mu_0 = 2e\+07 Pa is that of no soft foam .*kPa or MPa"),
    (1.0, 2.0, r"Shear is 2 times as stiff at small strain as uniaxial alone predicts: check the units and sizes"),
    (1.0, 1e-3, r"Shear is 0.001 times as stiff")])
def test_wrong_units_and_sizes_are_doubted(uniaxial: float, shear: float, says: str) -> None:
    assert any(re.search(says, said) for said in cautions(card_of(uniaxial, shear)))


def test_rubber_fitted_as_foam_is_doubted() -> None:
    card = card_of(strain=np.linspace(0, 2.5, 60))
    assert any("nu = 0 was taken, which is a foam's" in said and "--poisson" in said for said in cautions(card))


def test_a_band_that_misses_its_record_is_said() -> None:
    card = card_of(1 + 0.005 * np.sin(12 * E), 1 + 0.005 * np.sin(9 * GAMMA), order=4)
    assert card.fit["uniaxial_1"]["inside_band"] < 0.9
    assert any("The 95 % band holds too little" in said for said in cautions(card))


def test_strain_that_earlier_loadings_left_is_said_with_what_it_changes() -> None:
    law = replace(LAW, strain_range={"uniaxial": (-0.6, 0.0)})
    row = {"kind": "uniaxial", "relative_rms": 0.01, "strain_range": [-0.6, 0.0]}
    here, there = (-float(nominal_stress(law, "uniaxial", e)) / 1e3 for e in (-0.4, -0.34))
    card = MaterialCard("foam", law, fit={"uniaxial_1": row | {"residual_strain": -0.06}})
    (said,) = (said for said in cautions(card) if "--branch first" in said)
    assert f"{there:.3g} kPa instead of {here:.3g} kPa" in said
    rested = MaterialCard("foam", law, fit={"uniaxial_1": row | {"residual_strain": -0.01}})
    assert not any("--branch first" in said for said in cautions(rested))


@pytest.mark.parametrize(("ratio", "reaches", "said"), [
    (0.75, -0.5, True), (1.3, -0.5, True), (0.95, -0.5, False), (0.75, -0.9, False)])
def test_a_hold_of_another_stress_than_the_law_gives_is_said(ratio: float, reaches: float, said: bool) -> None:
    """Where the compression curves reach the strain of the hold."""
    row = {"kind": "relaxation", "relative_rms": 0.01, "strain_range": [reaches, 0.0], "stiffness_over_law": ratio}
    card = MaterialCard("foam", replace(LAW, strain_range={"uniaxial": (-0.6, 0.0)}), fit={"relaxation_1": row})
    assert any(f"relaxation_1 holds {ratio:.2f} times the stress" in line for line in cautions(card)) == said


def test_lost_stability_is_clipped_to_the_fitted_strains_and_names_the_option() -> None:
    law = replace(LAW, strain_range={"uniaxial": (-0.43, 0.0)})
    card = MaterialCard("foam", law, stability={"drucker": {"uniaxial": {"unstable_strain": [[-0.95, -0.4]]}}})
    assert unstable_inside(card) == [("drucker", "uniaxial", -0.43, -0.4)]
    assert any("--stable drucker" in said for said in cautions(card))


@pytest.mark.parametrize(("lost", "said"), [([-0.95, -0.44], True), ([-0.95, -0.6], False), ([-0.95, -0.3], False)])
def test_ellipticity_lost_close_to_the_fitted_strains_is_said(lost: list[float], said: bool) -> None:
    """Within them `_stability` says it."""
    law = replace(LAW, strain_range={"uniaxial": (-0.43, 0.0)})
    card = MaterialCard("foam", law, stability={"elliptic": {"uniaxial": {"unstable_strain": [lost]}}})
    assert any("uniaxial from -0.44 on (fitted to -0.43)" in line for line in cautions(card)) == said


def test_stated_scatter_widens_the_draws_about_the_fit() -> None:
    """One term through two: where the scatter may be inferred, misfit moves the law to another part of it."""
    modes = {"uniaxial": E, "shear": GAMMA}
    curves = weigh([Experiment(mode, e, stress, deviation=0.15 * np.abs(stress)) for mode, e in modes.items()
                    for stress in [nominal_stress(LAW, mode, e)]])
    found = fit(curves, 1)
    part = law_part(found, 40.0, None)
    drawn = part.draws(np.repeat(part.start(found)[0][None], 4000, axis=0), None, None, np.random.default_rng(0))
    mu, alpha = drawn.law["mu_Pa"], drawn.law["alpha"]
    assert mu.mean() == pytest.approx(found.law.mu_Pa[0], rel=0.02)
    assert 0.07 < mu.std() / mu.mean() < 0.15
    assert np.ptp(alpha) == 0


def test_an_exponent_on_its_bound_is_said() -> None:
    strain = np.linspace(-0.6, 0.3, 91)
    stress = nominal_stress(Hyperfoam([12000.0, 400.0], [2.0, 40.0], [0.0, 0.0]), "uniaxial", strain)
    found = calibrate([Experiment("uniaxial", strain, stress)], FitOptions(2))
    assert found.fit is not None
    card = MaterialCard("foam", found.fit.law, fit=summary(found))
    (said,) = (said for said in cautions(card) if "ended on the bound" in said)
    assert said.startswith("alpha_2 = 25 ended on the bound of the exponents that are searched")
    assert not any("ended on the bound" in said for said in cautions(card_of()))


def test_a_record_with_equal_strains_has_its_share_in_the_band() -> None:
    strain = np.r_[E, E[:40]]
    card = card_of(strain=strain)
    assert card.fit["uniaxial_1"]["n"] == strain.size
    assert card.fit["uniaxial_1"]["inside_band"] == 1.0


@pytest.mark.parametrize(("ranges", "how", "said"), [
    ({"uniaxial": (-0.6, 0.0)}, "assumed", False), ({"uniaxial": (0.0, 0.3)}, "assumed", True),
    ({"uniaxial": (-0.6, 0.0), "planar": (0.0, 0.3)}, "assumed", True), ({"planar": (0.0, 0.3)}, "given", False),
    ({"uniaxial": (-0.6, 0.0), "biaxial": (-0.3, 0.0)}, "assumed", True),
    ({"uniaxial": (-0.6, 0.3), "shear": (0.0, 0.4)}, "assumed", False)])
def test_a_poissons_ratio_that_nobody_stated_is_said_where_mu_0_rests_on_it(
        ranges: dict[str, tuple[float, float]], how: str, said: bool) -> None:
    card = MaterialCard("foam", replace(LAW, strain_range=ranges), fit={"nu": {"how": how}})
    assert any(text.startswith("nu = 0 was assumed") for text in cautions(card)) == said


def test_what_makes_the_numbers_wrong_comes_before_what_was_not_tested() -> None:
    """A modulus that is not determined, a record that is doubted, a law that misses it, stability, scatter."""
    card = card_of(1 + 0.3 * np.sin(12 * E), order=2)
    derived = {**card.fit["derived"], "mu_0_Pa": {**card.fit["derived"]["mu_0_Pa"], "lo": -1.0}}
    lost = {"drucker": {"uniaxial": {"stable": False, "unstable_strain": [[-0.5, -0.4]], "scanned": [-0.8, 1.0]}}}
    said = cautions(replace(card, fit={**card.fit, "derived": derived}, stability=lost,
                            provenance={"cautions": ["The record stops early."]}))
    first = ("The tests do not determine mu_0", "The record stops early", "The fit misses", "Drucker stability is lost",
             "One specimen of each kind")
    at = [next(k for k, text in enumerate(said) if text.startswith(words)) for words in first]
    assert at == sorted(at)
