"""When half the element size is tried, and when it is out of reach."""

from __future__ import annotations

from dataclasses import replace

import pytest

from eitsim import simulate as simulation
from eitsim.axisymmetric import solve_touch
from eitsim.mesh import default_element_m
from eitsim.scene import Body, Punch, scene_from
from matcal.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def touch():
    return solve_touch(FOAM, Body(), Punch(), element_m=4 * default_element_m(Body(), Punch()))


@pytest.mark.parametrize(("friction", "error", "nodes", "tries"), [
    ("none", 0.001, 1.0, 1), ("none", 0.01, 1.0, 2), ("none", 0.5, 1.0, 2), ("none", 0.01, 20.0, 1),
    ("stick", 0.01, 1.0, 1)])
def test_half_the_element_size_is_tried_where_it_is_in_reach(touch, monkeypatch, friction, error, nodes, tries):
    """Of the mechanics 0.8 % is wanted; a large mesh, or a path with friction, stays and tells its error."""
    grown = replace(touch.section, nodes_m=touch.section.nodes_m.repeat(int(nodes), axis=0))
    sizes = []

    def solved(law, body, punch, *, strain, element_m=None):
        sizes.append(element_m)
        return replace(touch, signal_error=error, section=grown)

    monkeypatch.setattr(simulation, "solve_touch", solved)
    scene = scene_from({"punch": {"friction": friction}})
    told = simulation._touch(FOAM, scene, scene.punches[0], exact=False)
    assert len(sizes) == tries
    assert told.signal_error == error
