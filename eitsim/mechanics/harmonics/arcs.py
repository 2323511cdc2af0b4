"""Circles about the punch's axis, sampled where they lie on the skin, and the harmonics of the angle on them.

Near the rim of a disc the angle t counts from the direction to the nearest point of the rim; everything is symmetric
about that line, so half a turn serves. A circle of radius s lies inside a disc of radius R, whose centre is c away,
from cos t = (R^2 - s^2 - c^2)/(2 s c) on. In any other outline t counts from the x axis, all around. Whole circles have
equally spaced angles, which sum harmonics exactly; parts of one have Gauss points. Even harmonics are 1 and
sqrt(2) cos m t, odd ones sqrt(2) sin m t: orthonormal in the mean over a circle.

On half a turn u_r and u_z have even harmonics and u_theta odd ones. On a whole turn each order stands twice, second
with u_r and u_z odd and u_theta even: the same functions a quarter of a period on, sin m t and -cos m t in place of
cos m t and sin m t, so that derivatives are the same. The second one of order 0 is the turn about the axis, u_theta
alone.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from eitsim.scene.polygons import inside
from touchcal.arrays import Array

# Parts of a circle shorter than this, rad, are none.
_SLIVER = 1e-9


@dataclass(frozen=True)
class OffsetDisc:
    """The disc seen from the punch; lengths in any one unit."""

    disc: float  # radius of the disc
    offset: float  # distance of the punch's axis from the disc's centre
    whole_turn: ClassVar[bool] = False

    def scaled(self, factor: float) -> "OffsetDisc":
        return OffsetDisc(factor * self.disc, factor * self.offset)

    def start(self, radius: Array) -> Array:
        """Angle from which circles of these radii about the axis lie inside the disc: 0 where all of one does."""
        reach = 2 * radius * self.offset
        above = self.disc**2 - radius**2 - self.offset**2
        cosine = np.where(reach > 0, above / np.where(reach > 0, reach, 1.0), np.sign(above))
        return np.arccos(np.clip(cosine, -1.0, 1.0))

    def sampled(self, radius: Array, angles: int) -> tuple[Array, Array]:
        """Angles (n, angles) on half circles of radii (n,), and the share of the circle that each stands for."""
        start = self.start(radius)[:, None]
        t, w = np.polynomial.legendre.leggauss(angles)
        whole, share = start == 0, 1 - start / np.pi
        angle = start + (np.pi - start) * np.where(whole, (np.arange(angles) + 0.5) / angles, (t + 1) / 2)
        return angle, share * np.where(whole, 1 / angles, w / 2)


@dataclass(frozen=True, eq=False)
class OffsetOutline:
    """Any outline with its holes seen from the punch; lengths in any one unit."""

    start: Array  # (edges, 2) ends of its edges, as in `eitsim.scene.edges.outline.corners_and_edges`
    end: Array
    whole_turn: ClassVar[bool] = True

    def scaled(self, factor: float) -> "OffsetOutline":
        return OffsetOutline(factor * self.start, factor * self.end)

    def arcs(self, radius: float) -> Array:
        """First and last angle (k, 2) of the parts of a circle about the axis that lie inside, counter-clockwise."""
        along = self.end - self.start
        square, half = np.sum(along**2, axis=1), np.sum(self.start * along, axis=1)
        under = half**2 - square * (np.sum(self.start**2, axis=1) - radius**2)
        root = np.sqrt(np.maximum(under, 0.0))
        way = np.stack([-half - root, -half + root]) / square
        at = (self.start + way[..., None] * along)[(under > 0) & (way >= 0) & (way < 1)]
        cuts = np.unique(np.arctan2(at[:, 1], at[:, 0]))
        cuts = cuts[np.diff(cuts, append=np.inf) > _SLIVER]
        ends = np.append(cuts, cuts[:1] + 2 * np.pi) if len(cuts) else np.array([0.0, 2 * np.pi])
        middle = (ends[1:] + ends[:-1]) / 2
        kept = inside(radius * np.column_stack([np.cos(middle), np.sin(middle)]), self.start, self.end)
        return np.column_stack([ends[:-1], ends[1:]])[kept]

    def sampled(self, radius: Array, angles: int) -> tuple[Array, Array]:
        """Angles (n, angles) on circles of radii (n,), and the share of the circle that each stands for, 0 for those
        that stand for nothing."""
        angle, share = np.zeros((len(radius), angles)), np.zeros((len(radius), angles))
        for i, size in enumerate(radius.tolist()):
            arcs = self.arcs(size)
            arcs = arcs[np.argsort(arcs[:, 0] - arcs[:, 1])[:angles]]
            length = arcs[:, 1] - arcs[:, 0]
            if len(arcs) == 1 and length[0] > 2 * np.pi - _SLIVER:
                angle[i], share[i] = (np.arange(angles) + 0.5) / angles * 2 * np.pi, 1 / angles
            elif len(arcs):
                parts = [np.polynomial.legendre.leggauss(n) for n in _divided(length, angles)]
                angle[i] = np.concatenate([a + (t + 1) / 2 * b for (t, _), a, b in zip(
                    parts, arcs[:, 0], length, strict=True)])
                share[i] = np.concatenate([w / 2 * b for (_, w), b in zip(parts, length, strict=True)]) / (2 * np.pi)
        return angle, share


def _divided(length: Array, count: int) -> list[int]:
    """How many of a count of points each of several lengths has: one at least, the others where they lie farthest from
    each other."""
    out = np.ones(len(length), dtype=int)
    for _ in range(count - len(length)):
        out[np.argmax(length / out)] += 1
    return out.tolist()


@dataclass(frozen=True)
class AngularQuadrature:
    """Sampled circles."""

    weight: Array  # (circles, angles) share of the circle, summing to the part of it that lies on the skin
    # (circles, harmonics, angles) harmonics of u_r and u_z, and of u_theta
    cosine: Array
    sine: Array
    whole_turn: bool = False

    @property
    def orders(self) -> NDArray[np.int64]:
        """(harmonics,) their orders m."""
        return orders(self.cosine.shape[1], self.whole_turn)

    @property
    def inside(self) -> Array:
        """Part of each circle (circles,) that lies on the skin; 1 for whole ones."""
        return self.weight.sum(axis=1)

    @property
    def cut(self) -> NDArray[np.bool_]:
        """Whether the rim cuts a circle (circles,)."""
        return self.inside < 1 - 1e-12


def circles(outline: OffsetDisc | OffsetOutline, radius: Array, count: int, angles: int) -> AngularQuadrature:
    """Circles of radii (n,) with that many angles, and the first `count` harmonics on them."""
    angle, weight = outline.sampled(radius, angles)
    return AngularQuadrature(weight, *harmonics_at(angle, count, outline.whole_turn), outline.whole_turn)


def orders(count: int, whole_turn: bool = False) -> NDArray[np.int64]:
    """Orders (count,) of the first harmonics."""
    return np.arange(count) // (1 + whole_turn)


def odd(count: int, whole_turn: bool = False) -> NDArray[np.bool_]:
    """Which (count,) of the first harmonics have u_r and u_z odd."""
    return whole_turn & (np.arange(count) % 2 == 1)


def harmonics_at(angle: Array, count: int, whole_turn: bool = False) -> tuple[Array, Array]:
    """The first harmonics (circles, count, angles) of u_r and u_z, and of u_theta, at angles (circles, angles)."""
    m, turned = orders(count, whole_turn)[:, None], odd(count, whole_turn)[:, None]
    cosine, sine = np.cos(m * angle[:, None]), np.sin(m * angle[:, None])
    norm = np.where(m == 0, 1.0, np.sqrt(2))
    return norm * np.where(turned, sine, cosine), norm * np.where(turned, -cosine, sine)
