"""What several straight edges change of a touch: what each changes by itself, from a table, added up.

What is left out is what one edge changes of another's change, of second order in both. Metrics less 1, added depths,
displacements, and ratios less 1 of pressure, areas and stretches normal to the surface are added.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eitsim.mechanics.load_paths.rim_table import change_from
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.correction import RimCorrection, apply_correction, within_face
from eitsim.scene.nearest_edge import straight_edges
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Body, Punch
from eitsim.sheet.sheet_conductance import changes, moved
from touchcal.arrays import Array

_ANGLES = 97  # Angles of a whole turn at which the sum is sampled, the first one twice.


def near_edges_from(table: Table, touch: Touch, body: Body, punch: Punch, left_out: float) -> Touch | None:
    """An axisymmetric touch with the changes by all straight edges that the table reaches; None where other edges are
    as near, or the table does not serve one of them. left_out: what adding them up may cost of depth and signals."""
    unit = body.thickness_m
    if table.rim is None or punch.force_N is None or not table.shape.straight:
        return None
    size = punch.diameter_m / unit
    lines = straight_edges(body.outline, (punch.x_m, punch.y_m), (size / 2 + float(table.rim.gaps[-1])) * unit)
    parts = [change_from(table.shape, table.rim, size, away / unit - size / 2, touch.depth_m / unit)
             for _, away in lines]
    found = [part for part in parts if part is not None]
    if not found or len(found) < len(parts):
        return None
    total = summed_changes([part.change for part in found], [towards for towards, _ in lines])
    assert total.field.error_estimate is not None
    field = replace(total.field, radius_m=total.field.radius_m * unit, displacement_m=total.field.displacement_m * unit,
                    error_estimate=total.field.error_estimate + left_out)
    change = replace(total, field=field, depth_m=total.depth_m * unit)
    return replace(within_face(apply_correction(touch, change), punch),
                   depth_error=touch.depth_error + sum(part.depth_error for part in found),
                   signal_errors=touch.signal_errors + np.sum([part.signal_errors for part in found], axis=0))


def summed_changes(each: Sequence[RimCorrection], towards: Sequence[Array]) -> RimCorrection:
    """The sum of changes, on the same circles, by edges in these directions (2,)."""
    radius, share = each[0].field.radius_m, np.linspace(0, 1, _ANGLES)
    place = radius[:, None, None] * np.column_stack([np.cos(2 * np.pi * share), np.sin(2 * np.pi * share)])
    shift, metric, normal = np.zeros((*place.shape[:2], 3)), np.zeros((*place.shape, 2)), np.ones(place.shape[:2])
    off = np.zeros(4)
    for one, direction in zip(each, towards, strict=True):
        axes = np.array([direction, [-direction[1], direction[0]]])
        local = place @ axes.T
        by, factor = changes(one.field, local)
        by_shift = moved(one.field, local)
        metric += axes.T @ (by - np.eye(2)) @ axes
        normal += factor - 1
        shift += np.concatenate([by_shift[..., :2] @ axes, by_shift[..., 2:]], axis=-1)
        off = off + (0.0 if one.field.error_estimate is None else one.field.error_estimate)
    for part in (shift, metric, normal):
        part[:, -1] = part[:, 0]
    metric = (metric + np.eye(2))[..., [0, 0, 1], [0, 1, 1]]
    field = RimField(radius, share, shift, metric, normal, np.inf, 0.0, np.array([1.0, 0.0]), error_estimate=off,
                     whole_turn=True)
    depth, pressure, area, wall, lost = np.array(
        [[one.depth_m, one.pressure - 1, one.area - 1, one.wall - 1, one.fraction_non_elliptic]
         for one in each]).sum(axis=0).tolist()
    return RimCorrection(field, depth, 1 + pressure, 1 + area, max(1 + wall, 0.0), min(lost, 1.0), ())
