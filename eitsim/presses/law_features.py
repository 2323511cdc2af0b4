"""What of a law the force on a punch depends on: logarithms of its stresses in simple modes.

ln force is nearly linear in them, far more than in a law's own parameters, of which only some combinations change a
stress; a prior of them means something too.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from matcal.card import MaterialCard, with_moduli
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law, expanded, units, vector, with_vector
from matcal.laws.law_stack import LawStack
from matcal.posterior.drawn_laws import stress_of, stress_of_stack
from matcal.posterior.draws import Draws, read_draws
from touchcal.arrays import Array, Index, Mask

# mode -> strains whose stresses are the features
_STRAINS = {"uniaxial": (-0.6, -0.45, -0.3, -0.15, -0.05, 0.2), "shear": (0.1, 0.4, 0.9)}
# Prior standard deviations of ln stress about a card that is only a start: of all together, and of each; about one with
# draws: of all together, of each, and the factor by which the draws' own are widened.
_START, _KNOWN, _WIDER = (1.5, 1.0), (0.3, 0.05), 2.0
_MODULI, _NUMBERS = 10.0, 10.0  # of parameters about the start, in mu_0 and as numbers, where stresses leave them open
_RELATIVE = 1e-4  # least singular value, over the largest, of what parameters change of features that is inverted
_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class LawPrior:
    """What is known of a law before it is pressed."""

    law: Law
    free: Index  # (p,) which of `matcal.laws.law.vector` are sought
    size: Array  # (p,) the unit of each
    mean: Array  # (q,) features
    root: Array  # (q, q) that turns a deviation of features into standard ones
    wide: Array  # (p,) standard deviation of each parameter about the start, in its unit
    words: str

    def vectors(self, white: Array) -> Array:
        """(..., K) parameters of laws at (..., p) numbers in units, 0 at the start."""
        out = np.broadcast_to(vector(self.law), (*white.shape[:-1], vector(self.law).size)).copy()
        out[..., self.free] += self.size * white
        return out

    def laws(self, white: Array) -> Law:
        """The law at (p,) numbers."""
        return with_vector(self.law, self.vectors(white))

    def inside(self, white: Array) -> Mask:
        """(...) whether what is sought lies within the bounds of the law, moduli of any size."""
        found = self.vectors(white)[..., self.free]
        named = expanded(self.law)
        ends = [(-np.inf, np.inf) if (p := named[k][0]).name.endswith("_Pa") else p.bounds for k in self.free]
        low, high = np.array(ends).T
        return np.all((found >= low) & (found <= high), axis=-1)


def law_prior(card: MaterialCard) -> LawPrior:
    """That of a card: its draws widened, or wide about its law where it has none."""
    law = with_moduli(card, "card")
    named = expanded(law)
    free = np.flatnonzero([p.name != "nu" for p, _ in named])
    middle, (common, each), words = features(law, vector(law)[None])[0], _START, "wide about the card's law"
    covariance = np.zeros((middle.size, middle.size))
    if card.posterior and card.file is not None:
        drawn = read_draws(card)
        known = features(law, np.hstack([*drawn.law.values()]))
        covariance = _WIDER**2 * np.cov(known[np.isfinite(known).all(axis=1)].T)
        (common, each), words = _KNOWN, "the card's draws, twice as wide, of a stiffness that may differ by 30 %"
    covariance = covariance + common**2 + each**2 * np.eye(middle.size)
    size = units(law)[free]
    wide = np.where(size == 1.0, _NUMBERS, _MODULI)
    root = np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), dtype=float)
    return LawPrior(law, free, size, middle, root, wide, words)


def features(law: Law, vectors: Array) -> Array:
    """(D, q) logarithms of stresses, Pa, of laws with parameters (D, K); not finite where a law has no such stress."""
    def stress(mode: str, strain: Array) -> Array:
        if not isinstance(law, Hyperfoam):
            return stress_of_stack(LawStack(law, vectors), mode, strain)
        parts = np.split(vectors, np.cumsum([np.size(getattr(law, p.name)) for p in law.parameters])[:-1], axis=1)
        named = {p.name: part for p, part in zip(law.parameters, parts, strict=True)}
        return stress_of(Draws(named, Hyperfoam), mode, strain)

    return _logarithms(stress)


def features_of(draws: Draws) -> Array:
    """Those of the laws of draws, (D, q)."""
    return _logarithms(lambda mode, strain: stress_of(draws, mode, strain))


def _logarithms(stress: Callable[[str, Array], Array]) -> Array:
    with np.errstate(all="ignore"):
        found = np.hstack([np.sign(e) * stress(mode, np.array(e)) for mode, e in _STRAINS.items()])
        return np.where(found > 0, np.log(np.maximum(found, 1e-300)), np.nan)


def by_features(prior: LawPrior, white: Array, by_law: Array, kept: Mask | slice = slice(None)) -> Array:
    """(n, q) derivatives by the features that are kept, of least size, that give those by the law's parameters, by_law
    (n, K)."""
    p = len(white)
    moved = white + _STEP * np.vstack([np.eye(p), -np.eye(p)])
    found = features(prior.law, prior.vectors(moved))[:, kept]
    slope = (found[:p] - found[p:]) / (2 * _STEP)
    return by_law[:, prior.free] * prior.size @ np.linalg.pinv(slope.T, rcond=_RELATIVE)
