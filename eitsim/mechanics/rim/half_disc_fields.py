"""Fields inside the foam of a touch near the rim: on cells of the half disc on one side of the punch's line to the rim.

Cells lie between half-planes through the punch's axis. Radii under the punch are the mesh's; those outside are spread
from the punch's edge to the rim along every half-plane, so that the last ones lie on the rim.
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
# Corners of a cell, steps in radius, angle and height, as in VTK: hexahedra, and wedges on the axis.
_CORNERS = {"wedge": np.array([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 0, 1), (1, 1, 1), (1, 0, 1)]),
            "hexahedron": np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0),
                                    (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])}


@dataclass(frozen=True)
class Lattice:
    """Corners of the cells."""

    radius_m: Array  # (radii, angles) reference radius, m
    angle_rad: Array  # (angles,) from the direction to the nearest point of the rim, rad
    height_m: Array  # (heights,) m


def volume_fields(touch: Touch) -> tuple[Array, list[tuple[str, Indices]], dict[str, Array]]:
    """Points (n, 3), m, cells by their VTK name (cells, corners), and point fields, every cell with its own corners.

    Axes are the disc's: x and y as the scene's from its centre, z upwards from the untouched top; tensors (n, 9) are
    row by row in that order, the rest as in `fields.section_fields`. The half disc lies counter-clockwise of the line
    from the centre through the punch; the other half mirrors it. Everything is of the mesh of the rim's change, coarser
    than the axisymmetric touch's, so that peaks of stress at the punch's edge come out lower than there; outside that
    mesh, a disc's radius from the punch's axis, the foam rests. The rim is free of traction in the mean only.
    ValueError where the touch keeps no such fields, or where they turn the foam inside out."""
    volume = touch.volume
    if volume is None:
        raise ValueError("this touch keeps no fields with the rim's effect: it comes from a table, or lies near the "
                         "edge of an outline, where they are not built. Solve it with "
                         "eitsim.mechanics.rim.solve_near_rim on a disc.")
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


def lattice_of(volume: Volume, each: int) -> Lattice:
    """Corners of the cells of the half disc, `each` of them an element under the punch and through the thickness."""
    order, edge, offset = volume.order, volume.punch_m, volume.offset_m
    angle = np.linspace(0, np.pi, _ANGLES + 1)
    under = _divided(volume.radius_m[::order][volume.radius_m[::order] <= edge * (1 + 1e-9)], each)
    rim = np.sqrt(volume.disc_m**2 - (offset * np.sin(angle)) ** 2) - offset * np.cos(angle)
    start, length = under[-1], _WIDENING * -volume.height_m[0]
    share = np.linspace(0, 1, _OUTSIDE + 1)[1:, None]
    outside = start + length * np.expm1(share * np.log1p((rim - start) / length))
    radius = np.concatenate([np.repeat(under[:, None], len(angle), axis=1), outside])
    return Lattice(radius, angle, _divided(volume.height_m[::order], each))


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
    place[:, :2] += volume.offset_m * np.array([np.cos(volume.bearing_rad), np.sin(volume.bearing_rad)])
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
    """Directions r, theta, z (n, 3, 3) in the columns, in the disc's axes."""
    angle = volume.bearing_rad + at.angle_rad
    cosine, sine, none = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    return np.array([[cosine, -sine, none], [sine, cosine, none], [none, none, none + 1]]).transpose(2, 0, 1)[at.plane]
