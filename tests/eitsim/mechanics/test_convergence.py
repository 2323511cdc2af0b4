"""Observed rates of convergence: elements of both orders under a smooth load, and the touch's depth and strains."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_path, solve_touch
from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.grid import default_element_m, tensor_grid
from eitsim.numerics.newton import minimise
from eitsim.scene.scene import Body, Punch
from matcal.laws.hyperfoam import Hyperfoam

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
UNIT = replace(TABLE_1, mu_Pa=TABLE_1.mu_Pa / TABLE_1.mu_0_Pa)
BODY, PUNCH = Body(), Punch(diameter_m=0.014, force_N=1.0)


def rate(errors):
    """Power of the element size, which halves from one error to the next."""
    return -np.polyfit(np.arange(len(errors)), np.log2(errors), 1)[0]


def pressed_smoothly(elements, order):
    """Potential energy and centre depth of a layer under a dead pressure (1 - r^2)^3/4, all lengths in thicknesses."""
    grid = tensor_grid(np.linspace(0, 3, 3 * elements + 1), np.linspace(-1, 0, elements + 1), order=order)
    facets = contact.top_facets(grid, 1 - 1e-9)
    load, push = np.zeros(grid.unknowns), -0.25 * (1 - facets.radius**2) ** 3 * facets.weight
    np.add.at(load, grid.unknown[facets.nodes, 1], push @ facets.shape)

    def system(u, share):
        gradient, band = axisymmetric_assembly.residual_and_tangent(UNIT, grid, u, share)
        return gradient - load, lambda: axisymmetric_assembly.factorised(grid, band())

    found = minimise(lambda u: axisymmetric_assembly.energy(UNIT, grid, u) - load @ u, system, np.zeros(grid.unknowns),
                     scale=np.linalg.norm(load))
    return axisymmetric_assembly.energy(UNIT, grid, found.x) - load @ found.x, -found.x[grid.unknown[grid.top[0, 0], 1]]


@pytest.fixture(scope="module")
def exactly():
    return pressed_smoothly(32, 2)


@pytest.mark.parametrize("order", [1, 2])
def test_energy_converges_with_twice_the_elements_order(order, exactly):
    found = np.array([pressed_smoothly(n, order) for n in (4, 8, 16)])
    energy, depth = np.abs(found / exactly - 1).T
    print(f"order {order}: energy {energy}, rate {rate(energy):.2f}; depth {depth}, rate {rate(depth):.2f}")
    assert rate(energy) > 2 * order - 0.3
    assert rate(depth) > order + 1 - 0.2
    assert np.all(found[:, 0] > exactly[0])  # every mesh is too stiff


def touched(size, order):
    return solve_touch(TABLE_1, BODY, PUNCH, element_m=size * default_element_m(BODY, PUNCH), order=order)


@pytest.fixture(scope="module")
def finest():
    return touched(0.5, 2)


def strain_errors(touch, finest):
    """L2 errors of through-thickness and in-plane strains over the contact and outside it, over the whole norm."""
    r = np.union1d(touch.radius_m, finest.radius_m)
    under, out = r <= finest.contact_radius_m, []
    for names in (("stretch_normal",), ("stretch_meridian", "stretch_hoop")):
        ours, theirs = (np.stack([np.interp(r, t.radius_m, getattr(t, n)) for n in names]) for t in (touch, finest))
        square, size = ((ours - theirs) ** 2).sum(axis=0) * r, np.trapezoid(((theirs - 1) ** 2).sum(axis=0) * r, r)
        out += [np.sqrt(np.trapezoid(square[part], r[part]) / size) for part in (under, ~under)]
    return out


def test_a_path_of_bilinear_elements_passes_where_its_coarsest_mesh_buckles():
    """Its energy has a saddle near 0.74 thicknesses, which damped steps of the minimiser leave too slowly."""
    forces = np.linspace(0.25, 3, 12)
    coarse = solve_path(TABLE_1, BODY, PUNCH, forces, element_m=1.2e-4, order=1)
    fine = solve_path(TABLE_1, BODY, PUNCH, forces[-1:])
    depths = [touch.depth_m for touch in coarse]
    assert np.all(np.diff(depths) > 0)
    assert depths[-1] == pytest.approx(fine[0].depth_m, rel=0.01)


def test_depth_and_surface_strains_of_a_touch_converge(finest):
    """Bilinear elements: the depth with order 2; the strains, whose slope is unbounded at the fillet, with order 1."""
    touches = [touched(size, 1) for size in (4.0, 2.0, 1.0)]
    depth = [abs(touch.depth_m / finest.depth_m - 1) for touch in touches]
    strains = np.array([strain_errors(touch, finest) for touch in touches])
    rates = [rate(column) for column in strains.T]
    print(f"depth {depth}, rate {rate(depth):.2f}; strains {strains}, rates {rates}")
    assert rate(depth) > 1.6
    assert min(rates) > 0.9


def test_the_higher_order_is_the_better_one(finest):
    """On one mesh, the default: depth forty times nearer, every surface strain nearer."""
    linear, quadratic = touched(1.0, 1), touched(1.0, 2)
    assert abs(quadratic.depth_m / finest.depth_m - 1) < 0.025 * abs(linear.depth_m / finest.depth_m - 1)
    assert np.all(np.array(strain_errors(quadratic, finest)) < strain_errors(linear, finest))
    assert quadratic.sigma_max_Pa == pytest.approx(finest.sigma_max_Pa, rel=0.03)
    assert quadratic.contact_area_m2 == pytest.approx(finest.contact_area_m2, rel=0.01)
