"""Touches on curved bodies: a cap's exact one, the flat limit, symmetries, poses, and the field in space."""

import contextlib
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.continuation import BottomedOut
from eitsim.mechanics.axisymmetric.indentation import first_touch
from eitsim.mechanics.axisymmetric.solve_axisymmetric import (
    Unresolved,
    at_depth,
    force_unit,
    mesh_hierarchy,
    under_force,
)
from eitsim.mechanics.curved import solve_on_surface as on_surface
from eitsim.mechanics.curved.solve_on_surface import CurvedSolution, alone_on_balls, solve_on_surface, unfit
from eitsim.mechanics.general.meshing.levels import FINE, ROUGH, Level
from eitsim.mechanics.general.solve_general import solve_general
from eitsim.mechanics.solid.cap_grid import on_cap
from eitsim.mechanics.solid.grid import Grid, tensor_grid
from eitsim.scene.edges.disc import Disc
from eitsim.scene.scene import Body, Punch, profile_of
from eitsim.scene.surfaces.curved_surface import CurvedSurface
from eitsim.scene.surfaces.cylinder import Cylinder
from eitsim.scene.surfaces.saddle import Saddle
from eitsim.scene.surfaces.sphere import Sphere
from eitsim.scene.surfaces.triangle_surface import TriangleSurface
from matcal.laws.neo_hooke import NeoHooke
from touchcal.errors import NotConverged

LAW = NeoHooke(1e4, 0.25)
THICKNESS_M = 0.01
BALL = Punch(profile="sphere", diameter_m=0.02, depth_m=0.003)
ROUGHER = Level(12.0, 1.2, 0.9, 0.6, 8)
# Force, mu mm^2, on a ball of 10 mm radius 3 mm deep, of triquadratic bricks (benchmarks/peers/hexahedra.py, 1.6 mm;
# on a flat layer they leave 0.16 %).
BRICKS = {"flat": 110.148, "cylinder": 98.884, "sphere": 88.719}


def _pressed(surface: CurvedSurface, place: list[float], punch: Punch = BALL) -> CurvedSolution:
    return solve_on_surface(LAW, surface, THICKNESS_M, [punch], np.array([place]), level=ROUGH, coarser=ROUGHER)


@pytest.fixture(scope="module")
def cylinder() -> CurvedSolution:
    return _pressed(Cylinder(0.04, 0.3), [0.01, 0.02, 0.03])


def _on_cap(curvature_per_m: float, depth: float) -> float:
    """Force, mu mm^2, of the axisymmetric touch."""
    punch = replace(BALL, fillet_m=profile_of(BALL).edge_radius)
    levels = mesh_hierarchy(LAW, Body(Disc(0.06)), punch, None, None, curvature_per_m=curvature_per_m)
    return at_depth(levels, depth)[-1].force * 100


def test_a_grid_on_a_cap_fills_its_shell() -> None:
    exact = 2 * np.pi / 3 * (4**3 - 3**3) * (1 - np.cos(4 * 0.25))
    grids = [tensor_grid(np.linspace(0, 4, count), np.linspace(-1, 0, 3)) for count in (5, 9)]
    coarse, fine = (abs(on_cap(grid, 0.25).weight.sum() / exact - 1) for grid in grids)
    assert fine < coarse / 8
    assert fine < 1e-4
    with pytest.raises(ValueError, match="does not fit"):
        on_cap(grids[0], 1.1)


@pytest.mark.parametrize("curvature", [1.5, -1.5])
def test_a_cap_reaches_to_the_centre_of_its_ball_and_half_around_it(curvature: float) -> None:
    """A little less than either fits, a little more does not; a hollow has no centre below it."""
    half, deep = np.pi / abs(curvature), 1 / abs(curvature)

    def cap(length: float, depth: float) -> Grid:
        return on_cap(tensor_grid(np.linspace(0, length, 5), np.linspace(-depth, 0, 3)), curvature)

    far = cap(0.999 * half, 0.1).nodes
    assert np.hypot(far[-1, 0], far[-1, 1] + 1 / curvature) == pytest.approx(deep, rel=1e-9)
    with pytest.raises(ValueError, match="does not fit"):
        cap(1.001 * half, 0.1)
    cap(0.5, 0.999 * deep)
    with pytest.raises(ValueError, match="does not fit") if curvature > 0 else contextlib.nullcontext():
        cap(0.5, 1.001 * deep)


@pytest.mark.thorough
def test_a_cap_is_pressed_as_bricks_say_and_a_flat_layer_is_its_limit() -> None:
    flat, cap = _on_cap(0.0, 0.3), _on_cap(25.0, 0.3)
    assert cap / flat == pytest.approx(BRICKS["sphere"] / BRICKS["flat"], rel=1e-3)
    assert cap == pytest.approx(BRICKS["sphere"], rel=3e-3)
    assert _on_cap(1e-4, 0.3) == pytest.approx(flat, rel=1e-5)


def test_a_hollow_cap_is_touched_first_at_the_punch_s_edge() -> None:
    levels = mesh_hierarchy(LAW, Body(Disc(0.04)), Punch(), None, None, curvature_per_m=-25.0)
    inner = 7.0 - 0.5  # mm
    assert first_touch(levels[-1]) * 10 == pytest.approx(-(40 - np.sqrt(40**2 - inner**2)), rel=0.1)
    state = under_force(levels, 1.0 / force_unit(LAW, Body()))[-1]
    assert state.depth - first_touch(levels[-1]) > 0


@pytest.mark.slow
def test_a_cylinder_is_pressed_as_bricks_say(cylinder: CurvedSolution) -> None:
    (touch,) = cylinder.touches
    assert touch.force_N * 100 / _on_cap(0.0, 0.3) == pytest.approx(BRICKS["cylinder"] / BRICKS["flat"], rel=2e-3)


@pytest.mark.slow
def test_a_field_in_space_is_the_identity_far_off_and_turns_with_the_body(cylinder: CurvedSolution) -> None:
    surface, field = Cylinder(0.04, 0.3), cylinder.field
    far = surface.nearest(np.array([[-0.1, 0.0, 1.0], [0.0, -1.0, -1.5]]))[0]
    assert field.deformation_gradient(far) == pytest.approx(np.tile(np.eye(3), (2, 1, 1)), abs=1e-12)
    assert field.displacement(far) == pytest.approx(np.zeros((2, 3)), abs=1e-12)
    (place,), (normal,) = surface.nearest(np.array([[0.01, 0.02, 0.03]]))
    moved = field.displacement(place[None])[0]
    assert moved == pytest.approx(-0.003 * normal, abs=2e-5)
    across = np.cross(normal, [1.0, 0.0, 0.0])
    sides = surface.nearest(place + 0.004 * np.array([across, -across, [1, 0, 0], [-1, 0, 0]]))[0]
    gradient = field.deformation_gradient(sides)
    turned = [float(across @ gradient[0] @ across), float(across @ gradient[1] @ across)]
    assert turned[0] == pytest.approx(turned[1], abs=0.02)
    assert gradient[2, 0, 0] == pytest.approx(gradient[3, 0, 0], abs=0.02)


@pytest.mark.slow
def test_the_gradient_in_space_is_that_of_the_displacement(cylinder: CurvedSolution) -> None:
    chart = Cylinder(0.04, 0.3).chart_about(np.array([0.01, 0.02, 0.03]))
    uv, step = np.array([[0.012, 0.001], [-0.004, 0.013]]), 1e-5
    for way in np.eye(2):
        ahead, back = (chart.place(uv + sign * step * way)[0] for sign in (1, -1))
        change = (cylinder.field.displacement(ahead) - cylinder.field.displacement(back)) / (2 * step)
        along = (ahead - back) / (2 * step)
        gradient = cylinder.field.deformation_gradient(chart.place(uv)[0]) - np.eye(3)
        assert (gradient @ along[..., None])[..., 0] == pytest.approx(change, abs=0.02)


@pytest.mark.slow
def test_a_sphere_gives_the_cap_and_a_wide_cylinder_that_of_its_mean_curvature() -> None:
    (touch,) = _pressed(Sphere(0.04), [0.0, 0.03, 0.01]).touches
    assert touch.force_N * 100 == pytest.approx(_on_cap(25.0, 0.3), rel=1e-4)
    (wide,) = _pressed(Cylinder(3.0, 0.5), [0.0, 0.0, 3.0]).touches
    assert wide.force_N * 100 == pytest.approx(_on_cap(1 / 6, 0.3), rel=1e-3)


@pytest.mark.slow
def test_requested_errors_choose_finer_elements_on_a_cap() -> None:
    def errors(requested: np.ndarray) -> np.ndarray:
        return solve_on_surface(LAW, Sphere(0.04), THICKNESS_M, [BALL], np.array([[0.0, 0.02, 0.03]]),
                                requested=requested).touches[0].signal_errors

    plain = errors(np.full(3, np.inf))
    assert np.all(errors(np.where(np.arange(3) == 1, 0.9 * plain, np.inf)) < plain)


def test_a_cap_that_default_elements_do_not_resolve_is_solved_on_finer_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[bool] = []

    def solved(*_: object, finer: bool = False) -> None:
        tried.append(finer)
        raise (NotConverged if finer else Unresolved)("no need to solve it")

    monkeypatch.setattr(on_surface, "solve_on_cap", solved)
    with pytest.raises(NotConverged):
        solve_on_surface(LAW, Sphere(0.04), THICKNESS_M, [BALL], np.array([[0.0, 0.02, 0.03]]))
    assert tried == [False, True]


@pytest.mark.parametrize(("ends", "served"), [(NotConverged, True), (BottomedOut, False)])
def test_a_cap_without_end_on_finer_elements_keeps_the_default_ones(
        monkeypatch: pytest.MonkeyPatch, ends: type[NotConverged], served: bool) -> None:
    touch = SimpleNamespace(signal_errors=np.full(3, 0.1))

    def solved(*_: object, finer: bool = False) -> tuple[SimpleNamespace, None]:
        if finer:
            raise ends("no need to solve it")
        return touch, None

    monkeypatch.setattr(on_surface, "solve_on_cap", solved)
    how = LAW, Sphere(0.04), THICKNESS_M, [BALL], np.array([[0.0, 0.02, 0.03]])
    if served:
        assert solve_on_surface(*how, requested=np.full(3, 0.05)).touches == (touch,)
    else:
        with pytest.raises(BottomedOut):
            solve_on_surface(*how, requested=np.full(3, 0.05))


def test_requested_errors_decide_on_the_finest_mesh_in_three_dimensions(monkeypatch: pytest.MonkeyPatch) -> None:
    given, asked, read = [], np.array([0.01, np.inf, np.inf]), np.full(3, 0.02)

    def decided(found: object, errors: np.ndarray, requested: np.ndarray, finest: Level) -> None:
        given.append((errors is read, requested is asked, finest))
        raise NotConverged("no need to solve it")

    monkeypatch.setattr(on_surface, "solve_general", lambda *_, level, **__: SimpleNamespace(
        level=level, touches=[SimpleNamespace(signal_errors=read)]))
    monkeypatch.setattr(on_surface, "solved_finer", decided)
    with pytest.raises(NotConverged):
        solve_on_surface(LAW, Cylinder(0.04, 0.3), THICKNESS_M, [BALL], np.array([[0.0, 0.0, 0.04]]), requested=asked)
    assert given == [(True, True, FINE)]


def test_one_upright_punch_on_a_sphere_is_a_cap_s() -> None:
    places = np.array([[0.0, 0.0, 0.04], [0.04, 0.0, 0.0]])
    leaning = replace(BALL, tilt_rad=0.1)
    assert alone_on_balls(Sphere(0.04), 0.005, [BALL, leaning], places) == 1
    assert alone_on_balls(Cylinder(0.04, 0.3), 0.005, [BALL, BALL], places) == 0


@pytest.mark.slow
def test_a_saddle_looks_the_same_a_quarter_turn_on_upside_down() -> None:
    one, other = (_pressed(Saddle(*radii), [0.0, 0.0, 0.0]).touches[0].force_N for radii in (
        (0.05, -0.04), (-0.04, 0.05)))
    assert one == pytest.approx(other, rel=1e-3)


@pytest.mark.slow
def test_a_tilt_by_nothing_and_a_turn_of_the_tilt_change_nothing() -> None:
    punch, body = Punch(diameter_m=0.014, fillet_m=0.002, force_N=0.5), Body(Disc(0.1))

    def depth(**tilt: float) -> float:
        return solve_general(LAW, body, [replace(punch, **tilt)], level=ROUGH, coarser=ROUGHER).touches[0].depth_m

    upright = depth()
    assert depth(tilt_rad=1e-6) == pytest.approx(upright, rel=1e-3)
    leaning = [depth(tilt_rad=np.deg2rad(5), tilt_direction_rad=turn) for turn in (0.0, 0.7)]
    assert leaning[0] == pytest.approx(leaning[1], rel=5e-3)
    assert leaning[0] > 1.05 * upright


@pytest.mark.slow
def test_a_punch_that_stands_on_its_edge_takes_nothing_from_an_upright_one() -> None:
    punch = Punch(diameter_m=0.012, force_N=1.0, tilt_rad=np.deg2rad(8))
    found = solve_general(NeoHooke(3e5, 0.25), Body(Disc(0.06), 0.006), [punch], level=ROUGH, coarser=ROUGHER)
    (touch,) = found.touches
    half_m2 = np.pi * punch.diameter_m**2 / 8
    assert 0.02 * half_m2 < touch.contact_area_m2 < half_m2
    assert touch.contact_area_error is not None
    assert touch.contact_area_error < 1
    assert touch.sigma_ave_Pa < touch.sigma_max_Pa
    assert found.field.alone == ()
    away = np.array([[-0.02, 0.0]])
    np.testing.assert_array_equal(found.field.displacement(away), found.field.field.displacement(away))


def test_bodies_that_are_too_small_are_refused() -> None:
    with pytest.raises(ValueError, match="thickness_mm"):
        _pressed(Sphere(0.0105), [0, 0, 1])
    with pytest.raises(ValueError, match="do not fit"):
        _pressed(Cylinder(0.0115, 0.1), [0, 0, 1])


def test_a_refusal_names_the_hole_of_a_file_next_to_a_punch() -> None:
    along = np.linspace(-0.08, 0.08, 33)
    x, y = (part.ravel() for part in np.meshgrid(along, along))
    corner = np.arange(33 * 33).reshape(33, 33)[:-1, :-1].ravel()
    cells = np.vstack([corner[:, None] + [0, 1, 34], corner[:, None] + [0, 34, 33]])
    holed = np.delete(cells, np.argmin(np.hypot(x[cells].mean(axis=1), y[cells].mean(axis=1))), axis=0)
    places, punches = np.array([[0.015, 0.0, 0.04]]), [Punch(diameter_m=0.014, force_N=1.0)]
    whole, broken = (TriangleSurface(np.column_stack([x, y, 0.04 - x**2 / 0.4]), some) for some in (cells, holed))
    assert not unfit(whole, 0.008, punches, places)
    assert re.search(r"whose triangles end 1\d(\.\d)? mm away at \([\d.e-]+, [\d.e-]+, 40\) mm; fill the hole there",
                     unfit(broken, 0.008, punches, places))


def test_a_refusal_names_punches_by_their_numbers_among_all() -> None:
    places = np.array([[-0.2, 0.0, 0.045], [0.1, 0.0, 0.045], [0.11, 0.0, 0.045]])
    assert "the edge of punch 1 (from 0)" in unfit(Cylinder(0.045, 0.6), 0.008, [Punch(diameter_m=0.014)] * 3, places)
