"""Captions say that a touch is changed for every way to solve one but the axisymmetric."""

from eitsim.simulation.routes.axisymmetric import AXISYMMETRIC
from eitsim.simulation.routes.known_routes import ROUTES
from reports.touch.touch_report import CHANGED


def test_every_route_but_the_axisymmetric_changes_the_touch() -> None:
    assert {route.kind for route in ROUTES} - {AXISYMMETRIC.kind} == CHANGED
