"""Curved surfaces: nearest places, coordinates there and back, lengths and curvatures at the origin."""

from __future__ import annotations

import numpy as np
import pytest

from eitsim.scene.surfaces.curved_surface import CROSS, CurvedSurface, frames, second_form
from eitsim.scene.surfaces.cylinder import Cylinder
from eitsim.scene.surfaces.saddle import Saddle
from eitsim.scene.surfaces.sphere import Sphere

RADIUS = 0.04
SURFACES = [Sphere(RADIUS), Cylinder(RADIUS, 0.2), Saddle(RADIUS, -RADIUS), Saddle(0.1, 0.05)]
PLACES = [[0.0, 0.0, 0.05], [0.013, -0.02, 0.03]]


@pytest.mark.parametrize("surface", SURFACES, ids=str)
@pytest.mark.parametrize("place", PLACES, ids=str)
def test_coordinates_are_found_again_and_normals_are_across_the_surface(surface: CurvedSurface, place: list[float]
                                                                        ) -> None:
    chart, rng = surface.chart_about(np.array(place)), np.random.default_rng(0)
    uv = 0.025 * rng.uniform(-1, 1, (50, 2))
    points, normals = chart.place(uv)
    assert chart.find(points) == pytest.approx(uv, abs=1e-9)
    again, across = surface.nearest(points + 3e-3 * normals)
    assert again == pytest.approx(points, abs=1e-9)
    assert across == pytest.approx(normals, abs=1e-7)
    turns = frames(chart, uv, 1e-6)
    assert np.linalg.det(turns) == pytest.approx(np.ones(50), abs=1e-9)
    way = np.array([1e-6, 0])
    slope = (chart.place(uv + way)[0] - chart.place(uv - way)[0]) / 2e-6
    assert np.abs(np.sum(slope * normals, axis=1)).max() < 1e-5


@pytest.mark.parametrize("surface", SURFACES, ids=str)
@pytest.mark.parametrize("place", PLACES, ids=str)
def test_lengths_at_the_origin_are_those_of_the_surface(surface: CurvedSurface, place: list[float]) -> None:
    chart, step = surface.chart_about(np.array(place)), 1e-5
    at, normal = chart.place(np.zeros(2))
    assert at == pytest.approx(surface.nearest(np.array([place]))[0][0], abs=1e-12)
    assert normal == pytest.approx(chart.frame[2], abs=1e-12)
    along = (chart.place(step * CROSS[::2])[0] - chart.place(step * CROSS[1::2])[0]) / (2 * step)
    assert along == pytest.approx(chart.frame[:2], abs=1e-6)


@pytest.mark.parametrize(("surface", "expected"), [
    (Sphere(RADIUS), [25, 25]), (Cylinder(RADIUS, 0.2), [0, 25]), (Saddle(RADIUS, -RADIUS), [25, -25])], ids=str)
def test_curvatures_are_those_of_the_radii(surface: CurvedSurface, expected: list[float]) -> None:
    chart = surface.chart_about(np.array([0, 0, 0.05]))
    form = second_form(*chart.place(1e-5 * CROSS), chart.frame[2])
    assert form == pytest.approx(np.diag(expected), abs=1e-3)
