"""The edges of a skin as presses know them: a circle, or closed polygons."""

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from eitsim.scene.polygons import inside, squared_distance
from touchcal.arrays import Array, Mask

Place = tuple[float, float]  # x, y, mm
ON_LINE = 1e-3  # ends of edges that are less than this part of a reach off a line lie on it
SLACK_MM = 1e-3  # rounding of places and edges that a press is not refused for


class Edges(Protocol):
    """What is asked of the edges of a skin; places in mm."""

    @property
    def middle_mm(self) -> Place:
        """The middle of the box about the skin."""
        ...

    def held(self, place: Place, gap_mm: float) -> Place:
        """The place that is pressed instead of another one."""
        ...

    def refuses(self, place: Place, diameter_mm: float, gap_mm: float) -> bool:
        """Whether a punch whose axis must keep this distance from the edges may not be pressed there."""
        ...

    def document(self) -> dict[str, Any]:
        """The edges and the box (x, y, x, y) about them, as a page draws them."""
        ...


@dataclass(frozen=True)
class Circle:
    """The edge of a disc: presses outside the allowed radius are pulled onto it, so that none is refused."""

    centre_mm: Place
    radius_mm: float

    @property
    def middle_mm(self) -> Place:
        """The centre."""
        return self.centre_mm

    def held(self, place: Place, gap_mm: float) -> Place:
        """The place, pulled towards the centre."""
        x, y = (place[k] - self.centre_mm[k] for k in (0, 1))
        reach, far = self.radius_mm - gap_mm, math.hypot(x, y)
        pull = min(1.0, reach / far) if far > 0 else 1.0
        return self.centre_mm[0] + x * pull, self.centre_mm[1] + y * pull

    def refuses(self, place: Place, diameter_mm: float, gap_mm: float) -> bool:
        """Never."""
        return False

    def document(self) -> dict[str, Any]:
        """As of Edges."""
        (x, y), r = self.centre_mm, self.radius_mm
        return {"circle_mm": [x, y, r], "loops_mm": [], "box_mm": [x - r, y - r, x + r, y + r]}


def by_one_straight_edge(place: Array, start: Array, end: Array, reach: float) -> Mask:
    """(n,) whether all edges from `start` to `end` (edges, 2) that are nearer to places (n, 2) than a reach lie on the
    line of the nearest one."""
    square = squared_distance(place[:, None], start, end)
    nearest, along = square.argmin(axis=1), end - start
    normal = (np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None])[nearest]
    first = np.sum(normal * start[nearest], axis=1)[:, None]
    off = np.maximum(np.abs(normal @ start.T - first), np.abs(normal @ end.T - first))
    return np.where(off > ON_LINE * reach, square, np.inf).min(axis=1) > reach**2


@dataclass(frozen=True, eq=False)
class Polygons:
    """The outer edge and the holes of a skin with an outline: presses are refused where no touch is known."""

    loops_mm: tuple[Array, ...]  # corners (n, 2) of the outer edge, then of every hole
    alone_mm: float = 0.0  # distance to the edges within which touches are known near one straight edge alone

    def _ends(self) -> tuple[Array, Array]:
        return np.vstack(self.loops_mm), np.vstack([np.roll(loop, -1, axis=0) for loop in self.loops_mm])

    def _box(self) -> tuple[Array, Array]:
        return self.loops_mm[0].min(axis=0), self.loops_mm[0].max(axis=0)

    def distance_mm(self, place: Place) -> float:
        """Distance of a place to the nearest edge, negative off the skin."""
        at, (start, end) = np.array(place), self._ends()
        away = float(np.sqrt(squared_distance(at, start, end).min()))
        return away if inside(at, start, end) else -away

    @property
    def middle_mm(self) -> Place:
        """As of Edges."""
        x, y = np.mean(self._box(), axis=0).tolist()
        return x, y

    def held(self, place: Place, gap_mm: float) -> Place:
        """The place, pulled into the box about the skin."""
        x, y = np.clip(place, *self._box()).tolist()
        return x, y

    def refuses(self, place: Place, diameter_mm: float, gap_mm: float) -> bool:
        """Whether the punch does not lie on the skin, or nearer to an edge, or to two, than the model knows."""
        away = self.distance_mm(place)
        if away < max(gap_mm, diameter_mm / 2) - SLACK_MM:
            return True
        return away < self.alone_mm - SLACK_MM and not by_one_straight_edge(np.array([place]), *self._ends(),
                                                                            self.alone_mm)[0]

    def document(self) -> dict[str, Any]:
        """As of Edges."""
        low, high = self._box()
        return {"circle_mm": None, "loops_mm": [np.round(loop, 4).tolist() for loop in self.loops_mm],
                "alone_mm": self.alone_mm, "on_line": ON_LINE, "box_mm": np.round([*low, *high], 4).tolist()}

