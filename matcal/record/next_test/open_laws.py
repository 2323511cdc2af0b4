"""What a card leaves open: the draws of its posterior, else the laws that were compared, else its law, each with its
covariance.

Any number that follows from a law has deviations A, one row a way in which the law may differ, so that several such
numbers have the covariance A'A. Draws give f_k - mean f over the square root of their number. A law with parameters
p and covariance L L' gives its slopes along the columns of L, and what laws of the next orders differ by.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from matcal.card import MaterialCard, require
from matcal.laws.known_laws import law_of
from matcal.laws.law import Law, units, vector
from matcal.posterior.draws import Draws, read_draws
from touchcal.arrays import Array

_DRAWS, _STEP = 400, 1e-4  # draws taken of a posterior; step of slopes, over the size of a parameter
# numbers (D, m) that follow from the laws of D draws
Predicted = Callable[[Draws], Array]
# (m,) mean and (M, m) deviations of such numbers
Spread = tuple[Array, Array]


@dataclass(frozen=True)
class OpenLaw:
    """One kind of law with what is not known of it."""

    draws: Draws  # of the posterior; or the law itself, then one step forward and one back along each direction
    weight: float = 1.0
    step: float | None = None  # of these steps, in standard deviations; None for draws of a posterior
    neighbours: tuple[Draws, ...] = ()  # laws of the next orders, one each, which show what the order hides

    def spread(self, predicted: Predicted) -> Spread:
        """(m,) mean and (M, m) deviations of numbers that follow from the law."""
        values = predicted(self.draws)
        if self.step is None:
            return values.mean(axis=0), (values - values.mean(axis=0)) / len(values) ** 0.5
        forward, back = np.split(values[1:], 2)
        hidden = [(predicted(other) - values[:1]) / len(self.neighbours) ** 0.5 for other in self.neighbours]
        return values[0], np.vstack([(forward - back) / (2 * self.step), *hidden])


def open_laws(card: MaterialCard) -> tuple[OpenLaw, ...]:
    """Draws of the card's posterior where it has one, else every law that was compared, else the law with the
    covariance of its fit; ValueError where it has none of them, or its posterior did not converge."""
    law = require(card, "law", "the choice of a test")
    if card.posterior:
        if not card.posterior.get("checks", {}).get("converged", True):
            raise ValueError(f"the posterior of card '{card.name}' did not converge, so that it does not say what is "
                             "open. Fit it again with more data or fewer terms.")
        draws = read_draws(card)
        return (OpenLaw(draws.taken(np.linspace(0, len(draws) - 1, min(_DRAWS, len(draws))).astype(int))),)
    if card.prony is not None:
        raise ValueError(f"card '{card.name}' has a series, and without a posterior it does not say how series and law "
                         "are open together. Fit it again with `matcal fit --posterior`.")
    if rows := [row for row in card.fit.get("laws", ()) if row["weight"] > 0]:
        return tuple(_around(_law(row), row["covariance"], row["weight"]) for row in rows)
    if "covariance" not in card.fit:
        raise ValueError(f"card '{card.name}' does not say what is open: it has no posterior, and its fit no "
                         "covariance, as where nu was fitted or the card was not fitted by this version. Fit it again "
                         "with `matcal fit --posterior`.")
    others = [law_of(law.name, values) for values in card.fit.get("neighbours", ())]
    return (_around(law, card.fit["covariance"], 1.0, others),)


def _law(row: Mapping[str, Any]) -> Law:
    return law_of(row["law"], [np.ravel(value).tolist() for value in row["parameters"].values()])


def _around(law: Law, covariance: ArrayLike, weight: float = 1.0, neighbours: Sequence[Law] = ()) -> OpenLaw:
    """A law and small steps along the columns of a root of the covariance of its parameters, of the last of which
    nothing is open where it has fewer columns."""
    size, known = units(law), np.array(covariance, dtype=float)
    held_back = size.size - len(known)
    scaled = np.pad(known, (0, held_back)) / np.outer(size, size)
    variance, ways = np.linalg.eigh((scaled + scaled.T) / 2)
    free = variance > 1e-12 * max(variance.max(), 1e-300)
    root = ways[:, free] * np.sqrt(variance[free])
    step = _STEP / max(float(np.abs(root).max(initial=0.0)), _STEP)
    moves, middle = step * (size[:, None] * root).T, vector(law)
    rows = np.vstack([middle[None], middle + moves, middle - moves])
    return OpenLaw(_draws(law, rows), float(weight), step, tuple(_draws(n, vector(n)[None]) for n in neighbours))


def _draws(law: Law, vectors: Array) -> Draws:
    """Laws of one kind with parameters (D, K)."""
    ends = np.cumsum([np.size(getattr(law, p.name)) for p in law.parameters])[:-1]
    parts = np.split(vectors, ends, axis=1)
    return Draws({p.name: part for p, part in zip(law.parameters, parts, strict=True)}, type(law))
