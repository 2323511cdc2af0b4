"""Figures of merit of images whose figures are known."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

RADIUS, TARGET, SIZE, CONTRAST = 0.1, np.array([0.03, -0.04]), 0.012, -0.4


def grid(side: int = 400) -> tuple[np.ndarray, np.ndarray]:
    middle = RADIUS * ((2 * np.arange(side) + 1) / side - 1)
    points = np.stack(np.meshgrid(middle, middle), axis=-1).reshape(-1, 2)
    points = points[np.hypot(*points.T) < RADIUS]
    return points, np.full(len(points), (2 * RADIUS / side) ** 2)


def disc(points: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    return CONTRAST * (np.hypot(*(points - centre).T) < radius)


@pytest.fixture
def figures_of_merit(benchmark_module: Callable[[str], ModuleType]) -> Any:
    return benchmark_module("figures_of_merit").figures_of_merit


def test_a_perfect_image_of_a_disc_is_perfect(figures_of_merit: Any) -> None:
    points, area = grid()
    found = figures_of_merit(points, area, disc(points, TARGET, SIZE), TARGET, CONTRAST * np.pi * SIZE**2)
    assert found.amplitude_response == pytest.approx(1, abs=0.01)
    assert found.resolution == pytest.approx(SIZE / RADIUS, rel=0.01)
    assert abs(found.position_error_m) < 1e-4
    assert found.displacement_m < 1e-4
    assert found.shape_deformation < 0.02
    assert found.ringing == 0


def test_an_image_drawn_inwards_and_blown_up_says_so(figures_of_merit: Any) -> None:
    points, area = grid()
    found = figures_of_merit(points, area, disc(points, 0.8 * TARGET, 2 * SIZE), TARGET, CONTRAST * np.pi * SIZE**2)
    assert found.position_error_m == pytest.approx(0.01, abs=2e-4)
    assert found.displacement_m == pytest.approx(0.01, abs=2e-4)
    assert found.amplitude_response == pytest.approx(4, rel=0.01)
    assert found.resolution == pytest.approx(2 * SIZE / RADIUS, rel=0.01)


def test_half_of_a_ring_outside_counts_as_ringing_and_a_bar_as_deformed(figures_of_merit: Any) -> None:
    points, area = grid()
    image = disc(points, TARGET, SIZE)
    around = np.hypot(*(points - TARGET).T)
    ring = (around > 1.5 * SIZE) & (around < 2 * SIZE)
    found = figures_of_merit(points, area, np.where(ring, -CONTRAST / 10, image), TARGET, CONTRAST * np.pi * SIZE**2)
    assert found.ringing == pytest.approx((2**2 - 1.5**2) / 10, rel=0.02)
    bar = CONTRAST * ((np.abs(points - TARGET) < [4 * SIZE / 2, SIZE / 2]).all(axis=1))
    half_angle = np.arcsin(np.sqrt(np.pi) / 4)
    inside = (2 * half_angle + np.sin(2 * half_angle)) / np.pi
    found = figures_of_merit(points, area, bar, TARGET, CONTRAST * 4 * SIZE**2)
    assert found.shape_deformation == pytest.approx(1 - inside, abs=0.02)


def test_the_set_has_the_sign_of_the_target(figures_of_merit: Any) -> None:
    points, area = grid(100)
    image = disc(points, TARGET, SIZE) - 0.5 * disc(points, -TARGET, SIZE)
    assert figures_of_merit(points, area, image, TARGET, -1.0).displacement_m < 1e-3
    assert figures_of_merit(points, area, image, -TARGET, 1.0).displacement_m < 1e-3
    with pytest.raises(ValueError, match="sign"):
        figures_of_merit(points, area, disc(points, TARGET, SIZE), TARGET, 1.0)
