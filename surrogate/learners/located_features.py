"""Features of a signal on a curved skin: where a touch that changes the sheet's conductance makes it, and how much.

A small touch changes the impedance between electrodes i and j by -g_i' M g_j, to first order, g being the slopes of
their potentials there and M (2, 2) what it changes of the sheet, integrated over it. Slopes are averaged over the
punch.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from surrogate.data.curved_sheet import CurvedSheet
from surrogate.data.sensor_ring import Ring
from surrogate.learners.novelty import reciprocal
from touchcal.arrays import Array

_NEAR = 14  # places about the likeliest one by which its surroundings are fitted
_TOGETHER = 256  # signals that are looked at together


@dataclass(frozen=True, eq=False)
class Located:
    """A sheet whose touches are located."""

    sheet: CurvedSheet
    axes: Array  # (readings, k) orthonormal signals of symmetric impedance matrices
    drive: Array  # (readings, electrodes) where currents enter, and leave
    read: Array  # (readings, electrodes) which voltages are read
    radius_mm: float  # over which the products of slopes are averaged

    @cached_property
    def basis(self) -> NDArray[np.float32]:
        """(n, k, 3) what M_11, M_12 and M_22 of a touch at each place make of a signal along the axes."""
        points, tree = self.sheet.points_mm, KDTree(self.sheet.points_mm)
        along, across = np.moveaxis(self.sheet.slopes, 1, 0)
        out = np.empty((len(points), self.axes.shape[1], 3), np.float32)
        single = np.empty_like(out)
        for k in range(len(points)):
            a, b = (part[k] @ self.drive.T for part in (along, across))
            c, d = (part[k] @ self.read.T for part in (along, across))
            single[k] = self.axes.T @ np.column_stack([a * c, a * d + b * c, b * d])
        for k, near in enumerate(tree.query_ball_point(points, self.radius_mm)):
            out[k] = single[near].mean(axis=0)
        return out

    @cached_property
    def _orthonormal(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(n, k, 3) orthonormal and (n, 3, 3) their coordinates of the basis."""
        q, r = np.linalg.qr(self.basis)
        return q, r

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.sheet.points_mm)

    def features(self, signal_V: Array) -> Array:
        """(n, 7) the place, mm, log of the size of M, and M_11, M_12 and M_22 over it, of signals (n, readings)."""
        parts = [self._some(signal_V[k:k + _TOGETHER]) for k in range(0, len(signal_V), _TOGETHER)]
        return np.concatenate([np.empty((0, 7)), *parts])

    def _some(self, signal_V: Array) -> Array:
        q, r = self._orthonormal
        seen = signal_V @ self.axes
        unit = seen / np.linalg.norm(seen, axis=1, keepdims=True)
        along = np.einsum("nka,sk->sna", q, unit.astype(np.float32), optimize=True)
        best = np.argmax(np.sum(along**2, axis=2), axis=1)
        _, near = self._tree.query(self.sheet.points_mm[best], k=_NEAR)
        rows = np.arange(len(best))[:, None]
        there = along[rows, near].astype(float)  # (s, near, 3)
        energy = np.sum(there**2, axis=2)
        moments = np.linalg.solve(r[near].astype(float), there[..., None])[..., 0]
        frame = self.sheet.frames[best]
        away = np.einsum("sij,snj->sni", frame, self.sheet.points_mm[near] - self.sheet.points_mm[best][:, None])
        moved = np.stack([_highest(a[:, :2], e) for a, e in zip(away, energy, strict=True)])
        moment = np.stack([_fitted(a[:, :2], m, at) for a, m, at in zip(away, moments, moved, strict=True)])
        place = self.sheet.points_mm[best] + np.einsum("si,sij->sj", moved, frame[:, :2])
        size = np.sqrt(moment[:, 0] ** 2 + 2 * moment[:, 1] ** 2 + moment[:, 2] ** 2)
        log = np.log(size * np.linalg.norm(seen, axis=1))
        return np.column_stack([place, log, moment / size[:, None]])


def located(ring: Ring, diameter_mm: float) -> Located:
    """The sheet of a ring, for punches of about a diameter."""
    assert ring.curved is not None, "flat skins have no curved sheet"
    unit = np.eye(ring.curved.slopes.shape[2])
    return Located(ring.curved, reciprocal(ring), unit[ring.source] - unit[ring.sink], unit[ring.read] - unit[
        ring.ground], diameter_mm / 2)


def _quadratic(at: Array) -> Array:
    x, y = at[..., 0], at[..., 1]
    return np.stack([np.ones_like(x), x, y, x**2, x * y, y**2], axis=-1)


def _highest(at: Array, values: Array) -> Array:
    """(2,) where the quadratic through values at places (n, 2) is highest, no further than they reach."""
    reach = np.abs(at).max()
    weight = np.exp(-np.sum(at**2, axis=1) / (2 * (reach / 2) ** 2))
    _, *slope, xx, xy, yy = np.linalg.lstsq(weight[:, None] * _quadratic(at), weight * values, rcond=None)[0]
    curving = np.array([[2 * xx, xy], [xy, 2 * yy]])
    if np.linalg.eigvalsh(curving)[-1] >= 0:
        return np.zeros(2)
    found = -np.linalg.solve(curving, slope)
    return found * min(1.0, reach / max(float(np.linalg.norm(found)), 1e-300))


def _fitted(at: Array, values: Array, place: Array) -> Array:
    """(k,) the quadratic through values (n, k) at places (n, 2), at a place."""
    return _quadratic(place) @ np.linalg.lstsq(_quadratic(at), values, rcond=None)[0]
