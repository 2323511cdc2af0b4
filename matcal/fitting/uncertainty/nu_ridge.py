"""What a fitted nu leaves open: the laws along its profile, how likely each is, and what each leaves open by itself.

Where tests hardly see nu its profile is flat or has several valleys, and no slope at its bottom says so. The density of
nu is therefore that of its profile, Student's in the root of the cost over a unit; zeros and drifts of the records are
fitted again at each nu, for the valley bends with them. The unit is the cost of one standard deviation of nu by the
errors' own covariance, correlated as they are (Godambe's adjustment), nuisances free. The laws of the next orders,
which may see less of nu, come in with Akaike's weights. Quantities are mixtures over all of these.

Source: Pace, Salvan & Sartori, Statistica Sinica 21 (2011) 129 (adjusted composite likelihood ratio); Burnham &
Anderson, Model Selection and Multimodel Inference (2002), DOI 10.1007/b97636, 2.9 (weights).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtr

from matcal.fitting.hyperfoam.curves import Curve
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit
from matcal.fitting.hyperfoam.order_selection import RESOLVED
from matcal.fitting.hyperfoam.shared_poisson import Profile, lateral_of, profile
from matcal.fitting.uncertainty import linear_response
from matcal.fitting.uncertainty.nuisance import settled_records, surprise, uncertain
from matcal.laws.hyperfoam import Hyperfoam
from matcal.statistics.residual_correlation import Errors, propagated
from touchcal.arrays import Array

# points between two nodes of a profile; halvings of a bracket of a quantile; log density, and weight of an order, that
# count as none
_BETWEEN, _HALVINGS, _NONE, _LEAST_SHARE = 5, 50, -12.0, 1e-4


@dataclass(frozen=True)
class Node:
    """One nu, and all that is known once it is given."""

    law: Hyperfoam  # the best law with this nu
    covariance: Array  # (2 N, 2 N) of (mu_Pa, alpha) with nu given
    shift: Array  # (2 N,) expected (mu_Pa, alpha) less those of the law: errors that move nu move these as well
    log_density: float  # of nu, the largest of its order being 0


@dataclass(frozen=True)
class Ridge:
    """The profile of nu at one order."""

    law: Hyperfoam  # the fit's own, without any stability that was asked for
    nodes: tuple[Node, ...]  # by increasing nu
    share: float  # weight of this order, that of the chosen one being 1


@dataclass(frozen=True)
class Spread:
    """A quantity that mixes over nu and order."""

    sd: float  # standard deviation
    form: float  # the part of it that comes from the order
    lo: float  # ends of the middle 95 %
    hi: float


@dataclass(frozen=True)
class _Given:
    """What is left open, and moved, once nu is given."""

    covariance: Array  # (2 N, 2 N) of (mu_Pa, alpha)
    pull: Array  # (2 N,) of (mu_Pa, alpha) for one standard deviation of nu
    unit: float  # cost of one standard deviation of nu


def ridges(fit: Fit, effect: Array, errors: Sequence[Errors], spare: float) -> tuple[Ridge, ...]:
    """One ridge for the chosen order and one for each neighbour; none where nu was given, or fitted term by term.
    `effect` (n + l, J): of the nuisances; `spare`: of Student's law."""
    if fit.nu_fitted != "fit":
        return ()
    variance = linear_response.effective_variance(errors)
    first = fit.free or fit.law

    def settle(records: tuple[Curve, ...], law: Hyperfoam) -> tuple[tuple[Curve, ...], float]:
        return settled_records(replace(fit, law=law, curves=records, nu_how="given"), variance)

    def price(records: tuple[Curve, ...]) -> float:
        return variance * surprise(records)

    least, out = _cost(fit, first), []
    for law in (first, *fit.neighbours):
        own = replace(fit, law=law)
        if _share((least - _cost(fit, law)) / variance, law, first) < _LEAST_SHARE:
            continue
        unit = _given(own, effect, errors, variance).unit
        found = profile(fit.curves, law, unit, settle, price)
        lowest = float(found.cost.min())
        least = lowest if law is first else least
        share = 1.0 if law is first else _share((least - lowest) / variance, law, first)
        out.append(Ridge(law, _nodes(own, found, effect, errors, variance, unit, spare), share))
    return tuple(out)


def _share(gain: float, law: Hyperfoam, first: Hyperfoam) -> float:
    """Akaike's weight of an order over that of the chosen one."""
    return float(np.exp(0.5 * min(gain - 4 * (law.alpha.size - first.alpha.size), 0.0)))


def with_stated(ridge: Ridge, stated: Array) -> Ridge:
    """The ridge with the answer (2 N, D) of (mu, alpha) to deviations that files state, where it has their order."""
    more = stated @ stated.T
    return replace(ridge, nodes=tuple(
        replace(node, covariance=node.covariance + more) if node.covariance.shape == more.shape else node
        for node in ridge.nodes)) if stated.shape[1] else ridge


def mixed(over: Sequence[Ridge], about: Hyperfoam, spare: float,
          slopes_of: Callable[[Hyperfoam], tuple[Mapping[str, float], Mapping[str, Array]]]) -> dict[str, Spread]:
    """Middle 95 % of every quantity about its value for `about`. `slopes_of` gives the quantities of a law and their
    slopes (2 N,) in (mu_Pa, alpha)."""
    value = slopes_of(about)[0]
    names = list(value)
    groups = [_points(ridge, names, slopes_of) for ridge in over]
    free = slopes_of(over[0].law)[0]
    move = np.array([value[name] - free[name] for name in names])
    location, scale, weight = (np.concatenate(parts) for parts in zip(*groups, strict=True))
    weight = weight / weight.sum()
    mean = weight @ location
    each = [(w.sum(), w @ q / w.sum()) for q, _, w in groups]
    total = sum(share for share, _ in each)
    form = np.sqrt(sum(share * (middle - mean) ** 2 for share, middle in each) / total)
    student = spare / (spare - 2) if spare > 2 else 3.0
    sd = np.sqrt(weight @ ((location - mean) ** 2 + student * scale**2))
    lo, hi = (_quantile(location, scale, weight, spare, level) for level in (0.025, 0.975))
    return {name: Spread(float(sd[k]), float(form[k]), float(min(lo[k] + move[k], value[name])),
                         float(max(hi[k] + move[k], value[name]))) for k, name in enumerate(names)}


def _cost(fit: Fit, law: Hyperfoam) -> float:
    return float(np.sum(linear_response.weighted_residual(replace(fit, law=law)) ** 2)
                 ) + lateral_of(fit.curves, float(law.nu[0]))


def _nodes(fit: Fit, found: Profile, effect: Array, errors: Sequence[Errors], variance: float, unit: float,
           spare: float) -> tuple[Node, ...]:
    least = int(np.argmin(found.cost))
    root = np.sqrt((found.cost - found.cost[least]) / unit) * np.where(np.arange(found.nu.size) < least, -1.0, 1.0)
    log = -0.5 * (spare + 1) * np.log1p(root**2 / spare)
    seen = log > _NONE
    seen |= np.r_[seen[1:], False] | np.r_[False, seen[:-1]]
    out = []
    for k in np.flatnonzero(seen):
        given = _given(replace(fit, law=found.laws[k], curves=found.records[k]), effect, errors, variance)
        out.append(Node(found.laws[k], given.covariance - np.outer(given.pull, given.pull), root[k] * given.pull,
                        float(log[k])))
    return tuple(out)


def _given(fit: Fit, effect: Array, errors: Sequence[Errors], variance: float) -> _Given:
    """(mu, alpha) with nu given at a law, by the errors' covariance; nuisances and wide priors of `variance`."""
    free, slopes, own = (linear_response.free_directions(fit), linear_response.all_slopes(fit),
                         linear_response.nu_slopes(fit)[:, 0])
    n, width = slopes.shape
    hold = linear_response.prior_precision(fit)[:width, :width]
    gain = linear_response.joint_gain(slopes, effect, variance, hold)[:width]
    data, prior = free @ gain[:, :n], free @ gain[:, n:]
    settled = sum(len(uncertain(c)) for c in fit.curves)
    along, doubt, spread, unit = _direction(own, slopes, effect, errors, variance, settled)
    joint = propagated(errors, np.vstack([data, along]))
    pull = (joint[:-1, -1] + variance * prior @ doubt) / np.sqrt(max(spread, 1e-300))
    return _Given(joint[:-1, :-1] + variance * prior @ prior.T, pull, unit)


def unit_of_term(fit: Fit, term: int, effect: Array, errors: Sequence[Errors], variance: float) -> float:
    """Cost of one standard deviation of a term's nu, where nu is fitted term by term."""
    nu = linear_response.nu_slopes(fit)
    others = np.hstack([linear_response.all_slopes(fit), np.delete(nu, term, axis=1)])
    return _direction(nu[:, term], others, effect, errors, variance)[3]


def _direction(own: Array, slopes: Array, effect: Array, errors: Sequence[Errors], variance: float, settled: int = 0
               ) -> tuple[Array, Array, float, float]:
    """Unit direction in data (n,) and nuisances (J,) by which a parameter with slope `own` is known next to those with
    `slopes`, the variance along it, and the cost of one standard deviation of the parameter, which counts the first
    `settled` nuisances as well."""
    n = slopes.shape[0]
    alone, seen = (_left(*_with_prior(own, slopes, effect[:, :numbers], variance))
                   for numbers in (settled, effect.shape[1]))
    size = max(float(np.linalg.norm(seen)), 1e-9 * float(np.linalg.norm(own)), 1e-300)
    along, doubt = seen[:n] / size, seen[n:] / size
    spread = float(propagated(errors, along[None])[0, 0] + variance * doubt @ doubt)
    return along, doubt, spread, max(spread * (float(np.linalg.norm(alone)) / size) ** 2, RESOLVED**2 / n)


def _with_prior(own: Array, slopes: Array, effect: Array, variance: float) -> tuple[Array, Array]:
    """A parameter's slope and those of the others, nuisances with their prior rows."""
    numbers = effect.shape[1]
    known = np.hstack([np.zeros((numbers, slopes.shape[1])), np.sqrt(variance) * np.eye(numbers)])
    return np.r_[own, np.zeros(numbers)], np.vstack([np.hstack([slopes, effect]), known])


def _left(column: Array, others: Array) -> Array:
    """What no combination of `others` (m, K) follows of a column (m,)."""
    size = np.maximum(np.linalg.norm(others, axis=0), 1e-300)
    left, kept, _ = np.linalg.svd(others / size, full_matrices=False)
    basis = left[:, kept > 1e-13 * kept[0]]
    return column - basis @ (basis.T @ column)


def _points(ridge: Ridge, names: Sequence[str],
            slopes_of: Callable[[Hyperfoam], tuple[Mapping[str, float], Mapping[str, Array]]]
            ) -> tuple[Array, Array, Array]:
    """Locations (M, Q), scales (M, Q) and weights (M,) of the quantities along a ridge, linear between its nodes."""
    found = [slopes_of(node.law) for node in ridge.nodes]
    middle = np.array([[value[name] + slope[name] @ node.shift for name in names]
                       for node, (value, slope) in zip(ridge.nodes, found, strict=True)])
    scale = np.array([[np.sqrt(max(float(slope[name] @ node.covariance @ slope[name]), 0.0)) for name in names]
                      for node, (_, slope) in zip(ridge.nodes, found, strict=True)])
    nu = np.array([node.law.nu[0] for node in ridge.nodes])
    log = np.array([node.log_density for node in ridge.nodes])
    if nu.size == 1:
        return middle, scale, np.full(1, ridge.share)
    at = np.linspace(0, nu.size - 1, (nu.size - 1) * _BETWEEN + 1)
    fine = _along(at, nu[:, None])[:, 0]
    weight = np.exp(_along(at, log[:, None])[:, 0]) * np.gradient(fine)
    location = _along(at, middle)
    cell = np.abs(np.gradient(location, axis=0)) / np.sqrt(12)
    return location, np.hypot(_along(at, scale), cell), ridge.share * weight / weight.sum()


def _along(at: Array, values: Array) -> Array:
    """Rows of values (K, Q) at positions (M,) between 0 and K - 1, linear between them."""
    first = np.minimum(at.astype(int), values.shape[0] - 2)
    part = (at - first)[:, None]
    return (1 - part) * values[first] + part * values[first + 1]


def _quantile(location: Array, scale: Array, weight: Array, spare: float, level: float) -> Array:
    """(Q,) quantile of mixtures of Student's laws with weights (M,), by halving a bracket."""
    width = np.maximum(scale, 1e-12 * np.maximum(np.abs(location), 1e-300))
    low, high = np.min(location - 60 * width, axis=0), np.max(location + 60 * width, axis=0)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        below = weight @ stdtr(spare, (middle - location) / width) < level
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2
