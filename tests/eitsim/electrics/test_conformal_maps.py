"""A square and an ellipse without a mesh: the maps are conformal, give the disc's readings, and outlines agree."""

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from eitsim.electrics.cem.boundary_integral import HARMONICS, solve_rim
from eitsim.electrics.cem.ring_scattering import impedance_change, on_disc
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.outline.adapted_mesh import readings_difference, solve_untouched
from eitsim.scene.drive import read_out
from eitsim.scene.electrodes import arcs
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin

S, SHARE = 6e-4, 1.488  # that of a skin pressed to 0.8 of its thickness, by benchmarks/outlines.py


@pytest.fixture(scope="module")
def maps(benchmark_module: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark_module("conformal_maps")


@pytest.fixture(scope="module")
def outlines(benchmark_module: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark_module("outlines")


def off(one: np.ndarray, known: np.ndarray) -> float:
    return float(np.linalg.norm(one - known) / np.linalg.norm(known))


def test_a_disc_mapped_to_the_disc_reads_and_scatters_as_it_does(maps):
    body, electrodes, circle = Body(), Electrodes(), (0.03 + 0.04j, 0.02)
    region = maps.Mapped(lambda place: place / body.radius_m, lambda angle: np.full(np.shape(angle), 1 / body.radius_m))
    ends = body.radius_m * np.exp(1j * arcs(body.radius_m, electrodes))
    rest, touched = (maps.mapped_impedance(region, ends, 1.0, S, patch, degree=12, modes=4000)
                     for patch in (None, maps.Patch(*circle, 0.6)))
    rim = solve_rim(body, electrodes, S)
    assert readings_difference(rest, rim.impedance_Ohm) < 3e-6
    known = impedance_change(on_disc(rim, body, electrodes, [circle], 16, HARMONICS), S, np.full(16, 0.25))
    assert off(read_out(Drive(), touched - rest), read_out(Drive(), known)) < 1e-5


@pytest.mark.parametrize("name", ["square", "ellipse"])
def test_the_maps_are_conformal_and_take_the_edge_to_the_circle(name, maps, outlines):
    region, ends = outlines.MAPS[name], outlines.electrode_ends(name).ravel()
    image = region.to_disc(ends)
    np.testing.assert_allclose(np.abs(image), 1, rtol=0, atol=1e-12)
    step = 1e-6 * np.exp(1j * np.array([0.0, np.pi / 2]))
    place = 0.01 + 0.02j
    along, across = (region.to_disc(np.array([place + h])) - region.to_disc(np.array([place - h])) for h in step)
    np.testing.assert_allclose(across, 1j * along, rtol=1e-8)
    middle = ends[:2].mean() if name == "square" else ends[0]
    turn = 1j if name == "square" else 1j * (middle.real / 0.06**2 + 1j * middle.imag / 0.04**2)
    h = 1e-6 * turn / abs(turn)
    slope = abs((region.to_disc(np.array([middle + h])) - region.to_disc(np.array([middle - h])))[0]) / 2e-6
    assert region.shrink(np.angle(region.to_disc(np.array([middle]))))[0] == pytest.approx(slope, rel=1e-6)


def test_a_square_reads_and_a_circle_on_it_changes_that_as_the_disc_says(maps, outlines):
    """dV of the default path within 1e-4, as exactly as stated within a factor of 3 or better."""
    body, electrodes = outlines.sensor("square")
    region, ends = outlines.MAPS["square"], outlines.electrode_ends("square")
    rest, touched = (maps.mapped_impedance(region, ends, 1.0, S, patch, degree=14, modes=4000)
                     for patch in (None, maps.Patch(0.01 + 0.005j, 0.01, SHARE)))
    untouched = solve_untouched(body.outline, electrodes, S, 1e-4)
    assert readings_difference(untouched.impedance_Ohm, rest) < untouched.error + 1e-5
    known = read_out(Drive(), touched - rest)
    found = solve(body, Skin(strain="normal"), electrodes, Drive(),
                  ((Punch(0.01, 0.005, 0.02), outlines.circle_of(0.01)),), outlines.LAW)
    error = off(found.signal_V, known)
    print(f"{error:.1e}, stated {found.signal_error:.1e}")
    assert found.method == "multipole"
    assert error < min(1e-4, 3 * found.signal_error)
