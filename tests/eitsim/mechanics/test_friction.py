"""Friction: derivatives, limits of Coulomb's law, balance of forces and energy, the half-space, forces and depths."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric import friction_increments
from eitsim.mechanics.axisymmetric.continuation import cold_start
from eitsim.mechanics.axisymmetric.hold import solve_hold
from eitsim.mechanics.axisymmetric.indentation import Equilibrium, contact_state, nearest, seen
from eitsim.mechanics.axisymmetric.solve_axisymmetric import force_unit, mesh_hierarchy, solve_path, solve_touch
from eitsim.mechanics.contact import friction
from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact.punch_contact import RigidPunch
from eitsim.mechanics.general.layer import lone_touches
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.edges.disc import Disc
from eitsim.scene.profiles.rounded_cone import Flat
from eitsim.scene.scene import Body, Hold, Punch
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import scaled
from matcal.laws.prony import Prony
from touchcal.errors import NotConverged

TABLE_1 = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
PUNCHES = {"flat": RigidPunch(Flat(0.7, 0.05), 1e4), "sphere": RigidPunch(Flat(0.7, 0.7), 1e4),
           "cone": RigidPunch(Flat(0.7, 0.05, 0.2), 1e4)}


def coarse(punch=None, size=2.0):
    punch = punch or Punch()
    return mesh_hierarchy(TABLE_1, Body(), punch, size * default_element_m(Body(), punch), None)[-1]


def pressed(model, coefficient, force_N, count=4):
    force = force_N / force_unit(TABLE_1, Body())
    return friction_increments.loaded(model, coefficient, friction_increments.at_rest(model), force, count)[1]


@pytest.mark.parametrize("name", PUNCHES)
def test_the_arc_is_the_length_of_the_profile(name):
    punch = PUNCHES[name].profile
    inner = punch.radius - punch.edge_radius
    angle = np.linspace(punch.slope, np.pi / 2, 2001)
    top = punch.edge_radius + inner * np.tan(punch.slope)
    ends = angle * 0 + punch.slope
    tip = punch.edge_radius * np.column_stack([np.sin(ends), 1 - np.cos(ends)])[:1]
    edge = np.array([inner, top]) + punch.edge_radius * np.column_stack([np.sin(angle), -np.cos(angle)])
    line = np.vstack([[0.0, 0.0], tip, np.linspace(tip[0], edge[0], 50)[1:], edge[1:], [punch.radius, top + 0.3]])
    length = np.cumsum(np.hypot(*np.diff(line, axis=0).T))
    assert punch.arc_length(*line.T)[1:] == pytest.approx(length, abs=1e-4)


@pytest.mark.parametrize("coefficient", [0.2, np.inf])
def test_derivatives_of_the_potential_equal_differences(coefficient):
    model, random = coarse(size=4.0), np.random.default_rng(1)
    found, h = pressed(model, coefficient, 0.5, 2), 1e-6
    springs, facets, nodes = found.springs, model.facets, len(model.grid.nodes)
    base, way = 1e-3 * random.standard_normal((nodes, 2)), random.standard_normal((nodes, 2))
    base += axisymmetric_assembly.nodal(model.grid, found.state.x[:-1])

    def at(step):
        return friction.moved(facets, base + step * way, found.state.x[-1] + step)

    slopes = [friction.shear(springs, at(step)).slope for step in (-h, h)]
    smooth = slopes[0] == slopes[1]
    springs = replace(springs, limit=np.where(smooth, springs.limit, 0.0))
    assert smooth.mean() > 0.9
    push, down = friction.forces(springs, facets, at(0.0))
    slope = (friction.energy(springs, facets, at(h)) - friction.energy(springs, facets, at(-h))) / (2 * h)
    assert slope == pytest.approx(float(np.sum(push * way[facets.nodes])) + down, rel=1e-7)
    blocks, border, corner = friction.tangent(springs, facets, at(0.0))
    (ahead, more), (behind, less) = (friction.forces(springs, facets, at(step)) for step in (h, -h))
    turned = np.einsum("faibj,fbj->fai", blocks, way[facets.nodes]) + border
    assert (ahead - behind) / (2 * h) == pytest.approx(turned, rel=1e-6, abs=1e-6 * np.abs(turned).max())
    assert (more - less) / (2 * h) == pytest.approx(float(np.sum(border * way[facets.nodes])) + corner, rel=1e-6)


@pytest.mark.thorough
def test_a_vanishing_coefficient_is_no_friction_and_a_large_one_sticks():
    model = coarse()
    free = cold_start(model, 0.5 / force_unit(TABLE_1, Body())).depth
    assert pressed(model, 1e-7, 0.5).state.depth == pytest.approx(free, rel=1e-4)
    stick = pressed(model, np.inf, 0.5, 32)
    assert pressed(model, 1e3, 0.5, 32).state.depth == pytest.approx(stick.state.depth, rel=1e-4)
    assert stick.slipping == 0


def test_more_friction_means_less_depth_and_less_slip_at_small_strain():
    model = coarse(size=4.0)
    found = [pressed(model, c, 0.1, 8) for c in (0.05, 0.2, 0.8)]
    depths, slips = [f.state.depth for f in found], [f.slipping for f in found]
    assert depths == sorted(depths, reverse=True)
    assert slips == sorted(slips, reverse=True)
    assert slips[0] > 0.9
    assert slips[-1] < 0.1


@pytest.mark.parametrize("coefficient", [0.3, np.inf])
def test_the_punch_and_the_foam_push_as_hard_as_the_force(coefficient):
    model = coarse()
    found = pressed(model, coefficient, 0.5)
    push = contact.forces(model.punch, model.facets, contact_state(model, found.state.x))[1]
    rub = friction.forces(found.springs, model.facets, seen(model, found.state.x))[1]
    assert push + rub == pytest.approx(found.state.force, rel=1e-8)
    assert rub > 0
    at, shear = nearest(model, found.state.x), friction.shear(found.springs, seen(model, found.state.x))
    pressure = contact.pressure(model.punch, np.maximum(at.penetration, 0))
    if np.isfinite(coefficient):
        assert np.all(np.abs(shear.size) <= coefficient * pressure + 1e-2 * pressure.max())


def course_of_energy(model, coefficient, force_N, count):
    """Work of the punch and the parts it goes to: foam, contact, springs, slip."""
    force, now = force_N / force_unit(TABLE_1, Body()), friction_increments.at_rest(model)
    forces, depths = [0.0], [0.0]
    for k in range(1, count + 1):
        _, now = friction_increments.loaded(model, coefficient, now, force * k / count, 1)
        forces.append(now.state.force)
        depths.append(now.state.x[-1])
    work = float(np.sum(np.diff(depths) * (np.array(forces)[1:] + np.array(forces)[:-1]) / 2))
    x = now.state.x
    spring = friction.shear(now.springs, seen(model, x)).size
    parts = [
        axisymmetric_assembly.energy(model.law, model.grid, x[:-1]),
        contact.energy(model.punch, model.facets, contact_state(model, x)),
        float(np.sum(model.facets.weight * spring**2)) / (2 * now.springs.stiffness),
        now.dissipated,
    ]
    return work, parts


@pytest.mark.parametrize("coefficient", [0.1, np.inf])
def test_work_is_stored_or_lost_to_slip(coefficient):
    work, (foam, penetration, springs, slip) = course_of_energy(coarse(size=4.0), coefficient, 0.1, 32)
    assert foam + penetration + springs + slip == pytest.approx(work, rel=1e-3)
    assert penetration + springs < 5e-3 * work
    assert slip == 0 if np.isinf(coefficient) else slip > 5e-3 * work


@pytest.mark.thorough
def test_a_flat_punch_that_sticks_to_a_half_space_is_stiffer_by_log_3():
    """Ratio of forces at a small depth, nu = 0; Spence, Proc. R. Soc. Lond. A 305 (1968) 55, after Mossakovskii."""
    body = Body(Disc(0.4), 0.2)
    punch = Punch(diameter_m=8e-3, force_N=1e-4, fillet_m=1e-4)
    free, stick = (solve_touch(TABLE_1, body, replace(punch, friction=f), element_m=2 * default_element_m(body, punch))
                   for f in ("none", "stick"))
    assert free.depth_m / stick.depth_m == pytest.approx(np.log(3), rel=2e-3)


def test_a_prescribed_depth_is_the_inverse_of_the_force():
    punch = Punch(friction="stick", force_N=0.3)
    size = 2 * default_element_m(Body(), punch)
    forced = solve_touch(TABLE_1, Body(), punch, element_m=size)
    pushed = solve_touch(TABLE_1, Body(), replace(punch, force_N=None, depth_m=forced.depth_m), element_m=size)
    assert pushed.depth_m == pytest.approx(forced.depth_m, rel=1e-5)
    assert pushed.force_N == pytest.approx(0.3, rel=2e-3)


def test_a_path_serves_the_forces_on_its_way():
    punch = Punch(friction="stick")
    size = 2 * default_element_m(Body(), punch)
    path = solve_path(TABLE_1, Body(), punch, [0.1, 0.3], element_m=size)
    alone = solve_touch(TABLE_1, Body(), replace(punch, force_N=0.3), element_m=size)
    assert path[1].depth_m == pytest.approx(alone.depth_m, rel=2e-3)
    assert path[0].depth_m < path[1].depth_m
    assert path[1].slip_fraction == 0


def test_a_hold_that_keeps_the_deformation_relaxes_friction_with_the_rest():
    law, series = replace(TABLE_1, moduli="instantaneous"), Prony(np.array([0.5]), np.array([10.0]))
    punch = Punch(friction="stick", force_N=None, depth_m=5e-4)
    size = 2 * default_element_m(Body(), punch)
    (_, first), (_, last) = solve_hold(law, series, Body(), punch, Hold((1e6,), "depth"), element_m=size)
    assert last.force_N == pytest.approx(first.force_N / 2, rel=1e-6)
    with pytest.raises(ValueError, match="friction"):
        solve_hold(law, series, Body(), punch, Hold((1e6,), "force", loading_s=1.0), element_m=size)


@pytest.mark.slow
@pytest.mark.parametrize("friction_of", [{"friction": "stick"}, {"friction": "coulomb", "friction_coefficient": 0.3}])
def test_friction_loaded_slowly_and_fast_reaches_that_of_the_relaxed_and_the_stiff_foam(friction_of):
    law, series = replace(TABLE_1, moduli="instantaneous"), Prony(np.array([0.5]), np.array([10.0]))
    punch = Punch(force_N=0.3, **friction_of)
    size = 2 * default_element_m(Body(), punch)
    slow, *_, late = (touch for _, touch in solve_hold(
        law, series, Body(), punch, Hold((10.0, 1e5), "force", loading_s=1e6), element_m=size))
    fast, *_, crept = (touch for _, touch in solve_hold(
        law, series, Body(), punch, Hold((10.0, 1e5), "force", loading_s=1e-4), element_m=size))
    soft, stiff = (solve_touch(scaled(law, share), Body(), punch, element_m=size) for share in (0.5, 1.0))
    for held, elastic in ((slow, soft), (late, soft), (fast, stiff)):
        assert abs(held.depth_m / elastic.depth_m - 1) < held.depth_error + elastic.depth_error < 0.01
    assert crept.depth_m == pytest.approx(soft.depth_m, rel=0.02)
    assert crept.force_N == pytest.approx(0.3, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("diameter_mm", "force_N", "depth_mm"), [(10, 2, 7.431), (14, 1, 3.438), (18, 0.5, 0.8123)])
def test_depths_converge_in_increments_and_elements(diameter_mm, force_N, depth_mm):
    """Depths in 64 increments on one mesh, known to about 0.05 %."""
    touch = solve_touch(TABLE_1, Body(), Punch(diameter_m=diameter_mm * 1e-3, force_N=force_N, friction="stick"))
    assert touch.depth_m * 1e3 == pytest.approx(depth_mm, rel=2e-3)
    assert abs(touch.depth_m * 1e3 / depth_mm - 1) < touch.depth_error + 5e-4


@pytest.mark.parametrize("jump", [4e-5, 1e-2])
def test_a_depth_inside_a_jump_is_unsettled_and_no_depth_where_it_is_large(jump, monkeypatch):
    """A course whose depth is 0.2 of its force, and jumps at 1.0; passes that end later make small jumps."""
    def at(force):
        depth = 0.2 * force * (1 + jump * (force > 1.0))
        return friction_increments.Loaded(Equilibrium(np.zeros(1), np.array([0.2]), force, depth, ()), np.zeros(0),
                                          None, 1e-7, 0.0, 0.0)

    monkeypatch.setattr(friction_increments, "_in_halves", lambda model, coefficient, before, force, settle: at(force))
    depth, found = 0.2 * (1 + jump / 3), None
    with contextlib.suppress(NotConverged):
        found = friction_increments._reached(None, 0.3, None, at(1.1), depth)
    assert (found is None) == (jump > 1e-4)
    if found is not None:
        assert found.unsettled == pytest.approx(abs(found.state.depth / depth - 1))
        assert found.unsettled <= jump


@pytest.mark.thorough
def test_a_lone_touch_of_a_layer_states_less_than_the_same_touch_in_half_as_many_increments(monkeypatch):
    body, punch = Body(Disc(0.1), 9e-3), Punch(0.0, 0.0, 15e-3, 0.4, profile="ellipse", friction="stick")
    found = lone_touches.lone_touch(TABLE_1, body, punch).rubbed
    monkeypatch.setattr(lone_touches, "_INCREMENTS", lone_touches._INCREMENTS // 2)
    rough = lone_touches.lone_touch(TABLE_1, body, punch).rubbed
    assert found is not None
    assert rough is not None
    assert found.signal_errors.max() < rough.signal_errors.max()
