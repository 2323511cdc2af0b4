"""How far signals are apart by two fields near the rim, from a nominal sensor: bearings, units, size, torn skin; and
readings no finer than the touch is known."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from eitsim.electrics.forward.nominal_sensor import signal_differences, surface_differences
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.rim.correction import RimCorrection, with_error
from eitsim.scene.edges.disc import Disc
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import STRAINS, Accuracy, Body, Drive, Punch, Scene
from eitsim.simulation.near_edges import with_signal_errors
from eitsim.simulation.simulate import ELECTRICS_SHARE, readings_of
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.errors import NotConverged

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
PUNCH = Punch(x_m=0.088, force_N=0.5)


@pytest.fixture(scope="module")
def touch() -> Touch:
    return solve_touch(FOAM, Body(), PUNCH)


def field(size: float) -> RimField:
    """Softer skin towards the rim, by the normal stretch and the metric, out to 20 mm."""
    radius, share = np.linspace(1e-4, 0.02, 30), (np.arange(12) + 0.5) / 12
    bump = size * np.exp(-((radius / 0.01) ** 2))[:, None] * np.cos(np.pi * share)
    metric = np.stack([1 + bump, 0 * bump, 1 - bump / 2], axis=-1)
    return RimField(radius, share, np.zeros((*bump.shape, 3)), metric, 1 + bump, Body().radius_m, PUNCH.x_m)


def apart(touch: Touch, one: float, other: float, bearing: float = 0.0) -> NDArray[np.float64]:
    punch = replace(PUNCH, x_m=PUNCH.x_m * np.cos(bearing), y_m=PUNCH.x_m * np.sin(bearing))
    return signal_differences(Body(), punch, touch, field(one), field(other))


def test_the_bearing_does_not_count(touch: Touch) -> None:
    # what other triangles make of it
    assert apart(touch, 0.0, 0.05, 0.7) == pytest.approx(apart(touch, 0.0, 0.05), rel=0.005)


def test_small_differences_add_up(touch: Touch) -> None:
    assert np.all(apart(touch, 0.0, 0.0) == 0.0)
    small, twice = apart(touch, 0.0, 0.002), apart(touch, 0.0, 0.004)
    assert np.all((small > 1e-4) & (small < 0.1))
    smooth = [strain != "principal" for strain in STRAINS]  # that is the larger stretch, here now one, now the other
    assert twice[smooth] == pytest.approx(2 * small[smooth], rel=0.05)


def test_lengths_may_be_over_the_thickness(touch: Touch) -> None:
    unit = Body().thickness_m
    one, other = (replace(f, radius_m=f.radius_m / unit, disc_m=f.disc_m / unit, offset_m=f.offset_m / unit)
                  for f in (field(0.0), field(0.05)))
    scaled = replace(touch, radius_m=touch.radius_m / unit, contact_radius_m=touch.contact_radius_m / unit)
    found = signal_differences(Body(Disc(Body().radius_m / unit), 1.0),
                              replace(PUNCH, x_m=PUNCH.x_m / unit, diameter_m=PUNCH.diameter_m / unit,
                                      fillet_m=PUNCH.fillet_m / unit), scaled, one, other)
    assert found == pytest.approx(apart(touch, 0.0, 0.05), rel=0.02)


def test_a_field_that_leaves_no_skin_is_infinitely_far(touch: Touch) -> None:
    assert np.all(apart(touch, 0.0, 2.5) == np.inf)
    whole, torn = (RimCorrection(field(size), 0.0, 1.0, 1.0, 1.0, 0.0, ()) for size in (0.0, 2.5))
    with pytest.raises(NotConverged, match="turned inside out"):
        with_signal_errors(with_error(touch, whole, torn, Body(), PUNCH))


class Bump:
    """A skin stretched along x about a place, m."""

    def __init__(self, size: float, at: tuple[float, float]) -> None:
        self.size, self.at = size, np.array(at)

    def metric(self, points_m: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        away = np.linalg.norm(points_m - self.at, axis=-1)
        stretch = 1 + self.size * np.exp(-((away / 0.004) ** 2))
        metric = np.zeros((*away.shape, 2, 2))
        metric[..., 0, 0], metric[..., 1, 1] = stretch**2, 1.0
        return metric, 1 / stretch

    def displacement(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.zeros((*points_m.shape[:-1], 3))


@pytest.mark.parametrize("missing", [(), (3,)])
def test_surfaces_differ_by_what_the_scenes_own_electrodes_read(touch: Touch, missing: tuple[int, ...]) -> None:
    def differ(rough: float, electrodes: Electrodes) -> NDArray[np.float64]:
        pressed = replace(touch, surface=Bump(0.02, (0.088, 0.0)))
        return surface_differences(Body(), electrodes, Drive(), [(PUNCH, pressed)], Bump(rough, (0.088, 0.0)))

    electrodes = Electrodes(missing=missing)
    assert np.all(differ(0.02, electrodes) == 0)
    assert differ(0.019, electrodes) == pytest.approx(0.05, rel=0.05)
    assert np.all(differ(-1.5, electrodes) == np.inf)


def test_readings_are_no_finer_than_the_touch_is_known(touch: Touch) -> None:
    scene = Scene(punches=(PUNCH,), accuracy=Accuracy(signal=0.001))
    law = Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4))
    near = replace(touch, rim=field(0.05), signal_errors=np.zeros(3))
    fine, rough = (readings_of(scene, (replace(near, signal_errors=np.full(3, error)),), law, exact=False)
                   for error in (0.0, 0.05))
    assert rough.unknowns < fine.unknowns / 2
    apart = np.linalg.norm(rough.signal_V - fine.signal_V) / np.linalg.norm(fine.signal_V)
    assert 0 < max(apart, rough.signal_error) < ELECTRICS_SHARE * 0.05
