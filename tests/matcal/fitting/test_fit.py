"""Hyperfoam fit: recovery, independence of starts, weights and orders, collinearity, stability held, errors."""

from dataclasses import replace

import lmfit
import numpy as np
import pytest

from matcal.fitting.hyperfoam.curves import weigh, weighted_design, weighted_model, weighted_stress, with_history
from matcal.fitting.hyperfoam.design_table import tabulate
from matcal.fitting.hyperfoam.hyperfoam_fit import allowed_exponents, fit, relative_rms
from matcal.fitting.hyperfoam.order_selection import collinearity
from matcal.fitting.uncertainty.standard_errors import standard_errors
from matcal.laws.deformation_modes import hereditary_stress, nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.laws.stability import is_stable
from matcal.reduction.experiment import Experiment

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0])
SERIES = Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672])


def curve(mode: str, law: Hyperfoam = TABLE_1, noise_Pa: float = 0.0, seed: int = 0, points: int = 60) -> Experiment:
    ends = {"uniaxial": (-0.8, -0.01), "shear": (0.02, 1.0), "biaxial": (-0.7, -0.01), "volumetric": (0.3, 0.99)}[mode]
    strain = np.linspace(*ends, points)
    scatter = noise_Pa * np.random.default_rng(seed).normal(size=points)
    return Experiment(mode, strain, nominal_stress(law, mode, strain) + scatter, source=(f"{mode}.csv",))


def test_exact_curves_give_back_the_parameters() -> None:
    found = fit(weigh([curve("uniaxial"), curve("shear")]), 3)
    np.testing.assert_allclose(found.law.mu_Pa, TABLE_1.mu_Pa[np.argsort(TABLE_1.alpha)], rtol=2e-3)
    np.testing.assert_allclose(found.law.alpha, np.sort(TABLE_1.alpha), rtol=1e-3)
    assert found.orders[0].rms < 1e-6


def test_orders_cost_what_the_findings_say() -> None:
    rms = [row.rms for row in fit(weigh([curve("uniaxial", noise_Pa=40), curve("shear", noise_Pa=40)])).orders]
    assert rms[0] > 0.1
    assert 0.05 < rms[1] < 0.1
    assert rms[2] < 0.01
    assert rms[3] > 0.95 * rms[2]


def test_every_start_of_three_terms_ends_in_the_same_minimum() -> None:
    found = fit(weigh([curve("uniaxial", noise_Pa=20), curve("shear", noise_Pa=20)]), order=3)
    assert found.optimum.starts[2] < 1.001 * found.optimum.starts[0]


def test_nu_is_recovered() -> None:
    law = replace(TABLE_1, nu=np.full(3, 0.15))
    found = fit(weigh([curve("uniaxial", law), curve("shear", law), curve("biaxial", law)]), 3, "fit", thorough=False)
    np.testing.assert_allclose(found.law.nu, 0.15, atol=2e-3)
    assert found.law.mu_0_Pa == pytest.approx(9530, rel=5e-3)


def test_histories_give_long_term_moduli() -> None:
    t = np.linspace(0, 192, 150)
    instantaneous = replace(TABLE_1, mu_Pa=TABLE_1.mu_Pa / SERIES.g_infinity, moduli="instantaneous")
    tests = [Experiment(mode, strain, hereditary_stress(instantaneous, SERIES, mode, t, strain), t)
             for mode, strain in (("uniaxial", -0.8 * t / 192), ("shear", t / 192))]
    plain = weigh(tests)
    corrected = fit([with_history(c, SERIES) for c in plain], 3)
    assert corrected.law.moduli == "longterm"
    assert corrected.law.mu_0_Pa == pytest.approx(9530, rel=1e-3)
    assert fit(plain, 3).law.mu_0_Pa > 1.05 * 9530


def test_the_weighted_model_is_the_design_for_one_nu_and_the_law_itself_for_several() -> None:
    tests = [replace(curve(mode), time_s=np.linspace(0, 100, 60), strain=np.r_[0.0, curve(mode).strain[1:]])
             for mode in ("uniaxial", "shear", "biaxial")]
    curves = [with_history(c, SERIES) for c in weigh(tests)]
    law = replace(TABLE_1, nu=np.full(3, 0.2))
    np.testing.assert_allclose(weighted_model(curves, law), weighted_design(curves, law.alpha, 0.2) @ law.mu_Pa,
                               rtol=1e-9, atol=1e-12)
    mixed, plain = replace(TABLE_1, nu=np.array([0.1, 0.3, 0.2])), weigh(tests)
    expected = np.concatenate([nominal_stress(mixed, c.experiment.kind, c.experiment.strain) / c.scale_Pa
                               for c in plain])
    np.testing.assert_allclose(weighted_model(plain, mixed), expected, rtol=1e-12)


def test_a_mode_left_out_is_cross_predicted() -> None:
    found = fit(weigh([curve("uniaxial", noise_Pa=30), curve("shear", noise_Pa=30)]), 3)
    assert found.alone["uniaxial"].relative_rms["uniaxial"] < found.alone["uniaxial"].relative_rms["shear"]
    assert found.alone["shear"].relative_rms["uniaxial"] > 0.1
    assert all(relative_rms(found.law, c) < 0.02 for c in found.curves)


def test_weights_and_residuals_move_the_fit_where_they_say() -> None:
    stiffer = replace(TABLE_1, mu_Pa=1.2 * TABLE_1.mu_Pa)
    pair = [curve("uniaxial"), curve("shear", stiffer)]
    even, leaning = fit(weigh(pair), 3), fit(weigh(pair, weights={"shear": 20.0}), 3)
    assert relative_rms(leaning.law, leaning.curves[1]) < 0.5 * relative_rms(even.law, even.curves[1])
    absolute = weigh(pair, "absolute")
    assert absolute[0].scale_Pa[0] == absolute[1].scale_Pa[0]
    deviation = weigh(pair, "deviation")[0]
    assert deviation.scale_Pa.min() == pytest.approx(0.05 * deviation.scale_Pa.max())
    twice = weigh([curve("uniaxial"), curve("uniaxial", seed=1), curve("shear")])
    assert [c.weight for c in twice] == [0.25, 0.25, 0.5]
    assert [c.label for c in twice] == ["uniaxial_1", "uniaxial_2", "shear_1"]


def test_merged_exponents_are_bounded_and_said() -> None:
    one_term = Hyperfoam([9000.0], [3.0], [0.0])
    found = fit(weigh([curve("uniaxial", one_term, 5.0), curve("shear", one_term, 5.0)]), 3)
    assert np.diff(found.law.alpha).min() >= allowed_exponents(found.curves).gap * (1 - 1e-9)
    assert found.law.mu_0_Pa == pytest.approx(9000, rel=0.01)
    assert fit(weigh([curve("uniaxial", one_term, 5.0), curve("shear", one_term, 5.0)])).law.alpha.size == 1
    assert "merged" in collinearity(np.array([1.0, 1.0]), np.array([1.0, 1.1]), 0.2)
    assert "times their sum" in collinearity(np.array([1e5, -1e5 + 10]), np.array([1.0, 2.0]), 0.2)
    assert collinearity(TABLE_1.mu_Pa, np.sort(TABLE_1.alpha), 0.2) == ""


def test_standard_errors_show_which_parameters_are_seen() -> None:
    errors = standard_errors(fit(weigh([curve("uniaxial", noise_Pa=30), curve("shear", noise_Pa=30)]), 3))
    assert errors["mu_0_Pa"]["stderr"] < 0.01 * 9530
    assert errors["mu_1_Pa"]["stderr"] > 10 * errors["mu_0_Pa"]["stderr"]


@pytest.mark.parametrize("order", [1, 3, 5])
def test_standard_errors_are_those_of_lmfit(order: int) -> None:
    """Order 5 has two pairs of exponents at their least distance, which lmfit ties by expressions."""
    found = fit(weigh([curve("uniaxial", noise_Pa=30), curve("shear", noise_Pa=30)]), order, thorough=False)
    law, gap, start = found.law, allowed_exponents(found.curves).gap, lmfit.Parameters()
    for k, (mu, alpha) in enumerate(zip(law.mu_Pa / law.mu_0_Pa, law.alpha, strict=True), 1):
        start.add(f"mu_{k}", mu)
        tied = k > 1 and alpha - law.alpha[k - 2] < 1.01 * gap
        start.add(f"alpha_{k}", alpha, expr=f"alpha_{k - 1} + {gap!r}" if tied else None)

    def residual(p: lmfit.Parameters) -> np.ndarray:
        mu, alpha = (np.array([p[f"{name}_{k}"].value for k in range(1, order + 1)]) for name in ("mu", "alpha"))
        return weighted_model(found.curves, Hyperfoam(law.mu_0_Pa * mu, alpha, law.nu)) - weighted_stress(found.curves)

    theirs, ours = lmfit.minimize(residual, start).params, standard_errors(found)
    for k in range(1, order + 1):
        assert ours[f"mu_{k}_Pa"]["stderr"] == pytest.approx(theirs[f"mu_{k}"].stderr * law.mu_0_Pa, rel=1e-3)
        assert ours[f"alpha_{k}"]["stderr"] == pytest.approx(theirs[f"alpha_{k}"].stderr, rel=1e-3)


def test_drucker_can_be_held_and_costs_what_it_says() -> None:
    curves = weigh([curve("uniaxial"), curve("shear")])
    held = fit(curves, 3, stable="drucker", thorough=False)
    assert is_stable(held.law, "drucker", "uniaxial", np.linspace(-0.8, 0, 300)).all()
    assert 0.02 < np.sqrt(held.optimum.cost) < 0.08
    assert any("held drucker stable" in d for d in held.decisions)
    for choice, word in ((dict(stable="hill"), "drucker"),
                         (dict(stable="drucker", stable_range=(1.2, 2.0)), "between 0 and 1")):
        with pytest.raises(ValueError, match=word):
            fit(curves, 3, **choice)


def test_the_table_is_the_design() -> None:
    curves = [with_history(replace(c, experiment=replace(c.experiment, time_s=np.linspace(0, 100, 60),
                                                         strain=np.r_[0.0, c.experiment.strain[1:]])), SERIES)
              for c in weigh([curve("uniaxial"), curve("shear")])]
    table = tabulate(curves, 0.0, (-15.0, 24.0))
    alpha = np.random.default_rng(0).uniform(-15, 24, 60)
    exact = weighted_design(curves, alpha, 0.0)
    error = np.linalg.norm(table.basis @ table.design(alpha) - exact, axis=0) / np.linalg.norm(exact, axis=0)
    assert error.max() < 5e-7
    assert table.basis.shape[1] < 45


@pytest.mark.parametrize(("choices", "word"), [
    (dict(order=7), "known: auto"), (dict(poisson=0.5), "between -1 and 0.5")])
def test_unknown_choices_are_refused(choices: dict, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        fit(weigh([curve("uniaxial")]), **choices)


def test_curves_that_cannot_be_weighed_are_refused() -> None:
    good = curve("uniaxial")
    for call, word in ((lambda: weigh([good], "squared"), "relative, absolute, deviation"),
                       (lambda: weigh([good], weights={"shear": 2}), "no such curve"),
                       (lambda: weigh([good], weights={"uniaxial": 0}), "positive"),
                       (lambda: weigh([replace(good, value=-good.value)]), "opposite signs"),
                       (lambda: fit([]), "no stress-strain curve"),
                       (lambda: with_history(replace(weigh([good])[0],
                                                     experiment=replace(good, time_s=np.arange(60.0))), SERIES),
                        "starts at rest")):
        with pytest.raises(ValueError, match=word):
            call()
