"""Where a touch is and how strong its multipoles are, before asking which punch made them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from surrogate.data import outlined_sheet
from surrogate.data.edge_frame import edge_frame
from surrogate.data.outlined_sheet import Sheet
from surrogate.data.sensor_ring import Ring, radial
from surrogate.forward_map import multipole_series
from surrogate.forward_map.forward_map import ForwardMap, series_signals
from surrogate.forward_map.forward_map import place as scaled_place
from surrogate.forward_map.inversion.reading_covariance import Drift, Uncertainty, of, white, whitened
from surrogate.statistics.levenberg_marquardt import minimise
from touchcal.arrays import Array, Index, Mask

# Candidate places, how many of the best go on, the orders that these are matched by, and the steps that each is given.
CANDIDATES, PLACES, MATCHED, STEPS = 400, 2, 2, 15
MARGIN_MM, MARGIN = 10.0, 0.1  # how far outside the training touches one may lie: its place, mm, and log d and log F
RIM = 0.97  # part of the disc's radius outside which no place is sought
# On a skin with an outline, distance to its edges inside which no place is sought, over that from which its fields are
# exact; steps back from the edges, of which two may be near each other; and tried candidates over those asked for.
EDGE, BACK, DENSER = 1.5, 4, 4
# Least part of what is known of a strength, the prior of the search with it, that the signal is taken to tell.
LEAST_KNOWN = 1e-6


@dataclass(frozen=True)
class Located:
    """Touches by place and strengths."""

    place_mm: Array  # (n, 2) x, y, mm
    strengths: Array  # (n, orders) p_n, V, by the signal alone
    precision: Array  # (n, orders, orders) inverse of their covariance by the signal alone, singular where it is silent

    def some(self, rows: Mask) -> Located:
        """Those of some frames."""
        return Located(self.place_mm[rows], self.strengths[rows], self.precision[rows])


def locate(forward: ForwardMap, signal: Array, sd: Array, drift: Drift) -> Located:
    """Fit place and free strengths to signals (n, readings) of standard deviation sd (n,) a reading, V, and a drift.

    All strengths but the dipole's are held by a prior as wide as the training touches, so that noise cannot blow them
    up; it is taken out of what is returned, which is a likelihood.
    """
    frames = np.repeat(np.arange(len(signal)), PLACES)
    place, size = _starts(forward, signal, drift, float(np.median(sd)) if len(sd) else 0.0)
    uncertain = white(sd, drift)
    mean, spread = (part * size[:, None] for part in _over_size(forward))
    start = np.column_stack([place, mean])

    def residuals(state: Array, which: Index) -> tuple[Array, Array]:
        frame = frames[which]
        return _residuals(forward, signal[frame], of(uncertain, frame), mean[which], spread[which], state)

    # the strengths by least squares at the start, as they are linear
    residual, jacobian = residuals(start, np.arange(len(start)))
    linear = jacobian[..., 2:]
    start[:, 2:] -= (np.linalg.pinv(linear) @ residual[..., None])[..., 0]
    found = minimise(residuals, start, STEPS,
                     lambda state: np.column_stack([on_skin(forward, state[:, :2]), state[:, 2:]]))
    best = np.argmin(found.cost.reshape(-1, PLACES), axis=1) + PLACES * np.arange(len(signal))
    state, normal = found.state[best], found.normal[best]
    # the place marginalised
    precision = normal[:, 2:, 2:] - normal[:, 2:, :2] @ np.linalg.solve(normal[:, :2, :2], normal[:, :2, 2:])
    return Located(state[:, :2], *_by_signal_alone(state[:, 2:], precision, mean[best], 1 / spread[best]))


def _starts(forward: ForwardMap, signal: Array, drift: Drift, sd_V: float) -> tuple[Array, Array]:
    """(n PLACES, 2) candidates whose first MATCHED orders leave least of the signals, mm, and sizes (n PLACES,) of the
    strengths there, V, where readings are uncertain by white noise and a drift."""
    place, base, products = planes(forward, CANDIDATES)
    part = drift.sd**2 / (drift.sd**2 + max(sd_V, np.finfo(float).tiny**0.25) ** 2)  # that whitening takes off
    drifted = np.tensordot(drift.axes, base, axes=(0, 0))
    products = products - np.einsum("d,dpk,dpl->pkl", part, drifted, drifted, optimize=True)
    norm = np.maximum(np.linalg.norm(signal, axis=1), np.finfo(float).tiny ** 0.25)
    signal = signal - (signal @ drift.axes * part) @ drift.axes.T
    along = np.tensordot(signal, base, axes=(1, 0))
    match = np.einsum("npk,pkl,npl->np", along, _pseudo_inverse(products), along, optimize=True)
    chosen = np.argsort(-match, axis=1)[:, :PLACES]
    return place[chosen.ravel()], (norm[:, None] / np.sqrt(products[:, 0, 0])[chosen]).ravel()


def _pseudo_inverse(products: Array) -> Array:
    """Inverses of products (n, k, k), of which a direction that all but vanishes is left out."""
    scale = np.sqrt(np.einsum("npp->np", products))
    both = np.maximum(scale[:, :, None] * scale[:, None, :], np.finfo(float).tiny)
    return np.asarray(np.linalg.pinv(products / both, rcond=1e-10, hermitian=True) / both, np.float64)


@lru_cache(maxsize=4)
def planes(forward: ForwardMap, count: int) -> tuple[Array, Array, Array]:
    """Places (count, 2), mm, signals (readings, count, MATCHED) of unit strengths of the first orders there, and their
    products (count, MATCHED, MATCHED)."""
    place = spiral(forward, count)
    z = scaled_place(forward.ring, place)
    base = multipole_series.basis(*multipole_series.patterns(forward.ring, forward.field, z, MATCHED))
    return place, np.ascontiguousarray(base.transpose(1, 0, 2)), base.transpose(0, 2, 1) @ base


def spiral(forward: ForwardMap, count: int) -> Array:
    """Places (count, 2) of a sunflower spiral over the training touches, mm; on a skin with an outline of an even
    sequence."""
    if forward.ring.sheet is not None:
        return _spread_places(forward.ring, forward.ring.sheet, float(forward.bounds[1, 0]), count)
    i = np.arange(count) + 0.5
    angle = np.pi * (1 + np.sqrt(5)) * i
    return (forward.bounds[1, 0] * np.sqrt(i / count) * np.array([np.cos(angle), np.sin(angle)])).T


def _spread_places(ring: Ring, sheet: Sheet, reach_mm: float, count: int) -> Array:
    """The first places (count, 2), mm, of Roberts's R2 sequence over the box of a skin that lie as far from its edges
    as its training touches."""
    low, high = sheet.start_mm.min(axis=0), sheet.start_mm.max(axis=0)
    found, first = np.zeros((0, 2)), 0
    plastic = 1.32471795724474602596
    while len(found) < count:
        k = first + np.arange(1, DENSER * count + 1)[:, None]
        tried = low + (high - low) * ((0.5 + k / plastic ** np.array([1, 2])) % 1)
        distance = outlined_sheet.edge_distance_mm(sheet, tried)[0]
        found = np.concatenate([found, tried[distance >= (ring.radius_mm - reach_mm)]])
        first += DENSER * count
    return found[:count]


def _over_size(forward: ForwardMap) -> tuple[Array, Array]:
    """Mean and spread (orders,) of p_n over the size in the training touches; the dipole's is free."""
    values = [process.values for process in forward.strengths]
    spread = np.array([2 * v.std() for v in values])
    spread[0] = np.inf
    return np.array([v.mean() for v in values]), spread


def _residuals(forward: ForwardMap, signal: Array, sd: Uncertainty, mean: Array, spread: Array,
               state: Array) -> tuple[Array, Array]:
    z = scaled_place(forward.ring, state)
    fields = forward.fields(z)
    strength = state[:, 2:]
    base, moved = series_signals(forward, fields, edge_frame(forward.ring, z), strength)
    misfit = multipole_series.combined(base, strength) - signal
    both = whitened(sd, np.concatenate([misfit[..., None], moved / forward.ring.radius_mm, base], axis=2))
    residual, jacobian = both[..., 0], both[..., 1:]
    holds = np.zeros((len(state), strength.shape[1], state.shape[1]))
    holds[:, :, 2:] = np.eye(strength.shape[1]) / spread[:, None]
    return (np.concatenate([residual, (strength - mean) / spread], axis=1),
            np.concatenate([jacobian, holds], axis=1))


def on_skin(forward: ForwardMap, place_mm: Array) -> Array:
    """Places (n, 2) pulled back to the training touches and a margin about them."""
    ring = forward.ring
    if ring.sheet is not None:
        return pulled(forward, place_mm, ring.radius_mm - least_from_edges_mm(forward))
    return pulled(forward, place_mm, min(float(forward.bounds[1, 0]) + MARGIN_MM, RIM * ring.radius_mm))


def pulled(forward: ForwardMap, place_mm: Array, reach_mm: float) -> Array:
    """Places (n, 2), mm, pulled back to this distance from the centre of a disc; on a skin with an outline from the
    edges to as much less than the largest one."""
    ring = forward.ring
    if ring.sheet is not None:
        return _from_edges(forward, ring.sheet, place_mm, ring.radius_mm - reach_mm)
    radius = np.hypot(place_mm[:, 0], place_mm[:, 1])
    return place_mm * np.minimum(1.0, reach_mm / np.maximum(radius, 1e-12))[:, None]


def sought(forward: ForwardMap, touch: Array) -> Mask:
    """(n,) whether touches (n, ...) that begin with x and y in mm lie where the fields are those of the map."""
    sheet = forward.ring.sheet
    nearest = RIM if sheet is None else 1 - EDGE * sheet.line_mm / forward.ring.radius_mm
    return radial(forward.ring, touch) <= nearest


def least_from_edges_mm(forward: ForwardMap) -> float:
    """Distance to the edges of a skin with an outline inside which no place is sought, mm."""
    assert forward.ring.sheet is not None
    return max(forward.ring.radius_mm - float(forward.bounds[1, 0]) - MARGIN_MM, EDGE * forward.ring.sheet.line_mm)


def _from_edges(forward: ForwardMap, sheet: Sheet, place_mm: Array, least_mm: float) -> Array:
    """Places (n, 2), mm, moved at right angles to the nearest edge until they are so far from all; where two edges
    are in each other's way the nearest of the candidates."""
    found = place_mm.copy()
    for _ in range(BACK):
        distance, slope = outlined_sheet.edge_distance_mm(sheet, found)
        found += np.maximum(least_mm - distance, 0.0)[:, None] * slope
    off = np.flatnonzero(outlined_sheet.edge_distance_mm(sheet, found)[0] < 0.999 * least_mm)
    if len(off):
        known = planes(forward, CANDIDATES)[0]
        found[off] = known[np.linalg.norm(known - place_mm[off, None], axis=2).argmin(axis=1)]
    return found


def on_range(forward: ForwardMap, unknown: Array) -> Array:
    """Touches (n, 4) as (x, y, log d, g) held to the training touches and a margin about them."""
    held = unknown.copy()
    held[:, :2] = on_skin(forward, unknown[:, :2])
    (d_lo, f_lo), (d_hi, f_hi) = forward.bounds[:, 1:] * np.exp(MARGIN * np.array([[-1], [1]]))
    held[:, 2] = np.clip(unknown[:, 2], np.log(d_lo), np.log(d_hi))
    area = np.exp(2 * held[:, 2]) * forward.p0
    held[:, 3] = np.clip(unknown[:, 3], np.arcsinh(f_lo / area), np.arcsinh(f_hi / area))
    return held


def _by_signal_alone(values: Array, precision: Array, mean: Array, prior: Array) -> tuple[Array, Array]:
    """Means (n, k) and precisions (n, k, k) of the normal likelihoods that make posteriors of these of a normal prior
    of these means and roots of its precisions (n, k)."""
    scale = np.sqrt(np.einsum("npp->np", precision))
    whole = precision / scale[:, :, None] / scale[:, None, :]
    held = (prior / scale) ** 2
    right = (whole @ (scale * values)[..., None])[..., 0] - held * scale * mean
    part, axes = np.linalg.eigh(whole - held[:, :, None] * np.eye(values.shape[1]))
    along = (axes.transpose(0, 2, 1) @ right[..., None])[..., 0] / np.maximum(part, LEAST_KNOWN)
    alone = (axes * np.maximum(part, 0.0)[:, None]) @ axes.transpose(0, 2, 1)
    return (axes @ along[..., None])[..., 0] / scale, alone * scale[:, :, None] * scale[:, None, :]
