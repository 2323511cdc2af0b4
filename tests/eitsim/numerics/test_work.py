"""A touch that is not found is given up after a counted amount of work, the same on every machine."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric import friction_increments, solve_axisymmetric
from eitsim.mechanics.axisymmetric.solve_axisymmetric import mesh_hierarchy, solve_touch
from eitsim.mechanics.rim import solve_near_rim
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.axisymmetric_assembly import factorised
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.numerics.linear_solvers import conjugate_gradients, factorise_band
from eitsim.numerics.newton import minimise
from eitsim.numerics.work_budget import PRODUCT, bounded, charge, used_up
from eitsim.scene.scene import Body, Punch
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.errors import NotConverged

# Factorisations of one iteration: the one that uses up the work, and those that find it indefinite.
OVERRUN = 10


def law(mu_3_Pa):
    """Table 1 with another third modulus; below -22.4 kPa ellipticity is lost early on."""
    return Hyperfoam(np.array([14420.0, 16780.0, mu_3_Pa]), np.array([0.288, 4.249, 0.741]), np.zeros(3))


PUNCH = Punch(diameter_m=0.014, force_N=0.3)


def touch(mu_3_Pa, friction="none", size=4.0):
    """14 mm and 0.3 N on a coarse mesh."""
    return solve_touch(law(mu_3_Pa), Body(), replace(PUNCH, friction=friction),
                       element_m=size * default_element_m(Body(), PUNCH))


def ended(mu_3_Pa):
    """The touch or why there is none."""
    try:
        return touch(mu_3_Pa), None
    except NotConverged as error:
        return None, error


def unknowns(size=4.0):
    """Unknowns of the touch's finest mesh."""
    return mesh_hierarchy(law(-24e3), Body(), PUNCH, size * default_element_m(Body(), PUNCH), None)[-1].grid.unknowns


@pytest.fixture
def taken(monkeypatch):
    """Unknowns of each matrix that is factorised, counted separately from the account."""
    sizes = []

    def counted(grid, stiffness):
        sizes.append(grid.unknowns)
        return factorised(grid, stiffness)

    monkeypatch.setattr(axisymmetric_assembly, "factorised", counted)
    return sizes


def endless(x, share):
    """A slope that never ends."""
    return np.array([-1.0]), lambda: factorise_band(np.array([[1e-3]]))


def test_newton_stops_once_the_work_is_used_up():
    with pytest.raises(NotConverged, match=r"stopped after 7 iterations.*work of 7 factorisations") as caught, \
            bounded(7, 1):
        minimise(lambda x: -float(x[0]), endless, np.zeros(1), scale=1.0)
    assert len(caught.value.residuals) == 7
    assert caught.value.estimate[0] == pytest.approx(7000.0)
    assert not used_up()


def test_the_outer_bound_holds_alone_and_ends_with_its_block():
    charge(1e9)
    with bounded(2, 10):
        with bounded(1, 10):
            charge(10)
            assert not used_up()
        charge(10)
        assert used_up()
    assert not used_up()


def test_a_failure_for_another_reason_is_told_as_it_is():
    error = NotConverged("flat", load_fraction=0.5)
    with pytest.raises(NotConverged) as caught, bounded(1, 10):
        raise error
    assert caught.value is error


def test_products_of_conjugate_gradients_count():
    matrix = np.diag(np.arange(1.0, 9.0))
    with bounded(PRODUCT * 8, 8):
        conjugate_gradients(lambda y: matrix @ y, lambda r: r, np.ones(8), 0.0, limit=7)
        assert not used_up()
        conjugate_gradients(lambda y: matrix @ y, lambda r: r, np.ones(8), 0.0, limit=1)
        assert used_up()


@pytest.mark.thorough
@pytest.mark.parametrize("mu_3_Pa", [-22e3, -23e3, -24e3, -25e3, -27e3, -30e3])
def test_laws_at_the_edge_of_ellipticity_end(mu_3_Pa, taken):
    found, error = ended(mu_3_Pa)
    if found is not None:
        assert found.residuals[-1] <= 1e-10
    if error is not None:
        assert error.load_fraction is not None
        assert 0 <= error.load_fraction < 1
        assert "not elliptic" in str(error)
        assert "Try a smaller force" in str(error)
    assert (found is None) == (mu_3_Pa < -26e3)
    assert sum(taken) <= (solve_axisymmetric.allowed(unknowns()) + OVERRUN) * unknowns()


@pytest.mark.parametrize(("friction", "module"), [("none", solve_axisymmetric), ("stick", friction_increments)])
def test_a_touch_beyond_its_work_tells_how_far_it_came(friction, module, taken, monkeypatch):
    """Given little work, a law that has lost ellipticity; with friction the touch before, without, has its own."""
    monkeypatch.setattr(module, "FACTORISATIONS", 40)
    monkeypatch.setattr(solve_axisymmetric, "UNKNOWNS", 1)
    with pytest.raises(NotConverged, match="given up after the work of 40 factorisations") as caught:
        touch(-27e3, friction)
    assert caught.value.load_fraction is not None
    assert 0 <= caught.value.load_fraction < 1
    assert "not elliptic" in str(caught.value)
    assert sum(taken) <= (40 + OVERRUN) * unknowns()


def test_what_stays_within_its_work_does_not_depend_on_the_bound(monkeypatch):
    found = touch(-22e3)
    monkeypatch.setattr(solve_axisymmetric, "FACTORISATIONS", 1e9)
    assert touch(-22e3).residuals == found.residuals
    assert touch(-22e3).depth_m == found.depth_m


def test_the_rims_change_has_its_bound(monkeypatch):
    punch = Punch(diameter_m=0.014, force_N=1.0, x_m=0.091)
    monkeypatch.setattr(solve_near_rim, "FACTORISATIONS", 20)
    with pytest.raises(NotConverged, match="given up after the work of 20 factorisations"):
        solve_near_rim.rim_change(law(-21670.0), Body(), punch, solve_near_rim.Resolution(8.0, 3, 8, 1.0))


@pytest.mark.slow
def test_a_fine_mesh_of_a_law_without_ellipticity_ends(taken):
    """The default mesh finds an equilibrium, half its element size none: two hundred steps of the force were tried."""
    assert touch(-24e3, size=1.0).fraction_non_elliptic > 0
    taken.clear()
    with pytest.raises(NotConverged, match="given up after the work"):
        touch(-24e3, size=0.5)
    assert sum(taken) <= (solve_axisymmetric.allowed(unknowns(size=0.5)) + OVERRUN) * unknowns(size=0.5)
