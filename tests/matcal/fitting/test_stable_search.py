"""Laws that are held stable: they are, everywhere in the range, they cost little more than the best, and it is said."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

from matcal.fitting.hyperfoam.constrained_moduli import bounded_moduli, nearest, within_bounds
from matcal.fitting.hyperfoam.curves import weigh, weighted_design, weighted_stress
from matcal.fitting.hyperfoam.hyperfoam_fit import fit, relative_rms
from matcal.fitting.hyperfoam.stable_fit import States, keeps, rows, search_stable, triples
from matcal.fitting.hyperfoam.variable_projection import least_moduli, projected_slopes
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.ellipticity import strongly_elliptic
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.stability import acoustic_form, worst_acoustic_directions
from matcal.reduction.experiment import Experiment
from touchcal.errors import NotConverged

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0])


def both_modes(law: Hyperfoam = TABLE_1) -> tuple:
    ends = {"uniaxial": (-0.8, -0.01), "shear": (0.02, 1.0)}
    return weigh([Experiment(mode, e := np.linspace(*ends[mode], 60), nominal_stress(law, mode, e), source=(mode,))
                  for mode in ends])


def holds(criterion: str, law: Hyperfoam, x: np.ndarray) -> bool:
    if criterion == "elliptic":
        return bool(np.all(strongly_elliptic(law, x)))
    return bool(np.linalg.eigvalsh(law.tangent(x)).min() > 0)


@pytest.mark.thorough
@pytest.mark.parametrize(("criterion", "nu", "ends"), [
    ("drucker", 0.0, (0.2, 1.6)), ("elliptic", 0.0, (0.2, 1.6)), ("drucker", 0.1, (0.5, 1.3)),
    pytest.param("elliptic", 0.1, (0.5, 1.3), marks=pytest.mark.slow)])
def test_a_held_law_is_stable_at_random_states_of_the_range(criterion: str, nu: float,
                                                            ends: tuple[float, float]) -> None:
    tests = both_modes()
    found = fit(tests, 3, nu, thorough=False, stable=criterion, stable_range=ends)
    x = np.log(np.random.default_rng(0).uniform(*ends, (4000, 3)))
    assert not holds(criterion, found.free, x)
    assert holds(criterion, found.law, x)
    assert found.free is not None
    assert any(f"held {criterion} stable" in d and "instead of" in d for d in found.decisions)
    print(criterion, nu, [f"{relative_rms(found.law, c):.2%} for {relative_rms(found.free, c):.2%}" for c in tests])


def test_drucker_costs_4_percent_on_table_1() -> None:
    found = fit(both_modes(), 3, thorough=False, stable="drucker")
    assert 0.02 < np.sqrt(found.optimum.cost) < 0.045
    assert any("rejects legitimate foam plateaus" in d for d in found.decisions)


@pytest.mark.thorough
def test_the_elliptic_law_is_no_worse_than_a_drucker_law_that_is_elliptic() -> None:
    ends = (0.4, 1.2)
    drucker, elliptic = (fit(both_modes(), 3, thorough=False, stable=s, stable_range=ends)
                         for s in ("drucker", "elliptic"))
    assert keeps("elliptic", drucker.law, np.log(ends))
    assert keeps("elliptic", elliptic.law, np.log(ends))
    assert elliptic.optimum.cost <= drucker.optimum.cost
    assert any("Neither criterion implies the other" in d for d in elliptic.decisions)


def test_a_law_that_is_stable_anyway_is_left_as_it_is() -> None:
    law = Hyperfoam([4000.0, 2000.0], [6.0, -2.0], [0, 0])
    free, held = (fit(both_modes(law), 2, thorough=False, stable=s) for s in (None, "drucker"))
    np.testing.assert_allclose(held.law.mu_Pa, free.law.mu_Pa, rtol=1e-3)
    assert held.optimum.cost < 1e-8


@pytest.mark.slow
def test_terms_with_their_own_nu_are_held_too() -> None:
    found = fit(both_modes(), poisson=(0.0, 0.1, 0.0), thorough=False, stable="drucker", stable_range=(0.4, 1.5))
    assert holds("drucker", found.law, triples((np.log(0.4), np.log(1.5)), 17))


def test_what_cannot_be_held_is_not_returned() -> None:
    with pytest.raises(NotConverged, match="still violates it at stretches"):
        search_stable("drucker", (np.log(0.2), np.log(1.5)), lambda _: TABLE_1)
    with pytest.raises(ValueError, match="known: drucker, elliptic"):
        fit(both_modes(), 3, stable="hill")


def test_rows_are_the_margins() -> None:
    law = replace(TABLE_1, nu=np.array([0.1, 0.2, 0.3]))
    x = np.log(np.random.default_rng(1).uniform(0.3, 1.5, (20, 3)))
    value, n, m = worst_acoustic_directions(law, x)
    np.testing.assert_allclose(acoustic_form(law, x, n, m), value, rtol=1e-9)
    np.testing.assert_allclose(rows("elliptic", States(x, n, m), law.alpha, law.nu) @ law.mu_Pa, value, rtol=1e-9)
    tangent = np.einsum("ki,kij,kj->k", n, law.tangent(x), n)
    np.testing.assert_allclose(rows("drucker", States(x, n, n), law.alpha, law.nu) @ law.mu_Pa, tangent, rtol=1e-9)


def test_the_nearest_moduli_are_those_of_a_general_solver() -> None:
    rng = np.random.default_rng(2)
    matrix, free, held = rng.normal(size=(30, 4)), rng.normal(size=4), rng.normal(size=(6, 4))
    floor = held @ rng.normal(size=4)
    found = nearest(matrix, free, held, floor)
    other = minimize(lambda mu: np.sum((matrix @ (mu - free)) ** 2), np.zeros(4), method="trust-constr",
                     constraints=LinearConstraint(held, lb=floor), options={"gtol": 1e-10, "xtol": 1e-12})
    assert np.all(held @ found >= floor - 1e-9)
    np.testing.assert_allclose(found, other.x, atol=1e-4)


@pytest.mark.parametrize("terms", [2, 3, 4])
def test_slopes_along_the_bound_on_moduli_are_those_of_differences(terms: int) -> None:
    x, rng, bounded = np.linspace(-0.9, -0.02, 50), np.random.default_rng(terms), 0

    def design(alpha: np.ndarray) -> np.ndarray:
        return 2 / alpha * np.expm1(np.outer(x, alpha))

    def slope(alpha: np.ndarray) -> np.ndarray:
        return (design(alpha + 1e-5) - design(alpha - 1e-5)) / 2e-5

    for _ in range(20):
        alpha = np.cumsum(rng.uniform(1, 5, terms)) - 6
        target = design(alpha + 1) @ rng.normal(size=terms) + rng.normal(0, 0.05, x.size)

        def miss(alpha: np.ndarray, target: np.ndarray = target) -> np.ndarray:
            matrix = design(alpha)
            return matrix @ bounded_moduli(matrix, target, alpha) - target

        free = within_bounds(bounded_moduli(design(alpha), target, alpha))
        bounded += free.shape[1] < terms
        found = projected_slopes(design(alpha), slope(alpha), target, free)
        expected = np.stack([(miss(alpha + step) - miss(alpha - step)) / 2e-6 for step in 1e-6 * np.eye(terms)], axis=1)
        np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())
    assert bounded > 3


@pytest.mark.thorough
def test_moduli_of_a_toe_are_bounded_with_positive_sum() -> None:
    strain = np.linspace(-0.6, -0.005, 60)
    toe = weigh([Experiment("uniaxial", strain, -1e5 * strain**2 * (1 + 10 * strain**2), source=("toe.csv",))])
    alpha = np.array([-3.0, 2.0, 12.0])
    design, stress = weighted_design(toe, alpha, 0.0), weighted_stress(toe)
    free, mu = least_moduli(design, stress, alpha), bounded_moduli(design, stress, alpha)
    assert np.abs(free).max() > 50 * free.sum()
    assert 0 < np.abs(mu).max() <= 50.001 * mu.sum()
    found = fit(toe)
    assert 0 < np.abs(found.law.mu_Pa).max() <= 50.001 * found.law.mu_0_Pa
    assert any("may begin with a toe" in d or "exceed 50 mu_0" in d for d in found.decisions)
