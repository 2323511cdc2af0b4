"""How the skin under a punch near the rim answers the fields of the electrodes: a bilinear form, learned.

Whatever a touch changes within the circle of its punch, a reading changes by a bilinear form in the Taylor series of
the driving and of the reading field about the punch's axis. Turned so that the rim lies across the real axis, the
series are f^(k)(z0) (z0 / |z0|)^k a^k / k!, a half the diameter; products of their imaginary parts (along the rim) and
of their real parts (towards it) belong to coefficients that depend on diameter, load and distance to the rim alone, not
on the angle, so all rows teach them together. What the electrodes' own metal changes is left to
`surrogate.forward_map.electrode_correction`.
"""

import math
from dataclasses import dataclass

import numpy as np

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import multipole_series
from surrogate.forward_map.rim_zone import FROM, part_at, part_slope
from surrogate.statistics import coefficient_process
from surrogate.statistics.coefficient_process import SharedProcess
from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Complex, Index

# Orders of the series, and of the coefficients that they make: two for each pair of orders.
ORDERS = 3
PAIRS = tuple((i, j) for i in range(ORDERS) for j in range(i, ORDERS))
MIN_ROWS, MAX_ROWS = 200, 3000  # fewest rows that teach it, and most
SOFT = 0.03  # gaps between the punch's edge and the rim are felt as log(SOFT + gap), over the disc's radius
# Lengths of the coefficients over the spread of (log d, g, the gap's logarithm), chosen on validation rows, and over
# the step between sides where what made the data changes its method.
LENGTHS, STEP = np.array([6.0, 1.0, 1.0]), 2.0


@dataclass(frozen=True)
class Effect:
    """What is added to a signal, over the size of the strengths or another size."""

    value: Array  # (n, readings)
    slope: Array  # (n, readings, 4) derivative by (x / R, y / R, log d, g)


def zero_correction() -> SharedProcess:
    """Coefficients that are 0 everywhere."""
    q = len(LENGTHS) + 1
    return SharedProcess(np.zeros((0, q)), np.zeros(q), np.ones(q), np.zeros((1 + q, 2 * len(PAIRS))))


def fit(ring: Ring, field: Array, z: Complex, punch: Array, side: Array, left: Array, strength: Array,
        size: Array) -> SharedProcess:
    """Learn the coefficients from places z (n,), (log d, g) (n, 2), sides of the step (n,), what the series leaves
    (n, readings) of signals of these sizes (n,), and that of the strengths (n,)."""
    near = near_rim(z, MAX_ROWS)
    half = half_width(ring, punch[near, 0])
    fields = multipole_series.electrode_fields(ring, field, z[near], ORDERS + 1)
    design = _design(ring, fields, z[near], half) * (strength[near] / half**2 / size[near])[:, None, None]
    inputs = _inputs(z[near], punch[near], side[near], half)
    spread = np.std(inputs[:, :len(LENGTHS)], axis=0)
    lengths = np.append(LENGTHS * np.where(spread > 1e-6, spread, 1.0), STEP)
    return coefficient_process.fit(inputs, design, left[near] / size[near, None], lengths, order=inputs[:, 2])


def near_rim(z: Complex, most: int) -> Index:
    """Rows from FROM on of places z (n,), at most so many, spread over all of these."""
    near = np.flatnonzero(np.abs(z) > FROM)
    return near[spread_evenly(len(near), most)]


def effect(process: SharedProcess, ring: Ring, fields: Complex, z: Complex, punch: Array, side: Array) -> Effect:
    """The effect at places z (n,) that it reaches, (log d, g) (n, 2) and sides of the step (n,), where electrodes have
    these derivatives of their fields (ORDERS + 1 or more, n, electrodes)."""
    half = half_width(ring, punch[:, 0])
    mean, gradient = coefficient_process.predict(process, _inputs(z, punch, side, half))
    scale = half[:, None] ** -2
    form, by_form = _form(mean * scale), _form((gradient * scale[..., None]) @ _along(z, half))
    by_form[:, 2] -= 2 * form
    series, by_series = _series(fields, z, half)
    left = series @ form
    value = _readings(ring, left @ series.transpose(0, 2, 1))
    slopes = []
    for q in range(4):
        moved = series @ by_form[:, q] @ series.transpose(0, 2, 1)
        if q < 3:
            turned = left @ by_series[q].transpose(0, 2, 1)
            moved += turned + turned.transpose(0, 2, 1)
        slopes.append(_readings(ring, moved))
    return Effect(value, np.stack(slopes, axis=2))


def _along(z: Complex, half: Array) -> Array:
    """(n, 3, 4) derivatives of the inputs by (x / R, y / R, log d, g)."""
    unit, felt = z / np.abs(z), log_gap(z, half)[1]
    along = np.zeros((len(z), 4, 4))
    along[:, 0, 2], along[:, 1, 3] = 1.0, 1.0
    along[:, 2, :3] = -felt[:, None] * np.column_stack([unit.real, unit.imag, half])
    return along


def _form(coefficients: Array) -> Array:
    """Symmetric matrices (n, 2 ORDERS, 2 ORDERS) of coefficients (n, 2 pairs), or (n, 4, ...) of derivatives (n, 2
    pairs, 4); imaginary parts come first."""
    values = coefficients[:, None] if coefficients.ndim == 2 else coefficients.transpose(0, 2, 1)
    out = np.zeros((*values.shape[:2], 2 * ORDERS, 2 * ORDERS))
    for k, (i, j) in enumerate(PAIRS):
        for part in (0, 1):
            out[..., i + part * ORDERS, j + part * ORDERS] += values[..., 2 * k + part] / 2
            out[..., j + part * ORDERS, i + part * ORDERS] += values[..., 2 * k + part] / 2
    return out[:, 0] if coefficients.ndim == 2 else out


def _readings(ring: Ring, table: Array) -> Array:
    """(n, readings) of tables (n, electrodes, electrodes) of driving by reading electrodes."""
    flat, count = table.reshape(len(table), -1), table.shape[1]
    plus = flat[:, ring.source * count + ring.read] + flat[:, ring.sink * count + ring.ground]
    return plus - flat[:, ring.source * count + ring.ground] - flat[:, ring.sink * count + ring.read]


def counted(effect: Effect, z: Complex) -> Effect:
    """The part of an effect at places z (n,) that counts."""
    part = part_at(z)
    slope = effect.slope * part[:, None, None]
    slope[..., :2] += effect.value[..., None] * part_slope(z)[:, None]
    return Effect(effect.value * part[:, None], slope)


def half_width(ring: Ring, log_d: Array) -> Array:
    """Half the diameter over the disc's radius."""
    return np.exp(log_d) / 2 / ring.radius_mm


def log_gap(z: Complex, half: Array) -> tuple[Array, Array]:
    """(n,) log(SOFT + gap) of punches of these halves at z (n,), and its derivative by the gap, 0 for an overhang."""
    gap = 1 - np.abs(z) - half
    felt = SOFT + np.maximum(gap, 0.0)
    return np.log(felt), np.where(gap > 0, 1 / felt, 0.0)


def _inputs(z: Complex, punch: Array, side: Array, half: Array) -> Array:
    return np.column_stack([punch, log_gap(z, half)[0], side])


def _design(ring: Ring, fields: Complex, z: Complex, half: Array) -> Array:
    """(n, readings, 2 pairs) products of the series, the coefficients of which make a signal."""
    series = _series(fields, z, half)[0]
    drive, read = series[:, ring.source] - series[:, ring.sink], series[:, ring.read] - series[:, ring.ground]
    columns = [(drive[..., i] * read[..., j] + drive[..., j] * read[..., i]) / 2
               for pair in PAIRS for i, j in (pair, (pair[0] + ORDERS, pair[1] + ORDERS))]
    return np.stack(columns, axis=2)


def _series(fields: Complex, z: Complex, half: Array) -> tuple[Array, Array]:
    """(n, electrodes, 2 ORDERS) imaginary, then real parts of f^(k) (z / |z|)^k a^k / k!, and their derivatives (3,
    ...) by (x / R, y / R, log d)."""
    order = np.arange(1, ORDERS + 1)[:, None, None]
    factorial = np.array([math.factorial(k) for k in range(1, ORDERS + 1)])[:, None, None]
    scale = ((z / np.abs(z) * half)[:, None]) ** order / factorial
    value, onward = fields[:ORDERS] * scale, fields[1:ORDERS + 1] * scale
    turn = [(step * z.conj()).imag / np.abs(z) ** 2 for step in (1, 1j)]
    slopes = [onward * step + value * (1j * order * by[:, None]) for step, by in zip((1, 1j), turn, strict=True)]
    return _parts(value), np.stack([_parts(one) for one in (*slopes, value * order)])


def _parts(values: Complex) -> Array:
    """(n, electrodes, 2 ORDERS) of complex values (ORDERS, n, electrodes)."""
    return np.moveaxis(np.concatenate([values.imag, values.real]), 0, -1)
