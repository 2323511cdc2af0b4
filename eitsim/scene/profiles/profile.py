"""What the solvers ask of a punch's profile: distance, arc length, and what its mesh and contact need."""

from typing import ClassVar, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from touchcal.arrays import Array


class SignedDistance(NamedTuple):
    """Points (...) and the point of the punch's outline that is nearest to each."""

    penetration: Array  # (...) depth inside the punch, negative outside
    # (...) its derivatives by r and by y
    normal_r: Array
    normal_y: Array
    # (...) minus its second derivative along the outline: that of the line of equal depth, positive on a round edge
    curvature: Array
    wall: NDArray[np.bool_]  # (...) whether the nearest point lies on the side wall


class Profile(Protocol):
    """Outline of a rigid punch of revolution: radius r, height y over its lowest point; lengths in any one unit."""

    is_flat: ClassVar[bool]  # whether its face is flat but for the edge, as tables of load paths take it
    sharp_tip: ClassVar[bool]  # whether it has a tip as sharp as its edge, about which the mesh is as fine
    default_penalty: ClassVar[float]  # nominal contact pressure over penetration: mu_0 over grid.feature_m

    @classmethod
    def of(cls, radius: float, fillet: float, half_angle_rad: float) -> Self:
        """The profile of a scene's punch: half its diameter, its fillet, and the angle from its axis to its face."""
        ...

    @property
    def radius(self) -> float:
        """Largest radius, that of the side wall."""
        ...

    @property
    def edge_radius(self) -> float:
        """Least radius of curvature, which the mesh resolves between `radius` less this and `radius`."""
        ...

    def with_edge(self, edge_radius: float) -> Self:
        """The same punch with another edge radius; a rounder one is solved first where an edge is hard to reach."""
        ...

    def signed_distance(self, r: Array, y: Array) -> SignedDistance:
        """Depth inside the punch of points (...), exact within an edge radius of the outline."""
        ...

    def arc_length(self, r: Array, y: Array) -> Array:
        """Length (...) of the outline from the axis to the point nearest to (r, y), outside or near the outline."""
        ...
