"""What the rim changes of a touch, along a parameter: a straight line through solutions in three dimensions.

These are solved so far apart that their meshes do not matter; radii are carried along with the punch's edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eitsim.near_rim import FINE, Fineness, rim_change
from eitsim.results import RimField
from eitsim.scene import Body, Punch
from matcal.hyperfoam import Hyperfoam

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RimLine:
    """A field of changes and its derivatives by one parameter."""

    field: RimField
    # (n,) and (n, k, ...) derivatives of radius, metric and normal factor, a unit of the parameter
    radius_m: Array
    metric: Array
    normal: Array
    # derivative of the axis's distance from the disc's centre, m a unit
    offset_m: float

    def at(self, by: float) -> RimField:
        """The field with that many units more of the parameter."""
        field = self.field
        return replace(field, radius_m=field.radius_m + by * self.radius_m, metric=field.metric + by * self.metric,
                       normal=field.normal + by * self.normal, offset_m=field.offset_m + by * self.offset_m)


def rim_line(field: RimField, body: Body, punch: Punch, at: Callable[[float], tuple[Hyperfoam, Punch]], step: float,
             fineness: Fineness = FINE) -> RimLine:
    """The line through a punch's field with the slope between `step` units less and more of a parameter, where the law
    and the punch are those of `at`; NotConverged as near_rim.rim_change."""
    ends = []
    for by in (-step, step):
        law, other = at(by)
        ends.append(_carried(rim_change(law, body, other, fineness).field, field.radius_m, punch, other))
    less, more = ends
    return RimLine(field, *((getattr(more, name) - getattr(less, name)) / (2 * step)
                            for name in ("radius_m", "metric", "normal", "offset_m")))


def _carried(field: RimField, radius_m: Array, punch: Punch, other: Punch) -> RimField:
    """The field of another punch at the radii of a punch's, moved with its edge."""
    edge, moved = punch.diameter_m / 2, other.diameter_m / 2
    inside, last = max(edge - punch.fillet_m, edge / 2), float(radius_m[-1])
    radii = np.interp(radius_m, [0.0, inside, edge, last], [0.0, moved - edge + inside, moved, moved - edge + last])
    samples = np.concatenate([field.metric, field.normal[..., None]], axis=-1).reshape(len(field.radius_m), -1)
    values = np.stack([np.interp(radii, field.radius_m, column) for column in samples.T], axis=-1)
    values = values.reshape(len(radii), len(field.share), 4)
    return replace(field, radius_m=radii, metric=values[..., :3], normal=values[..., 3])
