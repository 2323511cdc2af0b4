"""A touch and its readings on finer meshes than a plan takes: what benchmarks of whole scenes are measured against."""

import numpy as np

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.rim.solve_near_rim import FULL_DISC, Resolution, on_two_meshes
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import Readings, Touch
from eitsim.scene.scene import Scene
from eitsim.simulation.material import material_of
from eitsim.simulation.near_edges import with_signal_errors
from eitsim.simulation.routes.route import Case
from matcal.card import MaterialCard

# meshes of the change by the rim, and the wanted error of the readings
FINEST, FINELY = Resolution(2.0, 11, 22, np.inf), 2e-4


def finely_solved(scene: Scene, card: MaterialCard, *, rim: bool = False) -> tuple[Touch, Readings]:
    """A touch on elements of a quarter of the default size, near the rim on half of it with the change by finer meshes
    of the whole disc, with `rim` anywhere both; its readings on a mesh of the skin. What else the plan leaves out stays
    so."""
    (punch,), material = scene.punches, material_of(scene, card)
    law = material.law
    near, element_m = rim or Case(scene).near, default_element_m(scene.body, punch)
    size = element_m / (2 if near and not rim else 4)
    touch = solve_touch(law, scene.body, punch, element_m=size)
    if near:
        touch = with_signal_errors(on_two_meshes(touch, law, scene.body, punch, coarse=FULL_DISC, fine=FINEST))
    readings = solve(scene.body, scene.skin, scene.electrodes, scene.drive, ((punch, touch),),
                     material.skin, signal=FINELY, method="mesh")
    return touch, readings
