"""The benchmark's condensed update is the elimination of the whole mesh, where only the inner cells change."""

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import impedance, quadrature_points
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.scene.scene import Body, Electrodes


@pytest.fixture(scope="module")
def study(benchmark_module: Callable[[str], ModuleType]) -> ModuleType:
    """The benchmark as a module."""
    return benchmark_module("condensed")


@pytest.mark.parametrize(("x_m", "radius_m"), [(0.0, 0.03), (0.05, 0.02), (0.09, 0.03)])
def test_a_condensed_update_is_the_elimination_of_the_whole(study, x_m: float, radius_m: float) -> None:
    body, electrodes = Body(), Electrodes()
    angles, electrode = rim_angles(body, electrodes)
    mesh = ring_mesh(np.linspace(0, body.radius_m, 11), np.zeros((11, 2)), angles, electrode, electrodes.count)
    z, rng = np.linspace(0.5, 2.0, electrodes.count), np.random.default_rng(3)
    inside = np.hypot(*(quadrature_points(mesh).mean(axis=1) - [x_m, 0.0]).T) < radius_m
    patch, to_impedance = study.condensed(mesh, inside, 6e-4, z)
    assert len(patch.cells) == inside.sum() > 0
    for _ in range(2):
        touched = np.full(len(mesh.cells), 6e-4)
        touched[inside] *= np.exp(rng.normal(size=int(inside.sum())))
        whole = impedance(mesh, touched, z)
        assert np.abs(to_impedance(touched[inside]) - whole).max() < 1e-12 * np.abs(whole).max()
    assert np.abs(whole - impedance(mesh, np.full(len(mesh.cells), 6e-4), z)).max() > 1e-6 * np.abs(whole).max()
