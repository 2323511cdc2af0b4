"""Test modes: known values, limits, consistency of nominal, second Piola-Kirchhoff and energy, hereditary histories."""

from dataclasses import replace

import numpy as np
import pytest

from matcal.laws.deformation_modes import (
    MODES,
    design,
    hereditary_kernel,
    hereditary_stress,
    log_stretches,
    nominal_stress,
    push_forward,
    second_piola,
)
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony, relaxation

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0])
SHARED_NU = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.2, 0.2, 0.2])
MIXED_NU = Hyperfoam([14420.0, 16780.0, 2000.0], [0.288, 4.249, 0.741], [0.0, 0.2, 0.3])
SERIES = Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672])
STRAIN = {"uniaxial": [-0.7, -0.2, 0.4], "biaxial": [-0.6, -0.1, 0.3], "planar": [-0.6, -0.2, 0.4],
          "shear": [-0.5, 0.2, 1.5], "volumetric": [0.3, 0.8, 1.4]}


def test_table_1_values() -> None:
    np.testing.assert_allclose(nominal_stress(TABLE_1, "uniaxial", [-0.1, -0.5, -0.8]),
                               [-1611.949, -4221.980, -21467.795], rtol=1e-6)
    np.testing.assert_allclose(nominal_stress(TABLE_1, "shear", [0.1, 0.5, 1.0]),
                               [963.5897, 6092.2682, 20236.0794], rtol=1e-6)


def test_uniaxial_with_nu_0_is_paper_equation_2() -> None:
    stretch = 1 + np.array(STRAIN["uniaxial"])
    sums = sum(2 * m / a * (stretch**a - 1) for m, a in zip(TABLE_1.mu_Pa, TABLE_1.alpha, strict=True))
    np.testing.assert_allclose(nominal_stress(TABLE_1, "uniaxial", stretch - 1), sums / stretch, rtol=1e-12)


def test_shear_is_paper_equation_3_where_that_is_finite_and_regular_at_rest() -> None:
    gamma = np.array([0.05, 0.5, 1.0])
    total = np.zeros(3)
    for sign in (1, -1):
        stretch = np.sqrt(1 + gamma**2 / 2 + sign * gamma * np.sqrt(1 + gamma**2 / 4))
        sums = sum(m / a * (stretch**a - 1) for m, a in zip(TABLE_1.mu_Pa, TABLE_1.alpha, strict=True))
        total += 2 * gamma / (2 * (stretch**2 - 1) - gamma**2) * sums
    np.testing.assert_allclose(nominal_stress(TABLE_1, "shear", gamma), total, rtol=1e-10)
    tiny = 1e-9
    assert nominal_stress(TABLE_1, "shear", 0.0) == 0
    assert nominal_stress(TABLE_1, "shear", tiny) == pytest.approx(9530 * tiny, rel=1e-9)


@pytest.mark.parametrize("law", [TABLE_1, SHARED_NU, MIXED_NU])
@pytest.mark.parametrize("mode", MODES)
def test_stress_is_the_slope_of_the_energy_along_the_mode(law: Hyperfoam, mode: str) -> None:
    e, h = np.array(STRAIN[mode]), 1e-6
    slope = (law.energy(log_stretches(law, mode, e + h)) - law.energy(log_stretches(law, mode, e - h))) / (2 * h)
    share = {"biaxial": 2.0}.get(mode, 1.0)  # two axes work in biaxial loading
    np.testing.assert_allclose(share * nominal_stress(law, mode, e), slope, rtol=2e-6, atol=1e-3)


@pytest.mark.parametrize("mode", ["uniaxial", "biaxial", "planar"])
def test_free_faces_carry_no_stress(mode: str) -> None:
    e = np.array(STRAIN[mode])
    for law in (SHARED_NU, MIXED_NU):
        assert np.abs(law.kirchhoff(log_stretches(law, mode, e))[:, -1]).max() < 1e-6
    np.testing.assert_allclose(log_stretches(SHARED_NU, "uniaxial", e)[:, 1], -0.2 * np.log1p(e), rtol=1e-12)


@pytest.mark.parametrize("mode", MODES)
def test_beta_to_0_is_the_exact_limit(mode: str) -> None:
    near = replace(TABLE_1, nu=np.full(3, 1e-9))
    np.testing.assert_allclose(nominal_stress(near, mode, STRAIN[mode]), nominal_stress(TABLE_1, mode, STRAIN[mode]),
                               rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize("mode", MODES)
def test_design_times_moduli_is_the_stress(mode: str) -> None:
    for law in (TABLE_1, SHARED_NU):
        matrix = design(mode, STRAIN[mode], law.alpha, float(law.nu[0]))
        np.testing.assert_allclose(matrix @ law.mu_Pa, nominal_stress(law, mode, STRAIN[mode]), rtol=1e-9, atol=1e-9)


def test_shear_components_are_those_of_the_tensor() -> None:
    for gamma in (0.3, 1.2):
        f = np.array([[1.0, gamma, 0], [0, 1.0, 0], [0, 0, 1.0]])
        left, stretch, right = np.linalg.svd(f)
        nominal = left @ np.diag(TABLE_1.kirchhoff(np.log(stretch)) / stretch) @ right
        s = np.linalg.solve(f, nominal)
        np.testing.assert_allclose(second_piola(TABLE_1, "shear", gamma), [s[0, 1], s[1, 1]], rtol=1e-10)
        pushed = np.sum(push_forward("shear", gamma) * second_piola(TABLE_1, "shear", gamma))
        assert pushed == pytest.approx(nominal[0, 1])


def test_hereditary_stress_after_a_step_relaxes_as_the_series() -> None:
    instantaneous = replace(TABLE_1, moduli="instantaneous")
    t = np.array([0.0, 0.0, 0.5, 5.0, 100.0])
    for mode, held in (("uniaxial", -0.8), ("shear", 0.7)):
        strain = np.r_[0.0, np.full(4, held)]
        stress = hereditary_stress(instantaneous, SERIES, mode, t, strain)
        relaxed = nominal_stress(TABLE_1, mode, held) * relaxation(SERIES, t[1:])
        np.testing.assert_allclose(stress[1:], relaxed, rtol=1e-12)
    with pytest.raises(ValueError, match="instantaneous"):
        hereditary_stress(TABLE_1, SERIES, "shear", t, strain)


def test_kernel_and_design_give_the_hereditary_stress() -> None:
    t = np.linspace(0, 60, 40)
    instantaneous = replace(TABLE_1, moduli="instantaneous")
    for mode, strain in (("uniaxial", -0.8 * t / 60), ("shear", t / 60), ("volumetric", 1 - 0.5 * t / 60)):
        matrix = design(mode, strain, TABLE_1.alpha, 0.0, hereditary_kernel(SERIES, t))
        np.testing.assert_allclose(matrix @ TABLE_1.mu_Pa,
                                   hereditary_stress(instantaneous, SERIES, mode, t, strain), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("mode", "strain", "word"), [("torsion", 0.1, "known"), ("uniaxial", -1.0, "above -1"),
                                                      ("volumetric", 0.0, "J"), ("shear", np.nan, "finite")])
def test_bad_modes_and_strains_are_refused(mode: str, strain: float, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        nominal_stress(TABLE_1, mode, strain)
