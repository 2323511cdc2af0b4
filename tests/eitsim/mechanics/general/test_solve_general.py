"""Touches solved together in three dimensions, against those solved alone, about an axis, and against symmetry."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.general import solve_general as general
from eitsim.mechanics.general.layer.layer_surface import principal_stretches
from eitsim.mechanics.general.layer.lone_touches import lone_surface
from eitsim.mechanics.general.meshing.levels import COARSE, FINE, ROUGH, Level
from eitsim.mechanics.general.solve_general import GeneralSolution, predicted_cpu_s, solve_general, solved_finer
from eitsim.mechanics.general.solved_layer import equilibrium, lone_touches, problem
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.outline import Outline
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.sheet.sheet_conductance import driving_strains, stretches
from eitsim.simulation.near_edges import solve_near_rim
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.errors import NotConverged

LAW = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
SKIN = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
FLAT = Punch(diameter_m=0.014, force_N=1.0)
ROUGHER, ROUGHEST = Level(12.0, 1.2, 0.9, 0.6, 8), Level(16.0, 1.5, 1.0, 0.8, 6)


def _solved(body: Body, *punches: Punch) -> GeneralSolution:
    return solve_general(LAW, body, punches, level=ROUGH, coarser=ROUGHER)


@pytest.fixture(scope="module")
def alone() -> GeneralSolution:
    return _solved(Body(Disc(0.1)), FLAT)


@pytest.mark.thorough
def test_one_touch_is_the_axisymmetric_one(alone: GeneralSolution) -> None:
    exact, (touch,) = solve_touch(LAW, Body(Disc(0.1)), FLAT), alone.touches
    assert abs(touch.depth_m / exact.depth_m - 1) < min(2e-3, 2 * touch.depth_error)
    assert touch.contact_area_m2 == pytest.approx(exact.contact_area_m2, rel=0.01)
    assert touch.contact_radius_m == pytest.approx(exact.contact_radius_m, rel=0.02)
    assert (touch.force_N, touch.sigma_ave_Pa) == (pytest.approx(1.0), pytest.approx(exact.sigma_ave_Pa, rel=0.01))
    angle = np.linspace(0, 2 * np.pi, 9)[:-1]
    radius = np.linspace(0.0, 0.02, 200)
    points = radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    metric, normal = alone.field.metric(points)
    found = driving_strains(*principal_stretches(metric), normal)
    expected = driving_strains(*stretches(exact, radius))[..., None]
    missed = np.sqrt(np.sum((found - expected) ** 2 * radius[:, None], axis=(1, 2)))
    assert np.all(missed < 0.03 * np.sqrt(8 * np.sum(expected**2 * radius[:, None], axis=(1, 2))))


def test_the_skin_reads_it_as_the_axisymmetric_touch(alone: GeneralSolution) -> None:
    body, exact = Body(Disc(0.1)), solve_touch(LAW, Body(Disc(0.1)), FLAT)
    sensor = body, Skin(strain="principal"), Electrodes(), Drive()
    expected, found = (solve(*sensor, ((FLAT, touch),), SKIN, method="mesh").signal_V for touch in (
        exact, alone.touches[0]))
    assert np.linalg.norm(found - expected) < 0.02 * np.linalg.norm(expected)


@pytest.mark.slow
def test_a_kept_depth_gives_the_force_back(alone: GeneralSolution) -> None:
    (touch,) = _solved(Body(Disc(0.1)), Punch(diameter_m=0.014, depth_m=alone.touches[0].depth_m)).touches
    assert touch.depth_m == pytest.approx(alone.touches[0].depth_m, rel=1e-12)
    assert touch.force_N == pytest.approx(1.0, rel=0.01)


def test_the_mesh_leaves_the_skin_far_from_a_touch_as_it_was(alone: GeneralSolution) -> None:
    far = np.array([[0.06, 0.0], [-0.05, 0.07]])
    metric, normal = alone.field.field.metric(far)
    assert np.array_equal(metric, np.tile(np.eye(2), (2, 1, 1)))
    assert np.array_equal(normal, np.ones(2))
    assert np.array_equal(alone.field.field.displacement(far), np.zeros((2, 3)))


@pytest.mark.slow
def test_two_equal_touches_mirror_each_other() -> None:
    body = Body(Outline("rectangle", width_m=0.07, height_m=0.04))
    one, other = (Punch(x_m=x, diameter_m=0.01, force_N=0.3) for x in (-0.012, 0.012))
    first, second = _solved(body, one, other).touches
    assert first.depth_m == pytest.approx(second.depth_m, rel=2e-3)
    lone = solve_touch(LAW, Body(Disc(0.1)), one)
    assert first.depth_m == pytest.approx(lone.depth_m, rel=0.03)
    assert first.surface is second.surface


@pytest.mark.slow
def test_near_the_rim_it_is_what_the_rim_changes_of_the_axisymmetric_touch() -> None:
    body, punch = Body(Disc(0.05)), Punch(x_m=0.039, diameter_m=0.01, force_N=0.5)
    near, (touch,) = solve_near_rim(LAW, body, punch), _solved(body, punch).touches
    alone = solve_touch(LAW, body, punch)
    assert touch.depth_m == pytest.approx(near.depth_m, rel=0.01)
    assert touch.depth_m > 1.01 * alone.depth_m


@pytest.mark.thorough
@pytest.mark.parametrize("punch", [
    replace(FLAT, friction="stick"),
    pytest.param(replace(FLAT, depth_m=0.003, force_N=None, friction="coulomb", friction_coefficient=0.3),
                 marks=pytest.mark.slow)], ids=["stick", "coulomb"])
def test_a_punch_that_rubs_holds_the_layer_as_it_does_about_its_axis(punch: Punch) -> None:
    body, radius = Body(Disc(0.1)), np.linspace(0.0, 0.007, 30)
    points, moved = np.column_stack([radius * np.cos(0.3), radius * np.sin(0.3)]), []
    for each in (punch, replace(punch, friction="none")):
        lone = lone_touches(LAW, body, [each])
        found = equilibrium(problem(LAW, body, [each], lone, ROUGH), lone, body.thickness_m)
        exact = lone_surface(lone[0]).displacement(points / body.thickness_m) * body.thickness_m
        moved.append((found.field.displacement(points)[:, :2], exact[:, :2]))
        # the mesh leaves as much of both
        assert found.depths[0] == pytest.approx(lone[0].state.depth, rel=0.03)
    (rough, held), (_, free) = moved
    assert np.linalg.norm(held - free) > 0.5 * np.linalg.norm(free)
    assert np.linalg.norm(rough - held) < 0.05 * np.linalg.norm(held - free)


@pytest.mark.slow
def test_a_near_equilibrium_is_a_start() -> None:
    """Two punches 2 mm from each other, one of which rubs: the sum of the lone touches is further from equilibrium than
    what is known on a coarser mesh, or under less force."""
    body, pair = Body(Disc(0.1)), (FLAT, replace(FLAT, x_m=0.016, friction="coulomb", friction_coefficient=0.3))
    less = tuple(replace(punch, force_N=0.9 * (punch.force_N or 0.0)) for punch in pair)
    of_less, lone = (lone_touches(LAW, body, punches) for punches in (less, pair))
    coarse = equilibrium(problem(LAW, body, pair, lone, ROUGHER), lone, body.thickness_m)
    before = equilibrium(problem(LAW, body, less, of_less, ROUGH), of_less, body.thickness_m)
    by_sum, finer, more = (equilibrium(problem(LAW, body, pair, lone, ROUGH), lone, body.thickness_m, start)
                           for start in (None, coarse, before))
    for found in (finer, more):
        assert found.depths == pytest.approx(by_sum.depths, rel=1e-5)
        assert len(found.residuals) <= len(by_sum.residuals)
        assert found.residuals[0] < 0.5 * by_sum.residuals[0]


@pytest.mark.slow
def test_requested_errors_choose_a_finer_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = solve_general(LAW, Body(Disc(0.1)), [Punch(x_m=0.08, force_N=0.5)], level=ROUGHER, coarser=ROUGHEST)
    errors = plain.touches[0].signal_errors
    asked = np.where(np.arange(3) == 1, 0.9 * errors, np.inf)
    finer = solved_finer(plain, errors, asked, ROUGH)
    assert finer is not None
    assert finer.coarser is plain.corrected
    assert np.all(finer.touches[0].signal_errors < errors)
    assert finer.cpu_s > plain.cpu_s
    assert solved_finer(plain, errors, np.full(3, np.inf), ROUGH) is None
    assert solved_finer(plain, errors, 0.1 * asked, ROUGH) is None
    assert solved_finer(plain, errors, asked, ROUGHER) is None
    # less than half of what is left need not do, and what was read of both counts, not what their moments say
    assert solved_finer(plain, errors, 0.45 / 0.9 * asked, ROUGH) is not None
    assert solved_finer(plain, 0.5 * errors, asked, ROUGH) is None
    monkeypatch.setattr(general, "MOST_S", 0.0)
    assert solved_finer(plain, errors, asked, ROUGH) is None


@pytest.mark.thorough
def test_floors_of_the_errors_are_those_of_the_finer_mesh(alone: GeneralSolution) -> None:
    """Where both meshes agree the floor is left: in proportion to the elements of the finer one."""
    same = [general._compared(alone.of, alone.corrected, alone.corrected, level, 0.0).touches[0].signal_errors
            for level in (COARSE, FINE)]
    assert same[1] == pytest.approx(same[0] / 2)
    assert np.all(same[0] >= general.SIGNAL_FLOOR)


def test_a_search_without_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(general, "_FACTORISATIONS", 2)
    with pytest.raises(NotConverged, match="given up"):
        solve_general(LAW, Body(Disc(0.1)), [FLAT], level=ROUGHER, coarser=ROUGHER)


def test_overlap_is_refused() -> None:
    with pytest.raises(ValueError, match="another punch"):
        _solved(Body(Disc(0.1)), Punch(x_m=-0.006), Punch(x_m=0.007))


def test_the_cost_is_predicted_from_the_mesh_of_the_solution(alone: GeneralSolution) -> None:
    body, levels = Body(Disc(0.1)), (ROUGHER, ROUGH)
    lone = lone_touches(LAW, body, [FLAT])
    cpu_s = predicted_cpu_s([problem(LAW, body, [FLAT], lone, level) for level in levels], levels, lone)
    assert 1 / 5 < cpu_s / alone.cpu_s < 5


@pytest.mark.slow
@pytest.mark.parametrize("punch", [
    FLAT, Punch(diameter_m=0.014, force_N=0.2), Punch(diameter_m=0.014, force_N=2.0),
    Punch(profile="sphere", diameter_m=0.02), Punch(profile="cone", force_N=0.5),
    Punch(profile="ellipse", force_N=0.5, fillet_m=0.001)], ids=str)
def test_depths_are_within_a_thousandth_and_within_what_is_stated(punch: Punch) -> None:
    body = Body(Disc(0.1))
    exact, (touch,) = solve_touch(LAW, body, punch), solve_general(LAW, body, [punch], level=COARSE).touches
    assert abs(touch.depth_m / exact.depth_m - 1) < min(1e-3, touch.depth_error)
