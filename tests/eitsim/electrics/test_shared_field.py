"""Touches that share one field of the skin read as the same strains do when each touch brings its own."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from eitsim.electrics.forward.sheet_fields import surface_displacement
from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.edges.outline import Outline
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.sheet.sheet_conductance import added_metric, solutions
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
LAW = Conductivity(30.0, [-2, 2, -1], (0.0, 0.4))
PUNCH = Punch(0.02, -0.01, force_N=0.5)
RECTANGLE = Body(Outline("rectangle", width_m=0.16, height_m=0.1))


@dataclass(frozen=True)
class Sum:
    """The sum of solved touches as one field."""

    touches: tuple[tuple[Punch, Touch], ...]

    def metric(self, points_m):
        return added_metric(points_m, self.touches)

    def displacement(self, points_m):
        return surface_displacement(points_m, self.touches)


@pytest.fixture(scope="module")
def touch() -> Touch:
    return solve_touch(FOAM, Body(), PUNCH, element_m=0.2e-3)


@pytest.mark.parametrize("body", [Body(), RECTANGLE], ids=["disc", "rectangle"])
@pytest.mark.parametrize("count", [1, 2])
def test_one_field_reads_as_the_touches_that_it_adds_up(touch, body, count):
    punches = (PUNCH, replace(PUNCH, x_m=-0.04, y_m=0.02))[:count]
    alone = tuple((punch, touch) for punch in punches)
    field = Sum(alone)
    assert len(solutions(alone)) == count
    shared = tuple((punch, replace(touch, surface=field)) for punch in punches)
    sensor = body, Skin(strain="principal"), Electrodes(), Drive()
    expected = solve(*sensor, alone, LAW, method="mesh").signal_V
    got = solve(*sensor, shared, LAW)
    assert got.method == "mesh"
    np.testing.assert_allclose(got.signal_V, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    points = np.random.default_rng(1).uniform(-0.04, 0.04, (50, 2))
    np.testing.assert_allclose(surface_displacement(points, shared), surface_displacement(points, alone), atol=1e-15)
