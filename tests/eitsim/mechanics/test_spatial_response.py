"""The foam in three dimensions: axes against the singular values, stress and tangent against differences of the energy,
tensors of a gradient against their definitions."""

import itertools

import numpy as np
import pytest

from eitsim.mechanics.solid.kinematics import tensors
from eitsim.mechanics.solid.principal_stretches import diagonalise, scale_negative_eigenvalues
from eitsim.mechanics.solid.spatial_response import UPPER, principal, stress_and_tangent, upright
from matcal.laws.ellipticity import strongly_elliptic
from matcal.laws.hyperfoam import Hyperfoam

LAW = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.2, 0.1])


def _gradients() -> np.ndarray:
    """F - 1 (14, 9): random ones, one at rest, two with stretches that coincide."""
    change = np.random.default_rng(0).normal(0, 0.3, (12, 9))
    change = change[np.linalg.det(np.eye(3) + change.reshape(-1, 3, 3)) > 0.1]
    return np.vstack([change, np.zeros(9), np.diag([-0.3, -0.3, -0.3]).ravel(), np.diag([0.4, -0.5, 0.4]).ravel()])


def _by_angles(change: np.ndarray) -> np.ndarray:
    """As the layout (rings, 9, angles) wants it, one ring."""
    return np.ascontiguousarray(change.T[None])


def _stored(change: np.ndarray) -> np.ndarray:
    return LAW.energy(np.log(np.linalg.svd(np.eye(3) + change.reshape(*change.shape[:-1], 3, 3), compute_uv=False)))


def test_foam_is_upright_where_the_determinant_is_positive() -> None:
    for change in np.random.default_rng(1).normal(0, 0.8, (200, 9)):
        assert upright(change[None, :, None]) == (np.linalg.det(np.eye(3) + change.reshape(3, 3)) > 0)


def test_stretches_and_axes_are_the_singular_ones() -> None:
    change = _gradients()
    found = principal(_by_angles(change))
    stretch = np.exp(found.log[0])
    assert np.sort(stretch) == pytest.approx(
        np.sort(np.linalg.svd(np.eye(3) + change.reshape(-1, 3, 3), compute_uv=False)), rel=1e-12)
    whole = np.einsum("nk,nkr,nkc->nrc", stretch, found.left[0], found.right[0])
    assert whole == pytest.approx(np.eye(3) + change.reshape(-1, 3, 3), abs=1e-13)
    assert found.left[0] @ np.swapaxes(found.left[0], 1, 2) == pytest.approx(np.tile(np.eye(3), (len(change), 1, 1)),
                                                                             abs=1e-12)


def test_stress_and_tangent_are_derivatives_of_the_energy() -> None:
    change, weight = _gradients(), 1.7
    stress, tangent = stress_and_tangent(LAW, principal(_by_angles(change)), np.full((1, len(change)), weight))

    def at(moved: np.ndarray) -> np.ndarray:
        return stress_and_tangent(LAW, principal(_by_angles(moved)), np.ones((1, len(moved))))[0][0].T

    steps = 1e-5 * np.eye(9)
    slope = np.stack([(_stored(change + s) - _stored(change - s)) / 2e-5 for s in steps], axis=-1)
    assert pytest.approx(weight * slope, rel=1e-6, abs=1e-4 * LAW.mu_0_Pa) == stress[0].T
    bend = np.stack([(at(change + s) - at(change - s)) / 2e-5 for s in steps], axis=-1)
    assert pytest.approx(weight * bend[:, *UPPER], rel=1e-5, abs=1e-5 * LAW.mu_0_Pa) == tangent[0].T


def test_scaling_takes_negative_curvature_away_and_leaves_the_rest() -> None:
    """At 0 the tangent is the old one where that is positive and nowhere negative; in between it is in between."""
    change = np.vstack([_gradients(), np.diag([-0.45, -0.45, 0.0]).ravel()])
    at, weight = principal(_by_angles(change)), np.ones((1, len(change)))

    def whole(scale: float) -> np.ndarray:
        matrix = np.zeros((len(change), 9, 9))
        matrix[:, *UPPER] = stress_and_tangent(LAW, at, weight, scale)[1][0].T
        return matrix + np.swapaxes(np.triu(matrix, 1), 1, 2)

    full, half, none = (whole(scale) for scale in (1.0, 0.5, 0.0))
    least = np.linalg.eigvalsh(full)[:, 0]
    assert least.min() < -100
    assert np.linalg.eigvalsh(none).min() > -1e-8 * LAW.mu_0_Pa
    assert none[least > 0] == pytest.approx(full[least > 0], abs=1e-8 * LAW.mu_0_Pa)
    assert half == pytest.approx((full + none) / 2, abs=1e-8 * LAW.mu_0_Pa)


def test_jacobis_rotations_diagonalise() -> None:
    rng = np.random.default_rng(2)
    for size in (1.0, 1e-9, 1e6):
        matrix = size * rng.normal(size=(3, 3))
        matrix = matrix + matrix.T
        turned, vector = matrix.copy(), np.empty((3, 3))
        diagonalise(turned, vector)
        assert np.sort(np.diag(turned)) == pytest.approx(np.linalg.eigvalsh(matrix), rel=1e-12)
        assert vector @ np.diag(np.diag(turned)) @ vector.T == pytest.approx(matrix, abs=1e-13 * size)
        assert vector.T @ vector == pytest.approx(np.eye(3), abs=1e-14)


def test_tensors_of_a_gradient_are_their_definitions() -> None:
    """F = V R with V's stretches on turned axes, Cauchy stress tau/J on these, all after a turn of the body."""
    (axes, _), (turn, _) = (np.linalg.qr(m) for m in np.random.default_rng(3).normal(size=(2, 3, 3)))
    stretch = np.array([0.6, 0.9, 1.3])
    left = axes @ np.diag(stretch) @ axes.T
    gradient = left @ turn * np.sign(np.linalg.det(turn))
    found = {name: field.reshape(-1, *(3, 3) if field.size == 9 else ()) for name, field in
             tensors(LAW, gradient[None]).items()}
    stress = axes @ np.diag(LAW.kirchhoff(np.log(stretch))) @ axes.T
    expected = {"deformation_gradient": gradient, "nominal_strain": left - np.eye(3), "kirchhoff_stress_Pa": stress,
                "green_lagrange_strain": (gradient.T @ gradient - np.eye(3)) / 2, "volume_ratio": stretch.prod(),
                "cauchy_stress_Pa": stress / stretch.prod(),
                "elliptic": float(strongly_elliptic(LAW, np.log(stretch)))}
    assert set(found) == set(expected)
    for name, field in expected.items():
        assert found[name][0] == pytest.approx(field, rel=1e-10, abs=1e-10 * np.abs(field).max()), name


def test_the_order_of_axes_does_not_matter() -> None:
    """Turning the frame by an exchange of its axes turns stress with it."""
    change = _gradients()
    plain = stress_and_tangent(LAW, principal(_by_angles(change)), np.ones((1, len(change))))[0][0].T
    for order in itertools.permutations(range(3)):
        swapped = change.reshape(-1, 3, 3)[:, order][:, :, order].reshape(-1, 9)
        found = stress_and_tangent(LAW, principal(_by_angles(swapped)), np.ones((1, len(change))))[0][0].T
        assert found.reshape(-1, 3, 3) == pytest.approx(plain.reshape(-1, 3, 3)[:, order][:, :, order],
                                                        abs=1e-8 * LAW.mu_0_Pa)


@pytest.mark.parametrize("value", [(-40.0, -3.0, 60.0), (-2.0, 5.0, 70.0), (1.0, 2.0, 3.0), (-9.0, -5.0, -1.0)])
def test_the_negative_part_of_a_matrix_is_scaled(value: tuple[float, float, float]):
    """Each negative eigenvalue is 0.3 of what it was with the other sign; eigenvectors stay."""
    vector = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    block = (vector * value) @ vector.T
    scale_negative_eigenvalues(block, -0.3, np.empty((3, 3)), np.empty((3, 3)))
    np.testing.assert_allclose(block, (vector * [v if v > 0 else -0.3 * v for v in value]) @ vector.T, atol=1e-12)
