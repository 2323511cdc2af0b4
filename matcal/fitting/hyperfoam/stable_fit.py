"""The best law that is stable at every combination of principal stretches within a range, by cutting planes.

Both criteria are quadratic forms that are linear in the moduli, v.T(x) v for drucker and m.Q(x, n) m for ellipticity.
The search holds them at a few states and directions; the law that it finds is checked on a fine grid of all principal
stretches within the range, the worst violations are added, and so on until none is left. What is returned has
therefore been checked, in closed form for both (see `matcal.laws.ellipticity`).
Source: Reemtsen & Ruckmann, Semi-Infinite Programming (1998), DOI 10.1007/978-1-4757-2868-2 (exchange methods).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from matcal.laws.ellipticity import strongly_elliptic
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.stability import CRITERIA, acoustic_form, worst_acoustic_directions
from touchcal.arrays import Array
from touchcal.errors import NotConverged

StabilityRows = Callable[[Array, Array], Array]  # (alpha, nu), (N,) each -> (m, N) rows: times mu positive

_SEARCHED, _ACCEPTED = 21, 41  # stretches of the grids on which violations are searched and a law is accepted
_ROUNDS, _ADDED = 20, 12  # rounds at most, violations added in each
_TWIST = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)  # two equal stretches that part


@dataclass(frozen=True)
class States:
    """Where, and for which increment, stability is held."""

    x: Array  # (m, 3) logarithmic principal stretches
    n: Array  # (m, 3) direction: of the increment of logarithmic strain (drucker), of the normal of a band (elliptic)
    m: Array  # (m, 3) the same again (drucker), the polarisation (elliptic)

    def __add__(self, other: States) -> States:
        return States(*(np.vstack(pair) for pair in ((self.x, other.x), (self.n, other.n), (self.m, other.m))))


def search_stable(criterion: str, log_range: tuple[float, float],
                  search: Callable[[StabilityRows], Hyperfoam]) -> Hyperfoam:
    """The law of `search` that satisfies `criterion` wherever all three logarithmic stretches lie in `log_range`.
    Raises ValueError for another criterion and NotConverged, with the last law, where violations remain."""
    if criterion not in CRITERIA:
        raise ValueError(f"`stable` {criterion} is unknown; known: {', '.join(CRITERIA)}.")
    held = _first_states(criterion, log_range)
    for _ in range(_ROUNDS):
        law = search(lambda alpha, nu, held=held: rows(criterion, held, alpha, nu))
        if not (broken := _violations(criterion, law, triples(log_range, _SEARCHED))).x.size:
            broken = _violations(criterion, law, triples(log_range, _ACCEPTED))
        if not broken.x.size:
            return law
        held = held + broken
    raise NotConverged(f"`stable` {criterion}: after {_ROUNDS} rounds the best law still violates it at stretches "
                       f"{np.round(np.exp(broken.x[0]), 3).tolist()}. Narrow `stable_range` or lower `order`.",
                       estimate=law)


def keeps(criterion: str, law: Hyperfoam, log_range: tuple[float, float]) -> bool:
    """Whether a law satisfies a criterion at every grid point of the stretches in `log_range`."""
    return _violations(criterion, law, triples(log_range, _ACCEPTED)).x.size == 0


def rows(criterion: str, states: States, alpha: Array, nu: Array) -> Array:
    """(m, N) quadratic form of each term per unit of its modulus at m states."""
    form = _drucker_form if criterion == "drucker" else acoustic_form
    return np.stack([form(Hyperfoam(np.ones(1), np.array([a]), np.array([v])), states.x, states.n, states.m)
                     for a, v in zip(alpha, nu, strict=True)], axis=1)


def triples(log_range: tuple[float, float], points: int) -> Array:
    """(m, 3) all x_1 <= x_2 <= x_3 of a grid of `points` stretches, equally spaced in the stretch."""
    x = np.log(np.linspace(np.exp(log_range[0]), np.exp(log_range[1]), points))
    i, j, k = np.meshgrid(*[np.arange(points)] * 3, indexing="ij")
    keep = (i <= j) & (j <= k)
    return np.stack([x[i[keep]], x[j[keep]], x[k[keep]]], axis=-1)


def _first_states(criterion: str, log_range: tuple[float, float]) -> States:
    """One stretch at a time along the range, the others at rest: increments of that stretch."""
    x = np.zeros((60, 3))
    x[:, 0] = np.log(np.linspace(np.exp(log_range[0]), np.exp(log_range[1]), 60))
    if criterion == "drucker":
        twist = np.broadcast_to(_TWIST, x.shape)
        return States(x[:, [0, 0, 0]], twist, twist)
    axis = np.broadcast_to([1.0, 0.0, 0.0], x.shape)
    first = States(x, axis, axis)
    return first + States(x, axis, np.broadcast_to([0.0, 1.0, 0.0], x.shape))


def _violations(criterion: str, law: Hyperfoam, x: Array) -> States:
    """Some of the states among x (m, 3) where the criterion does not hold, far from one another, the worst first."""
    if criterion == "drucker":
        found, size = _not_drucker(law, x)
    else:
        x = x[~strongly_elliptic(law, x)]
        size, n, m = worst_acoustic_directions(law, x)
        found = States(x, n, m)
    chosen = _apart(found.x, np.argsort(size))
    return States(found.x[chosen], found.n[chosen], found.m[chosen])


def _apart(x: Array, order: NDArray[np.intp]) -> list[int]:
    """The first of `order` and others at a distance from those before, at most _ADDED."""
    chosen: list[int] = []
    for k in order:
        if all(np.abs(x[k] - x[c]).max() > 0.1 for c in chosen):
            chosen.append(int(k))
        if len(chosen) == _ADDED:
            break
    return chosen


def _drucker_form(law: Hyperfoam, x: Array, n: Array, m: Array) -> Array:
    """n . T m of the Kirchhoff tangent T = diag(d) + V 1 1, without the cancellation of its parts."""
    d, volume = _tangent_parts(law, x)
    return np.sum(d * n * m, axis=1) + volume * n.sum(axis=1) * m.sum(axis=1)


def _not_drucker(law: Hyperfoam, x: Array) -> tuple[States, Array]:
    """States where T = diag(d) + V 1 1 is not positive definite, with the increment that shows it, and how badly. All d
    must be positive (two equal stretches that part), and then 1 + V sum 1/d."""
    d, volume = _tangent_parts(law, x)
    low = np.argmin(d, axis=1)
    least = np.take_along_axis(d, low[:, None], 1)[:, 0]
    soft = least <= 0
    safe = np.where(d > 0, d, 1.0)
    balance = 1 + volume * np.sum(1 / safe, axis=1)
    sunk = ~soft & (balance <= 0)
    equal = np.repeat(np.take_along_axis(x, low[:, None], 1)[soft], 3, axis=1)
    along = 1 / safe[sunk]
    directions = np.vstack([np.broadcast_to(_TWIST, equal.shape), along / np.linalg.norm(along, axis=1)[:, None]])
    return States(np.vstack([equal, x[sunk]]), directions, directions), np.r_[least[soft], balance[sunk]]


def _tangent_parts(law: Hyperfoam, x: Array) -> tuple[Array, Array]:
    """d_k = 2 sum mu_i e^(alpha_i x_k), (m, 3), and V = 2 sum mu_i beta_i J^(-alpha_i beta_i), (m,), Pa."""
    d = 2 * np.tensordot(np.exp(x[..., None] * law.alpha), law.mu_Pa, axes=1)
    volume = 2 * np.exp(-x.sum(axis=1)[:, None] * law.alpha * law.beta) @ (law.mu_Pa * law.beta)
    return d, volume
