"""How the skin under a punch near the rim answers the fields of the electrodes: a bilinear form, learned.

Whatever a touch changes within the circle of its punch, a reading changes by a bilinear form in the Taylor series of
the driving and of the reading field about the punch's axis. Turned so that the edge lies across the real axis, the
series are f^(k)(z0) u^k a^k / k!, a half the diameter, u the direction towards the nearest edge (z0 / |z0| on a disc);
products of their imaginary parts (along the edge) and of their real parts (towards it) belong to coefficients that
depend on diameter, load and distance to the edge alone, not on where along it, so all rows teach them together. What
the electrodes' own metal changes is left to `surrogate.forward_map.electrode_correction`.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from surrogate.data.edge_frame import EdgeFrame, edge_frame
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import multipole_series
from surrogate.forward_map.rim_zone import Zone, part_at, part_slope
from surrogate.statistics import coefficient_process
from surrogate.statistics.coefficient_process import SharedProcess
from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Complex, Index
from touchcal.jit import compiled

# Orders of the series near the rim of a disc, where what the electrodes add is learned, too, and near edges of an
# outline, and nodes of their coefficients, two for each pair of orders.
RIM, EDGE = (3, coefficient_process.NODES), (5, 100)
ERROR = 3  # orders of the series whose products make up the errors near edges of an outline
MIN_ROWS, MAX_ROWS = 200, 3000  # fewest rows that teach it, and most
SOFT = 0.03  # gaps between the punch's edge and the rim are felt as log(SOFT + gap), over the disc's radius
# Lengths of the coefficients over the spread of (log d, g, the gap's logarithm), chosen on validation rows, and over
# the step between sides where what made the data changes its method.
LENGTHS, STEP = np.array([6.0, 1.0, 1.0]), 2.0


@dataclass(frozen=True)
class Effect:
    """What is added to a signal, over the size of the strengths or another size."""

    parts: Array  # (n, readings, 5) the effect and its derivatives by (x / R, y / R, log d, g)

    @property
    def value(self) -> Array:
        """(n, readings) the effect."""
        return self.parts[..., 0]


def zero_correction() -> SharedProcess:
    """Coefficients that are 0 everywhere."""
    q = len(LENGTHS) + 1
    return SharedProcess(np.zeros((0, q)), np.zeros(q), np.ones(q), np.zeros((1 + q, 2 * len(pairs(RIM[0])))))


def pairs(orders: int) -> list[tuple[int, int]]:
    """Pairs of so many orders, from 0."""
    return [(i, j) for i in range(orders) for j in range(i, orders)]


def orders_of(coefficients: int) -> int:
    """Orders of the series that make so many coefficients, n (n + 1)."""
    return math.isqrt(coefficients)


def fit(ring: Ring, field: Array, z: Complex, punch: Array, side: Array, left: Array, strength: Array,
        size: Array) -> SharedProcess:
    """Learn the coefficients from places z (n,), (log d, g) (n, 2), sides of the step (n,), what the series leaves
    (n, readings) of signals of these sizes (n,), and that of the strengths (n,)."""
    some = spread_evenly(len(z), MAX_ROWS)
    half, frame = half_width(ring, punch[some, 0]), edge_frame(ring, z[some])
    orders, nodes = RIM if ring.sheet is None else EDGE
    fields = multipole_series.electrode_fields(ring, field, z[some], orders)
    design = _design(ring, fields, frame, half) * (strength[some] / half**2 / size[some])[:, None, None]
    inputs = _inputs(frame, punch[some], side[some], half)
    spread = np.std(inputs[:, :len(LENGTHS)], axis=0)
    lengths = np.append(LENGTHS * np.where(spread > 1e-6, spread, 1.0), STEP)
    return coefficient_process.fit(inputs, design, left[some] / size[some, None], lengths, inputs[:, 2], nodes)


def effect(process: SharedProcess, ring: Ring, fields: Complex, frame: EdgeFrame, punch: Array, side: Array) -> Effect:
    """The effect at the places of a frame (n) that it reaches, (log d, g) (n, 2) and sides of the step (n,), where
    electrodes have these derivatives of their fields (one more than orders, or more, n, electrodes)."""
    half = half_width(ring, punch[:, 0])
    mean, gradient = coefficient_process.predict(process, _inputs(frame, punch, side, half))
    scale = half[:, None] ** -2
    along = (_along(frame, half) * scale[..., None]).transpose(0, 2, 1)
    form, by_form = _form(mean * scale), _form(along @ gradient.transpose(0, 2, 1))
    by_form[:, 2] -= 2 * form
    series, by_series = _series(fields, frame, half, form.shape[1] // 2)
    back, left = series.transpose(0, 2, 1)[:, None], (series @ form)[:, None]
    tables = np.concatenate([left, series[:, None] @ by_form], axis=1) @ back
    turned = left @ by_series.transpose(1, 0, 3, 2)
    tables[:, 1:4] += turned
    tables[:, 1:4] += turned.transpose(0, 1, 3, 2)
    return Effect(_readings(tables, ring.source, ring.sink, ring.read, ring.ground))


def _along(frame: EdgeFrame, half: Array) -> Array:
    """(n, 4, 4) derivatives of the inputs by (x / R, y / R, log d, g)."""
    felt = log_gap(frame.radial, half)[1]
    along = np.zeros((len(half), 4, 4))
    along[:, 0, 2], along[:, 1, 3] = 1.0, 1.0
    along[:, 2, :3] = -felt[:, None] * np.column_stack([frame.outwards.real, frame.outwards.imag, half])
    return along


def _form(coefficients: Array) -> Array:
    """Symmetric matrices (..., 2 orders, 2 orders) of coefficients (..., 2 pairs); imaginary parts come first."""
    size = 2 * orders_of(coefficients.shape[-1])
    return (coefficients @ places(size // 2)).reshape(*coefficients.shape[:-1], size, size)


@lru_cache(maxsize=4)
def places(orders: int) -> Array:
    """(2 pairs, 4 orders^2) what each coefficient adds to each place of the matrix."""
    out = np.zeros((2 * len(pairs(orders)), 2 * orders, 2 * orders))
    for k, (i, j) in enumerate(pairs(orders)):
        for part in (0, 1):
            out[2 * k + part, i + part * orders, j + part * orders] += 0.5
            out[2 * k + part, j + part * orders, i + part * orders] += 0.5
    return out.reshape(len(out), -1)


@compiled
def _readings(tables: Array, source: Index, sink: Index, read: Index, ground: Index) -> Array:
    """(n, readings, k) of tables (n, k, electrodes, electrodes) of driving by reading electrodes."""
    count, each = tables.shape[:2]
    out = np.empty((count, len(source), each))
    for i in range(count):
        for r in range(len(source)):
            for k in range(each):
                table = tables[i, k]
                out[i, r, k] = (table[source[r], read[r]] + table[sink[r], ground[r]]
                                - table[source[r], ground[r]] - table[sink[r], read[r]])
    return out


def counted(effect: Effect, frame: EdgeFrame, zone: Zone, ring: Ring, size: Array,
            size_slope: Array) -> tuple[Array, Array]:
    """What an effect over sizes (n,) of slopes (n, 4), by (x, y, log d, g), adds to signals and slopes, as far as it
    counts within a zone."""
    slope = part_slope(frame, zone) / ring.radius_mm
    return _counted(effect.parts, ring.radius_mm, part_at(frame.radial, zone), slope, np.ascontiguousarray(size),
                    np.ascontiguousarray(size_slope))


@compiled
def _counted(parts: Array, radius_mm: float, part: Array, part_slope: Array, size: Array,
             size_slope: Array) -> tuple[Array, Array]:
    count, readings = parts.shape[:2]
    value, slope = np.empty((count, readings)), np.empty((count, readings, 4))
    for i in range(count):
        for r in range(readings):
            value[i, r] = parts[i, r, 0] * part[i] * size[i]
            for q in range(4):
                slope[i, r, q] = parts[i, r, 1 + q] * part[i] * size[i] / (radius_mm if q < 2 else 1.0)
                slope[i, r, q] += parts[i, r, 0] * part[i] * size_slope[i, q]
            for q in range(2):
                slope[i, r, q] += parts[i, r, 0] * part_slope[i, q] * size[i]
    return value, slope


def half_width(ring: Ring, log_d: Array) -> Array:
    """Half the diameter over the disc's radius."""
    return np.exp(log_d) / 2 / ring.radius_mm


def log_gap(radial: Array, half: Array) -> tuple[Array, Array]:
    """(n,) log(SOFT + gap) of punches of these halves at places that are so near (n,) to the edge, and its derivative
    by the gap, 0 for an overhang."""
    gap = 1 - radial - half
    felt = SOFT + np.maximum(gap, 0.0)
    return np.log(felt), np.where(gap > 0, 1 / felt, 0.0)


def _inputs(frame: EdgeFrame, punch: Array, side: Array, half: Array) -> Array:
    return np.column_stack([punch, log_gap(frame.radial, half)[0], side])


def products(ring: Ring, fields: Complex, z: Complex, log_d: Array) -> Array:
    """(n, readings, orders (2 orders + 1)) signals by all products of the series at places z (n,) with punches of log d
    (n,), those that no edge as it is thought of makes among them, over the size of the strengths, where electrodes have
    these derivatives of their fields (orders, n, electrodes)."""
    half = half_width(ring, log_d)
    series = _parts(fields * _scale(edge_frame(ring, z), half, len(fields))) / half[:, None, None]
    return _columns(ring, series, [(i, j) for i in range(2 * len(fields)) for j in range(i, 2 * len(fields))])


def _design(ring: Ring, fields: Complex, frame: EdgeFrame, half: Array) -> Array:
    """(n, readings, 2 pairs) products of the series, the coefficients of which make a signal."""
    orders = len(fields)
    series = _parts(fields * _scale(frame, half, orders))
    return _columns(ring, series, [both for pair in pairs(orders)
                                   for both in (pair, (pair[0] + orders, pair[1] + orders))])


def _columns(ring: Ring, series: Array, chosen: list[tuple[int, int]]) -> Array:
    drive, read = series[:, ring.source] - series[:, ring.sink], series[:, ring.read] - series[:, ring.ground]
    return np.stack([(drive[..., i] * read[..., j] + drive[..., j] * read[..., i]) / 2 for i, j in chosen], axis=2)


def _series(fields: Complex, frame: EdgeFrame, half: Array, orders: int) -> tuple[Array, Array]:
    """(n, electrodes, 2 orders) imaginary, then real parts of f^(k) u^k a^k / k!, and their derivatives (3, ...) by
    (x / R, y / R, log d)."""
    order, scale = np.arange(1, orders + 1)[:, None, None], _scale(frame, half, orders)
    value, onward = fields[:orders] * scale, fields[1:orders + 1] * scale
    slopes = [onward * step + value * (1j * order * by[:, None])
              for step, by in zip((1, 1j), frame.turn.T, strict=True)]
    return _parts(value), np.stack([_parts(one) for one in (*slopes, value * order)])


def _scale(frame: EdgeFrame, half: Array, orders: int) -> Complex:
    """(orders, n, 1) u^k a^k / k!."""
    order = np.arange(1, orders + 1)[:, None, None]
    factorial = np.array([math.factorial(k) for k in range(1, orders + 1)])[:, None, None]
    return ((frame.outwards * half)[:, None]) ** order / factorial


def _parts(values: Complex) -> Array:
    """(n, electrodes, 2 orders) of complex values (orders, n, electrodes)."""
    return np.moveaxis(np.concatenate([values.imag, values.real]), 0, -1)
