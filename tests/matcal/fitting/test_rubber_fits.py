"""Rubber laws from tests: each finds what made the data, is compared by what it predicts, and its band is honest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import matcal
from matcal.fitting.calibrate import calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.general_fit import fit_law
from matcal.fitting.hyperfoam.curves import weigh
from matcal.fitting.law_ranking import band_over, ranked
from matcal.fitting.rubber_or_foam import kind_of
from matcal.laws.deformation_modes import hereditary_stress, nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.known_laws import LAWS as KNOWN
from matcal.laws.prony import Prony
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.extended_tube import ExtendedTube
from matcal.laws.rubbers.gent import Gent
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.mooney_rivlin_5 import MooneyRivlin5
from matcal.laws.rubbers.ogden import Ogden
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.record.cautions import cautions
from matcal.reduction.experiment import Experiment

SHARED = Path(__file__).parents[4] / "shared"
STRAIN = {"uniaxial": np.linspace(-0.4, 2.2, 40), "planar": np.linspace(0.05, 2.0, 25),
          "biaxial": np.linspace(0.05, 1.2, 25), "shear": np.linspace(0.05, 1.5, 25),
          "volumetric": np.linspace(0.99, 1.0, 12)}
LAWS = (MooneyRivlin(9e4, 2e4), MooneyRivlin5(9e4, 2e4, 8e2, 1e2, 50.0), Yeoh(1e5, -1e3, 60.0),
        Ogden([1.5e5, 4e3], [1.7, 5.0]), Gent(2e5, 40.0), ArrudaBoyce(2e5, 3.0), ExtendedTube(1e5, 0.15, 1e5, 0.4))


def records(law, modes, noise=0.0, seed=0):
    draw = np.random.default_rng(seed)
    return [Experiment(m, STRAIN[m], nominal_stress(law, m, STRAIN[m]) + noise * draw.normal(size=STRAIN[m].size))
            for m in modes]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_a_fit_finds_the_law_that_made_the_tests(law) -> None:
    found = fit_law(weigh(records(law, ["uniaxial", "biaxial"])), type(law), {})
    assert found.optimum.cost**0.5 < 1e-6
    assert found.law.mu_0_Pa == pytest.approx(law.mu_0_Pa, rel=1e-4)
    for mode in ("planar", "shear"):
        np.testing.assert_allclose(nominal_stress(found.law, mode, STRAIN[mode]),
                                   nominal_stress(law, mode, STRAIN[mode]), rtol=1e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("law", [LAWS[0], LAWS[3], LAWS[4]], ids=lambda law: law.name)
def test_a_volumetric_test_gives_the_bulk_modulus(law) -> None:
    from dataclasses import replace
    finite = replace(law, nu=0.4996)
    found = fit_law(weigh(records(finite, ["uniaxial", "volumetric"])), type(law), {}).law
    assert found.kappa_0_Pa == pytest.approx(finite.kappa_0_Pa, rel=1e-3)
    assert found.mu_0_Pa == pytest.approx(law.mu_0_Pa, rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_the_law_that_made_two_modes_predicts_the_third_within_its_band(seed) -> None:
    law = (Gent(2e5, 40.0), Yeoh(1e5, -1e3, 60.0), ExtendedTube(1e5, 0.15, 1e5, 0.4))[seed]
    rows = ranked(weigh(records(law, ["uniaxial", "planar"], 2e3, seed)), {})
    assert sum(row.weight for row in rows) == pytest.approx(1)
    assert all(row.weight == 0 for row in rows if row.lost)
    low, high = band_over(rows, "biaxial", STRAIN["biaxial"])
    truth = nominal_stress(law, "biaxial", STRAIN["biaxial"])
    assert np.mean((low <= truth) & (truth <= high)) > 0.9


@pytest.mark.parametrize("modes", [("uniaxial",), ("uniaxial", "planar")], ids=" ".join)
def test_laws_are_ranked_with_the_correction_for_rate_that_the_fit_has(modes: tuple[str, ...]) -> None:
    """A curve that bends by relaxation, half of it in 200 s: without, mu_0 of one mode was 5.6 % too high."""
    series = Prony(np.array([0.3, 0.2]), np.array([1.0, 20.0]))
    law, draw = Yeoh(2e5, -4e3, 300.0, moduli="instantaneous"), np.random.default_rng(3)
    tests = []
    for mode, end_s in zip(modes, (40.0, 200.0), strict=False):
        time = np.linspace(0, end_s, 90)
        exact = hereditary_stress(law, series, mode, time, 1.6 * time / end_s)
        tests.append(Experiment(mode, 1.6 * time / end_s, exact + 2e-3 * exact.max() * draw.normal(size=90), time))
    time = np.r_[np.linspace(0, 1, 60), 1 + np.geomspace(0.01, 200, 80)]
    strain = 0.5 * np.minimum(time, 1)
    held = Experiment("relaxation", strain, hereditary_stress(law, series, "uniaxial", time, strain), time)
    found = calibrate([*tests, held], FitOptions(law="auto"))
    assert found.choice is not None
    assert found.fit is not None
    best = min(found.choice.laws, key=lambda row: row.predicted)
    assert best.law.name == "yeoh"
    assert best.predicted < 0.006
    assert found.fit.law.mu_0_Pa == pytest.approx(0.5 * law.mu_0_Pa, rel=5e-3)


@pytest.mark.parametrize("seed", [6, 9])
def test_of_laws_that_the_modes_rank_differently_the_one_that_fits_is_taken(seed) -> None:
    """Yeoh's law misses the modes by four times their noise, but predicts the second from the first better than the law
    that made both, which the first alone leaves open. Seeds 1 to 9 were drawn: of the other seven the noise hides it.
    """
    law, draw = Ogden([1.5e5, 4e3], [1.7, 5.0]), np.random.default_rng(seed)
    tests = []
    for mode, most in (("uniaxial", 3.125), ("biaxial", 1.5)):
        strain = np.linspace(0.02, most, 40)
        stress = nominal_stress(law, mode, strain)
        noise = 0.01 * np.sqrt(np.mean(stress**2)) * draw.normal(size=40)
        tests.append(Experiment(mode, strain, stress + noise))
    card = matcal.fit(tests, law="auto").card
    taken = next(row for row in card.fit["laws"] if card.law is not None and row["law"] == card.law.name)
    assert taken["fitted"] < 0.012
    assert taken["weight"] == max(row["weight"] for row in card.fit["laws"])
    truth = nominal_stress(law, "planar", STRAIN["planar"])
    off = matcal.predict(card, "planar", STRAIN["planar"])["stress_Pa"] - truth
    assert np.sqrt(np.mean(off**2) / np.mean(truth**2)) < 0.02


@pytest.mark.parametrize(("law", "modes", "rubber"), [
    (Gent(2e5, 40.0), ["uniaxial"], True), (Ogden([1.5e5], [1.7]), ["uniaxial", "shear"], True),
    (Hyperfoam(np.array([2e4]), np.array([8.0]), np.zeros(1)), ["uniaxial"], False)])
def test_foams_and_rubbers_are_told_from_their_curves(law, modes, rubber) -> None:
    part = [Experiment(e.kind, e.strain[e.strain < 0.9], e.value[e.strain < 0.9]) for e in records(law, modes, 50.0)]
    if not rubber:
        part = [Experiment(e.kind, e.strain[e.strain < 0], e.value[e.strain < 0]) for e in part]
    assert kind_of(weigh(part), None).rubber is rubber
    assert kind_of(weigh(part), 0.5).rubber
    assert not kind_of(weigh(part), 0.1).rubber


@pytest.mark.parametrize("alpha", [6.0, 7.0, 8.0])
def test_a_foam_of_some_nu_in_compression_alone_is_not_taken_for_a_rubber(alpha) -> None:
    strain = np.linspace(-0.7, -0.02, 40)
    stress = nominal_stress(Hyperfoam([18e3, 2e3], [alpha, -1.8], [0.2, 0.2]), "uniaxial", strain)
    assert not kind_of(weigh([Experiment("uniaxial", strain, stress)]), None).rubber


@pytest.mark.parametrize(("alpha", "said"), [(1.0, 1), (10.0, 0)])
def test_a_rubber_by_the_shape_of_a_compression_alone_is_a_caution(alpha, said) -> None:
    """The foam of the first has that shape."""
    strain = np.linspace(-0.5, -0.02, 40)
    stress = nominal_stress(Hyperfoam([2e4], [alpha], [0.3]), "uniaxial", strain)
    card = matcal.fit({"uniaxial": (strain, stress)}, law="auto").card
    assert card.fit["material"]["rubber"] is bool(said)
    assert sum("by the shape of its compression" in text for text in cautions(card)) == said


@pytest.mark.parametrize("mode", ["uniaxial", "planar"])
def test_a_foam_is_known_by_its_tension_and_no_rubber_is_taken_for_one(mode) -> None:
    strain, draw = np.linspace(0.01, 0.5, 40), np.random.default_rng(5)

    def of(law):
        stress = nominal_stress(law, mode, strain)
        return kind_of(weigh([Experiment(mode, strain, stress + 0.01 * stress.max() * draw.normal(size=40))]), None)

    foam = of(Hyperfoam([2e4], [8.0], [0.4]))
    assert foam.decided
    assert foam.by_shape
    assert not foam.rubber
    assert [law.name for law in (*LAWS, Gent(2e5, 2.0)) if of(law).decided] == []


FILES = (("foam_leap/foam_leap_UC.csv", "uniaxial", "stretch=1,stress=2:MPa", "foam"),
         ("foam_leap/foam_leap_UT.csv", "uniaxial", "stretch=1,stress=2:MPa", "foam"),
         ("foam_leap/foam_leap_SS.csv", "shear", "strain=1,stress=2:MPa", "not decided"),
         ("nist_vn600.csv", "uniaxial", None, "foam"),
         ("Treloar1944_UT.txt", "uniaxial", "stress=1:MPa,stretch=2", "rubber"))


@pytest.mark.skipif(not (SHARED / "rawsamples").is_dir(), reason="needs the files of others")
def test_files_are_of_foams_or_rubbers_or_not_decided() -> None:
    tests = {name: matcal.read_test({kind: SHARED / "rawsamples" / name}, columns=[columns] if columns else ())
             for name, kind, columns, _ in FILES}
    kinds = {name: kind_of(weigh([test]), None) for name, test in tests.items()}
    assert {name: "not decided" if not kind.decided else "rubber" if kind.rubber else "foam"
            for name, kind in kinds.items()} == {name: right for name, *_, right in FILES}
    both = kind_of(weigh([tests[FILES[1][0]], tests[FILES[2][0]]]), None)
    assert both.decided
    assert not both.rubber


@pytest.mark.parametrize(("mode", "what", "share", "add"), [
    ("uniaxial", "mu_0", 1.0, "lateral strain, a compression test, or a second mode"),
    ("planar", "mu_0", 1.0, "lateral strain, a compression test, or a second mode"),
    ("shear", "E_0", 3.0, "a compression or a tension test")])
def test_what_is_not_decided_is_a_caution_with_the_modulus_of_a_rubber(mode, what, share, add) -> None:
    """That the law has which made the test, and what would decide in this mode."""
    strain, law = np.linspace(0.01, 0.27, 40), Ogden([9.4e4], [1.5])
    card = matcal.fit([Experiment(mode, strain, nominal_stress(law, mode, strain))], law="auto").card
    assert card.fit["material"]["decided"] is False
    [said] = [text for text in cautions(card) if "not decided" in text]
    assert said.endswith(f"or add {add}.")
    assert float(said.split(f"{what} would be ")[1].split()[0]) == pytest.approx(share * law.mu_0_Pa / 1e3, rel=0.01)


def test_a_card_holds_the_laws_and_predicts_with_their_band(tmp_path: Path) -> None:
    tests = records(Gent(2e5, 40.0), ["uniaxial"], 2e3)
    card = matcal.fit(tests, law="auto").save(tmp_path / "rubber.json").card
    assert card.fit["material"]["rubber"]
    assert {row["law"] for row in card.fit["laws"]} >= {"gent", "yeoh", "neo_hooke"}
    row = matcal.predict(tmp_path / "rubber.json", "biaxial", [0.5, 1.0])
    truth = nominal_stress(Gent(2e5, 40.0), "biaxial", [0.5, 1.0])
    assert np.all((row["stress_lo_Pa"] < truth) & (truth < row["stress_hi_Pa"]))
    with pytest.raises(ValueError, match="keeps its volume"):
        matcal.predict(card, "volumetric", [0.9])


def test_auto_gives_foams_the_card_of_today() -> None:
    files = ["data_raw/uniaxial.csv", "data_raw/shear.csv"]
    auto, plain = (matcal.fit(files, law=law).card for law in ("auto", "hyperfoam"))
    assert auto.hyperfoam is not None
    assert plain.hyperfoam is not None
    assert auto.hyperfoam.alpha.tolist() == plain.hyperfoam.alpha.tolist()
    assert auto.fit["derived"] == plain.fit["derived"]
    assert not auto.fit["material"]["rubber"]


def silicone() -> list[Experiment]:
    folder = SHARED / "cases" / "material" / "20_silicone_three_modes"
    if not folder.is_dir():
        pytest.skip("needs the files of others")
    read = {kind: np.loadtxt(folder / f"{name}.txt").T for kind, name in (
        ("uniaxial", "UT"), ("planar", "PS"), ("biaxial", "ET"))}
    return [Experiment(kind, stretch - 1, stress * 1e6) for kind, (stress, stretch) in read.items()]


@pytest.mark.thorough
def test_a_silicone_of_one_mode_is_held_by_the_band_in_the_others() -> None:
    """Meunier et al. 2008; Ogden with three terms, scipy: mu_0 = 340.7 kPa."""
    tests, inside = silicone(), []
    for k, own in enumerate(tests):
        rows = ranked(weigh([own]), {})
        for other in tests[:k] + tests[k + 1:]:
            low, high = band_over(rows, other.kind, other.strain)
            inside.append(np.mean((low <= other.value) & (other.value <= high)))
    assert np.mean(inside) > 0.85
    found = fit_law(weigh(tests), Ogden, {}, order=3, thorough=False)
    assert found.law.mu_0_Pa == pytest.approx(340.7e3, rel=0.03)


@pytest.mark.skipif(not (SHARED / "cases").is_dir(), reason="needs the files of others")
def test_the_band_over_laws_of_one_mode_holds_a_measured_silicone_in_the_others(benchmark_module) -> None:
    study = benchmark_module("treloar")
    tests = study.read(SHARED / "cases" / "material" / "20_silicone_three_modes")
    rows = study.of_bands("silicone", study.weigh(tests))
    held = sum(row["points"] * row["held_percent"] for row in rows) / sum(row["points"] for row in rows)
    assert held >= 85


@pytest.mark.parametrize("law", ["mooney_rivlin_5", "yeoh", "gent", "arruda_boyce"])
def test_no_constants_of_a_law_leave_less_than_its_fit_does(benchmark_module, law: str) -> None:
    """Noisy curves of a tube, which none of these laws meets; the other search goes over the law's whole range."""
    study = benchmark_module("treloar")
    curves = weigh(records(ExtendedTube(8e4, 0.2, 1.4e5, 0.6), ["uniaxial", "planar", "biaxial"], noise=2e3, seed=7))
    assert study.error_percent(curves, law) == pytest.approx(study.least_error_percent(curves, law), rel=1e-5)


def test_fits_to_treloar_leave_the_least_and_at_most_what_published_constants_leave() -> None:
    table = pd.read_csv(Path(__file__).parents[3] / "benchmarks" / "results" / "treloar.csv")
    fits = table[table.error_percent.notna()]
    assert set(fits.law) == {name for name in KNOWN if name != "hyperfoam"}
    assert (fits.error_percent <= fits.least_error_percent * 1.0005).all()  # four digits are stored
    published = table[table.source.notna()]
    assert len(published) >= 10
    assert (published.fit_error_percent <= published.published_error_percent).all()
