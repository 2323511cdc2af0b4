"""Features of a signal on a curved skin: the place and the load of a touch whose change of the sheet makes it.

A touch changes the impedance between electrodes i and j by an integral of -g_i' M g_j, to first order, g being the
slopes of their potentials. M is taken as that of some rings about the punch: along the radius, around it, and along the
surface's first tangent. Their sizes are polynomials of the load, whose coefficients the training touches teach.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree

from surrogate.data.curved_sheet import CurvedSheet
from surrogate.data.sensor_ring import Ring
from surrogate.learners.novelty import reciprocal
from touchcal.arrays import Array

# Middles and widths of the rings, in radii of the punch.
_RINGS = np.array([[0.25, 0.25], [0.6, 0.2], [0.9, 0.15], [1.15, 0.15], [1.5, 0.25], [2.1, 0.35]])
_WAYS = 3  # along the radius, around it, and along the first tangent less across it, since bodies bend unevenly
_DEGREE = 3  # of the polynomials in the logarithm of the force
_RIDGE = 1e-8  # of the coefficients, over the mean square of their columns
_NEAR = 14  # places about the likeliest one by which its surroundings are fitted
_FORCES, _DIAMETERS, _PAST = 61, 7, 0.2  # loads that are tried, and how far outside the trained ones, of their range
_SMALLEST = 1e-3  # size of a signal over that of a middle load
_TOGETHER = 128  # signals that are looked at together


@dataclass(frozen=True, eq=False)
class Located:
    """A sheet whose touches are located."""

    sheet: CurvedSheet
    axes: Array  # (readings, k) orthonormal signals of symmetric impedance matrices
    drive: Array  # (readings, electrodes) where currents enter, and leave
    read: Array  # (readings, electrodes) which voltages are read
    radius_mm: float  # of a usual punch, which scales the rings
    # (2, 2) least and largest logarithm of the force, N, and diameter, mm, of the training
    span: Array
    coefficients: Array  # (terms, ways of rings) of the polynomials

    @cached_property
    def _basis(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """What each place's touches make of a signal along the axes: (n, k, terms) orthonormal, and (n, terms, terms)
        the coordinates along them of the polynomials' terms."""
        made = _integrated(self, self.sheet.points_mm, self.coefficients)
        q, r = np.linalg.qr(np.stack(made, axis=2).astype(np.float32))
        return q, r

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.sheet.points_mm)

    @cached_property
    def _loads(self) -> Array:
        """(loads, 2) logarithms of forces, and diameters, that are tried."""
        low, high = self.span
        room = _PAST * (high - low)
        forces = np.linspace(low[0] - room[0], high[0] + room[0], _FORCES)
        diameters = np.linspace(low[1], high[1], _DIAMETERS) if high[1] > low[1] else low[1:]
        return np.stack(np.meshgrid(forces, diameters, indexing="ij"), axis=-1).reshape(-1, 2)

    def features(self, signal_V: Array) -> Array:
        """(n, 5 or 6) the place, mm, the logarithm of the size over that of a middle load there, the logarithm of the
        force and, where it varies, the diameter, mm, of signals (n, readings)."""
        parts = [self._some(signal_V[k:k + _TOGETHER]) for k in range(0, len(signal_V), _TOGETHER)]
        width = 6 if self.span[1, 1] > self.span[0, 1] else 5
        return np.concatenate([np.empty((0, 6)), *parts])[:, :width]

    def _some(self, signal_V: Array) -> Array:
        q, r = self._basis
        seen = signal_V @ self.axes
        size = np.linalg.norm(seen, axis=1)
        along = np.einsum("nka,sk->sna", q, (seen / size[:, None]).astype(np.float32), optimize=True)
        best = np.argmax(np.sum(along**2, axis=2), axis=1)
        _, near = self._tree.query(self.sheet.points_mm[best], k=_NEAR)
        there = along[np.arange(len(best))[:, None], near] * size[:, None, None]
        made = np.einsum("snab,gb->snga", r[near], _terms(self.span, self._loads))
        misfit = np.sum((made - there[:, :, None]) ** 2, axis=3) - np.sum(there**2, axis=2)[..., None]
        least = misfit.argmin(axis=2)
        loads = self._loads[least]
        away = np.einsum("sij,snj->sni", self.sheet.frames[best],
                         self.sheet.points_mm[near] - self.sheet.points_mm[best][:, None])[..., :2]
        values = np.take_along_axis(misfit, least[..., None], axis=2)[..., 0] / size[:, None] ** 2
        moved = np.stack([_lowest(at, one) for at, one in zip(away, values, strict=True)])
        middle = r[near] @ _terms(self.span, self.span.mean(axis=0)[None])[0]
        ratio = np.sum(middle * there, axis=2) / np.sum(middle**2, axis=2)
        sizes = np.concatenate([np.log(np.maximum(ratio, _SMALLEST))[..., None], loads], axis=2)
        load = np.stack([_fitted(at, one, place) for at, one, place in zip(away, sizes, moved, strict=True)])
        place = self.sheet.points_mm[best] + np.einsum("si,sij->sj", moved, self.sheet.frames[best, :2])
        return np.column_stack([place, load])


def located(ring: Ring, places_mm: Array, force_N: Array, diameter_mm: Array, signal_V: Array) -> Located:
    """The sheet of a ring, and the rings' coefficients from signals (n, readings), V, of touches at places (n, 3)."""
    assert ring.curved is not None, "flat skins have no curved sheet"
    unit = np.eye(ring.curved.slopes.shape[2])
    loads = np.column_stack([np.log(force_N), diameter_mm])
    span = np.array([loads.min(axis=0), loads.max(axis=0)])
    blank = Located(ring.curved, reciprocal(ring), unit[ring.source] - unit[ring.sink], unit[ring.read] - unit[
        ring.ground], float(np.median(diameter_mm)) / 2, span, np.empty((0, _WAYS * len(_RINGS))))
    seen = signal_V @ blank.axes
    size = np.linalg.norm(seen, axis=1)
    made = np.stack(_integrated(blank, places_mm, np.eye(_WAYS * len(_RINGS))), axis=1)
    terms = _terms(span, loads)
    columns = np.einsum("sbk,st->sktb", made / size[:, None, None], terms).reshape(seen.size, -1)
    scale = np.linalg.norm(columns, axis=0)
    normal = (columns / scale).T @ (columns / scale) + _RIDGE * np.eye(len(scale))
    found = np.linalg.solve(normal, (columns / scale).T @ (seen / size[:, None]).ravel()) / scale
    return Located(**{**vars(blank), "coefficients": found.reshape(terms.shape[1], -1)})


def _terms(span: Array, loads: Array) -> Array:
    """(n, terms) polynomials of loads (n, 2), scaled to the training's."""
    low, high = span
    varied = high > low
    force, diameter = ((2 * loads - low - high) / np.where(varied, high - low, 1.0)).T
    powers = [force**k for k in range(_DEGREE + 1 if varied[0] else 1)]
    return np.stack(powers + ([diameter, diameter * force, diameter**2] if varied[1] else []), axis=-1)


def _products(located: Located) -> NDArray[np.float32]:
    """(3 n, k) what a change by g_1 g_1, g_1 g_2 + g_2 g_1 and g_2 g_2 at each place makes of a signal, V/mm^2."""
    along, across = np.moveaxis(located.sheet.slopes, 1, 0)
    out = np.empty((len(along), 3, located.axes.shape[1]), np.float32)
    for k in range(len(along)):
        a, b = located.drive @ along[k], located.drive @ across[k]
        c, d = located.read @ along[k], located.read @ across[k]
        out[k] = np.stack([a * c, a * d + b * c, b * d]) @ located.axes
    return out.reshape(-1, out.shape[2])


def _integrated(located: Located, places_mm: Array, mix: Array) -> list[Array]:
    """What mixtures (m, ways of rings) of rings' changes about places make of a signal: (places, k) each, V."""
    products = _products(located)
    return [weight @ products for weight in _weights(located.sheet, places_mm, located.radius_mm, mix)]


def _weights(sheet: CurvedSheet, places_mm: Array, radius_mm: float, mix: Array) -> Iterator[csr_matrix]:
    """Matrices (places, 3 n) by which the products integrate over mixtures (m, ways of rings)."""
    middles, widths = radius_mm * _RINGS.T
    near = KDTree(sheet.points_mm).query_ball_point(places_mm, float(middles[-1] + 2 * widths[-1]))
    row = np.repeat(np.arange(len(places_mm)), [len(some) for some in near])
    at = np.concatenate(near).astype(np.int64)
    x, y, _ = np.einsum("nij,nj->in", sheet.frames[at], sheet.points_mm[at] - places_mm[row])
    radius = np.hypot(x, y)
    cosine, sine = x / np.maximum(radius, 1e-9), y / np.maximum(radius, 1e-9)
    columns = np.concatenate([3 * at + k for k in range(3)])
    shape = len(places_mm), 3 * len(sheet.points_mm)
    matrix = csr_matrix((np.arange(len(columns)), (np.tile(row, 3), columns)), shape=shape)
    order = matrix.data.astype(np.int64)
    rings = [np.exp(-(((radius - middle) / width) ** 2) / 2) for middle, width in zip(middles, widths, strict=True)]
    for each in mix.reshape(len(mix), len(_RINGS), _WAYS):
        out, around, even = (sheet.areas_mm2[at] * sum(c * ring for c, ring in zip(size, rings, strict=True))
                             for size in each.T.tolist())
        change = (out * cosine**2 + around * sine**2 + even, (out - around) * cosine * sine,
                  out * sine**2 + around * cosine**2 - even)
        yield csr_matrix((np.concatenate(change)[order], matrix.indices, matrix.indptr), shape=shape)


def _quadratic(at: Array) -> Array:
    x, y = at[..., 0], at[..., 1]
    return np.stack([np.ones_like(x), x, y, x**2, x * y, y**2], axis=-1)


def _lowest(at: Array, values: Array) -> Array:
    """(2,) where the quadratic through values at places (n, 2) is lowest, no further than they reach."""
    reach = float(np.abs(at).max())
    weight = np.exp(-np.sum(at**2, axis=1) / (2 * (reach / 2) ** 2))
    _, *slope, xx, xy, yy = np.linalg.lstsq(weight[:, None] * _quadratic(at), weight * values, rcond=None)[0]
    curving = np.array([[2 * xx, xy], [xy, 2 * yy]])
    if np.linalg.eigvalsh(curving)[0] <= 0:
        return np.zeros(2)
    found = -np.linalg.solve(curving, slope)
    return found * min(1.0, reach / max(float(np.linalg.norm(found)), 1e-300))


def _fitted(at: Array, values: Array, place: Array) -> Array:
    """(k,) the quadratic through values (n, k) at places (n, 2), at a place."""
    return _quadratic(place) @ np.linalg.lstsq(_quadratic(at), values, rcond=None)[0]
