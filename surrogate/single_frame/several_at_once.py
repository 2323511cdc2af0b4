"""Several touches from one frame: the learned map's signals and what they scatter of each other, by their number.

Touches are added one by one, each sought over all places of a grid where the others leave most. What the sum of two
signals misses of them was measured by the gap between their edges (benchmarks/results/several_touches.csv, two 14 mm
punches under 1 N), "sum"; where the scattering is added, what then was left of three touches that are solved together
in three dimensions, most of it these solutions' own error. It counts as noise. What a neighbour does that looks like
another place or force does not show in the residual, and counts in the covariance.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from surrogate.forward_map import forward_map, multipole_series
from surrogate.forward_map.forward_map import ForwardMap, linearise, noise_floor, signal_size
from surrogate.forward_map.forward_map import place as scaled_place
from surrogate.forward_map.inversion.diameter_force_posterior import make_table
from surrogate.forward_map.inversion.multipole_location import on_range, spiral
from surrogate.forward_map.load_coordinates import to_touch, touch_slope
from surrogate.forward_map.scattering import scattered
from surrogate.statistics.levenberg_marquardt import Minimum, inverse, minimise
from touchcal.arrays import Array, Index

# Places that touches are sought among, states that are tried further of each number of touches, and steps of each.
PLACES, TRIED, STEPS = 150, 12, 40
KEPT, ADDED = 3, 5  # states that one more touch is added to, and places that it is added at
# Gap between the edges, mm, and the part of the signal, 2-norm, that the sum misses there, and with the scattering.
GAPS_MM = np.array([5.0, 10.0, 20.0, 30.0, 45.0, 60.0])
SUM_MISSED = np.array([0.094, 0.050, 0.021, 0.0114, 0.0059, 0.0034])
SCATTERED_MISSED = np.array([0.060, 0.018, 0.008, 0.003, 0.0012, 0.0006])
ORDERS = 1  # angular orders that scatter: higher ones are learned of single touches no better than they matter
MOST_KNOWN = 5  # touches up to which all combinations of known diameters are weighed
# Gap at which a neighbour moves a force by this part of it, and a place along x or y, 1 sd; e times less each further
# such gap.
MOVED_GAP_MM, FORCE_SD, PLACE_SD_MM = 15.0, 0.08, 0.5
STRONG = 10.0  # twice the log evidence (BIC) by which more must beat fewer: "very strong" (Kass, Raftery 1995)


@dataclass(frozen=True, eq=False)
class Several:
    """One frame read as k touches, in the order of x."""

    touch: Array  # (k, 4) x, y, d in mm, F in N
    covariance: Array  # (4 k, 4 k) covariance of all
    score: float  # BIC
    misfit: float  # squared residual a degree of freedom
    too_near: bool  # whether two punches overlap or one lies within two standard deviations of another


def number(found: tuple[Several, ...]) -> int:
    """How many touches a frame has, by what is read of it as one, two ...: the fewest that more do not surely beat."""
    count = 1
    for k in range(2, len(found) + 1):
        if found[count - 1].score - found[k - 1].score > STRONG:
            count = k
    return count


def read_several(forward: ForwardMap, signal_V: Array, noise_V: float, one: Array, most: int,
                 one_V: float | None = None) -> tuple[Several, ...]:
    """The best one, two ... `most` touches of a signal (readings,), V; one: (4,) the best one in (x, y, log d, g);
    one_V: `scattering.unit_V` of a disc, without which scattering counts as noise."""
    starts, found = ((one - forward.mean) / forward.sd)[None], []
    for count in range(1, most + 1):
        if count == 2:
            starts = np.concatenate([_starts(forward, signal_V), _with_one_more(forward, signal_V, starts, one_V)])
        elif count > 2:
            starts = _with_one_more(forward, signal_V, starts, one_V)
        end, sd = _ended(forward, signal_V, noise_V, starts, one_V)
        score = np.array([_bic(end, k, sd[k], signal_V.size) for k in range(len(sd))])
        order = np.argsort(score)
        found.append(_several(forward, end, int(order[0]), float(score[order[0]]), signal_V.size))
        starts = end.state[order[:KEPT]]
    return tuple(found)


def _ended(forward: ForwardMap, signal_V: Array, noise_V: float, state: Array, one_V: float | None
           ) -> tuple[Minimum, Array]:
    """Where starts (n, 4 k) end, and the standard deviation of a reading there."""
    root_n = np.sqrt(signal_V.size)
    sd = np.full(len(state), np.hypot(noise_V, 0.02 * (state.shape[1] > 4) * np.linalg.norm(signal_V) / root_n))
    for turn in range(3):
        more = _scattered(forward, state, one_V)
        end = _minimised(forward, signal_V - more, sd, state, STEPS if turn < 2 else 5)
        state = end.state
        sd = np.hypot(noise_V, _error(forward, state, one_V is not None) / root_n)
    return end, sd


def _scattered(forward: ForwardMap, state: Array, one_V: float | None) -> Array:
    """(n, readings) what the touches of states (n, 4 k) scatter of each other, V; 0 where V_1 is not known."""
    if one_V is None or state.shape[1] == 4:
        return np.zeros((len(state), len(forward.ring.source)))
    unknown = _unknown(forward, state).reshape(len(state), -1, 4)
    return np.array([scattered(forward.ring, forward.fields(scaled_place(forward.ring, one)),
                               scaled_place(forward.ring, one), forward_map.strengths(forward, one)[:, :ORDERS], one_V)
                     for one in unknown])


def _bic(end: Minimum, k: int, sd: float, readings: int) -> float:
    chi2 = float(np.sum(end.residual[k, :readings] ** 2))
    return chi2 + 2 * readings * float(np.log(sd)) + end.state.shape[1] * float(np.log(readings))


def _several(forward: ForwardMap, end: Minimum, k: int, score: float, readings: int) -> Several:
    unknown = _unknown(forward, end.state[k:k + 1])
    count = len(unknown)
    touch, slope = to_touch(unknown, forward.p0), touch_slope(unknown, forward.p0) * forward.sd
    whole = np.zeros((4 * count, 4 * count))
    for i in range(count):
        whole[4 * i:4 * i + 4, 4 * i:4 * i + 4] = slope[i]
    misfit = float(np.sum(end.residual[k, :readings] ** 2)) / (readings - 4 * count)
    covariance = whole @ inverse(end.normal[k:k + 1])[0] @ whole.T * max(misfit, 1.0)
    if len(forward.known_mm) and count <= MOST_KNOWN:
        touch, covariance = _of_known(touch, covariance, forward.known_mm)
    order = np.argsort(touch[:, 0])
    rows = np.concatenate([4 * i + np.arange(4) for i in order])
    touch, covariance = touch[order], covariance[np.ix_(rows, rows)]
    near = any(_near(touch, covariance, i, j) for i in range(count) for j in range(i))
    moved = np.exp(1 - np.maximum(_gaps(touch), 0.0).min(axis=1, initial=np.inf) / MOVED_GAP_MM)
    sd = np.column_stack([np.full((count, 2), PLACE_SD_MM), np.zeros(count), FORCE_SD * touch[:, 3]])
    covariance += np.diag((moved[:, None] * sd).ravel() ** 2)
    return Several(touch, covariance, score, misfit, near)


def _of_known(touch: Array, covariance: Array, known_mm: Array) -> tuple[Array, Array]:
    """Mean and covariance of touches (k, 4) whose diameters are some of the known ones, each as likely before."""
    d = np.arange(2, touch.size, 4)
    off = np.array([*product(known_mm, repeat=len(touch))]) - touch[:, 2]
    weighed = np.linalg.solve(covariance[np.ix_(d, d)], off.T).T
    cost = np.sum(weighed * off, axis=1)
    weight = np.exp(-(cost - cost.min()) / 2)
    weight /= weight.sum()
    to = weighed @ covariance[d]  # (combinations, 4 k) how far each moves the touches
    mean = weight @ to
    given = covariance - covariance[:, d] @ np.linalg.solve(covariance[np.ix_(d, d)], covariance[d])
    spread = (to - mean).T * weight @ (to - mean) + given + 1e-12 * np.diag(np.diag(covariance))
    return touch + mean.reshape(touch.shape), spread


def _near(touch: Array, covariance: Array, i: int, j: int) -> bool:
    """Whether two of the touches overlap or one lies within two standard deviations of the other."""
    between = np.zeros((2, len(covariance)))
    between[:, 4 * i:4 * i + 2], between[:, 4 * j:4 * j + 2] = np.eye(2), -np.eye(2)
    separation = touch[i, :2] - touch[j, :2]
    near = separation @ np.linalg.solve(between @ covariance @ between.T, separation) < 4
    return bool(near or np.linalg.norm(separation) < touch[[i, j], 2].mean())


def _gaps(touch: Array) -> Array:
    """(..., k, k) gaps between the edges of touches (..., k, 4), mm, infinite of one to itself."""
    distance = np.linalg.norm(touch[..., :, None, :2] - touch[..., None, :, :2], axis=-1)
    gap = distance - (touch[..., :, None, 2] + touch[..., None, :, 2]) / 2
    return np.where(np.eye(touch.shape[-2], dtype=bool), np.inf, gap)


def _minimised(forward: ForwardMap, signal_V: Array, sd: Array, start: Array, steps: int) -> Minimum:
    """From starts (n, 4 k), of signals (n, readings)."""
    def residuals(state: Array, which: Index) -> tuple[Array, Array]:
        n, unknowns = state.shape
        here = linearise(forward, _unknown(forward, state))
        whole = here.signal_V.reshape(n, unknowns // 4, -1).sum(axis=1)
        slope = (here.jacobian * forward.sd).reshape(n, unknowns // 4, -1, 4).transpose(0, 2, 1, 3)
        identity = np.broadcast_to(np.eye(unknowns), (n, unknowns, unknowns))
        return (np.column_stack([(whole - signal_V[which]) / sd[which, None], state]),
                np.concatenate([slope.reshape(n, -1, unknowns) / sd[which, None, None], identity], axis=1))

    return minimise(residuals, start, steps, partial(_within, forward))


def _error(forward: ForwardMap, state: Array, scattering: bool) -> Array:
    """(n,) 2-norm of what the map, and of several touches their sum, with or without scattering, miss of the signal,
    V."""
    unknown = _unknown(forward, state)
    signal = linearise(forward, unknown).signal_V
    own = noise_floor(forward, unknown) * signal_size(forward, unknown) * np.sqrt(signal.shape[1])
    own = np.sqrt(np.sum(own.reshape(len(state), -1) ** 2, axis=1))
    touch = unknown.reshape(len(state), -1, 4).copy()
    touch[..., 2] = np.exp(touch[..., 2])
    i, j = np.triu_indices(touch.shape[1], 1)
    gap = np.maximum(_gaps(touch)[:, i, j], GAPS_MM[0])
    missed = np.exp(np.interp(np.log(gap), np.log(GAPS_MM), np.log(SCATTERED_MISSED if scattering else SUM_MISSED)))
    each = signal.reshape(*touch.shape[:2], -1)
    norm = np.linalg.norm(each[:, i] + each[:, j], axis=2)
    return np.sqrt(own**2 + np.sum((missed * norm) ** 2, axis=1))


def _with_one_more(forward: ForwardMap, signal_V: Array, states: Array, one_V: float | None) -> Array:
    """(n, 4 k + 4) states with one more mean punch each, at places where they, moved as they like, leave most."""
    place = spiral(forward, PLACES)
    pattern = _dipole_patterns(forward, place)
    lowest, highest = _dipoles(forward)
    out: list[Array] = []
    for state in states:
        here = linearise(forward, _unknown(forward, state[None]))
        left = signal_V - here.signal_V.sum(axis=0) - _scattered(forward, state[None], one_V)[0]
        onto, _ = np.linalg.qr(np.concatenate([*here.jacobian], axis=1) * np.tile(forward.sd, len(state) // 4))
        free = pattern - pattern @ onto @ onto.T
        amount = free @ left / np.maximum(np.sum(free**2, axis=1), 1e-6 * np.sum(pattern**2, axis=1))
        explained = np.where((amount * lowest > 0) | (amount * highest > 0), amount * (free @ left), -np.inf)
        taken: list[int] = []
        for k in np.argsort(-explained).tolist():
            if all(np.linalg.norm(place[k] - place[other]) > 8 for other in taken):
                taken.append(k)
                punch = _punch(forward, place[k], float(np.clip(amount[k], lowest, highest)))
                out.append(np.concatenate([state, (punch - forward.mean) / forward.sd]))
            if len(taken) == ADDED:
                break
    return np.array(out)


def _dipole_patterns(forward: ForwardMap, place_mm: Array) -> Array:
    """(n, readings) signals of unit dipoles at places (n, 2), V."""
    z = scaled_place(forward.ring, place_mm)
    return multipole_series.basis(*multipole_series.patterns(forward.ring, forward.field, z, 1))[..., 0]


def _starts(forward: ForwardMap, signal_V: Array) -> Array:
    """(TRIED, 8) scaled states: pairs of places whose dipoles together explain most, each a mean punch."""
    place = spiral(forward, PLACES)
    pattern = _dipole_patterns(forward, place)
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
        if len(out) == TRIED:
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
