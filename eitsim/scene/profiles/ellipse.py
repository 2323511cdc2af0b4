"""A punch whose end is half an ellipsoid of revolution, on a shank; between a flat punch and a hemisphere."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from scipy.special import ellipeinc

from eitsim.scene.profiles.profile import SignedDistance
from touchcal.arrays import Array

# Newton's iterations towards the nearest point, which converge from one side.
_ITERATIONS = 60


@dataclass(frozen=True)
class Ellipse:
    """Half an ellipse of semi-axes a = radius and b = sqrt(a f), b at most a, where f is its radius of curvature at the
    edge: a hemisphere where f = a."""

    is_flat: ClassVar[bool] = False
    sharp_tip: ClassVar[bool] = False
    default_penalty: ClassVar[float] = 525.0

    radius: float
    edge_radius: float

    @classmethod
    def of(cls, radius: float, fillet: float, half_angle_rad: float) -> Self:
        """The ellipse whose radius of curvature at the edge is the fillet; the half-angle has no effect."""
        return cls(radius, fillet)

    @property
    def height(self) -> float:
        """Semi-axis b along the punch's axis."""
        return float(np.sqrt(self.radius * self.edge_radius))

    def with_edge(self, edge_radius: float) -> Self:
        """The same width with another edge, at most that of the hemisphere."""
        return replace(self, edge_radius=min(edge_radius, self.radius))

    def signed_distance(self, r: Array, y: Array) -> SignedDistance:
        """Depth (...) inside the nearest point (a^2 r/(s + a^2), b^2 z/(s + b^2)), z = b - y, of the ellipse, or inside
        the side wall where y >= b; s is the largest root of (a r/(s + a^2))^2 + (b z/(s + b^2))^2 = 1."""
        a, b = self.radius, self.height
        wall = y >= b
        z = np.where(wall, b, b - y)
        s = np.maximum(a * r - a**2, b * z - b**2)
        for _ in range(_ITERATIONS):
            u, v = a * r / (s + a**2), b * z / (s + b**2)
            step = (u**2 + v**2 - 1) / (2 * (u**2 / (s + a**2) + v**2 / (s + b**2)))
            s = s + step
            if np.all(np.abs(step) <= 1e-15 * a**2):
                break
        p, q = r / (s + a**2), z / (s + b**2)
        size = np.hypot(p, q)
        depth = np.where(wall, a - r, -s * size)
        bend = 1 / (a**2 * b**2 * size**3 - depth)
        return SignedDistance(depth, np.where(wall, -1.0, -p / size), np.where(wall, 0.0, q / size),
                              np.where(wall, 0.0, bend), wall)

    def arc_length(self, r: Array, y: Array) -> Array:
        """Length (...) of the outline from the axis: a E(t, 1 - b^2/a^2), sin t the nearest point's radius over a."""
        a, b = self.radius, self.height
        at = self.signed_distance(r, y)
        t = np.arctan2(-a * at.normal_r, b * at.normal_y)
        return a * ellipeinc(t, 1 - (b / a) ** 2) + np.where(at.wall, y - b, 0.0)
