"""The mesh that follows the touch."""

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import gradients
from eitsim.electrics.mesh.ring_mesh import rim_angles, template
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch


def contact(radius_m: float) -> Touch:
    """A touch of which only the radius of contact is used."""
    rest = np.ones(2)
    return Touch(np.array([0.0, 0.1]), 0 * rest, 0 * rest, rest, rest, rest, 0 * rest, radius_m, *[0.0] * 9, 0, (), 0.0)


PLACES = [Punch(), Punch(x_m=0.05, y_m=-0.04), Punch(x_m=-0.08, y_m=0.02), Punch(y_m=0.0915, diameter_m=0.016)]


@pytest.mark.parametrize("punch", PLACES)
def test_the_mesh_covers_the_disc_wherever_the_punch_fits(punch):
    mesh = template(Body(), Electrodes(), punch, contact(punch.diameter_m / 2 + 1e-4), 2)
    _, area = gradients(mesh, np.zeros((len(mesh.nodes_m), 1)))
    assert area.min() > 0
    assert area.sum() == pytest.approx(np.pi * 0.01, rel=1e-6)
    np.testing.assert_allclose(np.linalg.norm(mesh.nodes_m[mesh.under], axis=-1), 0.1, rtol=1e-14)


@pytest.mark.parametrize("punch", PLACES)
def test_lines_follow_the_fillet_the_edge_and_the_end_of_contact(punch):
    edge = punch.diameter_m / 2
    mesh = template(Body(), Electrodes(), punch, contact(edge + 4e-4), 1)
    corners = mesh.nodes_m[np.unique(mesh.cells[:, :4])] - [punch.x_m, punch.y_m]
    radius = np.linalg.norm(corners, axis=1)
    for line in (edge - punch.fillet_m, edge, edge + 4e-4):
        assert np.sum(np.abs(radius - line) < 1e-12) == len(rim_angles(Body(), Electrodes(), 1)[0])


def test_every_electrode_has_its_own_width():
    electrodes = Electrodes(count=12, width_m=0.02, first_angle_rad=0.3)
    mesh = template(Body(), electrodes, Punch(x_m=0.03), contact(7e-3), 4)
    start, stop, middle = (mesh.nodes_m[mesh.under[:, i]] for i in range(3))
    # Simpson's rule for the length of short quadratic arcs
    first, last = np.linalg.norm(4 * middle - 3 * start - stop, axis=1), np.linalg.norm(
        3 * stop + start - 4 * middle, axis=1)
    length = (first + 4 * np.linalg.norm(stop - start, axis=1) + last) / 6
    for k in range(12):
        assert length[mesh.electrode == k].sum() == pytest.approx(0.02, rel=1e-6)


def test_a_punch_beyond_the_rim_is_refused():
    with pytest.raises(ValueError, match=r"3\.0 mm outside the rim"):
        template(Body(), Electrodes(), Punch(x_m=0.096), contact(7e-3))
