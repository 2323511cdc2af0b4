"""Which of a few known punches made a signal: the training rows' own diameters as a prior, without ruling others out.

Where many training rows share a few diameters, a touch is most likely by one of these punches. Each is tried with its
diameter held, and weighed by its evidence, after Laplace, against the others and against a punch of any diameter, which
has the prior probability OTHER (Kass, Raftery, J. Am. Stat. Assoc. 90 (1995) 773, section 4.1).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from surrogate.statistics.levenberg_marquardt import Minimum, inverse
from touchcal.arrays import Array, Mask

RULED_OUT = 30.0  # cost above the free fit's from which a punch is not tried, were the signal linear
# Place of log d among the unknowns, and the information by which it is held, in the scale of its prior.
LOG_D, HELD = 2, 1e12


@dataclass(frozen=True)
class Selected:
    """The most probable punch of each frame."""

    end: Minimum  # where its fit ended, the information of a held diameter included
    # (n, punches, k) states (x, y, log d, g, discrepancies) of every candidate, the free one first, and their
    # probabilities
    states: Array
    probability: Array


def held(residuals: tuple[Array, Array], readings: int) -> tuple[Array, Array]:
    """Residuals and Jacobian of states whose log d is held in place of its prior."""
    residual, jacobian = residuals[0].copy(), residuals[1].copy()
    residual[:, readings + LOG_D] = 0.0
    jacobian[..., LOG_D] = 0.0
    jacobian[:, readings + LOG_D, LOG_D] = 1.0
    return residual, jacobian


def starts(ends: Minimum, log_d: Array) -> Array:
    """(n, punches, p) states of the scaled log d (punches,), the others moved with it by the ends' normal matrices."""
    rest = np.delete(np.arange(ends.state.shape[1]), LOG_D)
    normal = ends.normal
    moves = -np.linalg.solve(normal[:, rest[:, None], rest], normal[:, rest, LOG_D][..., None])[..., 0]
    shift = log_d - ends.state[:, LOG_D, None]
    out = np.repeat(ends.state[:, None], len(log_d), axis=1)
    out[..., LOG_D] = log_d
    out[..., rest] += shift[..., None] * moves[:, None]
    return out


def by_load(normal: Array, load: int) -> Array:
    """(n, p) change of the most probable state with the unknown `load` at the same diameter, of normals (n, p, p)."""
    rest = np.delete(np.arange(normal.shape[1]), (LOG_D, load))
    out = np.zeros(normal.shape[:2])
    out[:, load] = 1.0
    out[:, rest] = -np.linalg.solve(normal[:, rest[:, None], rest], normal[:, rest, load][..., None])[..., 0]
    return out


def worth_trying(free: Minimum, ends: Minimum, log_d: Array) -> Mask:
    """(n branches, punches) which of `starts` the normal matrices do not rule out; of each frame's first branch always
    the nearest on either side, since a fit may end between two punches."""
    count = len(ends.cost) // len(free.cost)
    variance = inverse(ends.normal)[:, LOG_D, LOG_D]
    shift = log_d - ends.state[:, LOG_D, None]
    foreseen = ends.cost[:, None] + 0.5 * shift**2 / variance[:, None]
    worth = foreseen < np.repeat(free.cost, count)[:, None] + RULED_OUT
    first = np.arange(0, len(worth), count)
    for side in (shift[first], -shift[first]):
        distance = np.where(side >= 0, side, np.inf)
        worth[first] |= np.isfinite(distance) & (distance == distance.min(axis=1, keepdims=True))
    return worth


def filled(tried: Minimum, worth: Mask, start: Array) -> Minimum:
    """The ends of all starts (m, p): those tried, and of no evidence the others."""
    m, p = start.shape
    out = Minimum(start.copy(), np.full(m, np.inf), np.broadcast_to(np.eye(p), (m, p, p)).copy(),
                  np.zeros((m, tried.residual.shape[1])))
    for whole, part in ((out.state, tried.state), (out.cost, tried.cost), (out.normal, tried.normal),
                        (out.residual, tried.residual)):
        whole[worth] = part
    return out


def select(free: Minimum, candidates: Minimum, punches: int, other: float) -> Selected:
    """Weigh the free fit of each frame, of prior probability `other`, against candidates (n branches punches) with held
    diameters; branches that end in one minimum count once."""
    n = len(free.cost)
    log_weight = _evidence(candidates).reshape(n, -1, punches) + np.log((1 - other) / punches)
    log_weight[_again(candidates, n, punches)] = -np.inf
    weight = np.column_stack([_evidence(free) + np.log(other), log_weight.reshape(n, -1)])
    probability = np.exp(weight - weight.max(axis=1, keepdims=True))
    probability /= probability.sum(axis=1, keepdims=True)
    chosen = probability.argmax(axis=1)
    known = np.arange(n) * log_weight[0].size + np.maximum(chosen - 1, 0)
    normal = candidates.normal.copy()
    normal[:, LOG_D, LOG_D] = HELD
    parts = ((free.state, candidates.state), (free.cost, candidates.cost), (free.normal, normal),
             (free.residual, candidates.residual))
    end = Minimum(*(np.where((chosen > 0).reshape(-1, *[1] * (one.ndim - 1)), held[known], one) for one, held in parts))
    states = candidates.state.reshape(n, -1, candidates.state.shape[1])
    return Selected(end, np.concatenate([free.state[:, None], states], axis=1), probability)


def _again(candidates: Minimum, n: int, punches: int) -> Mask:
    """(n, branches, punches) whether a branch ends where one before it does, to within its standard deviation."""
    count = candidates.state.shape[1]
    state = candidates.state.reshape(n, -1, punches, count)
    normal = candidates.normal.reshape(n, -1, punches, count, count)
    again = np.zeros(state.shape[:3], bool)
    for later in range(1, state.shape[1]):
        for earlier in range(later):
            off = state[:, later] - state[:, earlier]
            again[:, later] |= np.einsum("nkp,nkpq,nkq->nk", off, normal[:, later], off) < 1
    return again


def between(selected: Selected, touch: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Mean (n, 4) of the candidates' touches, and their covariance (n, 4, 4) about it."""
    n, k, p = selected.states.shape
    touches = touch(selected.states.reshape(n * k, p)).reshape(n, k, -1)
    mean = np.einsum("nk,nkq->nq", selected.probability, touches)
    off = touches - mean[:, None]
    return mean, np.einsum("nk,nkp,nkq->npq", selected.probability, off, off)


def _evidence(end: Minimum) -> Array:
    return -end.cost - 0.5 * np.linalg.slogdet(end.normal)[1]
