"""Touches on a body that is not flat, near ones together, in three dimensions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from eitsim.mechanics.axisymmetric.hold import solve_hold
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.contact.punch_shape import shapes_of
from eitsim.mechanics.curved.solve_on_surface import solve_on_surface
from eitsim.mechanics.general.meshing.levels import COARSE, FINE, ROUGH
from eitsim.scene.curved.curved_scene import CurvedScene
from eitsim.scene.results import SpaceField, Touch
from eitsim.scene.scene import Punch
from eitsim.simulation.material import Material
from eitsim.simulation.routes.general import requested_of_mesh
from eitsim.simulation.routes.route import NOT_MEANT, Case, Route, Values, Words
from matcal.laws.law import Law
from touchcal.choice import Choice
from touchcal.errors import NotConverged


class OnSurface(Route):
    """By coordinates of the curved surface about each group of touches; flat bodies have other routes."""

    kind = "on_surface"
    spatial = True

    def serves(self, case: Case) -> float | Choice:
        return NOT_MEANT

    def words(self, of: Values) -> Words:
        several = f"{of['count']} touches, near ones together," if of["count"] > 1 else "the touch,"
        along = "; ".join(", ".join(f"{part + 0.0:g}" for part in way) for way in of["inwards"])
        return (f"{several} solved in three dimensions on the curved body",
                f"the layer of {of['thickness_mm']:g} mm on a rigid core is laid out about each, which is "
                f"pressed along x, y, z = {along} unless it leans; a coarser mesh tells the error, which counts in the "
                f"result's own; about {of['cost_s']:.0f} CPU s")


ON_SURFACE = OnSurface()


@dataclass(frozen=True, eq=False)
class Pressed:
    """Touches on a curved body with the field that they make of its surface."""

    touches: tuple[Touch, ...]
    field: SpaceField


def pressed(scene: CurvedScene, law: Law, punches: Sequence[Punch], exact: bool = False) -> Pressed:
    """The touches of punches where the scene has them. NotConverged where no equilibrium is found, ValueError where a
    punch overhangs an edge or another one."""
    level, coarser = (FINE, COARSE) if exact else (COARSE, ROUGH)
    solved = solve_on_surface(law, scene.body.surface, scene.body.thickness_m, punches, scene.places_m, level=level,
                              coarser=coarser, shapes=shapes_of(punches, scene.body.thickness_m),
                              requested=None if exact else requested_of_mesh(scene))
    return Pressed(solved.touches, solved.field)


def alone_on_flat(scene: CurvedScene, material: Material) -> tuple[Touch, ...]:
    """What every touch gives alone, upright, on a flat layer of the same thickness, or at the end of a hold, then
    without friction; empty where one has no equilibrium there, or a shape, which is solved in three dimensions alone.
    """
    if any(punch.shape for punch in scene.punches):
        return ()
    law, body, hold = material.law, scene.body.flat, scene.hold
    punches = [_upright(punch) for punch in scene.punches]
    try:
        return tuple(solve_hold(law, material.series, body, replace(punch, friction="none"), hold)[-1][1]
                     if hold.time_s else solve_touch(law, body, punch) for punch in punches)
    except NotConverged:
        return ()


def _upright(punch: Punch) -> Punch:
    return replace(punch, x_m=0.0, y_m=0.0, tilt_rad=0.0)
