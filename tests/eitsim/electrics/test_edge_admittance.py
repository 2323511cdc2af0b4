"""Electrodes that slide along an outline: their admittance against meshes of their own, its derivatives, and a disc."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.cem.boundary_integral import rim_admittance
from eitsim.electrics.cem.uneven_sheet import MODES, sheet_modes
from eitsim.electrics.forward.small_touch import impedance_by_touch
from eitsim.electrics.outline.adapted_mesh import readings_difference, solve_untouched
from eitsim.electrics.outline.edge_admittance import CLOSELY, ROUGHLY, edge_admittance, sliding_mesh
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.outline import Outline
from eitsim.scene.edges.outline_electrodes import along_edge
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.outline_edge import arcs_of, edge_starts, places_along
from eitsim.scene.polygons import circle, moments_m
from eitsim.scene.scene import Body, Scene

SHEET_S, COUNT = 8e-4, 8
RECTANGLE = Body(Outline("rectangle", width_m=0.12, height_m=0.08, holes_m=((-0.03, 0.01, 0.008),)))
DESIGN = Scene(body=RECTANGLE, electrodes=Electrodes(count=COUNT)).electrodes


def moved(seed: int = 0) -> Electrodes:
    """Electrodes displaced by 0.5 mm, 5 % wider or narrower, contacts off by 30 %; two lie around corners."""
    rng = np.random.default_rng(seed)
    return replace(DESIGN, shares=(), positions_m=tuple(along_edge(RECTANGLE.outline, DESIGN)
                                                        + 5e-4 * rng.standard_normal(COUNT)),
                   width_m=tuple(0.01 * np.exp(0.05 * rng.standard_normal(COUNT))),
                   contact_impedance_Ohm_m=tuple(np.exp(0.3 * rng.standard_normal(COUNT))))


def impedance(electrodes: Electrodes, made_for: Electrodes, kind: tuple[float, float]) -> np.ndarray:
    sliding = sliding_mesh(RECTANGLE, made_for, SHEET_S, kind)
    return np.linalg.pinv(edge_admittance(sliding, electrodes, SHEET_S).admittance_S)


@pytest.mark.parametrize(("made_for", "kind", "off"), [(DESIGN, ROUGHLY, 4e-4), (moved(), CLOSELY, 3e-5)])
def test_it_is_that_of_a_mesh_made_for_the_electrodes(made_for: Electrodes, kind: tuple[float, float],
                                                      off: float) -> None:
    expected = solve_untouched(RECTANGLE.outline, moved(), SHEET_S, 5e-6).impedance_Ohm
    found = readings_difference(impedance(moved(), made_for, kind), expected)
    print(f"off {found:.1e}")
    assert found < off


def test_its_derivatives_are_those_of_differences() -> None:
    """By contact impedances, places and widths of one electrode, and by the sheet's modes."""
    sliding, here = sliding_mesh(RECTANGLE, DESIGN, SHEET_S), moved()
    modes = np.array([0.05, -0.1, 0.03, 0.02, 0.04])
    at, step, k = edge_admittance(sliding, here, SHEET_S, modes), 1e-4, 3

    def changed(way: float, **more: float) -> np.ndarray:
        z, place, width = (np.array(one).tolist() for one in (here.contact_impedance_Ohm_m, here.positions_m,
                                                               here.width_m))
        z[k] += way * more.get("z", 0.0)
        place[k] += way * more.get("place", 0.0)
        width[k] *= np.exp(way * more.get("width", 0.0))
        sheet = modes + way * more.get("mode", 0.0) * np.eye(len(MODES))[4]
        return edge_admittance(sliding, replace(here, contact_impedance_Ohm_m=tuple(z), positions_m=tuple(place),
                                                width_m=tuple(width)), SHEET_S, sheet).admittance_S

    for found, unit, key in ((at.by_layer[k], SHEET_S / RECTANGLE.edge.size_m, "z"),
                             (at.by_angle[k], 1 / RECTANGLE.edge.size_m, "place"), (at.by_width[k], 1.0, "width"),
                             (at.by_sheet[4], 1.0, "mode")):
        size = step * (1e-2 if key == "place" else 1.0)
        expected = (changed(1.0, **{key: size}) - changed(-1.0, **{key: size})) / (2 * size)
        np.testing.assert_allclose(unit * found, expected, atol=2e-4 * np.abs(expected).max(), err_msg=key)


def test_a_disc_given_as_a_polygon_has_the_disc_s_admittance_and_derivatives() -> None:
    disc, ring = Body(Disc(0.05)), Electrodes(count=COUNT)
    body = Body(Outline("polygon", points_m=tuple(map(tuple, circle((0, 0), 0.05, 360).tolist()))))
    electrodes = Scene(body=body, electrodes=ring).electrodes
    modes = np.array([0.02, -0.03, 0.05, 0.01, -0.04])
    found = edge_admittance(sliding_mesh(body, electrodes, SHEET_S, CLOSELY), electrodes, SHEET_S, modes)
    expected = rim_admittance(disc, ring, SHEET_S, modes)
    for name, off in (("admittance_S", 2e-3), ("by_layer", 2e-3), ("by_angle", 1e-2), ("by_width", 5e-3),
                      ("by_sheet", 1e-2)):
        one, other = getattr(found, name), getattr(expected, name)
        print(f"{name}: off {np.linalg.norm(one - other) / np.linalg.norm(other):.1e}")
        assert np.linalg.norm(one - other) < off * np.linalg.norm(other), name


def test_electrodes_that_left_the_fine_part_of_the_edge_are_refused_by_name() -> None:
    sliding = sliding_mesh(RECTANGLE, DESIGN, SHEET_S)
    away = np.array(along_edge(RECTANGLE.outline, DESIGN))
    away[5] += 9e-3
    with pytest.raises(ValueError, match=r"electrode 5 \(from 0\) ends 14 mm"):
        edge_admittance(sliding, replace(DESIGN, shares=(), positions_m=tuple(away)), SHEET_S)
    with pytest.raises(ValueError, match="line electrodes which all have contact"):
        edge_admittance(sliding, replace(DESIGN, missing=(1,)), SHEET_S)


def test_moments_of_an_outline_are_those_of_its_parts() -> None:
    middle, second = moments_m(Outline("rectangle", width_m=0.12, height_m=0.06, holes_m=(((0.0, -0.03 + 1e-3),
                               (0.06 - 1e-3, -0.03 + 1e-3), (0.06 - 1e-3, 0.03 - 1e-3), (0.0, 0.03 - 1e-3)),)))
    hole, whole = 0.059 * 0.058, 0.12 * 0.06
    assert middle[0] == pytest.approx(-hole * 0.0295 / (whole - hole))
    assert middle[1] == pytest.approx(0.0, abs=1e-12)
    assert second[1, 1] == pytest.approx((whole * 0.06**2 - hole * 0.058**2) / 12 / (whole - hole))


def test_modes_of_the_sheet_have_no_mean_on_an_outline() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.06, -0.04], [0.06, 0.04], (400_000, 2))
    points = points[np.hypot(points[:, 0] + 0.03, points[:, 1] - 0.01) > 0.008]
    assert np.abs(sheet_modes(RECTANGLE, points).mean(axis=1)).max() < 3e-3


def test_points_of_the_edge_have_their_arc_lengths() -> None:
    arcs = np.linspace(0, edge_starts(RECTANGLE.outline)[-1], 57)[:-1]
    found, away = arcs_of(RECTANGLE.outline, places_along(RECTANGLE.outline, arcs))
    np.testing.assert_allclose(found, arcs, atol=1e-12)
    np.testing.assert_allclose(away, 0, atol=1e-12)


def test_a_small_touch_on_a_disc_given_as_a_polygon_is_that_on_the_disc() -> None:
    disc, ring = Body(Disc(0.05)), Electrodes(count=COUNT, first_angle_rad=0.3)
    body = Body(Outline("polygon", points_m=tuple(map(tuple, circle((0, 0), 0.05, 360).tolist()))))
    electrodes = Scene(body=body, electrodes=ring).electrodes
    places = np.array([[0.0, 0.0], [0.02, -0.01], [-0.015, 0.03]])
    found, expected = (impedance_by_touch(*one, SHEET_S, places) for one in ((body, electrodes), (disc, ring)))
    assert np.linalg.norm(found - expected) < 2e-3 * np.linalg.norm(expected)
