"""A law that is not hyperfoam from tests to a card and on: its own truth recovered, and what it cannot do refused."""

import json
from pathlib import Path

import numpy as np
import pytest

import matcal
from matcal.fitting.fit_options import FitOptions
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.neo_hooke import NeoHooke
from matcal.record.cautions import cautions

UNIAXIAL, SHEAR = np.linspace(-0.5, 0.4, 31), np.linspace(0.03, 0.9, 30)
LAW = NeoHooke(8e3, 0.3)


def records_of(law, noise=0.0, seed=0):
    draw = np.random.default_rng(seed)
    return [{mode: (strain, nominal_stress(law, mode, strain) + noise * draw.normal(size=strain.size))}
            for mode, strain in (("uniaxial", UNIAXIAL), ("shear", SHEAR))]


@pytest.fixture(scope="module")
def fitted():
    return matcal.fit(records_of(LAW), law="neo_hooke")


@pytest.mark.parametrize("law", [LAW, NeoHooke(350.0, -0.1), NeoHooke(2e6, 0.47)])
def test_the_fit_finds_the_law_that_made_the_tests(law) -> None:
    found = matcal.fit(records_of(law), law="neo_hooke").card.law
    assert isinstance(found, NeoHooke)
    assert found.mu_Pa == pytest.approx(law.mu_Pa, rel=1e-6)
    assert found.nu == pytest.approx(law.nu, abs=1e-6)


@pytest.mark.thorough
def test_intervals_hold_the_truth_about_as_often_as_they_say() -> None:
    inside = []
    for seed in range(30):
        row = matcal.fit(records_of(LAW, 60.0, seed), law="neo_hooke").card.fit["derived"]["mu_0_Pa"]
        inside.append(row["lo"] < LAW.mu_0_Pa < row["hi"])
        assert row["sd"] < 0.05 * LAW.mu_0_Pa
    assert np.mean(inside) > 0.8


def test_a_given_ratio_is_kept() -> None:
    found = matcal.fit(records_of(LAW), law="neo_hooke", poisson=0.1).card.law
    assert isinstance(found, NeoHooke)
    assert found.nu == 0.1
    assert found.mu_Pa != pytest.approx(LAW.mu_Pa, rel=1e-3)


def test_the_card_is_read_as_it_was_written(fitted, tmp_path: Path) -> None:
    fitted.save(tmp_path / "rubber.json")
    raw = json.loads((tmp_path / "rubber.json").read_text())
    assert raw["hyperelastic"]["law"] == "neo_hooke"
    assert set(raw["hyperelastic"]["parameters"]) == {"mu_Pa", "nu"}
    assert "hyperfoam" not in raw
    again = matcal.read_card(tmp_path / "rubber.json")
    assert again.law == fitted.card.law
    assert again.hyperfoam is None
    for change, expected in (({"law": "neohook"}, "unknown; known"),
                             ({"parameters": {"mu_Pa": 1e3}}, "'nu' is missing"),
                             ({"parameters": {"mu_Pa": [1e3], "nu": 0.1}}, "must be one number")):
        (tmp_path / "wrong.json").write_text(json.dumps(raw | {"hyperelastic": raw["hyperelastic"] | change}))
        with pytest.raises(ValueError, match=expected):
            matcal.read_card(tmp_path / "wrong.json")


def test_what_takes_a_card_takes_this_one(fitted) -> None:
    at = np.array([-0.4, 0.2])
    assert matcal.predict(fitted.card, "biaxial", at)["stress_Pa"] == pytest.approx(nominal_stress(LAW, "biaxial", at))
    assert matcal.check(fitted.card)["elliptic"]["uniaxial"]["stable"]
    assert not any("hyperfoam" in sentence for sentence in cautions(fitted.card))
    assert "neo-Hookean" in matcal.export(fitted.card, "febio").text


def test_relaxation_is_fitted_through_the_law() -> None:
    prony = matcal.Prony([0.3], [20.0])
    time = np.r_[np.linspace(0, 1, 21), np.geomspace(1.1, 400, 80)]
    strain = -0.3 * np.minimum(time, 1.0)
    from matcal.laws.deformation_modes import hereditary_stress
    stress = hereditary_stress(NeoHooke(8e3 / 0.7, 0.3, "instantaneous"), prony, "uniaxial", time, strain)
    found = matcal.fit([*records_of(LAW), {"relaxation": (strain, stress, time)}], law="neo_hooke").card
    assert found.prony is not None
    assert found.prony.g_infinity == pytest.approx(0.7, abs=2e-3)


@pytest.mark.parametrize(("choice", "expected"), [
    ({"law": "neohook"}, "law 'neohook' is unknown"), ({"law": "neo_hooke", "order": 2}, "`order` is not a choice"),
    ({"law": "neo_hooke", "stable": "drucker"}, "`stable` is not a choice"),
    ({"law": "neo_hooke", "poisson": (0.1, 0.2)}, "`poisson` is not a choice")])
def test_choices_that_the_law_does_not_have_are_refused(choice, expected) -> None:
    with pytest.raises(ValueError, match=expected):
        FitOptions(**choice)
