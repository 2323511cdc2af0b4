"""Holds: the closed relaxation, elastic limits, order in time, balance, dissipation, relaxation times far apart."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric import hold
from eitsim.mechanics.axisymmetric.continuation import BottomedOut
from eitsim.mechanics.axisymmetric.hold import HoldHistory, Step, solve_hold, states_over, stepped_through
from eitsim.mechanics.axisymmetric.indentation import at_rest, contact_state, equilibrium, indentation_problem, system
from eitsim.mechanics.axisymmetric.solve_axisymmetric import reached, solve_touch
from eitsim.mechanics.axisymmetric.viscoelastic import loaded_at_once, remembered, stepped, steps_s, unloaded
from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.grid import tensor_grid
from eitsim.scene.profiles.rounded_cone import Flat
from eitsim.scene.scene import Body, Hold, Punch, scene_from
from eitsim.simulation.result_json import as_json
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard, with_moduli
from matcal.laws.conductivity import Conductivity
from matcal.laws.deformation_modes import hereditary_stress, nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony, relaxation

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0], "instantaneous")
LONGTERM = replace(TABLE_1, moduli="longterm")
SERIES = Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672])
FAR_APART = Prony([0.2, 0.1, 0.2], [1e-4, 3.0, 1e6])
PAPER_S = (2.0, 5.0, 60.0, 120.0, 180.0)
CARD = MaterialCard("Table 1", LONGTERM, SERIES, Conductivity(30.0, [-2, 2, -1], (0.0, 0.4)))
COARSE_M = 0.4e-3
FORCE = 1.0 / (TABLE_1.mu_0_Pa * 0.01**2)


def model_of(law=TABLE_1, penalty=Flat.default_penalty):
    return indentation_problem(law, Body(), Punch(), COARSE_M, penalty)


def crept(model, times_s, per_decade=4, series=SERIES, force=FORCE):
    loaded = equilibrium(model, force, at_rest(model, force))
    course = HoldHistory(series, force, None, Hold(tuple(times_s)))
    return states_over(model, course, per_decade, loaded)


@pytest.fixture(scope="module")
def block():
    """A problem whose foam is one element, 1 x 1 in the (r, z) plane, free everywhere."""
    return replace(model_of(), grid=tensor_grid(np.array([0.0, 1.0]), np.array([0.0, 1.0]), free=True))


def compressed(block, strain):
    u = np.empty(block.grid.unknowns)
    u[block.grid.unknown] = np.column_stack([np.zeros(len(block.grid.nodes)), strain * block.grid.nodes[:, 1]])
    return np.append(u, 0.0)


def nominal(block, x):
    """Force on the top of the block over its reference area."""
    gradient, _ = axisymmetric_assembly.residual_and_tangent(block.law, block.grid, x[:-1], prestress=block.prestress)
    return gradient[block.grid.unknown[np.unique(block.grid.top), 1]].sum() / np.pi



def test_a_step_that_bottoms_out_says_so_with_its_time(block, monkeypatch):
    def met(*_):
        raise BottomedOut("squeezed flat.")

    monkeypatch.setattr(hold, "_met", met)
    steps = [Step(0.5, 1.0, None)]
    with pytest.raises(BottomedOut, match=r"flat\. This was 0\.5 s after the start of loading"):
        list(stepped_through(block, SERIES, unloaded(block, SERIES), None, steps))


def test_one_element_held_relaxes_as_the_series(block):
    x = compressed(block, -0.8)
    memory, before, start = loaded_at_once(block, SERIES, x), 0.0, nominal(block, x)
    for t in (1e-5, 0.3, 2.0, 180.0, 1e7):
        model = stepped(block, SERIES, memory, t - before)
        memory, before = remembered(block, SERIES, memory, t - before, x), t
        assert nominal(model, x) / start == pytest.approx(relaxation(SERIES, t), rel=1e-12)
    assert start * TABLE_1.mu_0_Pa == pytest.approx(nominal_stress(TABLE_1, "uniaxial", -0.8), rel=1e-12)


def test_one_element_follows_a_history_as_the_calibration_does(block):
    times, strains = np.array([0.0, 0.2, 1.0, 1.0, 9.0, 1e3, 1e9]), np.array([0.0, -0.3, -0.8, -0.5, -0.6, -0.1, 0.4])
    expected = hereditary_stress(TABLE_1, SERIES, "uniaxial", times, strains) / TABLE_1.mu_0_Pa
    memory = unloaded(block, SERIES)
    for length, strain, stress in zip(np.diff(times), strains[1:], expected[1:], strict=True):
        model, x = stepped(block, SERIES, memory, float(length)), compressed(block, strain)
        assert nominal(model, x) == pytest.approx(stress, rel=1e-11)
        memory = remembered(block, SERIES, memory, float(length), x)


@pytest.mark.parametrize("series", [SERIES, FAR_APART])
def test_limits_are_the_elastic_touches(series):
    at_once, soon, late = crept(model_of(), (1e-13, 1e14), series=series)
    soft = model_of(replace(TABLE_1, mu_Pa=TABLE_1.mu_Pa * series.g_infinity), Flat.default_penalty / series.g_infinity)
    force = FORCE / series.g_infinity
    longterm = equilibrium(soft, force, at_rest(soft, force))
    assert soon.depth == pytest.approx(at_once.depth, rel=1e-8)
    assert late.depth == pytest.approx(longterm.depth, rel=1e-8)


def test_one_step_over_a_hundred_million_relaxation_times_is_exact():
    model, (_, late) = model_of(), crept(model_of(), (1e9,), per_decade=1)
    loaded = equilibrium(model, FORCE, at_rest(model, FORCE))
    memory = loaded_at_once(model, SERIES, loaded.x)
    (last,) = (state for _, state in stepped_through(model, SERIES, memory, loaded, [Step(1e10, FORCE, None)]))
    assert last.depth == pytest.approx(late.depth, rel=1e-8)


@pytest.mark.thorough
def test_steps_in_time_converge_faster_than_first_order():
    model = model_of()
    depths = [crept(model, (2.0, 60.0), n)[-1].depth for n in (4, 8, 16, 32)]
    changes = np.abs(np.diff(depths)) / depths[-1]
    print("changes of the depth from halved steps in time", changes, "orders", np.log2(changes[:-1] / changes[1:]))
    assert changes[0] < 1e-3
    assert np.all(np.log2(changes[:-1] / changes[1:]) > 1.2)


def test_error_estimates_cover_the_steps_in_time():
    touches, exact = (solve_hold(TABLE_1, SERIES, Body(), Punch(), Hold((2.0, 180.0)), element_m=COARSE_M, per_decade=n)
                      for n in (4, 16))
    for (_, touch), (_, fine) in zip(touches[1:], exact[1:], strict=True):
        assert abs(touch.depth_m / fine.depth_m - 1) < touch.depth_error - exact[0][1].depth_error / 2
        assert touch.residuals[-1] < 1e-10


def test_a_force_hold_keeps_the_reaction_and_creeps_down():
    model, states = model_of(), crept(model_of(), PAPER_S)
    reactions = [contact.forces(model.punch, model.facets, contact_state(model, state.x))[1] for state in states]
    assert reactions == pytest.approx([FORCE] * 6, rel=1e-8)
    assert np.all(np.diff([state.depth for state in states]) > 0)


def test_relaxation_times_far_apart_need_no_small_steps():
    ends = steps_s(FAR_APART, np.array(PAPER_S), 4)
    assert set(PAPER_S) <= set(ends)
    assert ends.size < 50
    depths = [state.depth for state in crept(model_of(), PAPER_S, series=FAR_APART)]
    assert np.all(np.diff(depths) > 0)
    assert np.isfinite(depths[-1])


def test_a_depth_hold_keeps_the_deformation_and_relaxes_as_the_series():
    """The loaded state balances G(t) F under contact that is G(t) as stiff; stepping with stiff contact comes near."""
    model = model_of()
    loaded = equilibrium(model, FORCE, at_rest(model, FORCE))
    share = float(relaxation(SERIES, 180.0))
    later = stepped(model, SERIES, loaded_at_once(model, SERIES, loaded.x), 180.0)
    later = replace(later, punch=replace(model.punch, stiffness=share * model.punch.stiffness))
    assert np.linalg.norm(system(later, share * FORCE, loaded.x)[0]) < 1e-9 * FORCE
    course = HoldHistory(SERIES, None, loaded.depth, Hold((2.0, 180.0), "depth"))
    forces = [state.force / FORCE for state in states_over(model, course, 2, loaded)]
    assert forces == pytest.approx(relaxation(SERIES, [0.0, 2.0, 180.0]), rel=3e-4)


def test_a_depth_hold_is_told_without_steps():
    held = solve_hold(TABLE_1, SERIES, Body(), Punch(), Hold((180.0, 2.0), "depth"), element_m=COARSE_M)
    assert [t for t, _ in held] == [0.0, 2.0, 180.0]
    assert [touch.force_N for _, touch in held] == pytest.approx(relaxation(SERIES, [0.0, 2.0, 180.0]), rel=1e-12)
    assert held[-1][1].depth_m == held[0][1].depth_m
    assert held[-1][1].sigma_ave_Pa * held[-1][1].contact_area_m2 == pytest.approx(held[-1][1].force_N)


@pytest.mark.parametrize("duration_s", [1e-7, 2.0, 1e7])
def test_a_cycle_of_force_dissipates_and_none_at_either_end_of_the_rates(duration_s):
    """Work of the punch over loading to 0.3 N and back to a hundredth of it."""
    model, shares = model_of(), np.r_[np.linspace(0.1, 1, 8), np.linspace(0.9, 0.01, 12)]
    steps = [Step(duration_s / shares.size, 0.3 * FORCE * share, None) for share in shares]
    states = [state for _, state in stepped_through(model, SERIES, unloaded(model, SERIES), None, steps)]
    depths = np.append(0.0, [state.x[-1] for state in states])
    forces = np.append(0.0, [state.force for state in states])
    work, stored = np.trapezoid(forces, depths), forces.max() * depths.max() / 2
    assert work > 0 if duration_s == 2.0 else abs(work) < 0.01 * stored
    if duration_s == 2.0:
        assert work > 0.02 * stored


def test_creep_leaves_less_energy_than_the_punch_gave():
    model = model_of()
    states = crept(model, (*PAPER_S, 1e6))
    at_once = axisymmetric_assembly.energy(model.law, model.grid, states[0].x[:-1])
    given = at_once + FORCE * (np.array([s.x[-1] for s in states]) - states[0].x[-1])
    kept = [SERIES.g_infinity * axisymmetric_assembly.energy(model.law, model.grid, s.x[:-1]) for s in states]
    assert np.all(given - kept > 0)
    assert given[-1] - kept[-1] > 0.05 * given[-1]


@pytest.mark.parametrize("punch", [Punch(force_N=0.5), Punch(force_N=None, depth_m=1e-3)])
def test_slow_and_fast_loading_reach_the_elastic_touches(punch):
    fast, slow = (solve_hold(TABLE_1, SERIES, Body(), punch, Hold((t,), "depth", loading_s=t), element_m=COARSE_M,
                             per_decade=2)[0][1] for t in (1e-9, 1e9))
    stiff = solve_touch(TABLE_1, Body(), punch, element_m=COARSE_M)
    soft = solve_touch(replace(TABLE_1, mu_Pa=TABLE_1.mu_Pa * SERIES.g_infinity), Body(), punch, element_m=COARSE_M)
    for held, elastic in ((fast, stiff), (slow, soft)):
        assert held.depth_m == pytest.approx(elastic.depth_m, rel=3e-4)
        assert held.force_N == pytest.approx(elastic.force_N, rel=1e-3)


@pytest.mark.parametrize(("diameter_m", "force_N"), [(0.0131, 0.03), (0.00882, 1.5)])
def test_a_depth_hold_after_loading_keeps_its_depth_and_loses_force(diameter_m, force_N):
    hold = Hold((0.2, 5.0, 2e5), "depth", loading_s=3e-3)
    held = solve_hold(TABLE_1, FAR_APART, Body(), Punch(diameter_m=diameter_m, force_N=force_N), hold,
                      element_m=COARSE_M, per_decade=2)
    assert [touch.depth_m for _, touch in held] == pytest.approx([held[0][1].depth_m] * 4, rel=1e-8)
    assert np.all(np.diff([touch.force_N for _, touch in held]) < 0)
    assert held[0][1].force_N == pytest.approx(force_N, rel=1e-9)


@pytest.mark.parametrize("alpha", [8.0, 2.0])
def test_a_sphere_that_flattens_a_foam_of_one_term_is_held_at_its_depth(alpha):
    law, force = Hyperfoam([9530.0], [alpha], [0.0], "instantaneous"), 1.23 * 9530.0 * np.pi * 0.01**2
    punch = Punch(diameter_m=0.01, force_N=force, profile="sphere")
    held = solve_hold(law, SERIES, Body(), punch, Hold((2.0, 180.0), "depth", loading_s=1.0), element_m=COARSE_M,
                      per_decade=2)
    assert [touch.depth_m for _, touch in held] == pytest.approx([held[0][1].depth_m] * 3, rel=1e-8)
    assert np.all(np.diff([touch.force_N for _, touch in held]) < 0)
    assert held[0][1].depth_m > 0.95 * Body().thickness_m


def beside_a_jump(model, share):
    """Equilibria just before and after a point of contact comes or goes, between a share of FORCE and a tenth more."""
    def touched(state):
        return np.count_nonzero(contact_state(model, state.x).penetration)

    low = equilibrium(model, share * FORCE, at_rest(model, share * FORCE))
    high, count = equilibrium(model, 1.1 * share * FORCE, low.x), touched(low)
    while high.force > (1 + 1e-9) * low.force:
        middle = equilibrium(model, (low.force + high.force) / 2, low.x)
        low, high = (middle, high) if touched(middle) == count else (low, middle)
    return low, high


@pytest.mark.parametrize("share", [0.1, 0.6, 1.0])
def test_a_depth_that_the_contact_correction_leaps_over_is_reached(share):
    model = model_of()
    low, high = beside_a_jump(model, share)
    assert high.x[-1] == pytest.approx(low.x[-1], rel=2e-9)
    assert high.depth > (1 + 1e-4) * low.depth
    depth = (low.depth + high.depth) / 2
    found = reached(model, depth, equilibrium(model, 0.9 * low.force, low.x))
    assert found.depth == depth
    assert found.x[-1] == pytest.approx(low.x[-1], rel=3e-9)
    assert found.force == pytest.approx(low.force, rel=3e-9)


def test_a_ramp_to_a_depth_that_the_contact_correction_leaps_over_is_held():
    depth = np.mean([state.depth for state in beside_a_jump(model_of(), 0.2)]) * Body().thickness_m
    hold = Hold((2.0, 60.0), "depth", loading_s=1e-6)
    held = solve_hold(TABLE_1, SERIES, Body(), Punch(force_N=None, depth_m=depth), hold, element_m=COARSE_M,
                      per_decade=2)
    assert [touch.depth_m for _, touch in held] == pytest.approx([depth] * 3, rel=1e-9)
    assert [touch.force_N for _, touch in held] == pytest.approx(
        held[0][1].force_N * relaxation(SERIES, [0.0, 2.0, 60.0]), rel=1e-3)


def test_slower_loading_is_deeper_and_forgotten_in_the_end():
    fast, slow = (solve_hold(TABLE_1, SERIES, Body(), Punch(), Hold((1e5,), loading_s=t), element_m=COARSE_M)
                  for t in (0.0, 1.0))
    assert slow[0][1].depth_m > 1.05 * fast[0][1].depth_m
    assert slow[1][1].depth_m == pytest.approx(fast[1][1].depth_m, rel=1e-5)


def test_foam_that_bulges_is_held_too():
    law = replace(TABLE_1, nu=np.full(3, 0.3))
    held = solve_hold(law, SERIES, Body(), Punch(force_N=0.5), Hold((10.0, 1e6)), element_m=COARSE_M)
    soft = solve_touch(replace(law, mu_Pa=law.mu_Pa * SERIES.g_infinity), Body(), Punch(force_N=0.5),
                       element_m=COARSE_M)
    assert held[-1][1].depth_m == pytest.approx(soft.depth_m, rel=3e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("control", ["force", "depth"])
def test_a_held_scene_tells_its_times(control):
    scene = scene_from({"punch": {"force_N": 0.3}, "hold": {"time_s": [2.0, 6.0], "control": control},
                        "accuracy": {"signal": 0.05}})
    result = simulate(scene, CARD)
    document = as_json(result, scene, CARD)
    assert result.outcome == "ok"
    assert [block["time_s"] for block in document["times"]] == [0.0, 2.0, 6.0]
    for key in ("force_N", "delta_max_mm", "sigma_ave_kPa", "sigma_max_kPa", "A_c_mm2", "readings_V"):
        assert document["times"][-1][key] == document[key]
    depths, forces = ([block[key] for block in document["times"]] for key in ("delta_max_mm", "force_N"))
    assert (np.ptp(forces) == 0) == (np.ptp(depths) > 0) == (control == "force")
    loaded = solve_touch(with_moduli(CARD, "instantaneous"), Body(), Punch(force_N=0.3))
    assert depths[0] == pytest.approx(loaded.depth_m * 1e3, rel=1e-9)


@pytest.mark.parametrize(("hold", "named"), [
    ({"time_s": [2.0], "moduli": "longterm"}, "nothing to relax"), ({"loading_s": 1.0}, "without time_s"),
    ({"time_s": [2.0], "loading_s": -1.0}, "must be from 0"), ({"time_s": [0.0]}, "positive")])
def test_holds_that_make_no_sense_are_refused(hold, named):
    with pytest.raises(ValueError, match=named):
        scene_from({"hold": hold})


def test_a_hold_needs_a_series_and_instantaneous_moduli():
    with pytest.raises(ValueError, match="no prony"):
        simulate(scene_from({"hold": {"time_s": [2.0]}}), replace(CARD, prony=None))
    with pytest.raises(ValueError, match="instantaneous"):
        solve_hold(LONGTERM, SERIES, Body(), Punch(), Hold((2.0,)))
