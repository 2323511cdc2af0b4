"""Touches from readings: Levenberg-Marquardt on the learned forward map, many frames at once, with covariance.

Unknowns are (x, y, log d, load g), one standard normal discrepancy for each multipole strength, one for the simulator
and two for the place, so the map's own error is marginalised. The training touches give a Gaussian prior. Punches of
different d and F may have nearly one signal, on a curved ridge with several branches: the start is sought over all of
them, and away from the rim d and F are those of the whole posterior, `diameter_force_posterior`, instead of its peak.
"""

from dataclasses import dataclass, replace

import numpy as np

from surrogate.data.sensor_ring import radial
from surrogate.forward_map import electrode_correction
from surrogate.forward_map.forward_map import (
    ForwardMap,
    added_by_rim,
    linearise,
    noise_floor,
    place,
    reaches,
    signal_size,
    strength_discrepancy,
    within_bounds,
)
from surrogate.forward_map.inversion import changed_contacts, known_diameters, reading_covariance
from surrogate.forward_map.inversion.diameter_force_posterior import (
    Posterior,
    drawn,
    make_table,
    moments,
    one_sided,
    posterior,
    resolved,
    starts,
)
from surrogate.forward_map.inversion.known_diameters import Selected
from surrogate.forward_map.inversion.multipole_location import Located, locate, on_range
from surrogate.forward_map.inversion.outside_diameters import asked_for, outside, smallest
from surrogate.forward_map.inversion.reading_covariance import Drift, Uncertainty, no_drift, of, whitened
from surrogate.forward_map.inversion.rim_starts import rim_starts
from surrogate.forward_map.load_coordinates import to_touch, to_unknown, touch_slope
from surrogate.forward_map.multipole_series import combined
from surrogate.statistics.conformal import COVERAGE, normal
from surrogate.statistics.levenberg_marquardt import Minimum, inverse, minimise
from touchcal.arrays import Array, Index, Mask

BANDS = 5  # bands of loads that each give one start
SHORT, LONG = 12, 100  # steps of every start, and of the best BRANCHES of each frame after that
BRANCHES, HELD = 2, 20  # branches of each frame that known punches are tried from, and the steps of each
LEAST_SIDE = 0.25  # least one-sided standard deviation over the two-sided one
RIM_PART = 0.01  # part of a signal that the rim may add where the table of punches speaks for the peak
FORCE, LOAD = 3, 3  # column of F in a touch, and that of g among the unknowns
# Standard deviation of g from which known punches are tried aside of an end, too, and how many of these aside.
WIDE, ASIDE = 0.06, np.array([0.0, -4.0, -2.0, 2.0, 4.0])
# Least diameter and force that a regression may leave before it is held to the training touches, mm and N.
TINY = 1e-6
_ROUNDING_V = 1e-15  # of a reading of some volts


@dataclass(frozen=True)
class Peak:
    """Laplace's covariance of a touch (x, y, d, F), and what remains of it when less is left unknown."""

    joint: Array  # (n, 4 + k, 4 + k) of the touch and the states of the material
    known: Array  # (n, 4, 4) were the material known
    noise: Array  # (n, 4, 4) were the map exact too, so that noise alone is left


@dataclass(frozen=True)
class Inversion:
    """Most probable touches."""

    touch: Array  # (n, 4) x, y, d in mm, F in N
    covariance: Array  # (n, 4, 4) covariance of the touch, widened by the misfit where that exceeds 1
    material: Array  # (n, k) most probable states of the material
    peak: Peak  # the covariance about the peak, and what makes it up
    misfit: Array  # (n,) squared residual over what noise and the map's error explain, a degree of freedom
    map_part: Array  # (n,) part of that which the map's error is expected to make
    left: Array  # (n, readings) whitened residual
    inside: Mask  # (n,) whether the solution's radius, d and F lie among those of the training touches
    broad: Mask  # (n,) whether d and F are the mean over the posterior of punches rather than its peak
    punches: Posterior | None  # that posterior, of those touches; None where there is none
    below: Array  # (n, 4) one-sided standard deviations of the touch, towards smaller values
    above: Array  # (n, 4) and towards larger ones
    past: Array  # (2, n, 4) as below and above, as far as the punches outside the training range that are allowed
    other: Mask  # (n,) whether these are asked for, no trained punch being a likely one
    outer: Posterior | None = None  # what broad touches allow of these; None where none is known
    smallest: Array | None = None  # (broad, 2, 2) d and F of the smallest ones that are allowed

    def reached(self, values: Array, outside: Array, smallest: Array) -> Array:
        """(2, broad, k) one-sided standard deviations, from values (broad, k) of broad touches to the likely punches of
        the outer table, of values (RADII or 1, D, G, k), and to the smallest ones, of values (broad, 2, k)."""
        assert self.outer is not None
        off = np.where(np.isnan(smallest), 0.0, smallest - values[:, None])
        ends = np.maximum([-off.min(axis=1), off.max(axis=1)], 0.0) / normal(COVERAGE)
        widened = np.sqrt(np.maximum(self.misfit[self.broad], 1.0))[:, None]
        return np.maximum(one_sided(self.outer, outside, values), ends) * widened


def invert(forward: ForwardMap, signal: Array, noise_V: float = 0.0, drift: Drift | None = None) -> Inversion:
    """Invert signals (n, readings) in V under white noise of standard deviation noise_V on each reading, and a drift
    between the frames where one is given."""
    drift = drift or no_drift(signal.shape[1])
    norm = np.linalg.norm(signal @ forward.correction.rim.fill.T, axis=1)
    interior = forward.floor * np.sqrt(forward.ring.copies)
    located = locate(forward, signal, np.hypot(noise_V, interior * norm), drift)
    near = np.column_stack([located.place_mm, np.tile(forward.mean[2:], (len(signal), 1))])
    usual = noise_floor(forward, near) * norm
    short = _descend(forward, signal, reading_covariance.white(np.hypot(noise_V, usual), drift),
                     _starts(forward, signal, located), SHORT)
    start = _unknown(forward, _best(short, len(signal), 1).state)
    size = signal_size(forward, start)
    floor = noise_floor(forward, start) * size
    sd = reading_covariance.at(forward, start, size, noise_V, drift)
    branches = _descend(forward, signal, sd, _best(short, len(signal), BRANCHES).state, LONG)
    free = _best(branches, len(signal), 1)
    part = reading_covariance.white_part(sd, np.sqrt(np.maximum(sd.white**2 - noise_V**2, 0.0)))
    found = replace(_bounded(forward, _inversion(forward, signal, free, sd, noise_V, drift)), map_part=part)
    # the signals whose size is not their norm, as where the dipole vanishes, are less sure than foreseen
    less = np.hypot(noise_V, interior * norm) / np.hypot(noise_V, interior * size)
    located = replace(located, precision=located.precision * (less**2)[:, None, None])
    found = _with_punches(forward, signal, found, located, np.hypot(noise_V, floor), drift)
    rest = np.flatnonzero(~found.broad)
    if len(forward.known_mm) and len(rest):
        tried = _rows(branches, (rest[:, None] * BRANCHES + np.arange(BRANCHES)).ravel())
        signal, sd = signal[rest], of(sd, rest)
        selected = _selected(forward, signal, sd, _rows(free, rest), tried)
        known = _inversion(forward, signal, selected.end, sd, noise_V, drift)
        known = _bounded(forward, _mixed(forward, known, selected))
        found = _with_rows(found, known, rest)
    return _along_ridge(forward, found)


def _rows(ends: Minimum, rows: Index) -> Minimum:
    return Minimum(ends.state[rows], ends.cost[rows], ends.normal[rows], ends.residual[rows])


def _with_rows(found: Inversion, known: Inversion, rows: Index) -> Inversion:
    """With the rows of the peak that known punches gave."""
    def merged(whole: Array, part: Array) -> Array:
        out = whole.copy()
        out[rows] = part
        return out

    peak = Peak(*(merged(getattr(found.peak, name), getattr(known.peak, name)) for name in ("joint", "known", "noise")))
    return replace(found, peak=peak, **{name: merged(getattr(found, name), getattr(known, name)) for name in (
        "touch", "covariance", "material", "misfit", "left", "inside")})


def _descend(forward: ForwardMap, signal: Array, sd: Uncertainty, state: Array, steps: int) -> Minimum:
    """Minima from states (m, p), the same number of each frame, whose discrepancies of the strengths are held."""
    frames = np.repeat(np.arange(len(signal)), len(state) // len(signal))
    discrepancy = strength_discrepancy(forward, _unknown(forward, state))
    return minimise(lambda s, which: _residuals(forward, signal[frames[which]], of(sd, frames[which]),
                                                discrepancy[which], s), state, steps, lambda s: _within(forward, s),
                    frames)


def _best(ends: Minimum, frames: int, most: int) -> Minimum:
    cost = ends.cost.reshape(frames, -1)
    return _rows(ends, (np.argsort(cost, axis=1)[:, :most] + cost.shape[1] * np.arange(frames)[:, None]).ravel())


def _selected(forward: ForwardMap, signal: Array, sd: Uncertainty, free: Minimum, branches: Minimum) -> Selected:
    """Known punches tried from the ends of the free fit and of the next best branch."""
    log_d = (np.log(forward.known_mm) - forward.mean[2]) / forward.sd[2]
    branches = _spread(branches, WIDE / forward.sd[3])
    worth = known_diameters.worth_trying(free, branches, log_d).ravel()
    frames = np.repeat(np.arange(len(signal)), len(branches.cost) // len(signal) * len(log_d))[worth]

    def residuals(state: Array, which: Index) -> tuple[Array, Array]:
        frame = frames[which]
        free = _residuals(forward, signal[frame], of(sd, frame), discrepancy[which], state)
        return known_diameters.held(free, signal.shape[1])

    start = _within(forward, known_diameters.starts(branches, log_d).reshape(len(worth), -1))
    discrepancy = strength_discrepancy(forward, _unknown(forward, start[worth]))
    punch = np.tile(np.arange(len(log_d)), len(branches.cost))[worth]
    tried = minimise(residuals, start[worth], HELD, lambda state: _within(forward, state), frames * len(log_d) + punch)
    ends = known_diameters.filled(tried, worth, start)
    return known_diameters.select(free, ends, len(log_d), 1 / (forward.rows + 2))


def _spread(ends: Minimum, wide: float) -> Minimum:
    """Each end, and others along its regression on g at the same diameter, of no promise where g is not wide."""
    sd = np.sqrt(inverse(ends.normal)[:, LOAD, LOAD])
    along = known_diameters.by_load(ends.normal, LOAD) * sd[:, None]
    state = ends.state[:, None] + ASIDE[:, None] * along[:, None]
    cost = np.where((ASIDE == 0) | (sd[:, None] > wide), ends.cost[:, None], np.inf)
    return Minimum(state.reshape(-1, ends.state.shape[1]), cost.ravel(), np.repeat(ends.normal, len(ASIDE), axis=0),
                   np.repeat(ends.residual, len(ASIDE), axis=0))


def _mixed(forward: ForwardMap, found: Inversion, selected: Selected) -> Inversion:
    """With the mean over the candidate punches, and what parts them added to the covariance."""
    mean, covariance = known_diameters.between(selected, lambda state: to_touch(_unknown(forward, state), forward.p0))
    joint = found.peak.joint.copy()
    joint[:, :4, :4] += covariance
    return replace(found, touch=mean, covariance=joint[:, :4, :4],
                   peak=replace(found.peak, joint=joint, known=found.peak.known + covariance))


def _bounded(forward: ForwardMap, found: Inversion) -> Inversion:
    """With forces that may be in the training range held to it, a uniform prior; the covariance stays as wide."""
    both = np.column_stack([found.touch, found.material])
    mean = reading_covariance.truncated_normal_mean(both, found.peak.joint, FORCE, *forward.bounds[:, 2])
    unknown = on_range(forward, to_unknown(np.maximum(mean[:, :4], [-np.inf, -np.inf, TINY, TINY]), forward.p0))
    touch = to_touch(unknown, forward.p0)
    return replace(found, touch=touch, material=mean[:, 4:], inside=within_bounds(forward, touch))


def _with_punches(forward: ForwardMap, signal: Array, found: Inversion, located: Located, sd: Array,
                  drift: Drift) -> Inversion:
    """With the posterior of punches where it may speak, of signals less what the rim adds to them at the peak: not
    there where punches are known, since what the rim adds tells these from each other."""
    unknown = to_unknown(found.touch, forward.p0)
    reached = reaches(forward, place(forward.ring, unknown))
    usable, near = ~reached, np.flatnonzero(reached)
    if len(near) and not len(forward.known_mm):
        added = added_by_rim(forward, unknown[near])
        small = np.linalg.norm(added, axis=1) < RIM_PART * np.linalg.norm(signal[near], axis=1)
        near, added = near[small], added[small]
        usable[near] = True
        again = locate(forward, signal[near] - added, sd[near], drift)
        located = Located(located.place_mm.copy(), located.strengths.copy(), located.precision.copy())
        located.place_mm[near], located.strengths[near], located.precision[near] = (
            again.place_mm, again.strengths, again.precision)
    if not np.any(usable):
        return replace(found, broad=usable)
    punches = posterior(make_table(forward), located.some(usable))
    tells = resolved(punches)
    usable[usable] = tells
    if not np.any(tells):
        return replace(found, broad=usable)
    punches = punches.some(tells)
    return replace(found, punches=punches, broad=usable, outer=outside(forward, located.some(usable), punches),
                   smallest=smallest(forward, punches))


def _along_ridge(forward: ForwardMap, found: Inversion) -> Inversion:
    """With d and F over the posterior of punches where that may speak, and one-sided standard deviations; a punch among
    the trained ones fits there, wherever about an end of their range the peak lies."""
    widened, k = np.maximum(found.misfit, 1.0)[:, None], found.broad
    touch, spread = found.touch.copy(), found.covariance.copy()
    sides = np.repeat(np.sqrt(np.einsum("npp->np", spread))[None], 2, axis=0)
    if found.punches is not None:
        nodes = found.punches.table.touch[None]
        mean, covariance = moments(drawn(found.punches, nodes))
        touch[k, 2:] = mean
        spread[k, :2, 2:], spread[k, 2:, :2] = 0.0, 0.0
        spread[k, 2:, 2:] = covariance * widened[k, :, None]
        least = LEAST_SIDE * np.sqrt(np.einsum("npp->np", spread[k, 2:, 2:]))
        sides[:, k, 2:] = np.maximum(one_sided(found.punches, nodes, mean) * np.sqrt(widened[k]), least)
    past, other = found.past.copy(), found.other.copy()
    if found.punches is not None and found.outer is not None and found.smallest is not None:
        past[:, k, 2:] = found.reached(touch[k, 2:], found.outer.table.touch[None], found.smallest)
        other[k] = asked_for(found.punches, found.outer)
    return replace(found, touch=touch, covariance=spread, inside=within_bounds(forward, touch), below=sides[0],
                   above=sides[1], past=past, other=other)


def _inversion(forward: ForwardMap, signal: Array, end: Minimum, sd: Uncertainty, noise_V: float,
               drift: Drift) -> Inversion:
    state, residual = end.state, end.residual
    readings = residual.shape[1] - state.shape[1]
    open_to_prior = np.trace(inverse(end.normal), axis1=1, axis2=2)  # what readings leave open of the states
    misfit = np.sum(residual[:, :readings] ** 2, axis=1) / (readings - state.shape[1] + open_to_prior)
    more = np.zeros_like(end.normal)  # by contacts that may have changed
    fitted = _unknown(forward, state)
    if noise_V > _ROUNDING_V:
        discrepancy = strength_discrepancy(forward, fitted)
        shift, more = changed_contacts.moved(forward, sd, *_residuals(forward, signal, sd, discrepancy, state))
        state = _within(forward, state + shift)
    unknown = _unknown(forward, state)
    touch = to_touch(unknown, forward.p0)
    slope = touch_slope(unknown, forward.p0) * forward.sd
    peak = _peak(forward, end.normal, more, slope, np.maximum(misfit, 1.0), _by_noise(forward, fitted, noise_V, drift))
    covariance = peak.joint[:, :4, :4]
    return Inversion(touch, covariance, state[:, 4 + forward.own:], peak, misfit, np.ones(len(touch)),
                     residual[:, :readings], within_bounds(forward, touch),
                     np.zeros(len(touch), bool), None, np.zeros_like(touch), np.zeros_like(touch),
                      np.zeros((2, *touch.shape)), np.zeros(len(touch), bool))


def _by_noise(forward: ForwardMap, unknown: Array, noise_V: float, drift: Drift) -> Array:
    """(n, 4, 4) covariance of the scaled touches were the map exact; 0 without noise that exceeds rounding."""
    if noise_V < _ROUNDING_V:
        return np.zeros((len(unknown), 4, 4))
    here = linearise(forward, unknown, np.zeros((len(unknown), len(forward.strengths))))
    slope = whitened(reading_covariance.white(np.full(len(unknown), noise_V), drift), here.jacobian * forward.sd)
    return inverse(slope.transpose(0, 2, 1) @ slope + np.eye(4))


def _peak(forward: ForwardMap, normal: Array, more: Array, slope: Array, widened: Array, noise: Array) -> Peak:
    """From normal matrices (n, p, p) of the scaled states and what contacts add to their inverses, derivatives
    (n, 4, 4) of the touch by them, the factor (n,) by which the misfit widens variances, and the covariance (n, 4, 4)
    of the scaled touches by noise alone."""
    n, k, known = len(normal), forward.materials, 4 + forward.own
    to_touch_and_card = np.broadcast_to(np.eye(4 + k), (n, 4 + k, 4 + k)).copy()
    to_touch_and_card[:, :4, :4] = slope
    kept = np.r_[:4, known:known + k]
    open_, held = inverse(normal) + more, inverse(normal[:, :known, :known]) + more[:, :known, :known]
    return Peak(_carried(to_touch_and_card, open_[:, kept[:, None], kept]) * widened[:, None, None],
                _carried(slope, held[:, :4, :4]) * widened[:, None, None],
                _carried(slope, noise))


def _carried(slope: Array, covariance: Array) -> Array:
    return slope @ covariance @ slope.transpose(0, 2, 1)


def _starts(forward: ForwardMap, signal: Array, located: Located) -> Array:
    """(n BANDS, 4 + discrepancies) states with the most probable punch of each band of loads at the located places; of
    each band the touch whose foreseen signal is closest where that place is near the rim."""
    unknown = np.empty((len(signal), BANDS, 4))
    near = electrode_correction.teaches(forward.correction.rim) & (
        radial(forward.ring, located.place_mm) > forward.interior)
    if not np.all(near):
        chosen = starts(posterior(make_table(forward), located.some(~near)), BANDS)
        unknown[~near, :, :2] = located.place_mm[~near, None]
        unknown[~near, :, 2], unknown[~near, :, 3] = np.log(chosen[..., 0]), chosen[..., 1]
    if np.any(near):
        unknown[near] = rim_starts(forward, signal[near], located.place_mm[near], BANDS)
    scaled = (unknown.reshape(-1, 4) - forward.mean) / forward.sd
    return np.column_stack([scaled, np.zeros((len(scaled), forward.discrepancies))])


def _residuals(forward: ForwardMap, signal: Array, sd: Uncertainty, discrepancy: Array,
               state: Array) -> tuple[Array, Array]:
    """Residuals (n, readings + p) and Jacobian (n, readings + p, p), p = 4 + discrepancies: whitened readings, then
    prior and discrepancies."""
    columns = linearise(forward, _unknown(forward, state), discrepancy).columns
    columns[..., 0] += combined(columns[..., 5:], state[:, 4:]) - signal
    columns[..., 1:5] *= forward.sd
    both = whitened(sd, columns)
    identity = np.broadcast_to(np.eye(state.shape[1]), (len(state), state.shape[1], state.shape[1]))
    return np.column_stack([both[..., 0], state]), np.concatenate([both[..., 1:], identity], axis=1)


def _unknown(forward: ForwardMap, state: Array) -> Array:
    return forward.mean + forward.sd * state[:, :4]


def _within(forward: ForwardMap, state: Array) -> Array:
    return np.column_stack([(on_range(forward, _unknown(forward, state)) - forward.mean) / forward.sd, state[:, 4:]])
