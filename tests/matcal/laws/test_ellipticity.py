"""Strong ellipticity in closed form against the least eigenvalue of the acoustic tensor over directions."""

import numpy as np
import pytest

from matcal.laws.deformation_modes import log_stretches
from matcal.laws.ellipticity import strongly_elliptic
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.stability import acoustic_form, worst_acoustic_directions

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
LAWS = [TABLE_1, Hyperfoam(TABLE_1.mu_Pa, TABLE_1.alpha, [0.1, 0.2, 0.1]), Hyperfoam([1e4], [-3.0], [0.2]),
        Hyperfoam([1e4], [12.0], [0.0])]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("mode", ["uniaxial", "biaxial", "planar", "shear"])
def test_sign_of_the_acoustic_tensor(law, mode):
    strain = np.linspace(-0.9, 0.9, 181) if mode != "shear" else np.linspace(0, 3, 181)
    least = worst_acoustic_directions(law, log_stretches(law, mode, strain))[0]
    sure = np.abs(least) > 1e-3 * law.mu_0_Pa
    assert sure.sum() > 100
    assert np.array_equal(strongly_elliptic(law, log_stretches(law, mode, strain))[sure], least[sure] > 0)


def test_the_acoustic_form_is_the_bend_of_the_energy_along_its_directions():
    """d2/dt2 of the energy along F + t m n'F is m . J Q(n) m, also with the law's volumetric part."""
    rng, h = np.random.default_rng(4), 1e-3
    for law in LAWS[:3]:
        x, n, m = rng.uniform(-0.6, 0.4, (20, 3)), *rng.standard_normal((2, 20, 3))
        n, m = (v / np.linalg.norm(v, axis=1)[:, None] for v in (n, m))
        rest = np.exp(x)[:, :, None] * np.eye(3)
        step = m[:, :, None] * (n[:, None] @ rest)
        high, here, low = (law.energy(np.log(np.linalg.svd(rest + t * step, compute_uv=False))) for t in (h, 0, -h))
        np.testing.assert_allclose(acoustic_form(law, x, n, m), (high - 2 * here + low) / h**2,
                                   rtol=1e-4, atol=1e-4 * law.mu_0_Pa)


def test_table_1_is_elliptic_in_uniaxial_but_not_in_biaxial_compression():
    strain = np.linspace(-0.8, 0, 81)
    assert strongly_elliptic(TABLE_1, log_stretches(TABLE_1, "uniaxial", strain)).all()
    assert not strongly_elliptic(TABLE_1, log_stretches(TABLE_1, "biaxial", strain)).all()


def test_curvature_along_rank_one_directions():
    rng = np.random.default_rng(0)
    x = rng.uniform(-1.2, 0.5, (16, 3))
    told = strongly_elliptic(TABLE_1, x)
    least = np.array([least_rank_one_curvature(TABLE_1, at, rng) for at in x])
    sure = np.abs(least) > 0.05 * TABLE_1.mu_0_Pa
    assert sure.sum() > 10
    assert 0 < told[sure].sum() < sure.sum()
    assert np.array_equal(told[sure], least[sure] > 0)


def least_rank_one_curvature(law, x, rng):
    """Least second derivative of the energy along F + t a n' over many unit a, n, by differences."""
    a, n = rng.standard_normal((2, 6000, 3))
    step = (a / np.linalg.norm(a, axis=1)[:, None])[:, :, None] * (n / np.linalg.norm(n, axis=1)[:, None])[:, None, :]
    rest, h = np.diag(np.exp(x)), 1e-3

    def stored(t):
        return law.energy(np.log(np.linalg.svd(rest + t * step, compute_uv=False)))

    return ((stored(h) - 2 * stored(0.0) + stored(-h)) / h**2).min()
