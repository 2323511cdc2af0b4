"""Posterior: exact marginalisation, convergence gate, coverage of the truth, draws as whole materials."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from matcal import posterior as module
from matcal.card import MaterialCard, write_card
from matcal.conductivity import Conductivity
from matcal.curves import weigh, weighted_design, weighted_stress
from matcal.draws import Draws, card_of, read_draws, stress_band, write_draws
from matcal.errors import NotConverged, TestFileError
from matcal.experiment import Experiment
from matcal.fit import fit
from matcal.hyperfoam import Hyperfoam
from matcal.linear_response import PRIOR_MODULI
from matcal.modes import nominal_stress
from matcal.nuisance import nuisance
from matcal.posterior import ESS, RHAT, sample, series_of
from matcal.prony import Prony
from matcal.uncertainty import linearised

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0])


def pair(seed: int = 0) -> list[Experiment]:
    rng = np.random.default_rng(seed)
    return [Experiment(mode, e := np.linspace(lo, hi, 70), nominal_stress(TABLE_1, mode, e) + 30 * rng.normal(size=70),
                       noise=30.0) for mode, lo, hi in (("uniaxial", -0.8, -0.01), ("shear", 0.02, 1.0))]


@pytest.fixture(scope="module")
def fitted():
    found = fit(weigh(pair()), 3)
    return found, linearised(found)


@pytest.fixture(scope="module")
def sampled(fitted):
    start = time.process_time()
    found = sample(*fitted, None, None, seed=1)
    print(f"posterior: {found.checks}, {time.process_time() - start:.1f} CPU s")
    return found


def test_moduli_are_integrated_out_exactly() -> None:
    found = fit(weigh([replace(e, value=2e3 * e.strain) for e in pair()]), 1)
    problem = module._problem(found, nuisance(found), 50.0)
    points = np.array([[2.0, -1.0], [3.0, -1.5], [5.0, -0.3]])
    value = module._log_probability(problem, points)
    unit, stress = found.law.mu_0_Pa, weighted_stress(found.curves)
    for k, (alpha, ln_sigma) in enumerate(points):
        column = weighted_design(found.curves, np.array([alpha]), 0.0)[:, 0] * unit
        precision = 50 * np.exp(-2 * ln_sigma)
        centre = column @ stress / (column @ column)

        def density(mu: float, column: np.ndarray = column, precision: float = precision) -> float:
            misfit = np.sum((column * mu - stress) ** 2)
            return float(np.exp(-precision * misfit / 2 - (mu / PRIOR_MODULI) ** 2 / 2))

        wide = 12 / np.sqrt(precision * (column @ column))
        area = quad(density, centre - wide, centre + wide, epsabs=0, epsrel=1e-9)[0]
        expected = np.log(area) - 50 * ln_sigma
        value[k] -= expected
    np.testing.assert_allclose(value, value[0], atol=1e-5)


def test_chains_pass_their_gate(sampled) -> None:
    assert sampled.checks["converged"]
    assert sampled.checks["rhat"] < RHAT
    assert sampled.checks["ess"] > ESS
    assert "normal about 0" in sampled.prior


def test_mu_0_and_stress_bands_cover_the_truth_and_agree_with_the_linearised(fitted, sampled) -> None:
    draws = sampled.draws
    mu_0 = draws.mu_Pa.sum(axis=1)
    low, high = np.quantile(mu_0, [0.025, 0.975])
    assert low < TABLE_1.mu_0_Pa < high
    assert mu_0.std() == pytest.approx(fitted[1].derived["mu_0_Pa"].sd, rel=0.5)
    assert draws.mu_Pa[:, 0].std() > 10 * mu_0.std()
    for mode, strain in (("uniaxial", np.linspace(-0.8, -0.02, 12)), ("shear", np.linspace(0.05, 1, 12))):
        low, high = stress_band(draws, mode, strain, 0.999)
        truth = nominal_stress(TABLE_1, mode, strain)
        assert np.all((low < truth) & (truth < high))
        assert np.max((high - low) / np.abs(truth)) < 0.1


def test_short_chains_are_refused_and_carry_what_they_reached(fitted, monkeypatch) -> None:
    monkeypatch.setattr(module, "MOST_STEPS", 200)
    monkeypatch.setattr(module, "_CHUNK", 200)
    with pytest.raises(NotConverged, match="after 200 steps") as first:
        sample(*fitted, None, None, seed=3)
    with pytest.raises(NotConverged) as second:
        sample(*fitted, None, None, seed=3)
    with pytest.raises(NotConverged) as other:
        sample(*fitted, None, None, seed=4)
    np.testing.assert_array_equal(first.value.estimate.draws.mu_Pa, second.value.estimate.draws.mu_Pa)
    assert not np.array_equal(first.value.estimate.draws.mu_Pa, other.value.estimate.draws.mu_Pa)


def test_drawn_series_are_series() -> None:
    rng = np.random.default_rng(0)
    centre = Prony([0.3, 0.4, 0.2], [0.1, 1.0, 2.0])
    g, tau = series_of(centre, 0.3 * rng.normal(size=(200, 3)), rng.normal(size=(200, 3)))
    for k in range(200):
        Prony(g[k], tau[k])


def test_draws_come_back_from_the_file_as_cards(tmp_path) -> None:
    rng = np.random.default_rng(0)
    draws = Draws(TABLE_1.mu_Pa + rng.normal(size=(8, 3)), TABLE_1.alpha + 0.01 * rng.normal(size=(8, 3)), 0.0,
                  0.1 + 0.01 * rng.uniform(size=(8, 2)), np.array([1.0, 10.0]) + rng.uniform(size=(8, 2)),
                  np.array([30.0, -60, 60, -30]) + rng.normal(size=(8, 4)))
    (tmp_path / "c.d").mkdir()
    card = MaterialCard("c", TABLE_1, Prony([0.1, 0.1], [1.0, 10.0]), Conductivity(30.0, [-2, 2, -1.0], (0.0, 0.4)),
                        posterior={"file": "c.d/posterior.nc", "n": 8})
    write_card(card, tmp_path / "c.json")
    with pytest.raises(TestFileError, match="is not there"):
        read_draws(tmp_path / "c.json")
    write_draws(draws, tmp_path / "c.d" / "posterior.nc")
    back = read_draws(tmp_path / "c.json")
    for name in ("mu_Pa", "alpha", "g", "tau_s", "conductivity_S_per_m"):
        np.testing.assert_array_equal(getattr(back, name), getattr(draws, name))
    made = card_of(back, card, 5)
    np.testing.assert_array_equal(made.hyperfoam.mu_Pa, draws.mu_Pa[5])
    assert made.conductivity.c0_S_per_m * made.conductivity.a[1] == pytest.approx(draws.conductivity_S_per_m[5, 2])
    write_card(replace(card, posterior={}), tmp_path / "bare.json")
    with pytest.raises(ValueError, match="no posterior"):
        read_draws(tmp_path / "bare.json")
