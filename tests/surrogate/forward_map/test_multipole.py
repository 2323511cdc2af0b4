from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from surrogate.data.edge_frame import edge_frame
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import multipole_series, rim_zone

Synthetic = Callable[[int, int], tuple[NDArray[np.float64], NDArray[np.float64]]]


def left(ring: Ring, q: NDArray[np.float64], touch: NDArray[np.float64], signal: NDArray[np.float64],
         orders: int) -> float:
    """Relative norm of what the series of some orders leaves of exact signals."""
    design = multipole_series.basis(*multipole_series.patterns(ring, q, (touch[:, 0] + 1j * touch[:, 1]) / 100, orders))
    rest = [y - a @ np.linalg.lstsq(a, y, rcond=None)[0] for a, y in zip(design, signal, strict=True)]
    return float(np.sqrt(np.mean(np.sum(np.square(rest), axis=1) / np.sum(signal**2, axis=1))))


def test_the_series_converges_to_the_exact_response(ring: Ring, synthetic: Synthetic) -> None:
    touch, signal = synthetic(60, 0)
    errors = [left(ring, np.ones(60), touch, signal, orders) for orders in (1, 2, 3)]
    print("left by 1, 2, 3 orders:", errors)
    assert errors[0] < 2e-2
    assert errors[1] < 0.05 * errors[0]
    assert errors[2] < 0.3 * errors[1]


def test_the_field_of_point_electrodes_is_recovered(ring: Ring, synthetic: Synthetic) -> None:
    touch, signal = synthetic(60, 0)
    z = (touch[:, 0] + 1j * touch[:, 1]) / 100
    q = multipole_series.learn_field(ring, z, signal)
    assert np.allclose(q[:12], 1.0, atol=2e-3)
    left_over = multipole_series.strengths(ring, q, z, signal).residual
    assert np.linalg.norm(left_over) < 1e-4 * np.linalg.norm(signal)


def test_a_turned_touch_gives_turned_readings(ring: Ring) -> None:
    z = np.array([0.4 + 0.1j])
    here = multipole_series.basis(*multipole_series.patterns(ring, np.ones(20), z))[0]
    turned = multipole_series.basis(*multipole_series.patterns(ring, np.ones(20), z * np.exp(2j * np.pi / 16)))[0]
    assert np.allclose(turned, np.roll(here, 13, axis=0), rtol=1e-12)


def test_swapping_source_and_reader_changes_nothing(ring: Ring) -> None:
    drive, read = multipole_series.patterns(ring, np.ones(20), np.array([0.3 - 0.5j]))
    assert np.allclose(multipole_series.basis(drive, read), multipole_series.basis(read, drive))


@pytest.mark.parametrize(("reach", "modes"), [(0.01, 12), (0.65, 26), (0.99, 120)])
def test_modes_follow_the_reach(reach: float, modes: int) -> None:
    assert multipole_series.modes_needed(reach) == modes


def test_fields_of_electrodes_are_the_derivatives_of_their_power_series(ring: Ring) -> None:
    """f(z) = sum (q_m/m) (z exp(-i angle))^m, derived as a polynomial."""
    rng = np.random.default_rng(0)
    q, z = 1 + 0.3 * rng.normal(size=15), 0.6 * (rng.normal(size=4) + 1j * rng.normal(size=4))
    found = multipole_series.electrode_fields(ring, q, z, 4)
    for e, angle in enumerate(ring.angle_rad):
        f = np.polynomial.Polynomial(np.r_[0, q / np.arange(1, 16) * np.exp(-1j * angle * np.arange(1, 16))])
        for n in range(1, 5):
            np.testing.assert_allclose(found[n - 1, :, e], f.deriv(n)(z), rtol=1e-11)


def test_slopes_of_the_basis_are_differences_and_high_orders_end_in_their_zone(ring: Ring) -> None:
    """From 1 to 0 by 1 - t^2 (3 - 2 t) between radii 0.33 and 0.40."""
    q, h = 1 + 0.1 * np.random.default_rng(1).normal(size=20), 1e-6
    z = np.array([0.3 - 0.5j, 0.1 + 0.2j, 0.2 - 0.3j])

    strength = np.random.default_rng(2).normal(size=(3, multipole_series.ORDERS))

    def at(moved: NDArray[np.complex128]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        fields = multipole_series.electrode_fields(ring, q, moved, multipole_series.ORDERS + 1)
        parts = rim_zone.counted(edge_frame(ring, moved), multipole_series.ORDERS, ((0.33, 0.40), 3))
        return multipole_series.signals(ring, fields, *parts, strength)

    here, slopes = at(z)
    t = (np.hypot(0.2, 0.3) - 0.33) / (0.40 - 0.33)
    kept = np.ones((3, multipole_series.ORDERS))
    kept[:, 3:] = np.array([[0.0], [1.0], [1 - t**2 * (3 - 2 * t)]])
    whole = multipole_series.basis(*multipole_series.patterns(ring, q, z))
    np.testing.assert_allclose(here, whole * kept[:, None], rtol=1e-9, atol=1e-12)
    for k, way in enumerate((complex(h), 1j * h)):
        change = multipole_series.combined(at(z + way)[0] - at(z - way)[0], strength) / (2 * h)
        np.testing.assert_allclose(slopes[..., k], change, atol=1e-6 * np.abs(change).max())


def test_norms_of_a_dipole_and_their_slopes_are_those_of_its_readings(ring: Ring) -> None:
    z, h = np.array([0.3 - 0.5j, 0.1 + 0.2j]), 1e-6

    def norms(moved: NDArray[np.complex128]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return multipole_series.dipole_norms(ring, multipole_series.electrode_fields(ring, np.ones(20), moved, 2))

    readings = multipole_series.basis(*multipole_series.patterns(ring, np.ones(20), z, 1))
    np.testing.assert_allclose(norms(z)[0], np.linalg.norm(readings[..., 0], axis=1), rtol=1e-12)
    slopes = np.column_stack([(norms(z + way)[0] - norms(z - way)[0]) / (2 * h) for way in (complex(h), 1j * h)])
    np.testing.assert_allclose(norms(z)[1], slopes, rtol=1e-6)


def test_strengths_are_the_least_squares_ones(ring: Ring) -> None:
    """(A'A)^-1 A'y, its diagonal times y'y as variance up to a common factor, and y less the fit."""
    rng, z = np.random.default_rng(2), np.array([0.3 - 0.5j, 0.1 + 0.2j])
    design = multipole_series.basis(*multipole_series.patterns(ring, np.ones(20), z))
    signal = rng.normal(size=design.shape[:2])
    found = multipole_series.strengths(ring, np.ones(20), z, signal)
    for k, (a, y) in enumerate(zip(design, signal, strict=True)):
        inverse = np.linalg.inv(a.T @ a)
        np.testing.assert_allclose(found.value[k], inverse @ a.T @ y, rtol=1e-8)
        np.testing.assert_allclose(found.variance[k], np.diag(inverse) * (y @ y), rtol=1e-8)
        np.testing.assert_allclose(found.residual[k], y - a @ inverse @ a.T @ y, atol=1e-12)


def test_what_is_learned_is_a_least_point_of_misfit_and_prior(ring: Ring, synthetic: Synthetic) -> None:
    """Under noise, with other strengths foreseen than the true ones: no mode by itself lowers the objective."""
    touch, signal = synthetic(40, 0)
    noise = 0.02 * np.random.default_rng(3).normal(size=signal.shape) * np.sqrt(np.mean(signal**2))
    z, other = (touch[:, 0] + 1j * touch[:, 1]) / 100, replace(ring, modes=0.9 ** np.arange(len(ring.modes)))
    unit = (signal + noise) / np.linalg.norm(signal + noise, axis=1, keepdims=True)
    q = multipole_series._learned(other, z, unit)
    scale = multipole_series.strengths(other, q, z, unit)

    def objective(moved: NDArray[np.float64]) -> float:
        return multipole_series._objective(other, moved, multipole_series.strengths(other, moved, z, unit), scale)

    least = objective(q)
    for way in 3e-3 * np.eye(len(q))[1:8]:
        assert min(objective(q + way), objective(q - way)) > least
    assert np.abs(q - other.modes)[1:8].max() > 3e-2


def noisy(ring: Ring) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.float64]]:
    """Places, a field other than the foreseen one, and signals of unit norm that it makes, with noise of unit shape."""
    rng = np.random.default_rng(4)
    z = 0.4 * (rng.normal(size=12) + 1j * rng.normal(size=12)) / 2
    q = ring.modes * (1 + 0.2 * np.sin(np.arange(len(ring.modes))))
    signal = multipole_series.combined(multipole_series.basis(*multipole_series.patterns(ring, q, z, 3)),
                                       rng.uniform(0.5, 1, (12, 3)) * [1, 0.1, 0.01])
    return z, q, signal / np.linalg.norm(signal, axis=1, keepdims=True)


def test_a_step_is_that_of_gauss_and_newton_with_strengths_projected_out(ring: Ring) -> None:
    """(J'J + s I)^-1 (J'r - s (q - q_0)), J = (1 - P) dA/dq p by differences, s = mean r^2/0.1^2; the objective is the
    squared residual and s |q - q_0|^2."""
    z, q, signal = noisy(ring)
    fit = multipole_series.strengths(ring, 0.95 * q, z, signal)
    found = multipole_series._step(ring, 0.95 * q, z, fit, 8)

    def design(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return multipole_series.basis(*multipole_series.patterns(ring, at, z))

    columns = []
    for way in 1e-4 * np.eye(len(q))[1:8]:
        moved = multipole_series.combined(design(0.95 * q + way) - design(0.95 * q - way), fit.value) / 2e-4
        columns.append(np.concatenate([m - a @ np.linalg.lstsq(a, m, rcond=None)[0]
                                       for a, m in zip(design(0.95 * q), moved, strict=True)]))
    jacobian, prior = np.array(columns), np.mean(fit.residual**2) / 0.1**2
    off = (0.95 * q - ring.modes)[1:8]
    np.testing.assert_allclose(found[1:8], np.linalg.solve(
        jacobian @ jacobian.T + prior * np.eye(7), jacobian @ fit.residual.ravel() - prior * off), rtol=1e-6)
    assert not np.any(np.delete(found, np.arange(1, 8)))
    worse = multipole_series.strengths(ring, ring.modes, z, signal)
    assert multipole_series._objective(ring, 0.95 * q, worse, fit) == pytest.approx(
        np.sum(worse.residual**2) + prior * np.sum((0.95 * q - ring.modes) ** 2))


def test_a_field_is_learned_where_it_leaves_a_third_of_what_the_foreseen_one_does(
        ring: Ring, monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise is added until the gain is a little less or a little more than three."""
    z, q, signal = noisy(ring)
    noise = np.random.default_rng(5).normal(size=signal.shape)
    monkeypatch.setattr(multipole_series, "_learned", lambda *_: q)

    def gain(size: float) -> float:
        left = [np.linalg.norm(multipole_series.strengths(ring, modes, z, signal + size * noise).residual, axis=1)
                for modes in (ring.modes, q)]
        return float(np.median(left[0] / left[1]))

    for wanted, modes in ((2.9, ring.modes), (3.1, q)):
        size = brentq(lambda s, wanted=wanted: gain(s) - wanted, 1e-6, 1.0)
        assert multipole_series.learn_field(ring, z, signal + size * noise) is modes


def test_zones_of_outlines_are_those_of_the_disc_in_proportion() -> None:
    assert rim_zone.zones_from(rim_zone.DISC.learned[1]).learned == pytest.approx(rim_zone.DISC.learned)
    half = rim_zone.zones_from(0.7)
    assert half.learned == pytest.approx((0.665, 0.7))
    assert half.high_end == pytest.approx((0.75, 0.85))


def test_learned_modes_weigh_large_and_small_signals_in_the_same_way(ring: Ring, synthetic: Synthetic) -> None:
    touch, signal = synthetic(40, 3)
    z, size = (touch[:, 0] + 1j * touch[:, 1]) / 100, np.geomspace(1e-3, 1e3, 40)[:, None]
    noisy = signal + 0.02 * np.abs(signal).mean() * np.random.default_rng(0).normal(size=signal.shape)
    whole, scaled = (multipole_series._learned(ring, z, values) for values in (noisy, noisy * size))
    assert np.abs(whole - ring.modes).max() > 1e-3
    np.testing.assert_allclose(scaled, whole, rtol=1e-9)
