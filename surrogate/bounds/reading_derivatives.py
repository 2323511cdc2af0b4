"""Derivatives of readings by a touch and its card's parameters, from the adjoint sensitivities of the simulator."""

import math
from dataclasses import dataclass, replace

from eitsim.electrics.mesh.p2_triangles import HALVINGS
from eitsim.scene.scene import Accuracy, Scene
from eitsim.simulation.derivatives.readings import scene_sensitivity
from matcal.card import MaterialCard
from surrogate.bounds.fisher_information import Slopes
from surrogate.bounds.material_spread import MaterialSpread
from touchcal.arrays import Array

TOUCH = ("x_mm", "y_mm", "d_mm", "F_N")
# Halvings of the skin's mesh: with one less than the readings' own a touch takes a quarter of the time, and standard
# deviations differ by 0.2 to 1.5 % (14 mm, 80 dB: 1 N half way out, 0.3 N at the rim).
MESH_HALVINGS = HALVINGS - 1


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Readings of touches and their derivatives; leading axes are any."""

    parameters: tuple[str, ...]  # TOUCH, then the parameters of the foam and of the skin, names as in a data set
    by: Array  # (..., readings, parameters), V a unit
    baseline_V: Array  # (readings,) untouched, V


def derivatives_of(scene: Scene, card: MaterialCard, *, rim: bool = False) -> Derivatives:
    """Derivatives for a scene with one punch under a force; ValueError where it has none, NotConverged as its
    mechanics.

    rim: whether what the rim changes of the mechanics counts, which takes some 10 to 20 CPU seconds a touch instead of
    1.5 or less; the electrics is that of the whole skin without it, too. Near edges of an outline that is refused, see
    `scene_sensitivity`.
    """
    if len(scene.punches) != 1 or scene.punches[0].force_N is None:
        raise ValueError("the limit is that of one touch under a force; give one [punch] with force_N.")
    found = scene_sensitivity(scene if rim else replace(scene, accuracy=Accuracy(math.inf)), card,
                              halvings=MESH_HALVINGS)
    names = (*TOUCH, *(name for name in found.parameters if name not in TOUCH and not name.startswith("z_")))
    columns = [found.parameters.index(name) for name in names]
    return Derivatives(names, found.signal_by[:, columns], found.touched_V - found.signal_V)


def slopes_of(found: Derivatives, material: MaterialSpread) -> Slopes:
    """The derivatives by the touch, and by the material's independent standard deviations."""
    columns = [found.parameters.index(name) for name in material.parameters]
    return Slopes(found.by[..., :len(TOUCH)], found.by[..., columns] @ material.factor)
