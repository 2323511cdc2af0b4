"""Contact, strokes and thinning: what a noisy record hides is found again, and its uncertainty is honest."""

import numpy as np
import pytest

from matcal.reduction.contact_point import find_contact
from matcal.reduction.stroke_segments import find_stroke
from matcal.statistics.block_means import block_means, equal_blocks, log_blocks, sample_noise

LENGTH, AT, ZERO = 20e-3, 0.36e-3, 1.4


def _approach(noise: float, rng: np.random.Generator, toe: float = 0.04e-3) -> tuple[np.ndarray, np.ndarray]:
    """500 samples of rest, then a softening specimen that lands over a toe."""
    travel = np.concatenate([np.zeros(500), np.linspace(0, 4e-3, 4800)])
    u = toe * np.logaddexp(0.0, (travel - AT) / toe)
    load = ZERO + 2300.0 * u * (1 - 90.0 * u) + 1.1e7 * u**3
    return travel, load + noise * rng.standard_normal(travel.size)


def test_contact_is_exact_without_noise_and_toe() -> None:
    travel, load = _approach(1e-9, np.random.default_rng(0), toe=1e-9)
    found = find_contact(travel, load, 500, LENGTH, 1e-3)
    assert found.travel_m == pytest.approx(AT, abs=5e-7)
    assert found.zero_N == pytest.approx(ZERO, abs=1e-6)


@pytest.mark.thorough
def test_contact_error_is_what_it_says_it_is() -> None:
    rng = np.random.default_rng(1)
    found = [find_contact(*_approach(0.25, rng), 500, LENGTH, 0.9e-3) for _ in range(25)]
    z = np.array([(f.travel_m - AT) / f.sd_m for f in found])
    assert np.abs(z).max() < 3.5
    assert 0.4 < np.sqrt(np.mean(z**2)) < 1.3
    assert np.mean([f.sd_m for f in found]) < 0.02e-3


def _foam(name: str, strain: np.ndarray) -> np.ndarray:
    """Load, N, of foams that a cubic over a tenth of strain does not follow."""
    relaxing = 22 * strain + 5 * 0.024 * -np.expm1(-strain / 0.024) + 3 * 0.0012 * -np.expm1(-strain / 0.0012)
    return {"linear": 45 * strain, "relaxing": 2 * relaxing, "knee": 300 * strain / (1 + (25 * strain) ** 6) ** (1 / 6),
            "softening": 100 * (1 - np.exp(-8 * strain)) / 8, "stiff": 4000 * strain * (1 - 2 * strain)}[name]


def _contacts(name: str, noise: float, replicas: int, samples: int = 12000) -> np.ndarray:
    """(found - true)/stated over replicas of the noise; landing over a toe of 0.2 % of strain."""
    rng, out = np.random.default_rng(8), []
    travel = np.concatenate([np.zeros(500), np.linspace(0, 10e-3, samples)])
    load = _foam(name, 2e-3 * np.logaddexp(0.0, (travel - AT) / LENGTH / 2e-3))
    for _ in range(replicas):
        found = find_contact(travel, load + noise * rng.standard_normal(travel.size), 500, LENGTH, 0.9e-3)
        out.append((found.travel_m - AT) / found.sd_m)
    return np.array(out)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["relaxing", "knee"])
def test_contact_error_holds_whatever_the_shape(name: str) -> None:
    z = _contacts(name, 0.25, 12)
    print(f"{name}: rms z {np.sqrt(np.mean(z**2)):.2f}, largest {np.abs(z).max():.1f}")
    assert 0.3 < np.sqrt(np.mean(z**2)) < 1.6
    assert np.abs(z).max() < 3.5


@pytest.mark.slow
@pytest.mark.parametrize(("name", "noise", "samples"), [
    ("linear", 0.25, 12000), ("relaxing", 0.25, 12000), ("knee", 0.25, 12000), ("softening", 0.25, 12000),
    ("stiff", 0.25, 12000), ("relaxing", 2.0, 12000), ("linear", 2.0, 12000), ("softening", 0.25, 60)])
def test_contact_error_over_many_replicas(name: str, noise: float, samples: int) -> None:
    z = _contacts(name, noise, 60, samples)
    print(f"{name}, {noise} N, {samples} samples: rms z {np.sqrt(np.mean(z**2)):.2f}, largest {np.abs(z).max():.1f}")
    assert 0.3 < np.sqrt(np.mean(z**2)) < 1.5
    assert np.abs(z).max() < 4.5


def test_too_few_samples_are_refused() -> None:
    travel = np.linspace(0, 10e-3, 12)
    with pytest.raises(ValueError, match="fewer than 8 samples"):
        find_contact(travel, np.maximum(travel - 8e-3, 0) * 1e3, 1, LENGTH, 9e-3)


def test_stroke_of_a_compression_with_return() -> None:
    rng = np.random.default_rng(2)
    path = np.interp(np.arange(3000), [0, 500, 2000, 2200, 3000], [141.0, 141.0, 126.0, 141.0, 141.0]) * 1e-3
    stroke = find_stroke(path + 5e-7 * rng.standard_normal(path.size))
    assert stroke.sign == -1.0
    assert stroke.loadings == 1
    assert stroke.start == pytest.approx(500, abs=3)
    assert stroke.end == pytest.approx(2000, abs=3)
    assert stroke.travel.max() == pytest.approx(15e-3, abs=3e-6)
    assert stroke.noise_m == pytest.approx(5e-7, rel=0.15)


def test_stroke_of_cycles_and_of_a_ramp_with_a_hold() -> None:
    n = np.arange(4001)
    cycles = 2e-3 * (1 - np.cos(2 * np.pi * n / 400))
    found = find_stroke(np.concatenate([np.zeros(100), cycles]))
    assert found.loadings == 10
    assert found.end == pytest.approx(300, abs=15)
    hold = find_stroke(np.interp(n, [0, 200, 300, 4000], [0.0, 0.0, 16e-3, 16e-3]))
    assert (hold.loadings, hold.end) == (1, 300)


def test_nothing_that_moves_is_no_stroke() -> None:
    with pytest.raises(ValueError, match="never leaves"):
        find_stroke(1e-3 + 1e-7 * np.random.default_rng(3).standard_normal(500))


def test_noise_ignores_what_varies_slowly() -> None:
    rng = np.random.default_rng(4)
    trend = np.linspace(0, 50, 20000) ** 2 / 50
    assert sample_noise(trend + 0.25 * rng.standard_normal(trend.size)) == pytest.approx(0.25, rel=0.03)


def test_blocks_keep_every_sample_once() -> None:
    values = np.random.default_rng(5).standard_normal(1037)
    edges = equal_blocks(values.size, 100)
    assert set(np.diff(edges)) == {10}
    np.testing.assert_allclose(block_means(values, edges), values[7:].reshape(-1, 10).mean(axis=1), atol=1e-12)
    time = np.arange(18000) / 100
    edges = log_blocks(time, 120)
    assert (edges[0], edges[-1]) == (0, time.size)
    assert np.all(np.diff(edges) > 0)
    ratio = time[edges[-2]] / time[edges[-3]]
    assert ratio == pytest.approx((time[-1] / time[1]) ** (1 / 119), rel=0.01)
