"""What the end of a conducting punch's contact leaves of the signal, and its two parts, skin and conductor.

Under strains in plane a touch raises the resistance of the skin and a conductor shunts it, so that dV is a small
difference of two parts. An error of either counts as much as its part is larger than dV.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from eitsim.scene.results import ConductorPart, Readings, Touch
from eitsim.scene.scene import Punch
from touchcal.arrays import Array

Touches = tuple[tuple[Punch, Touch], ...]

# Relative error of a contact's radius where its touch has none of the contact's area; the least that is taken, since
# two meshes may agree by chance, and the largest step by which dV is differentiated.
_UNKNOWN, _LEAST, _STEP = 0.01, 2e-3, 0.02


def with_conductors(solved: Callable[[Touches], Readings], touches: Touches) -> Readings:
    """Readings of touches, `solved` by a forward solver, and where punches conduct what their contacts leave."""
    found = solved(touches)
    if not any(punch.conductor for punch, _ in touches):
        return found
    size = _size(found)
    insulated = solved(tuple((replace(punch, conductor=False), touch) for punch, touch in touches))
    end = 0.0
    for k, (punch, touch) in enumerate(touches):
        if punch.conductor:
            error = _radius_error(touch)
            step = min(error, _STEP)
            nearer = replace(touch, contact_radius_m=touch.contact_radius_m * (1 - step))
            moved = solved((*touches[:k], (punch, nearer), *touches[k + 1:]))
            end += _distance(moved, found) / size * error / step
    return replace(found, conductors=ConductorPart(_size(insulated) / size, _distance(found, insulated) / size, end))


def _radius_error(touch: Touch) -> float:
    """Relative error of the contact's radius, half that of its area."""
    return max(_UNKNOWN if touch.contact_area_error is None else touch.contact_area_error / 2, _LEAST)


def _size(readings: Readings) -> float:
    return float(np.linalg.norm(np.nan_to_num(readings.signal_V)))


def _distance(one: Readings, other: Readings) -> float:
    difference: Array = np.nan_to_num(one.signal_V - other.signal_V)
    return float(np.linalg.norm(difference))
