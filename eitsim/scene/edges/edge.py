"""Where a flat skin ends: what every edge answers, made by formulas (`disc`) or from polygons (`outline`)."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eitsim.scene.electrodes import Electrodes
from eitsim.scene.nearest_edge import NearestEdge
from touchcal.arrays import Array


class Edge(Protocol):
    """The edge of a flat skin, and of its holes; lengths in m."""

    @property
    def name(self) -> str:
        """What a user calls the part of it next to a touch."""
        ...

    @property
    def is_round(self) -> bool:
        """Whether it looks the same however it is turned about the origin."""
        ...

    @property
    def table_rim_m(self) -> float:
        """Radius, m, of the disc for whose rim tables of what edges change are made: its own, or that of a straight
        edge."""
        ...

    @property
    def corner(self) -> tuple[float, ...]:
        """Distances of its parts from a place in its usual corner, over that to the nearest."""
        ...

    @property
    def grids(self) -> tuple[str, ...]:
        """Grids on which fields of the skin may be stored."""
        ...

    @property
    def loops(self) -> tuple[Array, ...]:
        """Corners (n, 2), m, of the outer edge, counter-clockwise, then of every hole, clockwise."""
        ...

    @property
    def area_m2(self) -> float:
        """Area inside, less its holes, m^2."""
        ...

    @property
    def size_m(self) -> float:
        """Square root of its area over pi, m, by which lengths on the skin are measured."""
        ...

    @property
    def box_m(self) -> tuple[Array, Array]:
        """Least and largest coordinates (2,), m."""
        ...

    @property
    def moments_m(self) -> tuple[Array, Array]:
        """Centroid (2,), m, without holes, and means (2, 2), m^2, of the products of coordinates about it."""
        ...

    def gap_m(self, points_m: ArrayLike) -> Array:
        """Distance (...) of points (..., 2) to the nearest part of it, m; negative outside."""
        ...

    def contains(self, points_m: Array) -> NDArray[np.bool_]:
        """Whether points (..., 2) lie on the skin, or on its edge."""
        ...

    def nearest(self, point_m: ArrayLike) -> NearestEdge:
        """The part nearest to a point (2,) as part of the rim of a disc, and how near all others are."""
        ...

    def inmost_m(self, points_m: Array) -> Array:
        """Its middle (2,), m: the centre of a disc, else of points (n, 2) the one farthest from it."""
        ...

    def quarters_m(self, point_m: ArrayLike) -> Array:
        """Distances (4,), m, of a point (2,) to it in the four quarters of all directions, the nearest first."""
        ...

    def covered_rad(self, place_m: ArrayLike, radius_m: Array) -> Array:
        """Angle (...), rad, of circles of radii (...) about a place (2,) that lies on the skin."""
        ...

    def stretches_m(self, electrodes: Electrodes) -> Array:
        """First and last arc length (N, 2), m, of electrodes along it."""
        ...

    def along_m(self, arc_m: Array) -> Array:
        """Points (..., 2), m, at arc lengths (...)."""
        ...

    def path_m(self, first_m: float, last_m: float) -> Array:
        """Points (n, 2), m, from one arc length to another."""
        ...

    def outwards(self, stretches_m: Array) -> Array:
        """Directions (N, 2) out of the skin at the middles of stretches (N, 2)."""
        ...

    def check(self, electrodes: Electrodes) -> None:
        """ValueError where electrodes cannot be as they are given; names the key of [electrodes]."""
        ...

    def placed(self, electrodes: Electrodes) -> Electrodes:
        """The electrodes with the places that they have by default."""
        ...

    def by_arc(self, electrodes: Electrodes) -> Electrodes:
        """The electrodes as `moved` takes and gives them."""
        ...

    def moved(self, electrodes: Electrodes, along_m: Array) -> Electrodes:
        """Line electrodes, each further along it by an offset (N,), m."""
        ...

    def turns(self, electrodes: Electrodes) -> int:
        """How many turns about the origin take such electrodes to each other's places."""
        ...

    @property
    def keys(self) -> dict[str, Any]:
        """What it is in [body] of a scene file, by field; None for what is not written there."""
        ...
