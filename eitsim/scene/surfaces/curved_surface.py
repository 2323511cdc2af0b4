"""What the mechanics asks of a curved outer surface, and its tangents and curvatures by differences. Lengths in m."""

from typing import Protocol

import numpy as np

from eitsim.scene.edges.edge import Edge
from touchcal.arrays import Array

# Ways of a step along, back, across and back across.
CROSS = np.array([[1, 0], [-1, 0], [0, 1], [0, -1.0]])
# The share of a normal along x from which tangents are taken from another axis.
_STEEP = 0.95


class Coordinates(Protocol):
    """A surface by two coordinates."""

    def place(self, uv: Array) -> tuple[Array, Array]:
        """Points (..., 3) and outward unit normals (..., 3) at coordinates (..., 2)."""
        ...


class Chart(Coordinates, Protocol):
    """Coordinates u, v of the surface about a place, m; lengths at the origin are those on the surface."""

    @property
    def frame(self) -> Array:
        """Two tangents and the outward normal (3, 3), in rows, at the origin; right-handed."""
        ...

    @property
    def edge(self) -> Edge:
        """Where the surface ends in these coordinates, or the coordinates do."""
        ...

    @property
    def limit_m(self) -> float:
        """Distance from the origin within which no place has two pairs of coordinates."""
        ...

    @property
    def ball_m(self) -> float | None:
        """Radius of the surface where it is a sphere laid out about the origin; None otherwise."""
        ...

    @property
    def open_m(self) -> Array | None:
        """Place (3,) of the open edge of triangles that sets the limit; None where the bend of the surface does."""
        ...

    def find(self, points: Array) -> Array:
        """Coordinates (n, 2) of the places nearest to points (n, 3) on or near the surface; NaN where they do not
        reach."""
        ...


class CurvedSurface(Protocol):
    """The outer surface of a body on a rigid core."""

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Nearest points (n, 3) of the surface to points (n, 3), and outward unit normals (n, 3) there."""
        ...

    def chart_about(self, point: Array) -> Chart:
        """Coordinates about the surface's place that is nearest to a point (3,)."""
        ...


def tangent_frame(normal: Array) -> Array:
    """Right-handed frame (3, 3) in rows: the tangent nearest to the x axis (to -z where the normal is along x), the
    second tangent, and the normal (3,)."""
    axis = np.array([0.0, 0.0, -np.sign(normal[0])]) if abs(normal[0]) > _STEEP else np.array([1.0, 0.0, 0.0])
    first = axis - (axis @ normal) * normal
    first = first / np.linalg.norm(first)
    return np.array([first, np.cross(normal, first), normal])


def second_form(at: Array, normal: Array, middle: Array) -> Array:
    """Second fundamental form (2, 2), 1/m, positive where convex, from places and unit normals (4, 3) a step along,
    back, across and back across from one of normal (3,): of normals over places, in tangents nearest to those ways."""
    moved, turned = (np.column_stack([part[0] - part[1], part[2] - part[3]]) for part in (at, normal))
    axes = orthonormal(moved, middle)[:, :2]
    form = axes.T @ turned @ np.linalg.inv(axes.T @ moved)
    return (form + form.T) / 2


def orthonormal(along: Array, normal: Array) -> Array:
    """The rotations (..., 3, 3), in columns two tangents and the normal (..., 3), nearest to the columns of (..., 3, 2)
    with which they share a plane."""
    first = along[..., 0] - np.sum(along[..., 0] * normal, axis=-1, keepdims=True) * normal
    first = first / np.linalg.norm(first, axis=-1, keepdims=True)
    second = np.cross(normal, first)
    inside = np.stack([first, second], axis=-2) @ along
    angle = np.arctan2(inside[..., 1, 0] - inside[..., 0, 1], inside[..., 0, 0] + inside[..., 1, 1])[..., None]
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([cosine * first + sine * second, cosine * second - sine * first, normal], axis=-1)


def frames(chart: Coordinates, uv: Array, step_m: float) -> Array:
    """Rotations (..., 3, 3) at coordinates (..., 2): in columns the two tangents nearest to the chart's lines, and the
    normal; by differences over a step."""
    across = step_m * np.eye(2)
    along = [(chart.place(uv + d)[0] - chart.place(uv - d)[0]) / (2 * step_m) for d in across]
    return orthonormal(np.stack(along, axis=-1), chart.place(uv)[1])
