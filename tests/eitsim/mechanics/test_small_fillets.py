"""Flat punches with small fillets, over which deep touches draw much foam."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.continuation import carried_over, cold_start, fillet_continuation
from eitsim.mechanics.axisymmetric.indentation import IndentationProblem, at_rest, energy, equilibrium
from eitsim.mechanics.axisymmetric.solve_axisymmetric import force_unit, mesh_hierarchy
from eitsim.mechanics.solid.grid import default_element_m, foam_grid
from eitsim.scene.scene import Body, Punch
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.errors import NotConverged

TABLE_1 = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
SHARP = Punch(fillet_m=5e-5, diameter_m=0.02, force_N=3.0)


def lines_under(punch: Punch, scale: float) -> np.ndarray:
    """Widths of the elements within 0.18 thicknesses of the punch's edge, over the fillet."""
    r = foam_grid(Body(), punch, scale * default_element_m(Body(), punch)).lines[0][::2]
    edge = punch.diameter_m / 2 / Body().thickness_m
    inside = (r[1:] <= edge + 1e-9) & (r[:-1] >= edge - 0.18)
    return np.diff(r)[inside] * Body().thickness_m / punch.fillet_m


def problem(punch: Punch) -> tuple[IndentationProblem, float]:
    """The coarsest mesh under the punch, and its force."""
    assert punch.force_N is not None
    return mesh_hierarchy(TABLE_1, Body(), punch, None, None)[0], punch.force_N / force_unit(TABLE_1, Body())


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_no_element_that_may_be_drawn_over_a_fillet_is_wider_than_half_of_it(scale):
    widths = lines_under(SHARP, scale)
    assert 0.9 * scale / 2 < widths.max() <= scale / 2


def test_the_smallest_fillets_take_no_more_elements():
    """Above what fits into the memory the elements stay as wide as they are, and the solution says what it misses."""
    few, many = (len(lines_under(replace(SHARP, fillet_m=fillet), 1.0)) for fillet in (2.5e-5, 5e-6))
    assert few < many < 1.2 * few


@pytest.mark.thorough
def test_a_deep_touch_with_a_small_fillet_agrees_between_coarse_meshes():
    coarse, fine = mesh_hierarchy(TABLE_1, Body(), SHARP, None, None)[:2]
    force = 3.0 / force_unit(TABLE_1, Body())
    rough = cold_start(coarse, force)
    found = carried_over(coarse, rough, fine)
    assert found.residuals[-1] <= 1e-10
    assert rough.depth == pytest.approx(found.depth, rel=3e-3)


@pytest.mark.parametrize(("fillet_m", "force_N"), [(1e-4, 0.2), (2e-4, 1.0)])
def test_rounder_edges_lead_to_where_one_solve_leads(fillet_m, force_N):
    model, force = problem(Punch(fillet_m=fillet_m, force_N=force_N))
    once, led = equilibrium(model, force, at_rest(model, force)), fillet_continuation(model, force)
    assert led.depth == pytest.approx(once.depth, rel=1e-8)


def test_rounder_edges_leave_foam_that_catches_on_the_fillet():
    """The solve from rest stops at a minimum of the coarse mesh where an element's end hangs on the fillet."""
    model, force = problem(Punch(fillet_m=1e-4, force_N=1.0))
    once, led = equilibrium(model, force, at_rest(model, force)), fillet_continuation(model, force)
    assert energy(model, force, led.x) <= energy(model, force, once.x)
    assert led.depth >= once.depth


def test_a_round_edge_has_no_rounder_ones():
    with pytest.raises(NotConverged, match="round already"):
        fillet_continuation(*problem(Punch(force_N=1.0)))
