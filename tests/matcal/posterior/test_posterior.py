"""Posterior: exact marginalisation, convergence gate, coverage of the truth, draws as whole materials."""

import os
import time
from dataclasses import replace

import arviz
import h5py
import numpy as np
import pytest
from scipy.integrate import quad

from matcal.card import MaterialCard, write_card
from matcal.fitting.calibrate import calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.hyperfoam.curves import weigh, weighted_design, weighted_model, weighted_stress, with_history
from matcal.fitting.hyperfoam.hyperfoam_fit import fit
from matcal.fitting.relaxation.relaxation_fit import fit_prony
from matcal.fitting.uncertainty.intervals import linearised
from matcal.fitting.uncertainty.linear_response import PRIOR_MODULI
from matcal.laws.conductivity import Conductivity
from matcal.laws.deformation_modes import hereditary_stress, nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony, convolve
from matcal.posterior import ensembles
from matcal.posterior.derived_quantities import derived_of
from matcal.posterior.drawn_laws import law_of, stress_band, stress_of
from matcal.posterior.draws import card_of, foam_draws, read_draws, write_draws
from matcal.posterior.ensembles import ESS, RHAT, run_ensembles
from matcal.posterior.hyperfoam_posterior import law_part
from matcal.posterior.record_effects import series_effect
from matcal.posterior.sample import sample
from matcal.reduction.experiment import Experiment
from touchcal.errors import InputFileError, NotConverged

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
    part = law_part(found, 50.0, None)
    points = np.array([[2.0, -1.0], [3.0, -1.5], [5.0, -0.3]])
    value = part.log_density(points, None, None)
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
        value[k] -= np.log(area) - 50 * ln_sigma
    np.testing.assert_allclose(value, value[0], atol=1e-5)


@pytest.mark.thorough
def test_walkers_in_a_lost_mode_are_moved_out_of_it() -> None:
    """Two peaks, one of them e^60 times lower: no ensemble keeps walkers there."""
    def density(x: np.ndarray, share: float) -> np.ndarray:
        far = np.sum((x - 6.0) ** 2, axis=1) / 0.5 + 120
        return -0.5 * share * np.minimum(np.sum(x**2, axis=1) / 0.5, far)

    chains = run_ensembles(density, np.full(2, 3.0), np.full(2, 4.0), lambda x: {"sum": x.sum(axis=1)}, seed=1)
    assert chains.checks["converged"]
    assert chains.points.max() < 4


def test_the_rate_effect_follows_the_series() -> None:
    """The design with a sampled series is that of a curve with this series as its history, for the fitted law."""
    time_s = np.r_[0.0, np.geomspace(0.5, 200, 70)]
    strain = -0.8 * np.linspace(0, 1, 71)
    long = replace(TABLE_1, mu_Pa=TABLE_1.mu_Pa, moduli="instantaneous")
    near, far = Prony([0.2, 0.1], [1.0, 30.0]), Prony([0.3, 0.05], [2.0, 70.0])
    test = Experiment("uniaxial", strain, hereditary_stress(long, near, "uniaxial", time_s, strain), time_s, noise=5.0)
    hold = Experiment("relaxation", -0.5 * np.minimum(time_s, 1.0),
                      hereditary_stress(long, near, "uniaxial", time_s, -0.5 * np.minimum(time_s, 1.0)), time_s,
                      noise=5.0)
    series = fit_prony([hold], TABLE_1, 2)
    found = fit([with_history(c, series.prony) for c in weigh([test])], 3, starts=2, thorough=False)
    part = law_part(found, 50.0, series)
    basis = part.tables[0].basis
    asked = found.law
    moved = weighted_model([with_history(c, far) for c in weigh([test])], asked)
    effect = series_effect(part.rate, np.log(far.tau_s)[None], far.g[None])[0] - part.fitted_rate
    np.testing.assert_allclose(basis @ (part.model + effect), moved, atol=2e-5 * np.abs(moved).max())


@pytest.mark.slow
def test_draws_are_whole_cards(tmp_path) -> None:
    """With a long rate effect the long-term modulus and g_inf of a draw depend on each other through the same record.
    """
    found = sampled_with_series()
    mu_0, rest = found.draws.law["mu_Pa"].sum(axis=1), 1 - found.draws.g.sum(axis=1)
    assert abs(np.corrcoef(mu_0, rest)[0, 1]) > 0.3
    assert found.checks["converged"]
    about = {"prior": found.prior, "seed": found.seed}
    write_draws(found.draws, tmp_path / "posterior.nc", derived_of(found.draws), found.log_density, about)
    stored = arviz.from_netcdf(str(tmp_path / "posterior.nc"))
    assert stored.posterior["mu_Pa"].shape == (1, len(found.draws), 1)
    np.testing.assert_allclose(stored.posterior["mu_0_instantaneous_Pa"][0], mu_0 / rest)
    assert stored.sample_stats["lp"].shape == (1, len(found.draws))
    assert stored.posterior.attrs["seed"] == found.seed
    assert "ln tau uniform" in stored.posterior.attrs["prior"]


def sampled_with_series():
    time_s = np.r_[0.0, np.geomspace(0.1, 60, 90)]
    law, series = Hyperfoam([5e3], [3.0], [0.0], "instantaneous"), Prony([0.25], [12.0])
    rng, ramp = np.random.default_rng(0), -0.7 * np.minimum(time_s / 0.1, 1.0)
    slow = -0.8 * time_s / 60
    hold = Experiment("relaxation", ramp, hereditary_stress(law, series, "uniaxial", time_s, ramp)
                      + 100 * rng.normal(size=91), time_s, noise=100.0)
    test = Experiment("uniaxial", slow, hereditary_stress(law, series, "uniaxial", time_s, slow)
                      + 5 * rng.normal(size=91) * (time_s > 0), time_s, noise=5.0)
    found = calibrate([hold, test], FitOptions(order=1, prony_terms=1))
    return sample(found.fit, found.uncertainty, found.prony, None, seed=2)


@pytest.mark.slow
def test_relaxation_alone_is_sampled() -> None:
    time_s = np.r_[0.0, 0.5, 1.0, 1 + np.geomspace(0.05, 100, 80)]
    strain, series = -0.5 * np.minimum(time_s, 1.0), Prony([0.2, 0.1], [1.5, 25.0])
    stress = 1e4 * convolve(series, time_s, strain) + 5 * np.random.default_rng(1).normal(size=83)
    fitted = fit_prony([Experiment("relaxation", strain, stress, time_s, noise=5.0)], None, 2)
    found = sample(None, None, fitted, None, seed=0)
    assert found.checks["converged"]
    low, high = np.quantile(np.hstack([found.draws.g, found.draws.tau_s]), [0.005, 0.995], axis=0)
    truth = np.r_[series.g, series.tau_s]
    assert np.all((low < truth) & (truth < high))
    sd = np.sqrt(np.diag(fitted.covariance))
    np.testing.assert_allclose(np.hstack([found.draws.g, found.draws.tau_s]).std(axis=0), sd, rtol=0.4)


@pytest.mark.slow
def test_replicates_show_how_much_specimens_differ() -> None:
    factors, rng = np.exp([0.08, -0.1, 0.03, -0.05]), np.random.default_rng(3)
    law, e = Hyperfoam([5e3], [3.0], [0.0]), np.linspace(-0.6, -0.01, 50)
    alike = nominal_stress(law, "uniaxial", e)
    tests = [Experiment("uniaxial", e, f * alike + 10 * rng.normal(size=50), noise=10.0) for f in factors]
    found = fit(weigh(tests), 1, starts=2)
    drawn = sample(found, linearised(found), None, None, seed=0)
    assert "mean foam" in drawn.decisions[0]
    omega = drawn.draws.omega
    assert np.quantile(omega, 0.025) < np.std(np.log(factors), ddof=1) < np.quantile(omega, 0.975)
    values = derived_of(drawn.draws)
    assert values["mu_0_new_specimen_Pa"].std() > 1.3 * values["mu_0_Pa"].std()
    alone = fit(weigh(tests[:1]), 1, starts=2)
    single = sample(alone, linearised(alone), None, None, seed=0)
    assert values["mu_0_Pa"].std() > 3 * single.draws.law["mu_Pa"].sum(axis=1).std()
    assert "not in the intervals" in single.decisions[0]


@pytest.mark.slow
def test_a_fitted_nu_is_sampled_with_the_rest() -> None:
    law, rng = replace(TABLE_1, mu_Pa=[9e3], alpha=[3.0], nu=[0.2]), np.random.default_rng(0)
    tests = [Experiment(mode, e := np.linspace(lo, hi, 60), nominal_stress(law, mode, e) + 20 * rng.normal(size=60),
                        noise=20.0) for mode, lo, hi in (("uniaxial", -0.5, -0.01), ("shear", 0.02, 0.6))]
    found = fit(weigh(tests), 1, "fit")
    drawn = sample(found, linearised(found), None, None, seed=0)
    low, high = np.quantile(drawn.draws.law["nu"][:, 0], [0.005, 0.995])
    assert low < 0.2 < high
    assert 0 < high - low < 0.2
    few = stress_of(drawn.draws, "planar", [-0.4, 0.2])[:5]
    np.testing.assert_allclose(few, [nominal_stress(law_of(drawn.draws, k), "planar", [-0.4, 0.2]) for k in range(5)],
                               rtol=1e-8)
    low, high = np.quantile(derived_of(drawn.draws)["E_0_Pa"], [0.005, 0.995])
    assert low < law.E_0_Pa < high


def test_nothing_to_sample_is_refused() -> None:
    with pytest.raises(ValueError, match="nothing to sample"):
        sample(None, None, None, None, seed=0)


def test_chains_pass_their_gate(sampled) -> None:
    assert sampled.checks["converged"]
    assert sampled.checks["rhat"] < RHAT
    assert sampled.checks["ess"] > ESS
    assert "normal about 0" in sampled.prior


def test_mu_0_and_stress_bands_cover_the_truth_and_agree_with_the_linearised(fitted, sampled) -> None:
    draws = sampled.draws
    mu_0 = draws.law["mu_Pa"].sum(axis=1)
    low, high = np.quantile(mu_0, [0.025, 0.975])
    assert low < TABLE_1.mu_0_Pa < high
    assert mu_0.std() == pytest.approx(fitted[1].derived["mu_0_Pa"].sd, rel=0.5)
    assert draws.law["mu_Pa"][:, 0].std() > 10 * mu_0.std()
    for mode, strain in (("uniaxial", np.linspace(-0.8, -0.02, 12)), ("shear", np.linspace(0.05, 1, 12))):
        low, high = stress_band(draws, mode, strain, 0.999)
        truth = nominal_stress(TABLE_1, mode, strain)
        assert np.all((low < truth) & (truth < high))
        assert np.max((high - low) / np.abs(truth)) < 0.1


@pytest.mark.slow
def test_short_chains_are_refused_and_carry_what_they_reached(fitted, monkeypatch) -> None:
    monkeypatch.setattr(ensembles, "MOST_STEPS", 200)
    monkeypatch.setattr(ensembles, "CHUNK", 200)
    with pytest.raises(NotConverged, match="after 200 steps") as first:
        sample(*fitted, None, None, seed=3)
    with pytest.raises(NotConverged) as second:
        sample(*fitted, None, None, seed=3)
    with pytest.raises(NotConverged) as other:
        sample(*fitted, None, None, seed=4)
    np.testing.assert_array_equal(first.value.estimate.draws.law["mu_Pa"], second.value.estimate.draws.law["mu_Pa"])
    assert not np.array_equal(first.value.estimate.draws.law["mu_Pa"], other.value.estimate.draws.law["mu_Pa"])


def test_draws_come_back_from_the_file_as_cards(tmp_path) -> None:
    rng = np.random.default_rng(0)
    draws = foam_draws(TABLE_1.mu_Pa + rng.normal(size=(8, 3)), TABLE_1.alpha + 0.01 * rng.normal(size=(8, 3)), 0.0,
                       g=0.1 + 0.01 * rng.uniform(size=(8, 2)), tau_s=np.array([1.0, 10.0]) + rng.uniform(size=(8, 2)),
                       conductivity_S_per_m=np.array([30.0, -60, 60, -30]) + rng.normal(size=(8, 4)))
    (tmp_path / "c.d").mkdir()
    card = MaterialCard("c", TABLE_1, Prony([0.1, 0.1], [1.0, 10.0]), Conductivity(30.0, [-2, 2, -1.0], (0.0, 0.4)),
                        posterior={"file": "c.d/posterior.nc", "n": 8})
    write_card(card, tmp_path / "c.json")
    with pytest.raises(InputFileError, match="is not there"):
        read_draws(tmp_path / "c.json")
    write_draws(draws, tmp_path / "c.d" / "posterior.nc", derived_of(draws))
    stored = arviz.from_netcdf(str(tmp_path / "c.d" / "posterior.nc"))
    assert stored.posterior["mu_Pa"].shape == (1, 8, 3)
    np.testing.assert_allclose(stored.posterior["mu_0_instantaneous_Pa"][0],
                               draws.law["mu_Pa"].sum(axis=1) / (1 - draws.g.sum(axis=1)))
    back = read_draws(tmp_path / "c.json")
    for name in ("mu_Pa", "alpha"):
        np.testing.assert_array_equal(back.law[name], draws.law[name])
    for name in ("g", "tau_s", "conductivity_S_per_m"):
        np.testing.assert_array_equal(getattr(back, name), getattr(draws, name))
    made = card_of(back, card, 5)
    np.testing.assert_array_equal(made.hyperfoam.mu_Pa, draws.law["mu_Pa"][5])
    assert made.conductivity.c0_S_per_m * made.conductivity.a[1] == pytest.approx(draws.conductivity_S_per_m[5, 2])
    write_card(replace(card, posterior={}), tmp_path / "bare.json")
    with pytest.raises(ValueError, match="no posterior"):
        read_draws(tmp_path / "bare.json")


@pytest.mark.parametrize("change", ["cut", "empty", "no group", "link", "huge", "nan", "no draws", "pipe"])
def test_a_broken_posterior_is_named(tmp_path, change: str) -> None:
    path = tmp_path / "posterior.nc"
    write_card(MaterialCard("c", TABLE_1, posterior={"file": path.name, "n": 8}), tmp_path / "c.json")
    draws = foam_draws(np.ones((8, 3)), np.ones((8, 3)), 0.0)
    write_draws(draws, path, {})
    whole = path.read_bytes()
    if change in ("cut", "empty"):
        path.write_bytes(whole[:len(whole) // 2] if change == "cut" else b"")
    elif change == "pipe":
        path.unlink()
        os.mkfifo(path)
    else:
        (tmp_path / "other.nc").write_bytes(whole)
        with h5py.File(path, "a") as file:
            group = file["posterior"]
            gone = {"no draws": ("mu_Pa", "alpha", "nu"), "no group": (), "nan": ("mu_Pa",)}
            for name in gone.get(change, ("alpha",)):
                del group[name]
            if change == "link":
                group["alpha"] = h5py.ExternalLink("other.nc", "/posterior/alpha")
            elif change == "huge":
                group.create_dataset("alpha", (1, 10**13, 3), chunks=(1, 1000, 3))
            elif change == "nan":
                group["mu_Pa"] = np.full((1, 8, 3), np.nan)
            elif change == "no group":
                del file["posterior"]
    with pytest.raises(InputFileError, match=r"posterior\.nc: .+"):
        read_draws(tmp_path / "c.json")
