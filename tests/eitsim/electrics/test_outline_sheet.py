"""Untouched skins with an outline: equal to the disc, to a cosine series and to EIDORS's P1; error estimates hold."""

import subprocess
import sys
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import impedance
from eitsim.electrics.forward.untouched import by_contact, conductance_of, untouched_impedance, untouched_readings
from eitsim.electrics.outline.adapted_mesh import readings_difference, solve_untouched
from eitsim.electrics.outline.triangles import refined, skin_mesh, triangulated
from eitsim.scene.drive import Drive
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.scene import Body, Electrodes, Scene, Skin
from touchcal.errors import NotConverged

S = 6e-4
TURN = 2 * np.pi * np.arange(400) / 400
POLYGON = Body(Outline("polygon", points_m=0.1 * np.column_stack([np.cos(TURN), np.sin(TURN)])))
EVEN = Scene(POLYGON).electrodes
RECTANGLE = Body(Outline("rectangle", width_m=0.12, height_m=0.08))
POSITIONS = 0.4 / 32 * (np.arange(32) + 0.5)
L_SHAPE = Body(Outline("polygon", points_m=((0, 0), (0.12, 0), (0.12, 0.05), (0.05, 0.05), (0.05, 0.12), (0, 0.12)),
    holes_m=((0.025, 0.08, 0.01),)))


@pytest.fixture(scope="module")
def outlines(benchmark_module: Callable[[str], ModuleType]) -> ModuleType:
    """benchmarks/outlines.py, which holds the cosine series."""
    return benchmark_module("outlines")


def test_a_disc_given_as_a_polygon_is_the_disc():
    found = solve_untouched(POLYGON.outline, EVEN, S, 1e-5)
    assert readings_difference(found.impedance_Ohm, untouched_impedance(Body(), Electrodes(), S)) < 1e-5


def test_a_disc_given_as_a_round_rectangle_is_the_disc():
    """Its 96 chords are 1.8e-4 longer than the circle, and electrodes along them wider by as little."""
    body = Body(Outline("rectangle", width_m=0.2, height_m=0.2, corner_radius_m=0.1))
    found = solve_untouched(body.outline, Scene(body).electrodes, S, 1e-5)
    assert readings_difference(found.impedance_Ohm, untouched_impedance(Body(), Electrodes(), S)) < 1e-4


def test_the_rectangle_converges_to_a_cosine_series_and_knows_its_error(outlines):
    """32 electrodes, 928 readings; two resolutions of the series tell its own error."""
    electrodes = Electrodes(count=32, width_m=0.006, positions_m=POSITIONS)
    coarse, series = (
        outlines.rectangle_impedance(0.12, 0.08, POSITIONS, 0.006, 1.0, S, degree=n, modes=m, mixed=m // 4)
        for n, m in ((10, 2000), (14, 4000)))
    assert readings_difference(coarse, series) < 3e-6
    for asked in (1e-3, 1e-4):
        found = solve_untouched(RECTANGLE.outline, electrodes, S, asked)
        off = readings_difference(found.impedance_Ohm, series)
        assert found.error <= asked
        assert found.error / 10 < off + 1e-6
        assert off < 1.5 * found.error + 3e-6


@pytest.mark.thorough
def test_corners_and_holes_need_no_hand_and_the_estimate_holds():
    electrodes = Scene(L_SHAPE, electrodes=Electrodes(count=16, width_m=0.006)).electrodes
    fine = solve_untouched(L_SHAPE.outline, electrodes, S, 1e-5)
    for asked in (1e-3, 1e-4):
        found = solve_untouched(L_SHAPE.outline, electrodes, S, asked)
        assert readings_difference(found.impedance_Ohm, fine.impedance_Ohm) < 1.5 * found.error


def test_p1_triangles_give_what_eidors_assembles():
    """EIDORS's system_mat_1st_order and its complete electrode model, written out densely."""
    electrodes = Scene(L_SHAPE, electrodes=Electrodes(count=8, width_m=0.01)).electrodes
    triangles = triangulated(L_SHAPE.outline, electrodes)
    mesh = skin_mesh(triangles, electrodes, "P1")
    sheet = S * (1 + np.arange(len(mesh.cells)) % 7)
    nodes, count = len(mesh.nodes_m), mesh.count
    system = np.zeros((nodes + count,) * 2)
    for cell, conductance in zip(mesh.cells, sheet, strict=True):
        slopes = np.linalg.inv(np.column_stack([np.ones(3), mesh.nodes_m[cell]]))[1:]
        area = abs(np.linalg.det(np.column_stack([np.ones(3), mesh.nodes_m[cell]]))) / 2
        system[np.ix_(cell, cell)] += conductance * area * slopes.T @ slopes
    for (a, b), k in zip(mesh.under, mesh.electrode, strict=True):
        length = np.linalg.norm(mesh.nodes_m[a] - mesh.nodes_m[b])
        own = [a, b, nodes + k]
        system[np.ix_(own, own)] += length / 1.0 * np.array([[1 / 3, 1 / 6, -1 / 2], [1 / 6, 1 / 3, -1 / 2],
                                                            [-1 / 2, -1 / 2, 1]])
    currents = np.vstack([np.zeros((nodes, count)), np.eye(count) - 1 / count])
    voltage = np.linalg.lstsq(system, currents, rcond=None)[0][nodes:]
    expected = voltage - voltage.mean(axis=0)
    found = impedance(mesh, sheet, contact_impedances(electrodes))
    assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()


def test_patches_on_the_surface_cover_their_areas_and_keep_the_symmetry():
    places = 0.02 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    electrodes = Electrodes(kind="surface", count=4, x_m=places[:, 0], y_m=places[:, 1], width_m=0.008,
                            contact_impedance_Ohm_m2=1e-5)
    body = Body(Outline("rectangle", width_m=0.1, height_m=0.1))
    found = solve_untouched(body.outline, electrodes, S, 1e-4)
    mesh = skin_mesh(found.triangles, electrodes)
    area = found.triangles.area_m2
    assert area.sum() == pytest.approx(0.01, rel=1e-12)
    under = {tuple(cell): k for cell, k in zip(mesh.under, mesh.electrode, strict=True)}
    owner = np.array([under.get(tuple(cell), -1) for cell in mesh.cells])
    np.testing.assert_allclose([area[owner == k].sum() for k in range(4)], np.pi * 0.004**2, rtol=1e-12)
    z = found.impedance_Ohm
    np.testing.assert_allclose(np.roll(z, (1, 1), axis=(0, 1)), z, rtol=0, atol=3e-4 * np.ptp(z))
    fine = solve_untouched(body.outline, electrodes, S, 1e-5)
    assert np.abs(z - fine.impedance_Ohm).max() < 3 * found.error * np.abs(fine.impedance_Ohm).max()


def test_what_lies_under_a_perfect_contact_does_not_matter():
    """A patch of hardly any contact impedance is one conductor, whatever the skin under it is; under one of a large
    impedance the skin counts."""
    body = Body(Outline("rectangle", width_m=0.1, height_m=0.1))

    def change(contact_Ohm_m2: float) -> float:
        patches = Electrodes(kind="surface", count=5, x_m=(0.0, 0.03, 0, -0.03, 0), y_m=(0.0, 0, 0.03, 0, -0.03),
                             width_m=0.012, contact_impedance_Ohm_m2=(contact_Ohm_m2, *[1e-5] * 4))
        triangles = refined(triangulated(body.outline, patches), lambda places_m: np.full(len(places_m), 1e-6))
        mesh, z = skin_mesh(triangles, patches), contact_impedances(patches)
        sheet = np.where(np.hypot(*triangles.centres_m.T) < 0.006, 2 * S, S)
        return readings_difference(impedance(mesh, sheet, z), impedance(mesh, np.full(len(sheet), S), z))

    assert change(1e-9) < 1e-4
    assert change(1e-1) > 1e-2


def test_readings_by_the_contact_impedances_are_those_of_the_disc():
    disc = by_contact(Body(), Electrodes(), Drive(), S)
    found = by_contact(POLYGON, EVEN, Drive(), S)
    assert np.linalg.norm(found - disc) < 3e-3 * np.linalg.norm(disc)


def test_the_sheet_conductance_is_found_from_untouched_readings():
    scene = Scene(RECTANGLE, skin=Skin(), electrodes=Electrodes(count=8, width_m=0.01))
    assert conductance_of(scene, untouched_readings(scene, 4.2e-4)) == pytest.approx(4.2e-4, rel=1e-6)


def test_missing_electrodes_draw_no_current():
    scene = Scene(RECTANGLE, electrodes=Electrodes(count=8, width_m=0.01, missing=(3,)))
    assert np.isnan(untouched_readings(scene, S)).sum() > 0
    assert np.isfinite(untouched_readings(scene, S)).sum() > 0


def test_what_cannot_be_reached_says_how_far_it_came(monkeypatch):
    monkeypatch.setattr("eitsim.electrics.outline.adapted_mesh._STEPS", 2)
    with pytest.raises(NotConverged, match=r"known to .* only, 1e-09 was asked for"):
        solve_untouched(RECTANGLE.outline, Scene(RECTANGLE).electrodes, 1.1 * S, 1e-9)


def test_discs_are_solved_without_the_mesher_and_outlines_say_what_to_install():
    code = ("import sys; sys.modules['pythoncdt'] = None\n"
            "from eitsim.electrics.forward.untouched import untouched_readings as read\n"
            "from eitsim.scene.edges.outline import Outline\nfrom eitsim.scene.scene import Body, Scene\n"
            "print(read(Scene(), 6e-4).size)\n"
            "read(Scene(Body(Outline('rectangle', width_m=0.12, height_m=0.1))), 6e-4)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "208"
    assert "need pythoncdt, which is not installed; run pip install '.[outlines]'" in done.stderr
