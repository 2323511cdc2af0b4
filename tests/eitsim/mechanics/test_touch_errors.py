"""Estimated errors of touches cover the distance from finer meshes with a stiffer contact, whatever the profile: the
draws of benchmarks/touch_errors.py, a few here, all among the slow tests."""

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import pytest

from eitsim.mechanics.axisymmetric import solve_axisymmetric
from eitsim.mechanics.axisymmetric.solve_axisymmetric import at_depth, mesh_hierarchy, solve_touch, touch_of
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.scene import Body, Punch
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.neo_hooke import NeoHooke
from touchcal.errors import NotConverged

FEW = (41, 70)  # a sphere and a cone that two meshes alone did not cover; the longest test takes all
SMALL = [("flat", 0.017, 1.1), ("sphere", 0.008, 0.3), ("cone", 0.008, 0.3)]  # profiles, diameters (m) and forces (N)


@pytest.fixture(scope="module")
def study(benchmark_module: Callable[[str], ModuleType]) -> ModuleType:
    """The benchmark as a module."""
    return benchmark_module("touch_errors")


def missed(study, scenes):
    """(scene, quantity) whose estimate does not cover the error."""
    rows = {}
    for k in scenes:
        name, punch = study.scene_of(k)
        rows[k] = study.errors_of(study.LAWS[name], punch)
    return [(k, name) for k, row in rows.items() for name in study.QUANTITIES
            if not row[f"{name}_error"] <= row[f"{name}_estimate"]]


@pytest.mark.slow
@pytest.mark.parametrize("k", FEW)
def test_errors_of_a_few_profiles_are_covered(study, k):
    assert missed(study, [k]) == []


@pytest.mark.slow
def test_errors_of_random_profiles_are_covered(study):
    """Five quantities of 104 scenes: at least 95 % of each."""
    left = missed(study, range(study.SCENES))
    print(left)
    assert all(sum(name == quantity for _, name in left) <= 0.05 * study.SCENES for quantity in study.QUANTITIES)


@pytest.mark.thorough
@pytest.mark.parametrize("pressed", [
    SMALL, pytest.param([("sphere", 0.017, 1.1), ("cone", 0.017, 1.1), *SMALL], marks=pytest.mark.slow)])
def test_contacts_end_where_half_the_element_finds_them_within_their_errors(study, pressed):
    """The error of the radius does not rest on two meshes, which may agree by chance; one in twenty misses it."""
    law, body, moved = study.LAWS["Table 1"], Body(), []
    for profile, diameter_m, force_N in pressed:
        punch = Punch(diameter_m=diameter_m, force_N=force_N, profile=profile)
        touch, fine = solve_touch(law, body, punch), solve_touch(
            law, body, punch, element_m=default_element_m(body, punch) / 2)
        assert touch.contact_end_error is not None
        assert fine.contact_end_error is not None
        assert fine.contact_end_error < 0.7 * touch.contact_end_error < 0.03
        moved.append(abs(fine.contact_radius_m / touch.contact_radius_m - 1) / touch.contact_end_error)
    print(moved)
    assert max(moved) < 2
    assert sum(each > 1 for each in moved) <= 1


@pytest.mark.thorough
def test_elements_stay_small_to_where_a_conducting_punch_ends(study):
    """Its contact ends where an insulated one's does, within the errors of both; known twice as well in the foam that
    climbs a flat punch, and as before under a sphere, whose elements are even anyway."""
    for profile, share in (("flat", 0.5), ("sphere", 1.0)):
        punch = Punch(diameter_m=0.014, force_N=1.5, profile=profile)
        plain, one = (solve_touch(study.LAWS["Table 1"], Body(), replace(punch, conductor=conducts))
                      for conducts in (False, True))
        assert plain.contact_end_error is not None
        assert one.contact_end_error is not None
        assert one.contact_end_error <= share * plain.contact_end_error
        assert abs(one.contact_radius_m / plain.contact_radius_m - 1) < plain.contact_end_error + one.contact_end_error
        assert one.depth_m == pytest.approx(plain.depth_m, rel=plain.depth_error + one.depth_error)


@pytest.mark.parametrize(("law", "depth_m"), [(NeoHooke(1e4, 0.4995), 0.6e-3), (Hyperfoam([1e4], [6.0], [0.1]), 2e-3)])
def test_a_hemisphere_is_solved_as_on_a_mesh_that_is_fine_all_along(law, depth_m):
    body, punch = Body(), Punch(diameter_m=0.012, profile="sphere", depth_m=depth_m)
    levels = mesh_hierarchy(law, body, punch, 0.12e-3, None)
    even = touch_of(law, body, levels, at_depth(levels, depth_m / body.thickness_m), 0.0)
    touch = solve_touch(law, body, punch, element_m=0.12e-3)
    assert touch.radius_m.size < 0.7 * even.radius_m.size
    assert touch.force_N == pytest.approx(even.force_N, rel=2e-4)
    assert touch.sigma_max_Pa == pytest.approx(even.sigma_max_Pa, rel=touch.sigma_max_error)
    assert touch.contact_area_error is not None
    assert touch.contact_area_m2 == pytest.approx(even.contact_area_m2, rel=touch.contact_area_error)


def test_a_contact_that_cannot_be_softened_leaves_area_and_strain_unknown(study, monkeypatch):
    def failed(*args):
        raise NotConverged("no equilibrium.")

    punch = study.scene_of(0)[1]
    usual = solve_touch(study.LAWS["Table 1"], Body(), punch)
    monkeypatch.setattr(solve_axisymmetric.indentation, "softened", failed)
    touch = solve_touch(study.LAWS["Table 1"], Body(), punch)
    assert touch.depth_m == usual.depth_m
    assert touch.contact_area_error is not None
    assert touch.strain_errors is not None
    assert min(touch.contact_area_error, *touch.strain_errors) > 1
