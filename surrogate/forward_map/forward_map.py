"""A learned forward map: touch (x, y, d, F) -> the change of every reading, with its derivatives and its own error."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from surrogate.data.edge_frame import EdgeFrame, edge_frame
from surrogate.data.sensor_ring import Ring, outwards, place, radial
from surrogate.forward_map import (
    electrode_correction,
    known_places,
    linearised_columns,
    multipole_series,
    polarization,
    rim_correction,
    rim_covariance,
    rim_zone,
    simulator_error,
    strength_size,
    touch_strengths,
)
from surrogate.forward_map.known_places import MIN_ROWS, NearEdges, gap, gap_of, zones_of
from surrogate.forward_map.load_coordinates import known_mm, light_pressure, to_unknown
from surrogate.forward_map.multipole_series import Strengths
from surrogate.forward_map.rim_correction import FittedCorrection
from surrogate.forward_map.rim_zone import Zone, Zones
from surrogate.forward_map.simulator_error import SimulatorError
from surrogate.forward_map.strength_size import Size
from surrogate.forward_map.touch_strengths import TOUCH_INPUTS, TouchStrengths, inputs_of
from surrogate.statistics import change_point, gaussian_process
from surrogate.statistics.gaussian_process import GaussianProcess, Together
from touchcal.arrays import Array, Complex, Mask

# Least relative error of a reading that is believed; a series that leaves less only says that the data are exact.
MIN_NOISE_FLOOR = 1e-5
# Derivatives of the electrodes' fields that signals and their slopes take.
FIELDS = max(multipole_series.ORDERS, polarization.RIM[0], polarization.EDGE[0]) + 1
ONE_LOG_D = 1e-6  # least standard deviation of the unknowns, as of log d where all punches have one diameter


@dataclass(frozen=True, eq=False)
class ForwardMap:
    """Multipole series whose strengths are Gaussian processes of (log d, load g, |z0|^2, material), and the effect of
    the rim; the material is some standard normal states of the card, none where one card serves all rows. On a skin
    with an outline |z0| is 1 less the distance to the edges over the largest one, and nothing is learned of the rim."""

    ring: Ring
    field: Array  # (modes,) harmonic coefficients of one electrode's field; none on a skin with an outline
    size: Size  # positive size of the strengths over F, V/N
    strengths: tuple[GaussianProcess, ...]  # p_n over the size and F, n = 1 ...
    correction: FittedCorrection  # what the rim adds or takes the place of the series there, and the error there
    p0: float  # pressure p0 of the load g, N/mm^2
    floor: float  # standard deviation of what the series leaves in the interior, a reading, over the size of the signal
    shift_mm: float  # standard deviation of the place, along x or y, by what the series leaves in the interior
    mean: Array  # (4,) mean of the training touches in (x, y, log d, g), mm and N
    sd: Array  # (4,) their standard deviation
    # (2, 3) bounds of the training touches in (radius, d, F), mm, mm, N, with the gap that a draw leaves at its ends
    bounds: Array
    known_mm: Array  # diameters of the known punches that training rows share, mm; none where these vary
    rows: int  # training rows
    simulator: SimulatorError  # relative error of the size of the signals that it was learned from
    near_edges: NearEdges | None = None  # None on a disc, and where no touch near an edge of an outline taught

    @property
    def zones(self) -> Zones:
        """Where what the edge changes sets in."""
        known = self.near_edges
        return zones_of(self.ring, float(self.bounds[1, 0]) / self.ring.radius_mm if known is None else known.inner)

    @property
    def materials(self) -> int:
        """States of the material."""
        return len(self.strengths[0].centre) - TOUCH_INPUTS

    @cached_property
    def together(self) -> Together:
        """The processes of the strengths."""
        return Together(self.strengths)

    @cached_property
    def series(self) -> Complex:
        """(FIELDS, modes, electrodes) series of the electrodes' fields."""
        return multipole_series.field_series(self.ring, self.field, FIELDS)

    def fields(self, z: Complex) -> Complex:
        """(FIELDS, n, electrodes) derivatives of the electrodes' fields at z (n,)."""
        if self.ring.sheet is None:
            return multipole_series.fields_at(self.series, z)
        return multipole_series.electrode_fields(self.ring, self.field, z, FIELDS)

    @property
    def interior(self) -> float:
        """`EdgeFrame.radial` outside which the strengths are those of there."""
        return self.zones.learned[1]

    @property
    def own(self) -> int:
        """Standard normal unknowns of the map's own error: one a strength, the simulator's, and two of the place."""
        return len(self.strengths) + 3

    @property
    def discrepancies(self) -> int:
        """Standard normal unknowns besides the touch: those of the map's own error, then those of the material."""
        return self.own + self.materials


@dataclass(frozen=True)
class Linearised:
    """The map and its derivatives at touches given as (x, y, log d, g)."""

    # (n, readings, 5 + discrepancies) signal, V, its derivatives, V per unit of each, and those by the discrepancies:
    # along each strength times that strength's standard deviation, along the signal times the simulator's relative
    # error, by x and y times the shift of the series, then along each state of the material, V
    columns: Array

    @property
    def signal_V(self) -> Array:
        """(n, readings) signal, V."""
        return self.columns[..., 0]

    @property
    def jacobian(self) -> Array:
        """(n, readings, 4) derivatives, V per unit of each."""
        return self.columns[..., 1:5]

    @property
    def discrepancy(self) -> Array:
        """(n, readings, discrepancies) derivatives by the discrepancies, V."""
        return self.columns[..., 5:]


def fit(ring: Ring, touch: Array, signal_V: Array, material: Array | None = None,
        simulator: Array | None = None, near_edge: Mask | None = None) -> ForwardMap:
    """The map of `fit_with_errors`."""
    return fit_with_errors(ring, touch, signal_V, material, simulator, near_edge)[0]


def fit_with_errors(ring: Ring, touch: Array, signal_V: Array, material: Array | None = None,
                    simulator: Array | None = None, near_edge: Mask | None = None) -> tuple[ForwardMap, Array]:
    """Learn the map from touches (n, 4) in mm and N, their signals (n, readings) in V, and standard normal states of
    their materials (n, k); simulator: relative error (n,) of these signals, which is counted along the signal itself;
    near_edge: which of them (n,) lie near one straight edge of an outline, and no other. With it the errors (reached,
    readings), V, of the touches that what is learned of the edge `reaches`, each as the others foresee it.

    ValueError where there are too few rows.
    """
    material = np.zeros((len(touch), 0)) if material is None else material
    simulator = np.zeros(len(touch)) if simulator is None else simulator
    near_edge = np.zeros(len(touch), bool) if near_edge is None else near_edge
    if len(touch) - np.sum(near_edge) < MIN_ROWS:
        raise ValueError(f"{len(touch) - np.sum(near_edge)} training rows are too few for the forward map; it needs "
                         f"{MIN_ROWS} or more. Sweep more scenes.")
    p0, near = light_pressure(touch), radial(ring, touch)
    z, unknown, edges = place(ring, touch), to_unknown(touch, p0), known_places.near_edges_of(near, near_edge)
    zones = zones_of(ring, edges.inner)
    taught = rim_correction.taught(ring, z, unknown[:, 2:], zones)
    if np.any(near_edge) and not taught:
        kept = ~near_edge
        return fit_with_errors(ring, touch[kept], signal_V[kept], material[kept], simulator[kept])
    kept = near <= known_places.learned_within(ring, near, zones, taught)
    inputs = inputs_of(near[kept], zones.learned[1], unknown[kept], material[kept])
    field, size, processes, floor, shift = _series(ring, z[kept], inputs, touch[kept, 3], signal_V[kept])
    series = ForwardMap(ring, field, size, processes, rim_correction.zero_correction(ring),
                        p0, max(floor, MIN_NOISE_FLOOR), shift, unknown.mean(0),
                        np.maximum(unknown.std(0), ONE_LOG_D), known_places.bounds_of(ring, touch),
                        known_mm(touch[:, 2]), len(touch), simulator_error.learned_from(gap(ring, unknown), simulator),
                        edges if np.any(near_edge) else None)
    if ring.sheet is not None and series.near_edges is None:
        return series, np.zeros((0, signal_V.shape[1]))
    step = float(gap(ring, unknown[~near_edge]).min()) if np.any(near_edge) else None
    return _with_rim(series, z, unknown, signal_V, material, step)


def _with_rim(series: ForwardMap, z: Complex, unknown: Array, signal_V: Array, material: Array,
              step: float | None) -> tuple[ForwardMap, Array]:
    frame = edge_frame(series.ring, z)
    found = _strengths(series, frame, unknown, material)
    base = series_signals(series, series.fields(z), frame, found.value)[0]
    left = signal_V - multipole_series.combined(base, found.value)
    rows = rim_correction.Rows(z, unknown[:, 2:], gap(series.ring, unknown), left, found.size,
                               found.size * np.linalg.norm(base[..., 0], axis=1))
    correction, error_V = rim_correction.fit(series.ring, series.field, rows, signal_V, series.zones, step)
    return replace(series, correction=correction), error_V


def reaches(forward: ForwardMap, z: Complex) -> Mask:
    """(n,) whether touches at z (n,) are close enough to an edge for what was learned of it."""
    return _reached(forward, edge_frame(forward.ring, z))


def _reached(forward: ForwardMap, frame: EdgeFrame) -> Mask:
    if not rim_correction.teaches(forward.correction):
        return np.zeros(len(frame.z), bool)
    return frame.radial > forward.zones.learned[0]


def near_an_edge(forward: ForwardMap, touch: Array) -> Mask:
    """(n,) whether touches (n, 4) lie nearer to an edge of an outline than those that no edge was near to, where
    touches near one taught; none on a disc."""
    if forward.near_edges is None:
        return np.zeros(len(touch), bool)
    return gap(forward.ring, to_unknown(touch, forward.p0)) < forward.correction.step


def _series(ring: Ring, z: Complex, inputs: Array, force_N: Array,
            signal_V: Array) -> tuple[Array, Size, tuple[GaussianProcess, ...], float, float]:
    field = multipole_series.learn_field(ring, z, signal_V)
    found = multipole_series.strengths(ring, field, z, signal_V)
    size = strength_size.fit(inputs, np.linalg.norm(signal_V, axis=1) / found.dipole / force_N)
    over = strength_size.at(size, inputs)[0] * force_N
    processes = [gaussian_process.fit(inputs, found.value[:, 0] / over)]
    processes += [gaussian_process.fit(inputs, found.value[:, n] / over, found.variance[:, n] / over**2)
                  for n in range(1, multipole_series.ORDERS)]
    return field, size, tuple(processes), *_left(ring, field, z, found, over)


def _left(ring: Ring, field: Array, z: Complex, found: Strengths, size: Array) -> tuple[float, float]:
    """What strengths at z (n,) leave of the signals: its standard deviation, a reading, over their sizes, and that of
    the shift of the place, mm, that explains most of it."""
    fields = multipole_series.electrode_fields(ring, field, z, multipole_series.ORDERS + 1)
    whole = np.ones((len(z), multipole_series.ORDERS))
    base, moved = multipole_series.signals(ring, fields, whole, np.zeros((*whole.shape, 2)), found.value)
    explaining = np.asarray(np.linalg.pinv(np.concatenate([base, moved / ring.radius_mm], axis=2)), np.float64)
    shift = multipole_series.combined(explaining, found.residual)[:, -2:]
    left = found.residual / (size * found.dipole)[:, None]
    return float(np.sqrt(np.mean(left**2) * left.shape[1] / (left.shape[1] - multipole_series.ORDERS))), float(
        np.sqrt(np.mean(shift**2)))


def noise_floor(forward: ForwardMap, unknown: Array) -> Array:
    """(n,) standard deviation of the map's error, a reading, over the size of the signal, at touches (n, 4) given as
    (x, y, log d, g); as large as it counts among readings that are taken for independent ones."""
    floor = np.full(len(unknown), forward.floor)
    near = reaches(forward, place(forward.ring, unknown))
    if np.any(near):
        error = rim_covariance.size_at(forward.correction.error, gap(forward.ring, unknown[near]), unknown[near, 3])
        shared = forward.correction.rim.directions.shape[2] or forward.correction.error.directions
        floor[near] = np.maximum(floor[near], error / np.sqrt(shared))
    return floor * np.sqrt(forward.ring.copies)


def signal_size(forward: ForwardMap, unknown: Array) -> Array:
    """(n,) norm, V, of all readings of the ring by a dipole of the size of the strengths, at touches (n, 4) given as
    (x, y, log d, g): that of the signal, but for strengths that vanish."""
    z = place(forward.ring, unknown)
    norm = multipole_series.dipole_norms(forward.correction.rim.whole, forward.fields(z))[0]
    return _strengths(forward, edge_frame(forward.ring, z), unknown).size * norm


def within_bounds(forward: ForwardMap, touch: Array) -> Mask:
    """(n,) whether the map knows the places of touches (n, 4), and their d and F lie within those of the training."""
    return known_places.within(forward.ring, forward.bounds, forward.near_edges, touch)


def linearise(forward: ForwardMap, unknown: Array, discrepancy: Array | None = None) -> Linearised:
    """Signal, derivatives and discrepancy of the map at touches (n, 4) given as (x, y, log d, g); `discrepancy`
    (n, orders) is that of the strengths, `strength_discrepancy` there or, cheaper, close by."""
    z = place(forward.ring, unknown)
    fields, frame = forward.fields(z), edge_frame(forward.ring, z)
    found = _strengths(forward, frame, unknown)
    sd = strength_discrepancy(forward, unknown) if discrepancy is None else discrepancy
    base, moved = series_signals(forward, fields, frame, found.value, forward.correction.replaces)
    near = np.flatnonzero(_reached(forward, frame))
    rows, added = np.full(len(z), -1), (np.zeros((0, 0)), np.zeros((0, 0, 4)))
    if len(near):
        rows[near] = np.arange(len(near))
        some = slice(None) if len(near) == len(z) else near
        added = _near_rim(forward, fields[:, some], frame.some(some), found.size[some], found.size_slope[some],
                          unknown[some])
    taught = rim_correction.teaches(forward.correction)
    inner = np.ones(len(unknown)) if forward.ring.sheet is not None and not taught else 1 - rim_zone.part_at(
        frame.radial, forward.zones.learned if taught else forward.zones.high_end)
    scale = simulator_error.at(forward.simulator, gap_of(forward.ring, frame, unknown))
    return Linearised(linearised_columns.columns(base, moved, found, sd, rows, added, scale,
                                                 forward.shift_mm * inner, forward.ring.radius_mm))


def added_by_rim(forward: ForwardMap, unknown: Array) -> Array:
    """(n, readings) what the rim adds to the series at touches (n, 4) given as (x, y, log d, g), V."""
    z = place(forward.ring, unknown)
    frame = edge_frame(forward.ring, z)
    found = _strengths(forward, frame, unknown)
    series = series_signals(forward, forward.fields(z), frame, found.value)[0]
    return linearise(forward, unknown, np.zeros_like(found.value)).signal_V - multipole_series.combined(
        series, found.value)


def series_signals(forward: ForwardMap, fields: Complex, frame: EdgeFrame, strength: Array,
                   ends: bool = False) -> tuple[Array, Array]:
    """The basis of the series and slopes of signals by it, as `multipole_series.signals`, where electrodes have these
    derivatives of their fields; its high orders end near edges, if touches there taught, or all, where what was learned
    of the edge takes its place."""
    zones: list[tuple[Zone, int]] = []
    if forward.ring.sheet is None or forward.near_edges is not None:
        zones.append((forward.zones.high_end, rim_zone.ORDERS))
    if ends:
        zones.append((forward.zones.learned, 0))
    parts = rim_zone.counted(frame, strength.shape[1], *zones)
    return multipole_series.signals(forward.ring, fields, *parts, strength)


def strengths(forward: ForwardMap, unknown: Array) -> Array:
    """(n, orders) p_n, V, of touches (n, 4) given as (x, y, log d, g)."""
    return _strengths(forward, edge_frame(forward.ring, place(forward.ring, unknown)), unknown).value


def strength_covariance(forward: ForwardMap, unknown: Array) -> Array:
    """(n, orders, orders) covariance, V^2, of the strengths by the map's own error, the simulator's, and what is left
    open of the material, at touches (n, 4) given as (x, y, log d, g)."""
    frame = edge_frame(forward.ring, place(forward.ring, unknown))
    found = _strengths(forward, frame, unknown)
    own = (found.size[:, None] * strength_discrepancy(forward, unknown)) ** 2
    scale = simulator_error.at(forward.simulator, gap_of(forward.ring, frame, unknown))
    common = np.concatenate([(found.value * scale[:, None])[..., None], found.by_card], axis=2)
    return own[..., None] * np.eye(own.shape[1]) + common @ common.transpose(0, 2, 1)


def _near_rim(forward: ForwardMap, fields: Complex, frame: EdgeFrame, size: Array, size_slope: Array,
              unknown: Array) -> tuple[Array, Array]:
    """The signal by polarization and the electrodes' metal as far as it counts, and its derivatives by (x, y, log d,
    g)."""
    punch, fitted = unknown[:, 2:], forward.correction
    side = change_point.side(gap_of(forward.ring, frame, unknown), fitted.step)
    effect = polarization.effect(fitted.polarization, forward.ring, fields, frame, punch, side)
    if electrode_correction.teaches(fitted.rim):
        dipole = multipole_series.dipole_norms(fitted.rim.whole, fields)
        effect.parts[:] += electrode_correction.effect(fitted.rim, forward.ring, frame.z, punch, side, dipole).parts
    return polarization.counted(effect, frame, forward.zones.learned, forward.ring, size, size_slope)


def places_at(forward: ForwardMap, radii: Array) -> Array:
    """(n, 2) places, mm, at radii (n,) over the interior's."""
    return outwards(forward.ring, forward.interior * radii)


def strength_discrepancy(forward: ForwardMap, unknown: Array) -> Array:
    """(n, orders) standard deviations of p_n over the size at touches (n, 4) given as (x, y, log d, g).

    The scatter of p_1 about its process (noise) is discrepancy; that of the others is mostly what least squares on one
    row leaves undetermined, which the floor stands for already.
    """
    inputs = inputs_of(radial(forward.ring, unknown), forward.interior, unknown,
                     np.zeros((len(unknown), forward.materials)))
    variance = gaussian_process.variances(forward.together, inputs)
    variance[:, 0] += forward.strengths[0].noise[0]
    return np.sqrt(variance)


def _strengths(forward: ForwardMap, frame: EdgeFrame, unknown: Array, material: Array | None = None) -> TouchStrengths:
    """Strengths of touches in a frame by a material, the mean one where none is given."""
    held = np.zeros((len(unknown), forward.materials)) if material is None else material
    return touch_strengths.at(forward.size, forward.together, forward.p0, forward.interior, forward.ring.radius_mm,
                              frame, unknown, held)
