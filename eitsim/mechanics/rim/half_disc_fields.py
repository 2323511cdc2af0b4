"""Fields inside the foam of a touch near an edge: on cells of the half disc on one side of the punch's line to the rim,
or all around the punch in an outline.

Cells lie between half-planes through the punch's axis. Radii under the punch are the mesh's; those outside are spread
from the punch's edge to the rim along every half-plane, so that the last ones lie on the rim. In an outline they end
at the first edge that is met: what lies behind a hole or around a corner, seen from the punch, has no cells.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.rim.displacement_field import Places, contact_pressure, displacement, gradient
from eitsim.mechanics.solid.kinematics import tensors
from eitsim.scene.results import Touch, Volume
from touchcal.arrays import Array

Indices = NDArray[np.int64]

# Cells an element under the punch and through the thickness, cells from there to the rim, and cells over half a turn.
_EACH, _OUTSIDE, _ANGLES = 2, 30, 36
# Distance from the punch's edge over which cells outside it start to widen, thicknesses.
_WIDENING = 0.1
# Part of the way to its cell's middle by which a corner is moved to find the element that it belongs to: cells end on
# the elements' ends, or anywhere.
INWARDS = 1e-6
# Angle between two half-planes on either side of a corner, rad, and the least turn of an edge that is one, rad.
_ASIDE, _CORNER = 1e-4, 0.15
# Corners of a cell, steps in radius, angle and height, as in VTK: hexahedra, and wedges on the axis.
_CORNERS = {"wedge": np.array([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 0, 1), (1, 1, 1), (1, 0, 1)]),
            "hexahedron": np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0),
                                    (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])}


@dataclass(frozen=True)
class Lattice:
    """Corners of the cells."""

    radius_m: Array  # (radii, angles) reference radius, m
    angle_rad: Array  # (angles,) from the direction that the volume's angles count from, rad
    height_m: Array  # (heights,) m


def volume_fields(touch: Touch) -> tuple[Array, list[tuple[str, Indices]], dict[str, Array]]:
    """Points (n, 3), m, cells by their VTK name (cells, corners), and point fields, every cell with its own corners.

    Axes are the scene's: x and y, z upwards from the untouched top; tensors (n, 9) are row by row in that order, the
    rest as in `fields.section_fields`. The half disc lies counter-clockwise of the line from the centre through the
    punch; the other half mirrors it. In an outline all that is seen from the punch has cells. Everything is of the mesh
    of the rim's change, coarser than the axisymmetric touch's, so that peaks of stress at the punch's edge come out
    lower than there; outside that mesh, a disc's radius from the punch's axis, the foam rests. Edges are free of
    traction in the mean only. ValueError where the touch keeps no such fields, or where they turn the foam inside out.
    """
    volume = touch.volume
    if volume is None:
        raise ValueError("this touch keeps no fields with the rim's effect: it comes from a table, or was solved with "
                         "a neighbour. Solve it with eitsim.mechanics.rim.solve_near_rim.")
    lattice = lattice_of(volume, _EACH)
    parts, cells, count = [], [], 0
    for name, corner in _CORNERS.items():
        at, central = _places(lattice, corner, name == "wedge")
        parts.append(_fields(volume, at, central))
        size = len(at.radius_m)
        cells.append((name, np.arange(count, count + size).reshape(-1, len(corner))))
        count += size
    points, fields = zip(*parts, strict=True)
    return np.concatenate(points), cells, {key: np.concatenate([f[key] for f in fields]) for key in fields[0]}


def lattice_of(volume: Volume, each: int, cut_rad: float | None = None) -> Lattice:
    """Corners of the cells, `each` of them an element under the punch and through the thickness. In an outline they lie
    all around the punch or, where it is given, counter-clockwise of a direction from the x axis alone, rad."""
    order, edge = volume.order, volume.punch_m
    angle = np.linspace(0, np.pi, _ANGLES + 1)
    if volume.edges_m is None:
        rim = np.sqrt(volume.disc_m**2 - (volume.offset_m * np.sin(angle)) ** 2) - volume.offset_m * np.cos(angle)
    else:
        angle = np.append(angle, angle[1:] + np.pi) if cut_rad is None else angle + cut_rad - volume.bearing_rad
        angle = _with_corners(volume.edges_m, volume.bearing_rad, angle)
        rim = _ways(volume.edges_m, volume.bearing_rad + angle)
    under = _divided(volume.radius_m[::order][volume.radius_m[::order] <= edge * (1 + 1e-9)], each)
    start, length = under[-1], _WIDENING * -volume.height_m[0]
    share = np.linspace(0, 1, _OUTSIDE + 1)[1:, None]
    outside = start + length * np.expm1(share * np.log1p((rim - start) / length))
    radius = np.concatenate([np.repeat(under[:, None], len(angle), axis=1), outside])
    return Lattice(radius, angle, _divided(volume.height_m[::order], each))


def _with_corners(edges_m: Array, bearing_rad: float, angle: Array) -> Array:
    """Angles from the bearing, with those between the first and the last on either side of corners that are seen: those
    that turn, and those past which the next edge lies behind."""
    before, after = edges_m[:, 0] - _matched(edges_m), edges_m[:, 1] - edges_m[:, 0]
    bend = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], np.sum(before * after, axis=1))
    away, at = np.hypot(*edges_m[:, 0].T), np.arctan2(edges_m[:, 0, 1], edges_m[:, 0, 0])
    ways = np.stack([_ways(edges_m, at - _ASIDE), _ways(edges_m, at + _ASIDE)])
    seen = ways.max(axis=0) > away * (1 - 10 * _ASIDE)
    jump = ways.max(axis=0) > 1.1 * ways.min(axis=0)
    there = at[seen & (jump | (np.abs(bend) > _CORNER))] - bearing_rad - angle[0]
    more = angle[0] + np.concatenate([there - _ASIDE, there + _ASIDE]) % (2 * np.pi)
    return np.unique(np.concatenate([angle, more[more < angle[-1]]]))


def _matched(edges_m: Array) -> Array:
    """Start (edges, 2) of the edge that ends where each one starts."""
    ends = {tuple(end): k for k, end in enumerate(edges_m[:, 1].tolist())}
    return edges_m[[ends[tuple(start)] for start in edges_m[:, 0].tolist()], 0]


def _ways(edges_m: Array, direction_rad: Array) -> Array:
    """Distances (n,), m, from the axis to the first edge in directions (n,)."""
    ahead = np.column_stack([np.cos(direction_rad), np.sin(direction_rad)])[:, None]
    start, along = edges_m[:, 0], edges_m[:, 1] - edges_m[:, 0]
    across = ahead[..., 0] * along[:, 1] - ahead[..., 1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        way = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / across
        share = (start[:, 0] * ahead[..., 1] - start[:, 1] * ahead[..., 0]) / across
    met = (way > 0) & (share >= -1e-9) & (share <= 1 + 1e-9)
    return np.where(met, way, np.inf).min(axis=1)


def _divided(ends: Array, each: int) -> Array:
    return np.interp(np.arange(each * (len(ends) - 1) + 1) / each, np.arange(len(ends)), ends)


def _places(lattice: Lattice, corner: Indices, axis: bool) -> tuple[Places, Places]:
    """Corners of all cells, on the axis or off it, one cell after the other, and the cells' middles."""
    radii, angles = lattice.radius_m.shape
    i, j, k = np.array(np.meshgrid([0] if axis else range(1, radii - 1), range(angles - 1),
                                   range(len(lattice.height_m) - 1), indexing="ij")).reshape(3, -1)
    ends = lattice.radius_m[[i, i, i + 1, i + 1], [j, j + 1, j, j + 1]]
    middle = np.column_stack([ends.mean(axis=0), (lattice.height_m[k] + lattice.height_m[k + 1]) / 2])
    between = (lattice.angle_rad[1:] + lattice.angle_rad[:-1]) / 2
    central = Places(middle[:, 0], middle[:, 1], j, between, middle)
    i, j, k = ((cell[:, None] + step).ravel() for cell, step in zip((i, j, k), corner.T, strict=True))
    corners = np.column_stack([lattice.radius_m[i, j], lattice.height_m[k]])
    within = corners + INWARDS * (np.repeat(middle, len(corner), axis=0) - corners)
    return Places(corners[:, 0], corners[:, 1], j, lattice.angle_rad, within), central


def _fields(volume: Volume, at: Places, central: Places) -> tuple[Array, dict[str, Array]]:
    """Points and fields at corners of cells; a corner that is turned inside out takes its cell's middle."""
    axes, deformation = turn(volume, at), gradient(volume, at)
    local = np.column_stack([at.radius_m, np.zeros_like(at.radius_m), at.height_m])
    place = (axes @ local[..., None])[..., 0]
    place[:, :2] += volume.axis_m
    fine = np.linalg.det(deformation) > 0
    deformation = axes @ deformation @ np.swapaxes(axes, 1, 2)
    instead = turn(volume, central) @ gradient(volume, central) @ np.swapaxes(turn(volume, central), 1, 2)
    instead = np.repeat(instead, len(fine) // len(instead), axis=0)
    deformation = np.where(fine[:, None, None], deformation, instead)
    if not np.all(np.linalg.det(deformation) > 0):
        raise ValueError("the solution near the rim turns the foam inside out between the points of its mesh; ask for "
                         "the fields of a smaller force or depth, or of a larger gap to the rim.")
    top = at.height_m == volume.height_m[-1]
    pressure = contact_pressure(volume, at.radius_m, at.angle_rad[at.plane])
    return place, {"displacement_m": (axes @ displacement(volume, at)[..., None])[..., 0],
                   **tensors(volume.law, deformation), "contact_pressure_Pa": np.where(top, pressure, 0.0),
                   "taken_from_centre": (~fine).astype(float)}


def turn(volume: Volume, at: Places) -> Array:
    """Directions r, theta, z (n, 3, 3) in the columns, in the scene's axes."""
    angle = volume.bearing_rad + at.angle_rad
    cosine, sine, none = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    return np.array([[cosine, -sine, none], [sine, cosine, none], [none, none, none + 1]]).transpose(2, 0, 1)[at.plane]
