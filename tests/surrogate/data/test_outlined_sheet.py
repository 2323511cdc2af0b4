"""Fields of electrodes on a skin with an outline: against the integrals along its edges, and what they are used for."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from eitsim.electrics.forward.untouched import untouched_readings
from eitsim.electrics.outline.edge_response import arriving, edge_responses
from eitsim.scene.edges.outline import Outline
from eitsim.scene.scene import Body, Electrodes, Scene
from surrogate.data import outlined_sheet
from surrogate.data.edge_frame import edge_frame
from surrogate.data.frame_drift import by_gain
from surrogate.data.outlined_sheet import Sheet
from surrogate.data.samples import SweepSamples
from surrogate.data.sensor_ring import outwards, place, radial, ring_of, same_ring
from surrogate.data.skin_from_above import skin_of_sheet
from surrogate.learners.forward import TouchInversion

S = 6e-4
L_WITH_HOLE = Body(Outline("polygon", holes_m=((0.03, 0.09, 0.006),), points_m=(
    (0.0, 0.0), (0.12, 0.0), (0.12, 0.06), (0.06, 0.06), (0.06, 0.12), (0.0, 0.12))), 0.005)
SCENE = Scene(L_WITH_HOLE, electrodes=Electrodes(count=12, width_m=0.008))


@pytest.fixture(scope="module")
def sheet() -> Sheet:
    return outlined_sheet.sheet_of(SCENE.body.outline, SCENE.electrodes, S)[0]


def test_fields_are_those_of_the_integrals_along_edges_and_holes_in_all_orders(sheet: Sheet) -> None:
    rng, radius = np.random.default_rng(0), ring_of(SCENE).radius_mm
    tried = 120 * rng.random((2000, 2))
    tried = tried[outlined_sheet.edge_distance_mm(sheet, tried)[0] > 0.3 * radius][:20]
    response = edge_responses(SCENE.body.outline, SCENE.electrodes, S)[0]
    z = tried[:, 0] + 1j * tried[:, 1]
    known = np.pi * S * arriving(response, [(1e-3 * one, 1e-3 * radius) for one in z.tolist()], 5).reshape(20, 5, -1)
    found = outlined_sheet.fields(sheet, (z - complex(*sheet.origin_mm)) / radius, 5)
    for k, factorial in enumerate((1, 2, 6, 24, 120)):
        off = found[k] - factorial * known[:, k]
        assert np.linalg.norm(off) < 1e-5 * np.linalg.norm(found[k])


def test_fields_are_exact_where_the_touches_are() -> None:
    """A skin that is large for its foam has touches far nearer to its edges than a tenth of its size."""
    body = Body(Outline("rectangle", width_m=0.3, height_m=0.25))
    electrodes, at = Electrodes(count=8, width_m=0.02), np.array([[0.0, 0.117]])
    known = np.pi * S * arriving(edge_responses(body.outline, electrodes, S)[0], [(complex(*at[0]), 0.125)], 3)
    off = []
    for places in (None, at):
        sheet, reach_mm = outlined_sheet.sheet_of(body.outline, electrodes, S, places)
        found = outlined_sheet.fields(sheet, (1e3 * at @ [1, 1j] - complex(*sheet.origin_mm)) / reach_mm, 3)
        off.append(np.linalg.norm(found[:, 0] / np.array([1, 2, 6])[:, None] - known) / np.linalg.norm(known))
    assert off[0] > 1e-3 > 1e-5 > off[1]


def test_distances_know_the_hole_and_have_their_slopes(sheet: Sheet) -> None:
    at = np.array([[30.0, 80.0], [31.3, 88.2], [63.0, 61.0], [100.0, 29.0], [20.0, 40.0]])
    distance, slope = outlined_sheet.edge_distance_mm(sheet, at)
    assert distance[:3] == pytest.approx([4.0, np.hypot(1.3, 1.8) - 6.0, -1.0], abs=0.02)
    for k, step in enumerate(1e-5 * np.eye(2)):
        pair = [outlined_sheet.edge_distance_mm(sheet, at + sign * step)[0] for sign in (1, -1)]
        assert slope[:, k] == pytest.approx((pair[0] - pair[1]) / 2e-5, abs=1e-6)


def test_the_innermost_place_of_a_square_is_its_middle() -> None:
    place_m, far = outlined_sheet.innermost_m(Outline("rectangle", width_m=0.1, height_m=0.1))
    assert far == pytest.approx(0.05, abs=1e-8)
    assert place_m == pytest.approx([0.0, 0.0], abs=1e-8)


def test_radii_are_distances_to_the_edges_and_go_outwards_evenly() -> None:
    ring = ring_of(SCENE)
    radii = np.array([0.0, 0.25, 0.5])
    assert radial(ring, outwards(ring, radii)) == pytest.approx(radii, abs=1e-4)
    assert np.abs(place(ring, ring.origin_mm[None])) == pytest.approx(0.0)
    at, step = np.array([[45.0, 20.0]]), np.array([1e-5, 0.0])
    nearer = [radial(ring, at + sign * step)[0] * ring.radius_mm for sign in (1, -1)]
    assert edge_frame(ring, place(ring, at)).outwards.real == pytest.approx((nearer[0] - nearer[1]) / 2e-5, rel=1e-4)


@pytest.mark.slow
def test_a_sensor_is_the_same_on_another_sheet_conductance_and_not_with_other_edges() -> None:
    ring = ring_of(SCENE)
    other = ring_of(SCENE, untouched_readings(SCENE, 0.5 * S))
    assert same_ring(ring, other)
    assert ring.sheet is not None
    moved = replace(ring.sheet, start_mm=ring.sheet.start_mm + np.array([0.0, 1e-3]))
    assert not same_ring(ring, replace(ring, sheet=moved))
    assert not same_ring(ring, ring_of(Scene()))


def test_gains_drift_by_the_solved_potentials() -> None:
    rest = untouched_readings(SCENE, S)
    ring = ring_of(SCENE, rest)
    slopes = by_gain(ring, rest)
    assert slopes.sum(axis=1) == pytest.approx(rest, rel=1e-6)


def test_electrodes_on_the_surface_have_potentials_and_no_poles() -> None:
    body = Body(Outline("rectangle", width_m=0.1, height_m=0.1))
    patches = Electrodes(kind="surface", count=6, width_m=0.005, x_m=(-0.02, 0.02, 0.03, 0.02, -0.02, -0.03),
                         y_m=(-0.02, -0.02, 0.0, 0.02, 0.02, 0.0))
    scene = Scene(body, electrodes=patches)
    rest = untouched_readings(scene, S)
    ring = ring_of(scene, rest)
    assert ring.sheet is not None
    assert ring.sheet.on_surface
    assert by_gain(ring, rest).sum(axis=1) == pytest.approx(rest, rel=1e-6)
    rows = object.__new__(SweepSamples)
    object.__setattr__(rows, "ring", ring)
    with pytest.raises(ValueError, match="Take `method` ridge, network or gp"):
        TouchInversion.fit(rows, SimpleNamespace())  # pyright: ignore[reportArgumentType]
    drawn = skin_of_sheet(ring.sheet).electrodes_mm
    assert np.mean(drawn[1][:-1], axis=0) == pytest.approx([20.0, -20.0])
    assert np.ptp(drawn[1], axis=0) == pytest.approx([5.0, 5.0])
