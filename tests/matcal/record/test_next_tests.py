"""The next test: what is expected agrees with theory for a normal law, with fits made again, and with plain sense."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import matcal
from matcal.cli.main import app
from matcal.fitting.uncertainty.intervals import intervals
from matcal.laws.known_laws import law_of
from matcal.reduction.experiment import Experiment

NOISE = 0.02


def measured(law, kind: str, to: float, rng: np.random.Generator) -> dict:
    strain = np.linspace(0.0, to, 31)[1:]
    stress = matcal.nominal_stress(law, kind, strain)
    return {kind: (strain, stress + NOISE * np.sqrt(np.mean(stress**2)) * rng.normal(size=strain.size))}


@pytest.fixture(scope="module")
def rubber() -> tuple:
    law, rng = law_of("mooney_rivlin", [[5e4], [8e3], [0.5]]), np.random.default_rng(5)
    tests = [measured(law, "uniaxial", 0.8, rng)]
    return law, rng, tests, matcal.fit(tests, law="mooney_rivlin")


def test_promised_and_reached_narrowing_agree(rubber: tuple) -> None:
    law, rng, tests, found = rubber
    promised = matcal.next_tests(found.card, "stress:shear:0.4")

    def width(calibration: matcal.Calibration) -> float:
        quantity = intervals(calibration.laws.uncertainty,
                             lambda law: {"q": float(matcal.nominal_stress(law, "shear", [0.4])[0])})["q"]
        return quantity.hi - quantity.lo

    rows = promised.families[:2]
    again = [np.median([width(matcal.fit([*tests, measured(law, row.test.kind, row.test.strain_to, rng)],
                                         law="mooney_rivlin")) for _ in range(5)]) for row in rows]
    for row, after in zip(rows, again, strict=True):
        assert 1 - after / width(found) == pytest.approx(row.narrows_by, rel=0.25)


def test_the_mode_that_is_asked_for_is_proposed_to_its_strain(rubber: tuple) -> None:
    found = matcal.next_tests(rubber[3].card, "stress:biaxial:1.5")
    assert max(row.test.strain_to for row in found.tests if row.test.kind == "biaxial") == pytest.approx(1.5)
    narrows = [row.narrows_by for row in found.tests]
    assert narrows == sorted(narrows, reverse=True)
    assert all(-1e-9 < value < 1 for value in narrows)


def test_tested_strains_are_repeated_only_where_replicates_show_the_scatter(rubber: tuple) -> None:
    found = matcal.next_tests(rubber[3].card)
    assert not found.scatter_known
    assert not any(row.test.kind == "uniaxial" and row.test.strain_to > 0 for row in found.tests)


def test_a_small_test_is_as_noisy_as_the_cards_own_where_stress_is_least() -> None:
    law, strain = matcal.Hyperfoam([8e3, 2e3], [9.0, -2.0], [0.0, 0.0]), np.linspace(0.0, -0.5, 60)[1:]
    own = matcal.nominal_stress(law, "uniaxial", strain)

    def worth(noise: np.ndarray) -> dict[tuple[str, float], float]:
        stress = own + noise * np.random.default_rng(3).normal(size=strain.size)
        card = matcal.fit([Experiment("uniaxial", strain, stress)], order=2).card
        return {(row.test.kind, row.test.strain_to): row.sd / card.fit["derived"]["mu_0_Pa"]["value"]
                for row in matcal.next_tests(card).tests}

    of_each_stress, of_the_cell = worth(0.01 * own), worth(np.full(strain.size, 0.01 * float(np.std(own))))
    smallest = min((key for key in of_each_stress if key[0] == "shear"), key=lambda key: key[1])
    assert of_each_stress[smallest] < 0.01
    assert of_the_cell[smallest] > 1.3 * of_each_stress[smallest]
    assert not any(kind == "volumetric" and to > 1 for kind, to in of_each_stress)


def test_minutes_change_the_order_and_leave_other_kinds_out(rubber: tuple) -> None:
    card = rubber[3].card
    cheap = matcal.next_tests(card, minutes={"shear": 1.0, "biaxial": 1000.0})
    assert {row.test.kind for row in cheap.tests} == {"shear", "biaxial"}
    assert cheap.tests[0].test.kind == "shear"
    with pytest.raises(ValueError, match="minutes for 'pull'"):
        matcal.next_tests(card, minutes={"pull": 1.0})


@pytest.mark.thorough
def test_between_laws_a_test_in_the_mode_asked_for_is_named(tmp_path: Path) -> None:
    law, rng = law_of("mooney_rivlin", [[5e4], [8e3], [0.5]]), np.random.default_rng(1)
    tests = [measured(law, "uniaxial", 1.0, rng)]
    before = matcal.fit(tests, law="auto", poisson=0.5).save(tmp_path / "card.json").card
    found = matcal.next_tests(before, "stress:biaxial:0.4")
    assert found.between_laws > 0.3
    assert found.tests[0].test.kind == "biaxial"
    after = matcal.fit([*tests, measured(law, "biaxial", found.tests[0].test.strain_to, rng)], law="auto", poisson=0.5)
    assert matcal.next_tests(after.card, "stress:biaxial:0.4").sd < found.sd


def test_a_card_that_says_nothing_of_what_is_open_is_refused(tmp_path: Path) -> None:
    plain = matcal.MaterialCard("foam", matcal.Hyperfoam([12e3], [2.0], [0.0]))
    with pytest.raises(ValueError, match="does not say what is open"):
        matcal.next_tests(plain)
    matcal.write_card(plain, tmp_path / "card.json")
    refused = CliRunner().invoke(app, ["next", str(tmp_path / "card.json")])
    assert isinstance(refused.exception, ValueError)


@pytest.mark.parametrize("quantity", ["c_9", "stress:biaxial", "stress:twist:0.1", "stress:shear:x"])
def test_unknown_quantities_are_refused_with_the_known_ones(rubber: tuple, quantity: str) -> None:
    with pytest.raises(ValueError, match="`for`"):
        matcal.next_tests(rubber[3].card, quantity)


def test_the_command_prints_a_screen_and_whole_json(rubber: tuple, tmp_path: Path) -> None:
    rubber[3].save(tmp_path / "card.json")
    shown = CliRunner().invoke(app, ["next", str(tmp_path / "card.json"), "--for", "E_0"]).stdout
    assert 5 < len(shown.splitlines()) <= 40
    shown = json.loads(CliRunner().invoke(app, ["next", str(tmp_path / "card.json"), "--json"]).stdout)
    assert shown["quantity"] == "mu_0_Pa"
    assert shown["lo"] < shown["value"] < shown["hi"]
    assert shown["tests"][0]["sd"] < shown["sd"]
