"""Posterior of laws that are no hyperfoam: density against one without short cuts, coverage, draws as whole cards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import matcal
from eitsim.sweeps.design.card_draws import Material, card_at, cards_for, columns, recorded
from matcal.fitting.calibrate import calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.hyperfoam.curves import weighted_model, weighted_stress
from matcal.laws.deformation_modes import hereditary_stress, nominal_stress
from matcal.laws.law import Law, units, vector, with_vector
from matcal.laws.law_stack import LawStack
from matcal.laws.neo_hooke import NeoHooke
from matcal.posterior.derived_quantities import derived_of
from matcal.posterior.drawn_laws import law_of, stress_band, stress_of
from matcal.posterior.general_posterior import law_part
from matcal.posterior.sample import sample
from matcal.reduction.experiment import Experiment

RUBBER = NeoHooke(8e3, 0.3)
SPANS = {"uniaxial": (-0.5, 0.4), "shear": (0.03, 0.9), "volumetric": (0.7, 0.99)}


def experiments_of(law: Law, noise: float, seed: int, modes: tuple[str, ...] = ("uniaxial", "shear")
                   ) -> list[Experiment]:
    draw = np.random.default_rng(seed)
    return [Experiment(mode, e := np.linspace(*SPANS[mode], 30),
                       nominal_stress(law, mode, e) + noise * draw.normal(size=30), noise=noise) for mode in modes]


def fitted(law: Law, noise: float, seed: int, modes: tuple[str, ...] = ("uniaxial", "shear")):
    return calibrate(experiments_of(law, noise, seed, modes), FitOptions(law=law.name))


def law_named(name: str, mooney_rivlin: type[Law]) -> Law:
    return RUBBER if name == "neo_hooke" else mooney_rivlin(3e3, 1e3, 4e4)  # pyright: ignore[reportCallIssue]


@pytest.mark.parametrize("name", ["neo_hooke", "split_volume"])
def test_a_stack_is_its_laws_one_by_one(name, mooney_rivlin) -> None:
    law = law_named(name, mooney_rivlin)
    vectors = vector(law) * np.exp(0.05 * np.random.default_rng(0).normal(size=(6, vector(law).size)))
    stack, x = LawStack(law, vectors), np.random.default_rng(1).uniform(-0.4, 0.4, (6, 5, 3))
    each = [with_vector(law, values) for values in vectors]
    np.testing.assert_allclose(stack.kirchhoff(x), [one.kirchhoff(at) for one, at in zip(each, x, strict=True)])
    np.testing.assert_allclose(stack.tangent(x), [one.tangent(at) for one, at in zip(each, x, strict=True)])
    shear, bulk = stack.moduli_at_rest
    np.testing.assert_allclose(shear, [one.mu_0_Pa for one in each])
    np.testing.assert_allclose(bulk, [one.kappa_0_Pa for one in each])


@pytest.mark.parametrize("name", ["neo_hooke", "split_volume"])
def test_the_density_is_that_of_the_residuals(name, mooney_rivlin) -> None:
    """Without doubtful records: -points (ln sigma + |residual|^2 / (2 sigma^2)), to a constant, worked out plainly."""
    fit = fitted(law_named(name, mooney_rivlin), 60.0, 0).fit
    assert fit is not None
    part = law_part(fit, 20.0, None)
    draw = np.random.default_rng(1)
    points = part.start(fit)[0] + np.column_stack([0.02 * draw.normal(size=(8, part.size - 1)),
                                                   0.3 * draw.normal(size=8)])
    laws = [with_vector(fit.law, row * units(fit.law)) for row in points[:, :-1]]
    misses = [weighted_model(fit.curves, one) - weighted_stress(fit.curves) for one in laws]
    plain = [-20 * (s + m @ m / 2 * np.exp(-2 * s)) for m, s in zip(misses, points[:, -1], strict=True)]
    found = part.log_density(points, None, None)
    np.testing.assert_allclose(found - found[0], np.subtract(plain, plain[0]), atol=2e-3)
    outside = np.array(points[:1])
    outside[0, 0] = -1.0
    assert part.log_density(outside, None, None) == -np.inf


@pytest.mark.slow
@pytest.mark.parametrize(("name", "modes"), [("neo_hooke", ("uniaxial", "shear")),
                                             ("mooney_rivlin", ("uniaxial", "shear", "volumetric"))])
def test_draws_hold_the_truth_about_as_often_as_they_say(name, modes, mooney_rivlin) -> None:
    law, inside, ratio = law_named(name, mooney_rivlin), [], []
    at = np.array([-0.4, 0.3])
    truth = nominal_stress(law, "biaxial", at)
    for seed in range(3):
        found = fitted(law, 100.0, seed, modes)
        drawn = sample(found.fit, found.uncertainty, None, None, seed=seed)
        assert drawn.checks["converged"]
        mu_0 = derived_of(drawn.draws)["mu_0_Pa"]
        low, high = np.quantile(mu_0, [0.025, 0.975])
        inside.append(low < law.mu_0_Pa < high)
        low, high = stress_band(drawn.draws, "biaxial", at)
        inside += ((low < truth) & (truth < high)).tolist()
        assert found.uncertainty is not None
        ratio.append(mu_0.std() / found.uncertainty.derived["mu_0_Pa"].sd)
    print(f"{name}: {np.mean(inside):.0%} of {len(inside)} inside, sd over the linearised {min(ratio):.2f} to "
          f"{max(ratio):.2f}")
    assert np.mean(inside) > 0.7
    assert 0.6 < np.mean(ratio) < 1.5


@pytest.mark.slow
def test_draws_of_any_law_are_whole_cards_for_predictions_sweeps_and_export(tmp_path) -> None:
    prony = matcal.Prony([0.3], [20.0])
    time = np.r_[np.linspace(0, 1, 21), np.geomspace(1.1, 400, 80)]
    ramp = -0.3 * np.minimum(time, 1.0)
    hold = hereditary_stress(replace(RUBBER, mu_Pa=8e3 / 0.7, moduli="instantaneous"), prony, "uniaxial", time, ramp)
    hold = hold + 5 * np.random.default_rng(0).normal(size=time.size)
    curves = {e.kind: (e.strain, e.value) for e in experiments_of(RUBBER, 60.0, 0)}
    fit = matcal.fit([curves, {"relaxation": (ramp, hold, time)}], law="neo_hooke", posterior=True).save(
        tmp_path / "rubber.json")
    draws = fit.posterior.draws
    few = stress_of(draws, "planar", [-0.4, 0.2])[:5]
    np.testing.assert_allclose(few, [nominal_stress(law_of(draws, k), "planar", [-0.4, 0.2]) for k in range(5)])
    rows = matcal.predict(tmp_path / "rubber.json", "uniaxial", [-0.4, 0.3])
    truth = nominal_stress(RUBBER, "uniaxial", [-0.4, 0.3])
    assert np.all((rows["stress_lo_Pa"] < truth) & (truth < rows["stress_hi_Pa"]))
    assert np.max((rows["stress_hi_Pa"] - rows["stress_lo_Pa"]) / np.abs(truth)) < 0.2
    cards = cards_for(Material(draws=4), 0, matcal.read_card(tmp_path / "rubber.json"))
    assert columns(cards) == ["mu_Pa", "nu", "g_1", "tau_1_s"]
    own, row = card_at(cards, 0), recorded(cards, 0)
    assert isinstance(own.law, NeoHooke)
    assert (own.law.mu_Pa, own.law.nu) == (row["mu_Pa"], row["nu"])
    assert "neo-Hookean" in matcal.export(own, "febio").text


def test_replicates_scatter_and_series_move_a_sampled_law() -> None:
    """Contrasts of replicates are sampled, stated scatter widens draws about the fit, a given nu is kept."""
    e = np.linspace(-0.5, -0.02, 30)
    stress = nominal_stress(RUBBER, "uniaxial", e)
    noise = 20 * np.random.default_rng(0).normal(size=(3, 30))
    twice = [Experiment("uniaxial", e, s * stress + row, noise=20.0) for s, row in zip((0.93, 1.0, 1.08), noise,
                                                                                      strict=True)]
    found = calibrate(twice, FitOptions(law="neo_hooke", poisson=0.3))
    part = law_part(found.fit, 20.0, None)
    assert part.size == 3  # mu, ln sigma, ln omega
    point = np.repeat(part.start(found.fit)[0][None], 400, axis=0)
    drawn = part.draws(point, None, None, np.random.default_rng(0))
    assert np.ptp(drawn.law["nu"]) == 0
    assert drawn.law["mu_Pa"].std() / drawn.law["mu_Pa"].mean() == pytest.approx(0.05 / np.sqrt(3), rel=0.2)
    stated = [Experiment("uniaxial", e, stress, deviation=0.1 * np.abs(stress))]
    found = calibrate(stated, FitOptions(law="neo_hooke", poisson=0.3))
    part = law_part(found.fit, 20.0, None)
    drawn = part.draws(np.repeat(part.start(found.fit)[0][None], 4000, axis=0), None, None, np.random.default_rng(0))
    assert drawn.law["mu_Pa"].std() / drawn.law["mu_Pa"].mean() == pytest.approx(0.1, rel=0.1)
