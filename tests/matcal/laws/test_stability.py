"""Stability: known ranges of Table 1, agreement of the margins with brute force, the criteria on simple laws."""

import numpy as np
import pytest

from matcal.laws.deformation_modes import MODES, log_stretches
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.stability import is_stable, stability, worst_acoustic_directions

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0])
MIXED_NU = Hyperfoam([14420.0, 16780.0, -21670.0, 3000.0], [0.288, 4.249, 0.741, 1.3], [0.0, 0.2, 0.3, 0.1])


def test_ranges_of_table_1() -> None:
    found = stability(TABLE_1)
    drucker = {mode: found["drucker"][mode]["unstable_strain"] for mode in MODES}
    for mode in ("uniaxial", "biaxial", "planar"):
        np.testing.assert_allclose(drucker[mode], [[-0.5458, -0.3063]], atol=5e-4)
    np.testing.assert_allclose(drucker["shear"], [[0.748, 1.747]], atol=1e-3)
    np.testing.assert_allclose(drucker["volumetric"], [[0.094, 0.334]], atol=1e-3)
    elliptic = {mode: found["elliptic"][mode]["stable"] for mode in MODES}
    assert elliptic == {"uniaxial": True, "planar": True, "shear": True, "biaxial": False, "volumetric": False}


def test_one_term_is_stable_everywhere() -> None:
    found = stability(Hyperfoam([10000.0], [2.0], [0.0]))
    assert all(row["stable"] and row["unstable_strain"] == [] for row in found["drucker"].values())


def test_drucker_with_beta_0_is_the_sum_of_powers() -> None:
    stretch = np.array([0.3, 0.46, 0.6, 0.9])
    powers = np.sum(TABLE_1.mu_Pa * stretch[:, None] ** TABLE_1.alpha, axis=1)
    x = log_stretches(TABLE_1, "uniaxial", stretch - 1)
    found = np.linalg.eigvalsh(TABLE_1.tangent(x))[:, 0]
    np.testing.assert_allclose(found, 2 * np.minimum(powers, 9530), rtol=1e-9)
    assert np.array_equal(is_stable(TABLE_1, "drucker", "uniaxial", stretch - 1), powers > 0)


@pytest.mark.parametrize("law", [TABLE_1, MIXED_NU])
@pytest.mark.parametrize(("mode", "strain"), [("uniaxial", -0.6), ("biaxial", -0.4), ("shear", 1.2), ("planar", 0.3)])
def test_acoustic_margin_is_that_of_the_finite_difference_tensor(law: Hyperfoam, mode: str, strain: float) -> None:
    x = log_stretches(law, mode, strain)
    f, h = np.diag(np.exp(x)), 1e-5

    def nominal(gradient: np.ndarray) -> np.ndarray:
        left, stretch, right = np.linalg.svd(gradient)
        return left @ np.diag(law.kirchhoff(np.log(stretch)) / stretch) @ right

    moduli = np.zeros((3, 3, 3, 3))
    for k in range(3):
        for m in range(3):
            step = np.zeros((3, 3))
            step[k, m] = h
            moduli[:, :, k, m] = (nominal(f + step) - nominal(f - step)) / (2 * h)
    n = np.random.default_rng(0).normal(size=(4000, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    acoustic = np.einsum("ijkl,pj,ql,np,nq->nik", moduli, f, f, n, n)
    brute = np.linalg.eigvalsh((acoustic + acoustic.transpose(0, 2, 1)) / 2)[:, 0].min()
    found = worst_acoustic_directions(law, np.atleast_2d(x))[0][0]
    assert found <= brute + 1e-3 * abs(brute)
    assert found == pytest.approx(brute, rel=0.03, abs=30.0)


def test_unknown_criterion_lists_the_known() -> None:
    with pytest.raises(ValueError, match="drucker, elliptic"):
        is_stable(TABLE_1, "hill", "shear", 0.1)


def test_a_law_that_hardly_changes_volume_is_scanned_as_far_as_its_moduli_are_finite() -> None:
    """At alpha = 25 and nu = 0.49 moduli overflow at J = 0.05; a sum of positive terms is stable wherever it is judged.
    """
    found = stability(Hyperfoam([10000.0, 20.0], [2.0, 25.0], [0.49, 0.49]))
    for modes in found.values():
        assert all(row["stable"] for row in modes.values())
        assert 0.5 < modes["volumetric"]["scanned"][0] < 1 < modes["volumetric"]["scanned"][1]
        assert modes["uniaxial"]["scanned"][0] < -0.7
