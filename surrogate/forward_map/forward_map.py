"""A learned forward map: touch (x, y, d, F) -> the change of every reading, with its derivatives and its own error."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import electrode_correction, multipole_series, polarization, rim_correction, rim_covariance
from surrogate.forward_map.load_coordinates import force, known_mm, light_pressure, to_unknown
from surrogate.forward_map.rim_correction import FittedCorrection
from surrogate.statistics import change_point, gaussian_process
from surrogate.statistics.gaussian_process import GaussianProcess
from touchcal.arrays import Array, Complex

MIN_ROWS = 14  # fewest training rows that the map is learned from
# Least relative error of a reading that is believed; a series that leaves less only says that the data are exact.
MIN_NOISE_FLOOR = 1e-5
# Radius over the disc's within which the multipole series is learned; outside, its strengths are those of that radius.
INTERIOR = 0.40
# Derivatives of the electrodes' fields that signals and their slopes take.
FIELDS = max(multipole_series.ORDERS, polarization.ORDERS) + 1
TOUCH_INPUTS = 3  # inputs of the strengths that the touch gives: log d, g, |z0|^2


@dataclass(frozen=True, eq=False)
class ForwardMap:
    """Multipole series whose strengths are Gaussian processes of (log d, load g, |z0|^2, material), and the effect of
    the rim; the material is some standard normal states of the card, none where one card serves all rows."""

    ring: Ring
    field: Array  # (modes,) harmonic coefficients of one electrode's field
    sign: float  # sign of the dipole strength: -1 or 1
    strengths: tuple[GaussianProcess, ...]  # log of |p_1| / F in V/N, then p_n / p_1 for n = 2 ...
    beside: FittedCorrection  # what the rim adds, and the error there
    p0: float  # pressure p0 of the load g, N/mm^2
    floor: float  # standard deviation of what the series leaves in the interior, a reading, over the norm of the signal
    mean: Array  # (4,) mean of the training touches in (x, y, log d, g), mm and N
    sd: Array  # (4,) their standard deviation
    # (2, 3) bounds of the training touches in (radius, d, F), mm, mm, N, with the gap that a draw leaves at its ends
    bounds: Array
    known_mm: Array  # diameters of the known punches that training rows share, mm; none where these vary
    rows: int  # training rows
    simulator: float  # relative error of the size of the signals that it was learned from

    @property
    def materials(self) -> int:
        """States of the material."""
        return len(self.strengths[0].centre) - TOUCH_INPUTS

    @cached_property
    def series(self) -> Complex:
        """(FIELDS, modes, electrodes) series of the electrodes' fields."""
        return multipole_series.field_series(self.ring, self.field, FIELDS)

    @property
    def discrepancies(self) -> int:
        """Standard normal unknowns besides the touch: one a strength, then those of the material."""
        return len(self.strengths) + self.materials


@dataclass(frozen=True)
class Linearised:
    """The map and its derivatives at touches given as (x, y, log d, g)."""

    signal_V: Array  # (n, readings) signal, V
    jacobian: Array  # (n, readings, 4) derivative, V per unit of each
    # (n, readings, discrepancies) derivative along each strength times that strength's standard deviation, then along
    # each state of the material, V
    discrepancy: Array


def fit(ring: Ring, touch: Array, signal_V: Array, material: Array | None = None, simulator: float = 0.0) -> ForwardMap:
    """Learn the map from touches (n, 4) in mm and N, their signals (n, readings) in V, and standard normal states of
    their materials (n, k); simulator: relative error of these signals, which is counted along the signal itself.

    ValueError where there are too few rows or the touches do not share one sign of conductance change.
    """
    if len(touch) < MIN_ROWS:
        raise ValueError(f"{len(touch)} training rows are too few for the forward map; it needs {MIN_ROWS} or more. "
                         "Sweep more scenes.")
    p0 = light_pressure(touch)
    unknown = to_unknown(touch, p0)
    material = np.zeros((len(touch), 0)) if material is None else material
    z = place(ring, touch)
    # those within the interior, or the innermost where these are few
    inner = np.abs(z) <= max(INTERIOR, float(np.sort(np.abs(z))[MIN_ROWS - 1]))
    inputs = _inputs(ring, unknown[inner], material[inner])
    field, sign, processes, floor = _series(ring, z[inner], inputs, touch[inner, 3], signal_V[inner])
    series = ForwardMap(ring, field, sign, processes, rim_correction.zero_correction(ring), p0, floor, unknown.mean(0),
                        np.maximum(unknown.std(0), 1e-6), _bounds(touch), known_mm(touch[:, 2]), len(touch), simulator)
    return _with_rim(series, z, unknown, signal_V, material)


def _with_rim(series: ForwardMap, z: Complex, unknown: Array, signal_V: Array,
              material: Array) -> ForwardMap:
    base = multipole_series.basis(*multipole_series.patterns(series.ring, series.field, z))
    value = _strengths(series, unknown, material)[0]
    left, size = signal_V - multipole_series.combined(base, value), value[:, 0] * np.linalg.norm(base[..., 0], axis=1)
    rows = rim_correction.Rows(z, unknown[:, 2:], gap(series.ring, unknown), left, value[:, 0], size,
                               np.linalg.norm(signal_V, axis=1))
    return replace(series, beside=rim_correction.fit(series.ring, series.field, rows))


def gap(ring: Ring, unknown: Array) -> Array:
    """(n,) gap between punch and rim over the disc's radius."""
    return 1 - np.abs(place(ring, unknown)) - polarization.half_width(ring, unknown[:, 2])


def _series(ring: Ring, z: Complex, inputs: Array, force_N: Array,
            signal_V: Array) -> tuple[Array, float, tuple[GaussianProcess, ...], float]:
    field = multipole_series.learn_field(ring, z, signal_V)
    found = multipole_series.strengths(ring, field, z, signal_V)
    first = found.value[:, 0]
    sign = float(np.sign(np.median(first)))
    if not np.all(first * sign > 0):
        raise ValueError(f"{np.sum(first * sign <= 0)} of {len(first)} training rows change the skin's conductance the "
                         "other way, and the forward map needs one sign. Use --method ridge or trainbr.")
    processes = [gaussian_process.fit(inputs, np.log(np.abs(first) / force_N))]
    processes += [gaussian_process.fit(inputs, found.value[:, n] / first, found.variance[:, n] / first**2)
                  for n in range(1, multipole_series.ORDERS)]
    freedom = signal_V.shape[1] - multipole_series.ORDERS
    floor = np.sqrt(np.mean(np.sum(found.residual**2, axis=1) / np.sum(signal_V**2, axis=1)) / freedom)
    return field, sign, tuple(processes), max(float(floor), MIN_NOISE_FLOOR)


def noise_floor(forward: ForwardMap, unknown: Array) -> Array:
    """(n,) standard deviation of the map's error, a reading, over the norm of the signal, at touches (n, 4) given as
    (x, y, log d, g); as large as it counts among readings that are taken for independent ones."""
    floor = np.full(len(unknown), forward.floor)
    near = electrode_correction.reaches(forward.beside.rim, place(forward.ring, unknown))
    if np.any(near):
        error = rim_covariance.size_at(forward.beside.error, gap(forward.ring, unknown[near]), unknown[near, 3])
        floor[near] = np.maximum(floor[near], error / np.sqrt(forward.beside.rim.directions.shape[2]))
    return floor * np.sqrt(forward.ring.copies)


def extent(touch: Array) -> Array:
    """(n, 3) radius, d and F of touches (n, 4)."""
    return np.column_stack([np.hypot(touch[:, 0], touch[:, 1]), touch[:, 2:]])


def _bounds(touch: Array) -> Array:
    """Lowest and highest (radius, d, F), widened twice as far as n uniform draws end inside their range, span / n."""
    reached = extent(touch)
    lowest, highest = reached.min(axis=0), reached.max(axis=0)
    gap = 2 * (highest - lowest) / len(touch)
    return np.array([np.maximum(lowest - gap, lowest / 2), highest + gap])


def linearise(forward: ForwardMap, unknown: Array, discrepancy: Array | None = None) -> Linearised:
    """Signal, derivatives and discrepancy of the map at touches (n, 4) given as (x, y, log d, g); `discrepancy`
    (n, orders) is that of the strengths, `strength_discrepancy` there or, cheaper, close by."""
    fields = multipole_series.fields_at(forward.series, place(forward.ring, unknown))
    base, by_x, by_y = multipole_series.basis_and_slopes(forward.ring, fields)
    value, slope, by_card = _strengths(forward, unknown)
    sd = strength_discrepancy(forward, unknown) if discrepancy is None else discrepancy
    jacobian = base @ slope
    jacobian[..., 0] += multipole_series.combined(by_x, value) / forward.ring.radius_mm
    jacobian[..., 1] += multipole_series.combined(by_y, value) / forward.ring.radius_mm
    signal = multipole_series.combined(base, value)
    near = np.flatnonzero(electrode_correction.reaches(forward.beside.rim, place(forward.ring, unknown)))
    if len(near):
        parts = (part[near] for part in (base, by_x, by_y, value, slope, unknown))
        added, added_slope = _near_rim(forward, fields[:, near], *parts)
        signal[near] += added
        jacobian[near] += added_slope
    along = np.concatenate([sd[:, :, None] * np.eye(sd.shape[1]), by_card], axis=2)
    change = signal[..., None] * along[:, :1] + base[..., 1:] @ (value[:, :1, None] * along[:, 1:])
    return Linearised(signal, jacobian, change)


def by_material(forward: ForwardMap, unknown: Array) -> Array:
    """(n, orders, k) derivatives of log |p_1| and of the ratios p_n / p_1 by the states of the material, at touches
    (n, 4) given as (x, y, log d, g)."""
    return _strengths(forward, unknown)[2]


def log_strengths(forward: ForwardMap, unknown: Array) -> Array:
    """(n, orders) log |p_1 / V| and the ratios p_n / p_1 of touches (n, 4) given as (x, y, log d, g)."""
    inputs = _inputs(forward.ring, unknown, np.zeros((len(unknown), forward.materials)))
    out = np.column_stack([gaussian_process.mean(process, inputs)[0] for process in forward.strengths])
    out[:, 0] += np.log(force(unknown[:, 2], unknown[:, 3], forward.p0))
    return out


def _near_rim(forward: ForwardMap, fields: Complex, base: Array, by_x: Array, by_y: Array, value: Array,
              slope: Array, unknown: Array) -> tuple[Array, Array]:
    """What polarization and the electrodes' metal add to the signal, and its derivatives by (x, y, log d, g)."""
    z, punch, dipole = place(forward.ring, unknown), unknown[:, 2:], value[:, 0]
    fitted, side = forward.beside, change_point.side(gap(forward.ring, unknown), forward.beside.step)
    answer = polarization.counted(polarization.effect(fitted.polarization, forward.ring, fields, z, punch, side), z)
    metal = polarization.counted(electrode_correction.effect(fitted.rim, forward.ring, z, punch, side), z)
    if base.shape[1] < len(fitted.rim.whole.read):
        base, by_x, by_y = multipole_series.basis_and_slopes(fitted.rim.whole, fields)
    norm, norm_slope = np.linalg.norm(base[..., 0], axis=1), np.zeros((len(z), 4))
    for k, by in enumerate((by_x, by_y)):
        norm_slope[:, k] = np.sum(base[..., 0] * by[..., 0], axis=1) / norm / forward.ring.radius_mm
    whole = answer.value + metal.value * norm[:, None]
    by_unknown = answer.slope + metal.slope * norm[:, None, None]
    by_unknown[..., :2] /= forward.ring.radius_mm
    by_unknown += metal.value[..., None] * norm_slope[:, None]
    return whole * dipole[:, None], by_unknown * dipole[:, None, None] + whole[..., None] * slope[:, :1]


def place(ring: Ring, touch: Array) -> Complex:
    """(n,) x + iy over the radius of touches (n, ...) that begin with x and y in mm."""
    return (touch[:, 0] + 1j * touch[:, 1]) / ring.radius_mm


def _inputs(ring: Ring, unknown: Array, material: Array) -> Array:
    return np.column_stack([unknown[:, 2:], np.minimum(np.abs(place(ring, unknown)), INTERIOR) ** 2, material])


def _by_unknown(ring: Ring, unknown: Array, by_input: Array) -> Array:
    """Derivatives by (x, y, log d, g) from those by (log d, g, |z0|^2, ...), last axis."""
    radial = 2 * unknown[..., :2] / ring.radius_mm**2
    radial = radial * (np.hypot(unknown[..., :1], unknown[..., 1:2]) < INTERIOR * ring.radius_mm)
    return np.concatenate([by_input[..., 2:3] * radial, by_input[..., :2]], axis=-1)


def strength_discrepancy(forward: ForwardMap, unknown: Array) -> Array:
    """(n, orders) standard deviations of log p_1 and of p_n / p_1 at touches (n, 4) given as (x, y, log d, g).

    The scatter of log p_1 about its process (noise) is discrepancy, and so is the simulator's error; that of the ratios
    is mostly what least squares on one row leaves undetermined, which the floor stands for already.
    """
    inputs = _inputs(forward.ring, unknown, np.zeros((len(unknown), forward.materials)))
    variance = np.column_stack([gaussian_process.predict(process, inputs)[2] for process in forward.strengths])
    variance[:, 0] += forward.strengths[0].noise[0] + forward.simulator**2
    return np.sqrt(variance)


def _strengths(forward: ForwardMap, unknown: Array, material: Array | None = None) -> tuple[Array, Array, Array]:
    """Strengths (n, orders), their slopes (n, orders, 4), and the derivatives (n, orders, k) of log p_1 and of the
    ratios by the material, the mean one where none is given."""
    held = np.zeros((len(unknown), forward.materials)) if material is None else material
    inputs = _inputs(forward.ring, unknown, held)
    found = [gaussian_process.mean(process, inputs) for process in forward.strengths]
    first = forward.sign * force(unknown[:, 2], unknown[:, 3], forward.p0) * np.exp(found[0][0])
    ratio = np.column_stack([np.ones(len(first))] + [mean for mean, _ in found[1:]])
    value = first[:, None] * ratio
    by_first = found[0][1].copy()
    by_first[:, 0] += 2.0
    by_first[:, 1] += 1 / np.tanh(unknown[:, 3])
    by_input = value[..., None] * by_first[:, None, :]
    for n, (_, gradient) in enumerate(found[1:], start=1):
        by_input[:, n] += first[:, None] * gradient
    slope = _by_unknown(forward.ring, unknown[:, None], by_input)
    return value, slope, np.stack([gradient[:, TOUCH_INPUTS:] for _, gradient in found], axis=1)
