"""How fast, and along what, an untouched frame walks, by blocks of few frames with gaps between them. Synthetic."""

import numpy as np
import pytest

from surrogate.data.baseline_walk import Block, walk_of
from surrogate.data.untouched_stream import Background, error_after, followed, interrupted, known, principal
from touchcal.arrays import Array

READINGS, STEP_S, NOISE = 80, 0.02, 1e-3
RNG = np.random.default_rng(5)
CAUSES = RNG.normal(size=(6, READINGS))
NONE = np.zeros((0, READINGS))


def walked(root: Array, frames: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return np.cumsum(np.sqrt(STEP_S) * rng.normal(size=(frames, len(root))), axis=0) @ root


def blocks_of(clean: Array, seed: int, frames: int = 8, gap: int = 25) -> list[Block]:
    """Blocks of a few frames each, every so many."""
    noisy = clean + NOISE * np.random.default_rng(seed).normal(size=clean.shape)
    return [Block(noisy[k:k + frames].mean(axis=0), frames, k * STEP_S, (frames - 1) * STEP_S)
            for k in range(0, len(clean) - frames, gap)]


def test_the_rate_of_foreseen_causes_is_learnt_from_blocks_between_touches() -> None:
    rate = np.array([walk.root[0, 0] / CAUSES[0, 0] for seed in range(8) for walk in
                     [walk_of(blocks_of(walked(2e-3 * CAUSES, 400, seed), seed), NOISE**2, CAUSES)]])
    assert np.sqrt(np.mean(rate**2)) == pytest.approx(2e-3, rel=0.1)
    assert np.all(np.abs(rate / 2e-3 - 1) < 0.4)


def test_noise_alone_walks_along_nothing() -> None:
    for seed in range(10):
        walk = walk_of(blocks_of(np.zeros((600, READINGS)), seed), NOISE**2, CAUSES)
        assert walk.root.shape == (0, READINGS)
        assert walk.rest == 0


def test_foreseen_causes_are_not_blamed_for_a_walk_along_another_direction() -> None:
    way = RNG.normal(size=READINGS)
    way /= np.linalg.norm(way)
    walk = walk_of(blocks_of(walked(0.03 * way[None], 600, 1), 1), NOISE**2, CAUSES)
    assert len(walk.root) == 1
    assert abs(walk.root[0] @ way) > 0.95 * np.linalg.norm(walk.root[0])


def test_frames_of_one_time_tell_no_walk() -> None:
    blocks = [Block(RNG.normal(size=READINGS), 5, 1.0, 0.0) for _ in range(3)]
    assert walk_of(blocks, NOISE**2, NONE).trace == 0


def test_the_frame_is_as_far_off_as_it_is_said_to_be() -> None:
    """Squared errors over their variances along the walk are 1 in the mean, at the end of touches too."""
    clean, off = walked(3e-3 * CAUSES, 1500, 2), []
    noisy = clean + NOISE * np.random.default_rng(3).normal(size=clean.shape)
    background: Background = known(noisy[0], NOISE, 1, 0.0, CAUSES)
    for k in range(1, len(clean)):
        background = followed(background, noisy[k], k * STEP_S) if k % 45 < 30 else interrupted(background)
        if k > 300 and k % 45 in (25, 44):
            variance, root = error_after(background, k * STEP_S - background.time_s)
            size, axes = principal(root)
            off.append((axes @ (background.volts - clean[k])) ** 2 / (variance + size**2))
    assert np.mean(np.concatenate(off)) == pytest.approx(1.0, rel=0.2)


def test_a_jump_is_followed_at_once() -> None:
    background = known(np.zeros(READINGS), NOISE, 100, 0.0)
    jump = RNG.normal(size=READINGS)
    assert np.allclose(followed(background, jump, STEP_S).volts, jump, atol=1e-3)
    near = followed(background, NOISE * jump, STEP_S).volts
    assert np.linalg.norm(near) < 0.05 * NOISE * np.linalg.norm(jump)
