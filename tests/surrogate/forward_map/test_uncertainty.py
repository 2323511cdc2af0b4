import numpy as np
import pytest

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import multipole_series, rim_covariance
from surrogate.forward_map.inversion import reading_covariance
from surrogate.forward_map.ring_symmetry import fold, symmetry_of


def test_whitened_covariances_are_the_identity() -> None:
    rng = np.random.default_rng(0)
    axes = np.linalg.qr(rng.normal(size=(3, 20, 4)))[0]
    white, sd = np.array([0.1, 1.0, 3.0]), rng.random((3, 4)) * 5
    found = reading_covariance.Uncertainty(white, axes, 1 - white[:, None] / np.hypot(white[:, None], sd))
    covariance = (white**2)[:, None, None] * np.eye(20) + (axes * sd[:, None] ** 2) @ axes.transpose(0, 2, 1)
    half = reading_covariance.whitened(found, covariance)
    assert np.allclose(reading_covariance.whitened(found, half.transpose(0, 2, 1)), np.eye(20), atol=1e-10)
    plain = reading_covariance.white(white, reading_covariance.no_drift(20))
    assert np.allclose(reading_covariance.whitened(plain, covariance), covariance / white[:, None, None])


def test_a_drift_adds_its_covariance_to_white_noise() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(20, 6)) @ np.diag([5.0, 2.0, 1.0, 0.1, 0.0, 0.0])
    sd = np.array([0.3, 2.0])
    found = reading_covariance.white(sd, reading_covariance.drift_of(root))
    covariance = (sd**2)[:, None, None] * np.eye(20) + root @ root.T
    half = reading_covariance.whitened(found, covariance)
    assert np.allclose(reading_covariance.whitened(found, half.transpose(0, 2, 1)), np.eye(20), atol=1e-10)


def test_alike_errors_are_told_at_every_touch_by_those_of_one_half_sector(ring: Ring) -> None:
    """Errors along one pattern of the half-sector, as large as the gap and load ask: axis, size and rest come back, to
    the half per cent by which a mirror changes a norm."""
    rng, symmetry = np.random.default_rng(1), symmetry_of(ring)
    z = np.asarray(rng.uniform(0.5, 0.9, 900) * np.exp(2j * np.pi * rng.random(900)), np.complex128)
    gap, load = 0.95 - np.abs(z), rng.uniform(0.5, 2.5, 900)
    dipole = multipole_series.basis(*multipole_series.patterns(ring, ring.modes, np.array([0.6 * np.exp(0.1j)]), 1))[
        0, :, 0
    ]
    folded = np.linalg.pinv(symmetry.readings, rcond=1e-9) @ (dipole / np.linalg.norm(dipole))
    pattern = folded[fold(symmetry, z)[1]]
    error = (0.01 * (1 - gap) * load * rng.normal(size=900))[:, None] * pattern
    found = rim_covariance.learned_from(symmetry, z, gap, load, error)
    asked = np.asarray(np.exp(1j * np.array([0.3, 2.0, -1.2])) * 0.7, np.complex128)
    axes, sd, rest = rim_covariance.spread(found, asked, np.full(3, 0.25))
    expected = folded[fold(symmetry, asked)[1]]
    assert np.allclose(np.abs(np.einsum("nr,nr->n", axes[..., 0], expected)),
                       np.linalg.norm(expected, axis=1))
    assert np.allclose(sd[:, 0], np.linalg.norm(expected, axis=1), rtol=5e-3)
    assert np.allclose(sd[:, 1:], 0, atol=1e-9)
    assert np.all(rest == rim_covariance.REST)
    size = rim_covariance.size_at(found, np.array([0.15, 0.35]), np.array([2.0, 1.0]))
    median = 0.674 * 0.01 * np.array([0.85 * 2.0, 0.65 * 1.0])
    assert size == pytest.approx(median, rel=0.35)
