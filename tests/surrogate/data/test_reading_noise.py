"""Noise that readings share: found from few untouched frames, so that errors weighed by it are as large as stated."""

import numpy as np
import pytest

from surrogate.data.reading_noise import ReadingNoise, noise_of, shared_causes, white_noise
from surrogate.data.sensor_ring import Ring
from touchcal.arrays import Array


def untouched(ring: Ring) -> Array:
    return np.random.default_rng(7).uniform(0.5, 3.5, len(ring.read))


def drawn(ring: Ring) -> dict[str, Array]:
    """Roots of covariances of one mean variance."""
    n, base, rng = len(ring.read), untouched(ring), np.random.default_rng(8)
    unit = base / np.sqrt(np.mean(base**2))
    pattern = np.unique(np.column_stack([ring.source, ring.sink]), axis=0, return_inverse=True)[1].ravel()
    shared = (pattern[:, None] == np.unique(pattern)).astype(float)
    order = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    odd = rng.normal(size=(n, 4))
    each = {"white": np.eye(n), "pattern": np.hstack([np.eye(n), shared]) / np.sqrt(2),
            "neighbours": np.linalg.cholesky(np.exp(-order / 12) + 1e-9 * np.eye(n)), "proportional": np.diag(unit),
            "not foreseen": np.hstack([np.eye(n), odd]) / np.sqrt(5)}
    return {name: np.asarray(root, np.float64) for name, root in each.items()}


def over_stated(noise: ReadingNoise, root: Array, along: Array) -> float:
    """True standard deviation of generalised least squares along some directions, over the one stated."""
    weighed = np.linalg.solve(noise.covariance, along)
    return float(np.median(np.linalg.norm(root.T @ weighed, axis=0) / np.sqrt(np.sum(along * weighed, axis=0))))


@pytest.mark.thorough
@pytest.mark.parametrize(("kind", "frames", "most"), [
    *((kind, 200, 1.12) for kind in ("white", "pattern", "neighbours", "proportional", "not foreseen")),
    ("pattern", 20, 1.25), ("not foreseen", 20, 1.25)])
def test_errors_are_as_large_as_the_noise_of_untouched_frames_states(
        ring: Ring, kind: str, frames: int, most: float) -> None:
    root, rng, base = drawn(ring)[kind], np.random.default_rng(frames), untouched(ring)
    order = np.linspace(0, 1, len(base))
    along = np.array([np.sin((k + 1) * np.pi * order + k) for k in range(6)]).T  # smooth, as signals are
    ratio = []
    for _ in range(3):
        seen = base + 1e-3 * rng.normal(size=(frames, root.shape[1])) @ root.T
        found = noise_of(seen, ring)
        assert found is not None
        ratio.append(over_stated(found, 1e-3 * root, along))
    print(kind, frames, "true over stated:", np.round(ratio, 2))
    assert np.mean(ratio) < most
    assert np.mean(ratio) > 0.8


def test_few_frames_give_one_standard_deviation(ring: Ring) -> None:
    base = untouched(ring)
    found = noise_of(base + 1e-3 * np.random.default_rng(1).normal(size=(4, len(base))), ring)
    assert found is not None
    assert found.root.shape[1] == 0
    assert found.white_V == pytest.approx(1e-3, rel=0.1)
    assert noise_of(base[None], ring) is None


def test_draws_have_the_covariance_and_factors_scale_it(ring: Ring) -> None:
    n = len(ring.read)
    one = ReadingNoise(1.0, np.asarray(np.linalg.cholesky(shared_causes(ring)[2] + 1e-9 * np.eye(n)), np.float64), 0.1)
    frames = one.draws(20000, np.random.default_rng(2))
    assert np.allclose(frames.T @ frames / len(frames), one.covariance, atol=0.1)
    gain = np.linspace(0.5, 2, n)
    assert np.allclose(one.scaled(gain).covariance, one.covariance * np.outer(gain, gain), atol=1e-2)
    assert white_noise(2.0, n).rms_V == 2.0


def test_the_largest_directions_keep_the_size_of_the_noise(ring: Ring) -> None:
    n, rng = len(ring.read), np.random.default_rng(4)
    axes = np.linalg.qr(rng.normal(size=(n, 6)))[0]
    one = ReadingNoise(1.0, axes * np.array([0.1, 0.5, 0.9, 2.0, 3.0, 4.0]), 0.1)
    assert one.largest.root.shape[1] == 3
    assert one.largest.rms_V == pytest.approx(one.rms_V)
    assert white_noise(2.0, n).largest.white_V == 2.0
