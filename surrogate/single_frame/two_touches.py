"""Two touches from one frame: the learned map's signals added, sought over all pairs of places, weighed against one.

Superposition leaves what the two scatter of each other: its part of the signal by the gap between their edges was
measured (benchmarks/results/several_touches.csv, "sum", two 14 mm punches under 1 N) and counts as noise.
"""

from dataclasses import dataclass

import numpy as np

from surrogate.forward_map import multipole_series
from surrogate.forward_map.forward_map import ForwardMap, linearise, noise_floor, signal_size
from surrogate.forward_map.forward_map import place as scaled_place
from surrogate.forward_map.inversion.diameter_force_posterior import make_table
from surrogate.forward_map.inversion.multipole_location import on_range, spiral
from surrogate.forward_map.load_coordinates import to_touch, touch_slope
from surrogate.statistics.levenberg_marquardt import Minimum, inverse, minimise
from touchcal.arrays import Array, Index

# Places that pairs are sought among, pairs that are tried further, and steps of each.
PLACES, PAIRS, STEPS = 150, 12, 40
# Gap between the edges, mm, and the part of the signal, 2-norm, that superposition misses there.
GAPS_MM = np.array([5.0, 10.0, 20.0, 30.0, 45.0, 60.0])
MISSED = np.array([0.094, 0.050, 0.021, 0.0114, 0.0059, 0.0034])
STRONG = 10.0  # twice the log evidence (BIC) by which two must beat one: "very strong" (Kass, Raftery 1995)


@dataclass(frozen=True, eq=False)
class Pair:
    """One frame read as two touches, in the order of x."""

    touch: Array  # (2, 4) x, y, d in mm, F in N
    covariance: Array  # (8, 8) covariance of both
    # BIC of one touch minus that of two; squared residual a degree of freedom, of two and of one
    gain: float
    misfit: float
    misfit_of_one: float
    # whether the gain is strong, and whether the punches overlap or one lies within two standard deviations of the
    # other
    two: bool
    too_near: bool


def read_pair(forward: ForwardMap, signal_V: Array, noise_V: float, one: Array) -> Pair:
    """The best two touches of a signal (readings,), V, against the best one (4,) in (x, y, log d, g)."""
    state = _starts(forward, signal_V)
    norm, root_n = np.linalg.norm(signal_V), np.sqrt(signal_V.size)
    sd = np.full(len(state), np.hypot(noise_V, MISSED[2] * norm / root_n))
    for _ in range(2):
        end = _minimised(forward, signal_V, sd, state)
        state = end.state
        sd = np.hypot(noise_V, _error(forward, state) / root_n)
    score = np.array([_bic(end, k, sd[k], 8, signal_V.size) for k in range(len(state))])
    best = int(np.argmin(score))
    start = ((one - forward.mean) / forward.sd)[None]
    sd_one = np.hypot(noise_V, _error(forward, start) / root_n)
    alone = _minimised(forward, signal_V, sd_one, start)
    left = float(np.sum(alone.residual[0, :signal_V.size] ** 2)) / (signal_V.size - 4)
    gain = _bic(alone, 0, sd_one[0], 4, signal_V.size) - score[best]
    return _pair(forward, end, best, float(gain), left, signal_V.size)


def _bic(end: Minimum, k: int, sd: float, unknowns: int, readings: int) -> float:
    chi2 = float(np.sum(end.residual[k, :readings] ** 2))
    return chi2 + 2 * readings * float(np.log(sd)) + unknowns * float(np.log(readings))


def _pair(forward: ForwardMap, end: Minimum, k: int, gain: float, misfit_of_one: float, readings: int) -> Pair:
    unknown = _unknown(forward, end.state[k:k + 1])
    touch, slope = to_touch(unknown, forward.p0), touch_slope(unknown, forward.p0) * forward.sd
    whole = np.zeros((8, 8))
    whole[:4, :4], whole[4:, 4:] = slope
    misfit = float(np.sum(end.residual[k, :readings] ** 2)) / (readings - 8)
    covariance = whole @ inverse(end.normal[k:k + 1])[0] @ whole.T * max(misfit, 1.0)
    order = np.argsort(touch[:, 0])
    rows = np.concatenate([4 * order[0] + np.arange(4), 4 * order[1] + np.arange(4)])
    touch, covariance = touch[order], covariance[np.ix_(rows, rows)]
    between = np.hstack([np.eye(2), np.zeros((2, 2)), -np.eye(2), np.zeros((2, 2))])
    separation = touch[1, :2] - touch[0, :2]
    near = separation @ np.linalg.solve(between @ covariance @ between.T, separation) < 4
    overlap = np.linalg.norm(separation) < touch[:, 2].mean()
    return Pair(touch, covariance, gain, misfit, misfit_of_one, gain > STRONG, bool(near or overlap))


def _minimised(forward: ForwardMap, signal_V: Array, sd: Array, start: Array) -> Minimum:
    def residuals(state: Array, which: Index) -> tuple[Array, Array]:
        n, unknowns = state.shape
        here = linearise(forward, _unknown(forward, state))
        whole = here.signal_V.reshape(n, unknowns // 4, -1).sum(axis=1)
        slope = (here.jacobian * forward.sd).reshape(n, unknowns // 4, -1, 4).transpose(0, 2, 1, 3)
        identity = np.broadcast_to(np.eye(unknowns), (n, unknowns, unknowns))
        return (np.column_stack([(whole - signal_V) / sd[which, None], state]),
                np.concatenate([slope.reshape(n, -1, unknowns) / sd[which, None, None], identity], axis=1))

    return minimise(residuals, start, STEPS, lambda state: _within(forward, state))


def _error(forward: ForwardMap, state: Array) -> Array:
    """(n,) 2-norm of what the map, and of pairs superposition, miss of the signal, V."""
    unknown = _unknown(forward, state)
    signal = linearise(forward, unknown).signal_V
    own = noise_floor(forward, unknown) * signal_size(forward, unknown) * np.sqrt(signal.shape[1])
    own = np.sqrt(np.sum(own.reshape(len(state), -1) ** 2, axis=1))
    if state.shape[1] == 4:
        return own
    pairs = unknown.reshape(-1, 2, 4)
    gap = np.linalg.norm(pairs[:, 0, :2] - pairs[:, 1, :2], axis=1) - np.exp(pairs[..., 2]).mean(axis=1)
    missed = np.exp(np.interp(np.log(np.maximum(gap, GAPS_MM[0])), np.log(GAPS_MM), np.log(MISSED)))
    return np.hypot(own, missed * np.linalg.norm(signal.reshape(len(pairs), 2, -1).sum(axis=1), axis=1))


def _starts(forward: ForwardMap, signal_V: Array) -> Array:
    """(PAIRS, 8) scaled states: pairs of places whose dipoles together explain most, each a mean punch."""
    place = spiral(forward, PLACES)
    z = scaled_place(forward.ring, place)
    pattern = multipole_series.basis(*multipole_series.patterns(forward.ring, forward.field, z, 1))[..., 0]
    size = np.linalg.norm(pattern, axis=1)
    direction = pattern / size[:, None]
    match, identical = direction @ signal_V, direction @ direction.T
    i, j = np.triu_indices(len(place), 1)
    free = np.maximum(1 - identical[i, j] ** 2, 1e-6)
    first, second = (match[i] - identical[i, j] * match[j]) / free, (match[j] - identical[i, j] * match[i]) / free
    lowest, highest = _dipoles(forward)
    one, two = np.clip(first / size[i], lowest, highest), np.clip(second / size[j], lowest, highest)
    trained = (one * first > 0) & (two * second > 0)
    explained = np.where(trained, first * match[i] + second * match[j], -np.inf)
    out: list[Array] = []
    for k in np.argsort(-explained):
        pair = np.concatenate([place[i[k]], place[j[k]]])
        if all(np.abs(pair - other[[0, 1, 4, 5]]).max() > 8 for other in out):
            amounts = ((i[k], first[k]), (j[k], second[k]))
            out.append(np.concatenate([_punch(forward, place[m], float(amount / size[m])) for m, amount in amounts]))
        if len(out) == PAIRS:
            break
    scaled = (np.array(out).reshape(-1, 4) - forward.mean) / forward.sd
    return scaled.reshape(-1, 8)


def _dipoles(forward: ForwardMap) -> tuple[float, float]:
    """Weakest and strongest dipole of trained punches, signed, V."""
    table = make_table(forward)
    dipole = table.strengths[1, ..., 0] * table.unit[0]
    return float(dipole.min()), float(dipole.max())


def _punch(forward: ForwardMap, place_mm: Array, dipole: float) -> Array:
    """(4,) a punch of the mean diameter whose dipole is nearest."""
    table = make_table(forward)
    middle = table.known + (len(table.d_mm) - table.known) // 2
    nearest = np.argmin(np.abs(table.strengths[1, middle, :, 0] * table.unit[0] - dipole))
    return np.array([*place_mm, np.log(table.d_mm[middle]), table.load[middle, nearest]])


def _unknown(forward: ForwardMap, state: Array) -> Array:
    """(n k, 4) touches as (x, y, log d, g) of states (n, 4 k)."""
    return forward.mean + forward.sd * state.reshape(-1, 4)


def _within(forward: ForwardMap, state: Array) -> Array:
    return ((on_range(forward, _unknown(forward, state)) - forward.mean) / forward.sd).reshape(state.shape)
