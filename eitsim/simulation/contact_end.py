"""What the end of a conducting punch's contact leaves of the signal, and its two parts, skin and conductor.

Under strains in plane a touch raises the resistance of the skin and a conductor shunts it, so that dV is a small
difference of two parts. An error of either counts as much as its part is larger than dV.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eitsim.scene.results import ConductorPart, Readings, Touch
from eitsim.scene.scene import Punch
from touchcal.arrays import Array

Touches = tuple[tuple[Punch, Touch], ...]

# Relative error of a contact's radius where its touch states neither that nor the area's, and the largest step by which
# dV is differentiated.
_UNKNOWN, _STEP = 0.01, 0.02


def variants(touches: Touches) -> list[Touches]:
    """Touches whose readings show what conducting punches make of those of the given ones: none conducts, and each in
    turn has its contact end nearer; none where no punch conducts."""
    ends = [(*touches[:k], (punch, replace(touch, contact_radius_m=touch.contact_radius_m * (1 - _step(touch)))),
             *touches[k + 1:]) for k, (punch, touch) in enumerate(touches) if punch.conductor]
    return [tuple((replace(punch, conductor=False), touch) for punch, touch in touches), *ends] if ends else []


def with_conductors(found: Readings, touches: Touches, others: Sequence[Readings]) -> Readings:
    """Readings of touches with what the contacts of conducting punches leave, by those of their `variants`."""
    if not others:
        return found
    size, (insulated, *moved) = _size(found), others
    conducting = [touch for punch, touch in touches if punch.conductor]
    end = sum(_distance(other, found) / size * _radius_error(touch) / _step(touch)
              for other, touch in zip(moved, conducting, strict=True))
    return replace(found, conductors=ConductorPart(_size(insulated) / size, _distance(found, insulated) / size, end))


def _step(touch: Touch) -> float:
    return min(_radius_error(touch), _STEP)


def _radius_error(touch: Touch) -> float:
    """Relative error of the contact's radius; half that of its area where that is all that is known."""
    if touch.contact_end_error is not None:
        return touch.contact_end_error
    return _UNKNOWN if touch.contact_area_error is None else touch.contact_area_error / 2


def _size(readings: Readings) -> float:
    return float(np.linalg.norm(np.nan_to_num(readings.signal_V)))


def _distance(one: Readings, other: Readings) -> float:
    difference: Array = np.nan_to_num(one.signal_V - other.signal_V)
    return float(np.linalg.norm(difference))
