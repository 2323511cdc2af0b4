"""Patterns of places that add up, and pairs that do not: y = X B + e, e of covariance R a frame.

Columns of X are which places are pressed and, of pairs that were pressed together, the products of these. B has the
prior of rows R / penalty, R an inverse Wishart prior about the covariance of untouched frames. The penalty of pairs and
the weight of that prior maximise the evidence, which is in closed form (Bishop, Pattern recognition and machine
learning, 2006, 3.5; Gelman et al., Bayesian data analysis, 2013, 3.6).
"""

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from scipy.special import gammaln

from touchcal.arrays import Array, Index, Mask

PLACE_PENALTY = 0.05  # in presses: patterns of places are hardly drawn to 0
PAIR_PENALTIES = (3.0, 10.0, 30.0, 100.0, 300.0, np.inf)  # inf: no interaction
PRIOR_WEIGHTS = (30.0, 100.0, 300.0, 1000.0, 3000.0)  # of the untouched covariance, in presses
FEWEST_TOGETHER = 2  # presses of a pair from which on its interaction is learnt


@dataclass(frozen=True, eq=False)
class Superposition:
    """Learnt patterns and the noise about them."""

    pairs: Index  # (p, 2) places whose interaction is learnt
    pattern: Array  # (k + p, m) of places, then of pairs: what these add to the sum
    spread: Array  # (k + p, k + p) S: a frame x has the predictive covariance (1 + x S x) R
    covariance: Array  # (m, m) R
    freedom: float  # degrees of freedom of R

    def means(self, design: Array) -> Array:
        """(n, m) expected signals of rows of X."""
        return design @ self.pattern

    def uncertain(self, design: Array) -> Array:
        """(n,) x S x of rows of X."""
        return np.asarray(np.sum((design @ self.spread) * design, axis=1))


def design_of(amount: Array, pairs: Index) -> Array:
    """(n, k + p) X of how much each place is pressed (n, k)."""
    return np.hstack([amount, amount[:, pairs[:, 0]] * amount[:, pairs[:, 1]]])


def pairs_together(down: Mask) -> Index:
    """(p, 2) pairs of places that enough presses (n, k) hold."""
    together = down.T.astype(int) @ down.astype(int)
    return np.array([pair for pair in combinations(range(down.shape[1]), 2) if together[pair] >= FEWEST_TOGETHER],
                    np.intp).reshape(-1, 2)


def learn(amount: Array, signal: Array, untouched: Array | None) -> Superposition:
    """Patterns of signals (n, m) of presses (n, k); untouched: (m, m) covariance of untouched frames, None where there
    is none, where that of the residuals, the same and independent in all readings, takes its place."""
    pairs = pairs_together(amount > 0)
    found = [_learnt(amount, signal, untouched, pairs if np.isfinite(penalty) else pairs[:0], penalty, weight)
             for penalty, weight in product(PAIR_PENALTIES if len(pairs) else (np.inf,), PRIOR_WEIGHTS)]
    return max(found, key=lambda one: one[0])[1]


def _learnt(amount: Array, signal: Array, untouched: Array | None, pairs: Index, pair_penalty: float,
            weight: float) -> tuple[float, Superposition]:
    """The logarithm of the evidence but for a constant, and what is learnt."""
    design, (rows, readings) = design_of(amount, pairs), signal.shape
    penalty = np.full(design.shape[1], PLACE_PENALTY)
    penalty[amount.shape[1]:] = pair_penalty
    spread = inverse(design.T @ design + np.diag(penalty))
    pattern = spread @ design.T @ signal
    scatter = signal.T @ (signal - design @ pattern)
    scatter = (scatter + scatter.T) / 2
    prior = untouched if untouched is not None else np.trace(scatter) / readings / rows * np.eye(readings)
    scale = weight * prior * max(1.0, np.trace(scatter) / rows / np.trace(prior))
    freedom = weight + readings + 1
    half = np.arange(readings) / 2
    evidence = (gammaln((freedom + rows) / 2 - half).sum() - gammaln(freedom / 2 - half).sum()
                + freedom / 2 * _log_det(scale) - (freedom + rows) / 2 * _log_det(scale + scatter)
                + readings / 2 * (np.log(penalty).sum() + _log_det(spread)))
    return float(evidence), Superposition(pairs, pattern, spread, (scale + scatter) / (weight + rows), weight + rows)


def inverse(matrix: Array) -> Array:
    """Inverse of a symmetric positive matrix."""
    return np.asarray(np.linalg.inv(matrix), np.float64)


def shrunk(error: Array) -> Array:
    """(m, m) covariance of errors (k, m), drawn to the same noise in all readings, the more the fewer there are."""
    count, readings = error.shape
    share = readings / (readings + count)
    covariance = error.T @ error / count
    return (1 - share) * covariance + share * max(np.trace(covariance) / readings, np.finfo(float).tiny) * np.eye(
        readings)


def _log_det(matrix: Array) -> float:
    return float(np.linalg.slogdet(matrix)[1])
