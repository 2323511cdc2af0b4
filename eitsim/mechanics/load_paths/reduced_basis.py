"""Laws of the foam near one another, such as draws of a posterior: a few of them whose weighted means all others are.

Laws differ by their stresses in homogeneous strains, over mu_0: a factor on all moduli makes no other law. The
few are chosen one by one, each the worst of a mean of those before, as bases are in greedy reduced-basis methods
(DOI 10.1115/1.1448332); weights then hardly exceed 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from matcal.laws.law import Law
from touchcal.arrays import Array

# Directions of logarithmic strain, and how far along them laws are compared: compression with and without free sides,
# shear, and tension.
_DIRECTIONS = ((-1.0, 0.0, 0.0), (-1.0, 0.3, 0.3), (-1.0, 0.5, 0.0), (-0.6, 0.6, 0.0), (0.4, 0.0, 0.0))
_ALONG = np.linspace(0.05, 1.8, 24)
# Relative stress, r.m.s. over the strains, that a mean may miss; the most laws of a mean next to the central one.
_MISSED, _MOST = 5e-4, 6
# How many laws, not among those of the mean, give its error.
_HELD_OUT = 4
# What two laws may differ by in rounding alone.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class ReducedBasis:
    """A few laws, and what their weighted means are good for."""

    central: Law
    chosen: tuple[Law, ...]  # those whose differences to the central one are weighted
    # laws that give the error of a mean, the farthest from the central one first; empty where one law is all there is
    held_out: tuple[Law, ...]
    # largest relative stress, r.m.s., that a mean misses of the laws it was made for, and their largest weight
    missed: float
    heaviest: float

    def weights(self, law: Law) -> Array | None:
        """(K,) weights of the chosen ones whose mean a law is; None where it lies farther off than those it was made
        for."""
        reference = _stresses(self.central)
        found, missed = _weights(_apart(reference, self.chosen), _apart(reference, [law]))
        inside = missed[0] <= self.missed + _ROUNDING and np.abs(found).max(initial=0.0) <= self.heaviest + _ROUNDING
        return found[0] if inside else None


def reduced_basis(laws: Sequence[Law]) -> ReducedBasis:
    """The central one of some laws and those that span the rest; depends on the laws and their order alone. ValueError
    where there are none, or where a stress over mu_0 is no number."""
    if not laws:
        raise ValueError("none of the drawn cards has a law of the foam that makes a material.")
    stresses = np.stack([_stresses(law) for law in laws])
    central = int(np.argmin(_size(_relative(stresses, stresses.mean(axis=0)))))
    separation = _relative(stresses, stresses[central])
    chosen, left = [], separation.copy()
    while len(chosen) < _MOST and _size(left).max() > _MISSED:
        worst = int(np.argmax(_size(left)))
        chosen.append(worst)
        unit = left[worst] / np.linalg.norm(left[worst])
        left -= np.outer(left @ unit, unit)
    found, missed = _weights(separation[chosen], separation)
    held_out = _held_out(_size(separation), missed, [central, *chosen])
    return ReducedBasis(laws[central], tuple(laws[i] for i in chosen), tuple(laws[i] for i in held_out),
                        float(missed.max()), float(np.abs(found).max(initial=0.0)))


def _held_out(distance: Array, missed: Array, known: Sequence[int]) -> list[int]:
    """Laws that a mean serves worst: half of them the farthest, half those that it misses most; where all are known,
    the chosen ones themselves."""
    if len(known) == 1:
        return []
    others = [i for i in range(len(distance)) if i not in known]
    if not others:
        return list(known[1:1 + _HELD_OUT])
    farthest = sorted(others, key=lambda i: -distance[i])
    found = dict.fromkeys(farthest[:_HELD_OUT // 2] + sorted(others, key=lambda i: -missed[i])[:_HELD_OUT // 2])
    return sorted(found, key=lambda i: -distance[i])


def _stresses(law: Law) -> Array:
    """Principal Kirchhoff stresses over mu_0, (strains, 3)."""
    strain = (_ALONG[:, None, None] * np.array(_DIRECTIONS)).reshape(-1, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        stress = law.kirchhoff(strain) / law.mu_0_Pa
    if not np.isfinite(stress).all():
        raise ValueError("stresses of a drawn law of the foam are no numbers at large strains.")
    return stress


def _relative(stresses: Array, reference: Array) -> Array:
    """Differences (D, m) of stresses (D, strains, 3) to a law's, over the magnitude of that law's at each strain."""
    scale = np.linalg.norm(reference, axis=-1, keepdims=True)
    return ((stresses - reference) / scale).reshape(len(stresses), reference.size)


def _apart(reference: Array, laws: Sequence[Law]) -> Array:
    stresses = np.array([_stresses(law) for law in laws]).reshape(-1, *reference.shape)
    return _relative(stresses, reference)


def _weights(chosen: Array, separation: Array) -> tuple[Array, Array]:
    """Weights (D, K) of differences (K, m) that come closest to others (D, m), and what these miss (D,)."""
    if not len(chosen):
        return np.zeros((len(separation), 0)), _size(separation)
    found: Array = np.linalg.lstsq(chosen.T, separation.T, rcond=None)[0].T.astype(float)
    return found, _size(separation - found @ chosen)


def _size(separation: Array) -> Array:
    """R.m.s. (D,) of differences (D, m)."""
    return np.sqrt((separation**2).mean(axis=-1))
