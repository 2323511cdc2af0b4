"""Touched layers: conductivity of their volume, sheets of resultants, and what the volume scatters."""

from dataclasses import replace

import numpy as np
import pytest

import eitsim
import matcal
from eitsim.electrics.forward.disc_electrics import following_mesh
from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.mechanics.solid.section_gradient import gradient_at
from eitsim.scene.drive import Drive, read_out
from eitsim.scene.edges.disc import Disc
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.pressing import Punch, Skin
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body
from eitsim.sheet.layer_conductivity import referred_conductivity, sheet_law, sheet_skin
from eitsim.simulation.layers.layer_current import UNEVEN, layer_current
from eitsim.simulation.layers.layer_readings import UNSEEN
from eitsim.simulation.layers.layer_section import LayerSection, in_volume, layer_section, sheet_error, sheet_of
from eitsim.simulation.layers.touched_layer import layer_change

LAW = matcal.Conductivity(5.0, [-2.0, 2.0, -1.0], (-0.3, 1.0))
BODY, REACH_M = Body(Disc(0.04), 0.003), 0.03
PUNCH = Punch(0.008, 0.003, 0.008, depth_m=7e-4, profile="sphere")


@pytest.fixture(scope="module")
def touch() -> Touch:
    rubber = matcal.Hyperfoam([1e5], [2.0], [0.4])
    return solve_touch(rubber, BODY, PUNCH, element_m=2 * default_element_m(BODY, PUNCH))


def skin(strain: str, along: float = 0.0, across: float = 0.0) -> Skin:
    return Skin(BODY.thickness_m, strain, "layer", along, across)


def test_a_stretched_bar_has_its_resistance_and_a_turn_changes_nothing():
    stretch, rng = 1.3, np.random.default_rng(0)
    bar = np.diag([stretch, stretch**-0.5, stretch**-0.5])
    sigma = referred_conductivity(LAW, skin("piezoresistive", 4.0, 1.5), bar)
    assert LAW.c0_S_per_m / sigma[0, 0] == pytest.approx(stretch**2 * stretch ** (4.0 - 1.5), rel=1e-12)
    plain = referred_conductivity(replace(LAW, a=np.zeros(3)), skin("principal"), bar)
    np.testing.assert_allclose(referred_conductivity(LAW, skin("piezoresistive"), bar), plain, rtol=1e-12)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    for law in (skin("principal"), skin("volume"), skin("piezoresistive", 3.0, -1.0)):
        gradient = np.eye(3) + 0.2 * rng.normal(size=(4, 3, 3))
        gradient[np.linalg.det(gradient) < 0.2] = np.eye(3)
        np.testing.assert_allclose(referred_conductivity(LAW, law, turn @ gradient),
                                   referred_conductivity(LAW, law, gradient), rtol=1e-9, atol=1e-12)


def test_a_disc_of_another_conductivity_scatters_as_known_and_no_touch_scatters_nothing(touch: Touch):
    layer = layer_section(replace(touch, section=replace(touch.section, displacement_m=np.zeros_like(
        touch.section.displacement_m), log_volume=None)), skin("principal"), LAW)
    assert np.abs(layer.scattering(REACH_M, 16)).max() < 1e-12
    lines = np.unique(layer.section.nodes_m[layer.section.elements[:, :4], 0])
    edge = float(lines[np.argmin(np.abs(lines - touch.contact_radius_m))])  # there elements are small
    sigma = np.where((layer.radius_m < edge)[..., None, None], 3.0, 1.0) * np.eye(3)
    m = np.arange(1, 5)
    filled = LayerSection(layer.section, sigma, layer.outside, edge)
    np.testing.assert_allclose(filled.scattering(REACH_M, 4), -0.5 * (edge / REACH_M) ** (2 * m), rtol=1e-2)


@pytest.mark.parametrize("law", [skin("principal"), skin("volume"), skin("piezoresistive", 5.0, 1.0)])
def test_the_sheet_is_off_by_what_it_states_from_what_the_volume_scatters(touch: Touch, law: Skin):
    layer, electrodes = layer_section(touch, law, LAW), Electrodes(contact_impedance_Ohm_m=0.05)
    sheet = sheet_of(layer, touch)
    by_sheet, exact = (solve(BODY, sheet_skin(law), electrodes, Drive(), ((PUNCH, one),), sheet_law(LAW),
                             method="multipole").signal_V for one in (sheet, in_volume(layer, sheet)))
    off = np.linalg.norm(by_sheet - exact) / np.linalg.norm(exact)
    assert 0 < off <= UNSEEN * sheet_error(layer, sheet, PUNCH, law, LAW, REACH_M) < 0.4


@pytest.mark.thorough
def test_the_volume_scatters_what_a_solution_in_three_dimensions_does(touch: Touch):
    law, electrodes, z = skin("piezoresistive", 5.0, 1.0), Electrodes(count=8, contact_impedance_Ohm_m=0.05), 0.05
    layer = layer_section(touch, law, LAW)
    sheet = sheet_of(layer, touch)
    found = solve(BODY, sheet_skin(law), electrodes, Drive(), ((PUNCH, in_volume(layer, sheet)),), sheet_law(LAW),
                  method="multipole").signal_V
    mesh = following_mesh(BODY, electrodes, ((PUNCH, touch),), 1)
    _, change = layer_change(mesh, law, LAW, ((PUNCH, touch),), np.full(8, z * law.thickness_m), layers=3)
    exact = read_out(Drive(), change)
    assert np.linalg.norm(found - exact) <= 0.01 * np.linalg.norm(exact)


def test_the_gradient_at_a_place_is_that_of_its_element(touch: Touch):
    place = np.array([0.0011, 0.0037, 0.02, 1.0])
    step, height = 1e-7, np.full(4, -0.0012)
    f = gradient_at(touch.section, place, height)
    assert np.all(np.abs(np.linalg.det(f[:3]) - 1) < 0.3)
    np.testing.assert_array_equal(f[3], np.eye(3))
    near = gradient_at(touch.section, place + step, height)
    np.testing.assert_allclose(near, f, atol=1e-3)


def layer_scene(signal: float = 0.05, **electrodes: float) -> eitsim.Scene:
    return eitsim.Scene(Body(Disc(0.04)), (replace(PUNCH, depth_m=4e-4, fillet_m=0.001),), skin("principal"),
                        Electrodes(count=8, contact_impedance_Ohm_m=0.05, soft=True, **electrodes),
                        accuracy=eitsim.Accuracy(signal))


@pytest.mark.slow
def test_a_scene_of_a_layer_is_solved_exactly_and_as_a_sheet_and_with_electrodes_on_part_of_the_rim():
    card = matcal.MaterialCard("rubber", matcal.Hyperfoam([1e5], [2.0], [0.4]), conductivity=LAW)
    sheet, exact, part = (eitsim.simulate(scene, card, exact=how) for scene, how in (
        (layer_scene(0.2), False), (layer_scene(), True), (layer_scene(high_m=0.0015), False)))
    assert [one.outcome for one in (sheet, exact, part)] == ["ok"] * 3
    assert [one.readings.method for one in (sheet, exact, part)] == ["multipole, sheet", "multipole, volume", "volume"]
    for one, allowed in ((sheet, sheet.error_estimate["signal"]), (part, 0.05)):
        off = np.linalg.norm(one.readings.signal_V - exact.readings.signal_V)
        assert off <= allowed * np.linalg.norm(exact.readings.signal_V)
    np.testing.assert_allclose(part.readings.baseline_V, exact.readings.baseline_V, rtol=0.05)


def test_current_through_an_untouched_layer_is_even_and_crosses_it_under_a_touch_alone(touch: Touch):
    still = replace(touch, section=replace(touch.section, displacement_m=np.zeros_like(touch.section.displacement_m),
                                           log_volume=None))
    even = layer_current(layer_section(still, skin("principal"), LAW), still)
    assert even.spread.max() < 1e-6
    tenths = np.linspace(-BODY.thickness_m, 0, 11)[1:-1]
    np.testing.assert_allclose(even.lines_z_m, np.broadcast_to(tenths[:, None], even.lines_z_m.shape), atol=2e-5)
    found = layer_current(layer_section(touch, skin("principal"), LAW), touch)
    far, near = found.radius_m > found.sheet_from_m, found.radius_m < touch.contact_radius_m
    assert found.spread[near].max() > 10 * UNEVEN > 10 * found.spread[far].max()
    assert touch.contact_radius_m < found.sheet_from_m < touch.contact_radius_m + 2 * BODY.thickness_m
    assert np.all(np.diff(found.lines_z_m, axis=0) > 0)
    lowered = found.lines_z_m[-1][near].mean() - tenths[-1]
    assert -touch.depth_m < lowered < -0.3 * touch.depth_m
