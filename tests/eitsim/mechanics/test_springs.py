"""Facets, springs along the profile and those of a punch that sticks, each by its formula at single points."""

from __future__ import annotations

import numpy as np
import pytest

from eitsim.mechanics.contact import friction, stick_springs
from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact.friction import FrictionState
from eitsim.mechanics.contact.punch_contact import RigidPunch
from eitsim.mechanics.solid.grid import tensor_grid
from eitsim.scene.profiles.rounded_cone import Flat
from eitsim.scene.scene import Punch

GRID = tensor_grid(np.array([0.0, 0.3, 0.7, 1.2]), np.array([-1.0, -0.4, 0.0]))


def _springs(limit: float, shape: tuple[int, int] = (2, 3)) -> FrictionState:
    rng = np.random.default_rng(0)
    angle = rng.uniform(-1, 1, shape)
    return FrictionState(4.0, np.full(shape, limit), rng.normal(0, 0.5, shape), rng.normal(0, 0.3, (*shape, 2)),
                         np.stack([np.cos(angle), np.sin(angle)], axis=-1))


def test_facets_integrate_over_the_reference_surface() -> None:
    """Area pi r^2, moments of r^2, and derivatives of quadratics by the radius; only facets that start inside count."""
    facets = contact.top_facets(GRID)
    assert facets.weight.sum() == pytest.approx(np.pi * 1.2**2)
    assert np.sum(facets.weight * facets.radius**2) == pytest.approx(np.pi / 2 * 1.2**4)
    nodes = GRID.nodes[facets.nodes, 0]
    assert nodes @ facets.shape.T == pytest.approx(facets.radius)
    assert np.einsum("fpa,fa->fp", facets.slope, nodes**2) == pytest.approx(2 * facets.radius)
    assert contact.top_facets(GRID, 0.7).weight.sum() == pytest.approx(np.pi * 0.7**2)


@pytest.mark.parametrize("limit", [0.0, 0.6, np.inf])
def test_a_spring_holds_up_to_its_largest_shear_and_slips_from_there(limit: float) -> None:
    """k q^2/2 up to q = T/k, then T |q| - T^2/(2 k); the shear is the slope of that, against the slip."""
    springs = _springs(limit)
    seen = springs.moved + np.random.default_rng(1).normal(0, 0.4, springs.moved.shape)
    q = springs.slip + np.einsum("fpi,fpi->fp", springs.along, seen - springs.moved)
    found, holds = friction.shear(springs, seen), 4.0 * np.abs(q) < limit
    most = 0.0 if np.isinf(limit) else limit
    assert found.potential == pytest.approx(np.where(holds, 2 * q**2, most * np.abs(q) - most**2 / 8))
    assert found.size == pytest.approx(np.where(holds, 4 * q, most * np.sign(q)))
    assert found.slope == pytest.approx(np.where(holds, 4.0, 0.0))
    assert found.slipped == pytest.approx(np.where(holds, 0.0, np.abs(q) - most / 4), abs=1e-15)
    assert limit != 0.6 or 0 < holds.sum() < holds.size


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_damped_tangent_lies_above_what_slips(share: float) -> None:
    """The parabola of pull and tangent bounds the potential of any other slip from above; an undamped one does not."""
    facets, springs, rng = contact.top_facets(GRID), _springs(0.6, (3, 4)), np.random.default_rng(2)
    held = stick_springs.stick_springs(springs, (3, 4))
    flat, step = rng.normal(0, 0.8, (12, 3, 1)), rng.normal(0, 0.8, (12, 3, 1))
    flat[:, 1], step[:, 1] = 0.0, 0.0
    tangent = stick_springs.tangent(held, flat, share)[..., 0]
    bound = np.sum(stick_springs.pull(held, flat) * step, axis=(1, 2)) + (
        np.einsum("fi,fij,fj->f", step[..., 0], tangent, step[..., 0]) / 2)
    rise = np.sum(stick_springs.potential(held, flat + step) - stick_springs.potential(held, flat), axis=1)
    assert np.all(rise <= bound + 1e-12) == (share == 0)
    _, _, corner = friction.tangent(springs, facets, flat[:, ::2, 0].reshape(3, 4, 2), share)
    assert corner == pytest.approx(np.sum(facets.weight.ravel() * tangent[:, 2, 2]))


def test_what_springs_store_leaves_out_those_that_slip() -> None:
    springs, facets = _springs(0.6, (3, 4)), contact.top_facets(GRID)
    at = friction.shear(springs, springs.moved)
    pull = facets.weight * np.where(at.slope > 0, at.size, 0.0) * springs.along[..., 1]
    assert 0 < np.count_nonzero(at.slope) < at.slope.size
    assert friction.forces(springs, facets, springs.moved, elastic=True)[1] == pytest.approx(pull.sum())
    assert friction.energy(springs, facets, springs.moved) == pytest.approx(np.sum(facets.weight * at.potential))


def test_friction_is_named_by_its_coefficient_and_a_tenth_of_the_contacts_stiffness() -> None:
    found = [friction.coefficient(Punch(friction=kind, friction_coefficient=0.3))
             for kind in ("none", "coulomb", "stick")]
    assert found == [0.0, 0.3, np.inf]
    assert friction.stiffness(RigidPunch(Flat(0.7, 0.05), 2e4)) == pytest.approx(2e3)


@pytest.mark.parametrize("depth", [0.02, 0.08])
def test_the_direction_of_the_profile_is_where_its_arc_grows(depth: float) -> None:
    """Across the normal, outwards and up; a step along it adds its length to the arc, one along the normal none."""
    punch, facets = RigidPunch(Flat(0.7, 0.2, 0.3), 1e4), contact.top_facets(GRID, 0.9)
    position = GRID.nodes + 0.01 * np.random.default_rng(2).standard_normal(GRID.nodes.shape)
    at = friction.nearest(punch, facets, position, depth)
    state = contact.contact_state(punch, facets, position, depth)
    assert np.sum(at.along * state.normal, axis=-1) == pytest.approx(np.zeros(at.arc.shape), abs=1e-12)
    assert np.all(at.along[..., 0] >= -1e-12)
    assert np.maximum(at.penetration, 0) == pytest.approx(state.penetration)
    face = (at.arc > 0.07) & (at.arc < 0.5)
    assert face.sum() > 3
    for way, grows in ((np.array([1.0, 0.0]), at.along[..., 0]), (np.array([0.0, 1.0]), at.along[..., 1])):
        ends = [friction.nearest(punch, facets, position + s * 1e-7 * way, depth) for s in (1, -1)]
        assert ((ends[0].arc - ends[1].arc) / 2e-7)[face] == pytest.approx(grows[face], abs=1e-6)
        assert (ends[0].penetration - ends[1].penetration) / 2e-7 == pytest.approx(
            state.normal @ way, abs=1e-5)
    seen = friction.moved(facets, position - GRID.nodes, depth)
    assert seen == pytest.approx(facets.shape @ (position - GRID.nodes)[facets.nodes] + [0.0, depth])


@pytest.mark.parametrize("limit", [np.inf, 0.6])
def test_a_punch_that_sticks_or_rubs_holds_the_clipped_disc_as_the_whole_one(limit: float) -> None:
    """Along the profile the energy is that of friction; around the axis k v^2/2 more where it sticks; derivatives by
    differences; where nothing was held there is no spring."""
    held, rng = _springs(limit), np.random.default_rng(3)
    springs = stick_springs.stick_springs(held, (2, 3))
    seen = rng.normal(0, 0.4, (6, 3, 5))
    in_plane = np.moveaxis(seen[:, [0, 2]], -1, 0).reshape(5, 2, 3, 2)
    around = np.where(np.abs(held.slip) * held.stiffness < held.limit, 4.0 / 2, 0.0).reshape(6, 1)
    expected = np.stack([friction.shear(held, one).potential.ravel() for one in in_plane], axis=-1)
    assert stick_springs.potential(springs, seen) == pytest.approx(expected + around * seen[:, 1] ** 2)
    pull, steps = stick_springs.pull(springs, seen), 1e-6 * np.eye(3)[:, :, None]
    for k, step in enumerate(steps):
        rise = stick_springs.potential(springs, seen + step) - stick_springs.potential(springs, seen - step)
        assert pull[:, k] == pytest.approx(rise / 2e-6, rel=1e-6, abs=1e-8)
        change = stick_springs.pull(springs, seen + step) - stick_springs.pull(springs, seen - step)
        assert stick_springs.tangent(springs, seen)[:, :, k] == pytest.approx(change / 2e-6, rel=1e-6, abs=1e-8)
    assert not stick_springs.tangent(stick_springs.stick_springs(None, (2, 3)), seen).any()
