"""The rounded cylinder and cone: exact distance, derivatives of the contact energy."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact.punch_contact import RigidPunch
from eitsim.mechanics.solid.grid import foam_grid
from eitsim.scene.profiles.ellipse import Ellipse
from eitsim.scene.profiles.rounded_cone import Flat
from eitsim.scene.scene import Body, Punch

PUNCHES = {"flat": RigidPunch(Flat(0.7, 0.05), 1e4), "sphere": RigidPunch(Flat(0.7, 0.7), 1e4),
           "cone": RigidPunch(Flat(0.7, 0.05, 0.2), 1e4),
           "steep cone": RigidPunch(Flat(0.7, 0.1, 0.9), 1e4),
           "firm": RigidPunch(Flat(0.7, 0.05), 1e4, stiffening_penetration=0.02)}


def core(punch):
    """Corners of the profile's core, the tip's at (0, fillet): the punch is every point within its fillet of the core.
    """
    fillet, inner = punch.profile.edge_radius, punch.profile.radius - punch.profile.edge_radius
    return np.array([[0.0, fillet], [inner, fillet + inner * np.tan(punch.profile.slope)]])


def outline(punch, count=100_001):
    """Points of the punch's outline: tip, face, edge and wall, the lowest at the origin."""
    ends = core(punch)
    tip, edge = np.linspace(0, punch.profile.slope, count), np.linspace(punch.profile.slope, np.pi / 2, count)
    arcs = [end + punch.profile.edge_radius * np.column_stack([np.sin(angle), -np.cos(angle)])
            for end, angle in zip(ends, (tip, edge), strict=True)]
    face = np.linspace(arcs[0][-1], arcs[1][0], count)
    wall = np.column_stack([np.full(count, punch.profile.radius), np.linspace(ends[1, 1], 3, count)])
    return np.vstack([*arcs, face, wall])


def inside(punch, points):
    """Whether points lie inside the punch: under or next to the core, within the fillet of it; or in the core."""
    (_, low), (inner, high) = core(punch)
    in_core = (points[:, 0] <= inner) & (points[:, 1] >= low + points[:, 0] * np.tan(punch.profile.slope))
    face = np.array([inner, high - low])
    along = np.clip((points - [0, low]) @ face / max(face @ face, 1e-300), 0, 1)
    near = np.hypot(*(points - [0, low] - along[:, None] * face).T) < punch.profile.edge_radius
    aside = (points[:, 1] >= high) & (points[:, 0] < punch.profile.radius)
    return in_core | near | aside


def at_nodes(count: int) -> contact.Facets:
    """Facets of one node and one point each."""
    return contact.Facets(np.arange(count)[:, None], np.eye(1), np.zeros((count, 1, 1)), np.zeros((count, 1)),
                          np.ones((count, 1)))


@pytest.mark.thorough
@pytest.mark.parametrize("name", PUNCHES)
def test_penetration_is_the_distance_to_the_outline(name):
    punch, depth = PUNCHES[name], 0.3
    points = np.random.default_rng(0).uniform([0, -0.05], [0.8, 1.2], (600, 2))
    one = at_nodes(len(points))
    at = contact.contact_state(punch, one, points - [0, depth], depth)
    within, distance = inside(punch, points), KDTree(outline(punch), balanced_tree=False).query(points)[0]
    assert 100 < within.sum() < 550
    assert np.allclose(at.penetration[:, 0], np.where(within, distance, 0.0), atol=2e-5)


@pytest.mark.parametrize("name", [*PUNCHES, "ellipse"])
def test_forces_and_stiffness_equal_differences(name):
    punch = RigidPunch(Ellipse(0.7, 0.2), 1e4) if name == "ellipse" else PUNCHES[name]
    grid = foam_grid(Body(), Punch(), 1e-3)
    facets = contact.top_facets(grid, 1.0)
    rng, step = np.random.default_rng(2), 1e-7
    position = grid.nodes + 0.01 * rng.standard_normal(grid.nodes.shape)
    direction = rng.standard_normal((len(grid.nodes), 2))
    depth, more = 0.03, 0.7

    def state(length):
        return contact.contact_state(punch, facets, position + length * direction, depth + length * more)

    def force(length):
        on_nodes, reaction = contact.forces(punch, facets, state(length))
        return np.append(on_nodes.ravel(), reaction)

    work = np.sum(force(0)[:-1].reshape(-1, 3, 2) * direction[facets.nodes]) + force(0)[-1] * more
    rise = contact.energy(punch, facets, state(step)) - contact.energy(punch, facets, state(-step))
    assert rise / (2 * step) == pytest.approx(work, rel=1e-6)

    blocks, border, corner = contact.stiffness(punch, facets, state(0))
    change = np.einsum("faibj,fbj->fai", blocks, direction[facets.nodes]) + border * more
    reaction = np.sum(border * direction[facets.nodes]) + corner * more
    differences = (force(step) - force(-step)) / (2 * step)
    assert np.allclose(np.append(change.ravel(), reaction), differences, atol=1e-5 * np.abs(differences).max())


def test_the_complementary_energy_is_the_integral_of_the_penetration_over_the_pressure():
    punch, gaps = PUNCHES["firm"], np.linspace(0, 0.05, 2001)
    pressures = contact.pressure(punch, gaps)
    work = np.trapezoid(pressures, gaps)
    stored = at_nodes(1)
    at = contact.ContactState(gaps[-1:, None], np.array([[[0.0, 1.0]]]), np.zeros((1, 1, 2, 2)), np.zeros((1, 1), bool))
    assert contact.energy(punch, stored, at) == pytest.approx(work, rel=1e-5)
    by_gap = gaps * np.gradient(pressures, gaps)
    assert np.trapezoid(by_gap, gaps) == pytest.approx(pressures[-1] * gaps[-1] - work, rel=1e-4)
    assert contact.complementary_forces(punch, stored, at)[1] == pytest.approx(by_gap[-1], rel=1e-2)


def test_side_wall_is_told_from_the_face():
    punch = PUNCHES["flat"]
    points = np.array([[0.3, 0.01], [0.69, 0.2], [0.69, 0.01]])
    one = at_nodes(3)
    at = contact.contact_state(punch, one, points, 0.0)
    assert at.wall[:, 0].tolist() == [False, True, False]
    assert at.normal[1, 0].tolist() == [-1.0, 0.0]
