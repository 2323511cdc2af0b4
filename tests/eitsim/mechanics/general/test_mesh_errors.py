"""The lone touches' surfaces in place of the mesh's own: stretches are exchanged, and what turns adds none."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from eitsim.mechanics.general.layer.layer_field import metric_of
from eitsim.mechanics.general.mesh_errors import CorrectedField
from eitsim.mechanics.general.meshing.levels import COARSE
from touchcal.arrays import Array


def _steep(slope_deg: float, *stretches: float) -> Any:
    """A surface of one stretch, which stands at an angle to the untouched one."""
    turn = np.deg2rad(slope_deg)
    across = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])

    def gradient(points: Array) -> Array:
        return np.broadcast_to(across @ np.diag(stretches), (*points.shape[:-1], 3, 3))

    return SimpleNamespace(deformation_gradient=gradient, metric=lambda points: metric_of(gradient(points)))


def _corrected(mesh: Any, alone: Any, instead: Any) -> CorrectedField:
    return CorrectedField(SimpleNamespace(field=mesh), (alone,), instead, instead, (), COARSE)  # type: ignore[arg-type]


@pytest.mark.parametrize("slopes", [(70.0, 40.0, 55.0), (10.0, 80.0, 5.0), (0.0, 0.0, 0.0)])
def test_stretches_are_exchanged_however_steep_the_skin_lies(slopes: tuple[float, float, float]) -> None:
    mesh, alone, instead = (_steep(slope, *each) for slope, each in zip(
        slopes, [(1.66, 1.05, 0.5), (1.73, 1.02, 0.4), (1.29, 1.03, 0.44)], strict=True))
    metric, normal = _corrected(mesh, alone, instead).metric(np.zeros((4, 2)))
    expected = np.diag([1.66 * 1.29 / 1.73, 1.05 * 1.03 / 1.02]) ** 2
    assert metric == pytest.approx(np.broadcast_to(expected, (4, 2, 2)), abs=1e-12)
    assert normal == pytest.approx(0.5 * 0.44 / 0.4)


def test_where_the_mesh_leaves_nothing_of_a_lone_touch_its_own_surface_stays() -> None:
    mesh, alone = _steep(60.0, 1.3, 0.9, 0.8), _steep(30.0, 1.2, 1.0, 0.7)
    found = _corrected(mesh, alone, alone).deformation_gradient(np.zeros((2, 2)))
    assert found == pytest.approx(mesh.deformation_gradient(np.zeros((2, 2))), abs=1e-12)
