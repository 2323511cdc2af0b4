"""The rounded cylinder: exact distance, derivatives of the contact energy."""

from __future__ import annotations

import numpy as np
import pytest

from eitsim import punch as contact
from eitsim.mesh import foam_grid
from eitsim.punch import Tool
from eitsim.scene import Body, Punch

TOOLS = {"flat": Tool(0.7, 0.05, 1e4), "sphere": Tool(0.7, 0.7, 1e4)}


def outline(tool, count=200_001):
    """Points of the punch's outline: face, fillet and wall, the tip at the origin."""
    inner = tool.radius - tool.fillet
    angle = np.linspace(0, np.pi / 2, count)
    fillet = np.column_stack([inner + tool.fillet * np.sin(angle), tool.fillet * (1 - np.cos(angle))])
    face = np.column_stack([np.linspace(0, inner, count), np.zeros(count)])
    wall = np.column_stack([np.full(count, tool.radius), np.linspace(tool.fillet, 2, count)])
    return np.vstack([face, fillet, wall])


@pytest.mark.parametrize("name", TOOLS)
def test_penetration_is_the_distance_to_the_outline(name):
    tool, depth = TOOLS[name], 0.3
    points = np.random.default_rng(0).uniform([0, -0.05], [0.8, 0.2], (300, 2))
    one = contact.Facets(np.arange(len(points))[:, None], np.eye(1), np.zeros(1), np.zeros(1), np.ones(1))
    at = contact.touching(tool, one, points - [0, depth], depth)
    edge = outline(tool)
    distance = np.array([np.hypot(*(edge - p).T).min() for p in points])
    inner = tool.radius - tool.fillet
    corner = np.hypot(np.maximum(points[:, 0] - inner, 0), np.maximum(tool.fillet - points[:, 1], 0)) < tool.fillet
    inside = (points[:, 1] > 0) & (points[:, 0] < tool.radius) & corner
    assert inside.any()
    assert np.allclose(at.gap[:, 0], np.where(inside, distance, 0.0), atol=1e-5)


@pytest.mark.parametrize("name", TOOLS)
def test_forces_and_stiffness_equal_differences(name):
    tool = TOOLS[name]
    grid = foam_grid(Body(), Punch(), 1e-3)
    facets = contact.top_facets(grid, 1.0)
    rng, step = np.random.default_rng(2), 1e-7
    position = grid.nodes + 0.01 * rng.standard_normal(grid.nodes.shape)
    direction = rng.standard_normal((len(grid.nodes), 2))
    depth, more = 0.03, 0.7

    def state(length):
        return contact.touching(tool, facets, position + length * direction, depth + length * more)

    def force(length):
        on_nodes, reaction = contact.forces(tool, facets, state(length))
        return np.append(on_nodes.ravel(), reaction)

    work = np.sum(force(0)[:-1].reshape(-1, 3, 2) * direction[facets.nodes]) + force(0)[-1] * more
    rise = contact.energy(tool, facets, state(step)) - contact.energy(tool, facets, state(-step))
    assert rise / (2 * step) == pytest.approx(work, rel=1e-6)

    blocks, border, corner = contact.stiffness(tool, facets, state(0))
    change = np.einsum("faibj,fbj->fai", blocks, direction[facets.nodes]) + border * more
    reaction = np.sum(border * direction[facets.nodes]) + corner * more
    differences = (force(step) - force(-step)) / (2 * step)
    assert np.allclose(np.append(change.ravel(), reaction), differences, atol=1e-5 * np.abs(differences).max())


def test_side_wall_is_told_from_the_face():
    tool = TOOLS["flat"]
    points = np.array([[0.3, 0.01], [0.69, 0.2], [0.69, 0.01]])
    one = contact.Facets(np.arange(3)[:, None], np.eye(1), np.zeros(1), np.zeros(1), np.ones(1))
    at = contact.touching(tool, one, points, 0.0)
    assert at.wall[:, 0].tolist() == [False, True, False]
    assert at.normal[1, 0].tolist() == [-1.0, 0.0]
