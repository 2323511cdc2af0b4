"""Where a contact ends, by the gaps outside it."""

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.contact.contact_ends import end_by_gaps
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.scene import Body, Punch
from matcal.laws.hyperfoam import Hyperfoam


def test_a_gap_shows_where_it_begins():
    away, ends = np.linspace(0.3, 2.0, 7), np.array([-0.1, 0.0, 0.25])
    gaps = 3e-4 * np.maximum(away - ends[:, None], 0.0) ** 1.5
    np.testing.assert_allclose(end_by_gaps(away, gaps), ends, atol=1e-12)


def test_a_gap_that_does_not_grow_shows_no_end():
    assert np.isnan(end_by_gaps(np.linspace(0.3, 2.0, 7), np.zeros(7)))


@pytest.mark.parametrize(("profile", "diameter_m", "force_N"), [("sphere", 0.011, 0.15), ("flat", 0.009, 0.4)])
def test_the_error_of_a_contacts_end_holds_against_finer_elements(profile: str, diameter_m: float, force_N: float):
    law = Hyperfoam(np.array([14_000.0, 900.0]), np.array([5.0, -3.0]), np.array([0.1, 0.1]), "longterm")
    body = Body(thickness_m=0.012)
    punch = Punch(diameter_m=diameter_m, force_N=force_N, profile=profile, conductor=True)
    sizes = np.array([2.0, 1.0]) * default_element_m(body, punch)
    coarse, fine = (solve_touch(law, body, punch, element_m=size) for size in sizes.tolist())
    assert coarse.contact_end_error is not None
    assert abs(coarse.contact_radius_m / fine.contact_radius_m - 1) <= coarse.contact_end_error < 6e-3
