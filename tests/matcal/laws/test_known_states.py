"""Ellipticity, acoustic margins and scanned ranges against what their definitions give by differences and search."""

import itertools

import numpy as np
import pytest
from scipy.optimize import minimize

from matcal.laws.conductivity import Conductivity, coating_thickness, conductivity
from matcal.laws.deformation_modes import lateral_strain, log_stretches, nominal_stress
from matcal.laws.ellipticity import strongly_elliptic
from matcal.laws.hyperfoam import Hyperfoam, exp_remainder
from matcal.laws.law import sinh_ratio
from matcal.laws.prony import Prony, decaying
from matcal.laws.stability import stability, worst_acoustic_directions

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
UNEQUAL = Hyperfoam([9000.0, 5000.0, -4000.0], [1.2, 5.0, -1.5], [0.1, 0.2, 0.3])


def _copositive_least(law: Hyperfoam, x: np.ndarray) -> float:
    """Least v'Mv over v >= 0 and signs e, M with w_ii and e_ij w_ij + (w_i - e_ij w_j)/(l_i - e_ij l_j), scaled by the
    stretches (Dacorogna 2001), w by differences of the energy; and least of (tau_i - tau_j)/(x_i - x_j)."""
    stretch, h = np.exp(x), 1e-4

    def w(l: np.ndarray) -> float:  # noqa: E741
        return float(law.energy(np.log(l)))

    steps = h * np.diag(stretch)
    first = np.array([(w(stretch + s) - w(stretch - s)) / (2 * s.sum()) for s in steps])
    second = np.array([[(w(stretch + s + t) - w(stretch + s - t) - w(stretch - s + t) + w(stretch - s - t))
                        / (4 * s.sum() * t.sum()) for t in steps] for s in steps])
    tau, least = first * stretch, np.inf
    vectors = np.abs(np.random.default_rng(0).normal(size=(3000, 3))) ** 2
    vectors /= np.linalg.norm(vectors, axis=1)[:, None]
    for e_1, e_2 in itertools.product((1, -1), repeat=2):
        signs, matrix = np.array([1, e_1, e_2]), np.empty((3, 3))
        for i, j in itertools.product(range(3), repeat=2):
            e = signs[i] * signs[j]
            matrix[i, j] = second[i, i] if i == j else (
                e * second[i, j] + (first[i] - e * first[j]) / (stretch[i] - e * stretch[j]))
        matrix *= np.outer(stretch, stretch)
        least = min(least, float(np.einsum("ki,ij,kj->k", vectors, matrix, vectors).min()))
    return min(least, *((tau[i] - tau[j]) / (x[i] - x[j]) for i, j in ((0, 1), (0, 2), (1, 2))))


def test_strong_ellipticity_is_dacorognas_at_unequal_stretches() -> None:
    rng, seen = np.random.default_rng(3), []
    for law in (TABLE_1, UNEQUAL, Hyperfoam([1e4, 2e3], [2.0, -8.0], [0.0, 0.3])):
        x = rng.uniform(-1.6, 1.2, (60, 3))
        least = np.array([_copositive_least(law, at) for at in x])
        sure = np.abs(least) > 0.03 * law.mu_0_Pa
        assert np.array_equal(strongly_elliptic(law, x)[sure], least[sure] > 0)
        seen += (least[sure] > 0).tolist()
    assert 20 < sum(seen) < len(seen) - 20


def test_a_rare_loss_by_equal_signs_alone_is_seen() -> None:
    """A state, found by search among random laws, where no pair and no diagonal fails."""
    law = Hyperfoam([16732.30397587, 12192.11461314], [-9.01274421, 9.51977721], [0.3591558, 0.19548457])
    x = np.array([-1.13183587, -0.60191682, 0.63827612])
    assert _copositive_least(law, x) < 0
    assert not strongly_elliptic(law, x)


def test_strong_ellipticity_does_not_depend_on_the_order_of_the_axes_or_the_shape() -> None:
    x = np.random.default_rng(5).uniform(-1.6, 1.6, (1200, 3))
    for law in (TABLE_1, UNEQUAL, Hyperfoam([1e4], [12.0], [0.0]), Hyperfoam([1e4, 2e3], [2.0, -8.0], [0.0, 0.3])):
        found = strongly_elliptic(law, x)
        for order in itertools.permutations(range(3)):
            assert np.array_equal(strongly_elliptic(law, x[:, order]), found)
        assert np.array_equal(strongly_elliptic(law, x.reshape(4, 300, 3)), found.reshape(4, 300))
        assert strongly_elliptic(law, x[0]) == found[0]


@pytest.mark.parametrize(("mode", "strain"), [("biaxial", -0.45), ("shear", 1.3), ("uniaxial", -0.8)])
def test_the_elliptic_margin_is_the_least_over_directions(mode: str, strain: float) -> None:
    """m . J Q(n) m = d2/dt2 of the energy along F + t m n'F, least over unit m, n by search from random starts."""
    x = log_stretches(TABLE_1, mode, np.array([strain]))[0]
    rest, h = np.diag(np.exp(x)), 2e-3

    def bend(angles: np.ndarray) -> float:
        m, n = (np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)]) for a, b in angles.reshape(2, 2))
        step = np.outer(m, n) @ rest
        stored = [float(TABLE_1.energy(np.log(np.linalg.svd(rest + t * step, compute_uv=False)))) for t in (h, 0, -h)]
        return (stored[0] - 2 * stored[1] + stored[2]) / h**2

    starts = np.random.default_rng(1).uniform(0, np.pi, (8, 4))
    least = min(float(minimize(bend, start, method="Nelder-Mead", options={"maxfev": 250}).fun) for start in starts)
    assert worst_acoustic_directions(TABLE_1, x[None])[0][0] == pytest.approx(least, abs=2e-3 * TABLE_1.mu_0_Pa)


def test_what_is_scanned_is_what_is_said() -> None:
    found = stability(Hyperfoam([12e3], [2.0], [0.0]))["drucker"]
    assert {mode: entry["scanned"] for mode, entry in found.items()} == {
        "uniaxial": [-0.95, 1.0], "biaxial": [-0.95, 1.0], "planar": [-0.95, 1.0], "shear": [0.0, 3.0],
        "volumetric": [0.05, 2.0]}


def test_series_join_their_closed_forms() -> None:
    """On both sides of the places where the series take over, and the limit of equal stretches."""
    for z in (0.049, -0.049, 0.051, -0.051, 0.5):
        assert exp_remainder(z) == pytest.approx(np.expm1(z) - z, rel=1e-10)
        x, alpha = np.array([0.2 + z / 3, 0.2 - z / 3, -0.4]), 3.0
        law = Hyperfoam([1.3e4], [alpha], [0.2])
        tau = law.kirchhoff(x)
        assert law.difference(0.2, z / 3) == pytest.approx((tau[0] - tau[1]) / (x[0] - x[1]), rel=1e-10)
    assert law.difference(0.2, 0.0) == pytest.approx(2 * 1.3e4 * np.exp(3.0 * 0.2), rel=1e-12)
    for z in (0.9e-4, 1.1e-4, 2.0):
        assert sinh_ratio(z) - 1 == pytest.approx(z**2 / 6 + z**4 / 120 + z**6 / 5040 + z**8 / 362880, rel=3e-3)


def test_energy_and_moduli_with_a_volumetric_part() -> None:
    """Docstring's U at three unequal stretches; E_0 = 9 K mu/(3 K + mu) as the slope of the uniaxial stress."""
    x = np.array([0.3, -0.5, 0.1])
    stretch, volume = np.exp(x), np.exp(x.sum())
    expected = sum(2 * mu / a**2 * (np.sum(stretch**a) - 3 + (volume ** (-a * b) - 1) / b)
                   for mu, a, b in zip(UNEQUAL.mu_Pa, UNEQUAL.alpha, UNEQUAL.beta, strict=True))
    assert UNEQUAL.energy(x) == pytest.approx(expected, rel=1e-12)
    slope = np.diff(nominal_stress(UNEQUAL, "uniaxial", np.array([-1e-6, 1e-6])))[0] / 2e-6
    assert pytest.approx(slope, rel=1e-6) == UNEQUAL.E_0_Pa
    assert UNEQUAL.mu_0_Pa == 10000.0


@pytest.mark.parametrize(("mode", "free", "driven"), [("uniaxial", 2, 1), ("biaxial", 1, 2), ("planar", 1, 1)])
def test_free_faces_of_one_nu(mode: str, free: int, driven: int) -> None:
    """They carry no stress; lambda_free = lambda^(-beta k/(1 + beta f)) of k driven and f free axes."""
    law, strain = Hyperfoam([5e3, 8e3], [1.5, 4.0], [0.3, 0.3]), np.array([-0.5, 0.4])
    assert law.kirchhoff(log_stretches(law, mode, strain))[:, 2] == pytest.approx([0, 0], abs=1e-8)
    beta = 0.3 / 0.4
    expected = (1 + strain) ** (-beta * driven / (1 + beta * free)) - 1
    assert lateral_strain(law, mode, strain) == pytest.approx(expected, rel=1e-12)


def test_conductivity_and_coating_by_hand() -> None:
    """c(0.2) = 30 (1 - 0.4 + 0.12 + 0.032); the coating keeps its thickness."""
    law = Conductivity(30.0, [-2.0, 3.0, 4.0], (0.0, 0.4))
    assert conductivity(law, 0.2) == pytest.approx(30 * 0.752)
    assert coating_thickness(7e-6, np.array([0.5, 1.0, 2.0])).tolist() == [7e-6] * 3


def test_terms_of_a_series_decay_by_themselves() -> None:
    """A ramp of slope 2: h_i = 2 tau_i (1 - exp(-t/tau_i)), at any steps."""
    law, time = Prony([0.1, 0.2], [0.5, 20.0]), np.array([0.0, 0.3, 1.0, 1.0, 7.0])
    found = decaying(law, time, 2 * time)
    assert found == pytest.approx(2 * law.tau_s[:, None] * -np.expm1(-time / law.tau_s[:, None]), rel=1e-12)
