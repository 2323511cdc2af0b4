"""What a posterior leaves open of a material, to first order in its stresses and conductivities.

Moduli and exponents of a hyperfoam may differ much for laws that are almost one, so that a covariance of theirs is of
no use in a linear formula. Each draw is therefore taken as the change of the card's own mu and alpha that, to first
order, makes the draw's stress: their covariance is that of the stresses.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitsim.sweeps.design.card_draws import Cards, Material, cards_for
from matcal.card import MaterialCard, require
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.law import Law, differentiable, vector, with_vector
from matcal.posterior.draws import card_of
from touchcal.arrays import Array

_PARTS = ("law", "conductivity")  # parts of a card that readings at rest follow
# Uniaxial strains at which laws are compared, from nearly flat to where the skin next to a punch is stretched; the
# stress over mu_0 that counts as small.
_STRAINS = np.concatenate([np.linspace(-0.9, -0.02, 45), np.linspace(0.02, 0.5, 12)])
_SMALL = 0.05
_STEP = 1e-5  # step of the differences that tell the tangent, over the parameter
_KEPT = 1e-9  # directions are kept down to this part of the largest, once every parameter is scaled


@dataclass(frozen=True, eq=False)
class MaterialSpread:
    """The covariance L L' of a card's parameters over its posterior."""

    parameters: tuple[str, ...]  # names as in a data set
    factor: Array  # (parameters, m) L, in their units
    missed: float = 0.0  # largest relative stress, r.m.s. over the strains, that first order misses of a draw


def known_material() -> MaterialSpread:
    """No spread: the card is taken as true."""
    return MaterialSpread((), np.empty((0, 0)))


def spread_of(card: MaterialCard, card_path: Path) -> MaterialSpread:
    """The covariance of the hyperfoam's and the conductivity's parameters over the draws next to the card, moduli as it
    labels them; ValueError where there is no posterior of both that can be used."""
    return spread_over(cards_for(Material(parts=_PARTS), 0, card))


def spread_over(cards: Cards) -> MaterialSpread:
    """As `spread_of`, of cards that are drawn."""
    foam, missed = _foam_changes(cards)
    laws = [require(one, "conductivity", "the limit") for one in _drawn(cards)]
    skin = np.array([[law.c0_S_per_m, *law.a.tolist()] for law in laws])
    names = (*(name for name, _ in differentiable(require(cards.card, "law", "the limit"))), "c0_S_per_m",
             *(f"a_{i + 1}" for i in range(skin.shape[1] - 1)))
    return MaterialSpread(names, _factor(np.hstack([foam, skin])), missed)


def _drawn(cards: Cards) -> list[MaterialCard]:
    assert cards.draws is not None
    return [card_of(cards.draws, cards.card, k) for k in range(len(cards.samples))]


def _foam_changes(cards: Cards) -> tuple[Array, float]:
    """(draws, K) changes of the law's parameters that make the draws' stresses to first order, and what they miss."""
    law = require(cards.card, "law", "the limit")
    own = _stress(law)
    weight = 1 / (np.abs(own) + _SMALL * law.mu_0_Pa)
    tangent = weight[:, None] * _tangent(law)
    scale = 1 / np.maximum(np.linalg.norm(tangent, axis=0), np.finfo(float).tiny)
    requested = np.stack([weight * (_stress(require(one, "law", "the limit")) - own) for one in _drawn(cards)])
    change = np.linalg.lstsq(tangent * scale, requested.T, rcond=_KEPT)[0].T * scale
    left = np.sqrt(np.mean((requested - change @ tangent.T) ** 2, axis=1))
    return change, float(left.max())


def _stress(law: Law) -> Array:
    return nominal_stress(law, "uniaxial", _STRAINS)


def _tangent(law: Law) -> Array:
    """(strains, K) derivatives of the stress by the law's parameters, of a hyperfoam by mu and alpha."""
    at, columns = vector(law), []
    for _, one in differentiable(law):
        step = _STEP * max(abs(float(one @ at)), 1e-3)
        more, less = (_stress(with_vector(law, at + sign * step * one)) for sign in (1, -1))
        columns.append((more - less) / (2 * step))
    return np.column_stack(columns)


def _factor(values: Array) -> Array:
    """L (parameters, m) with L L' the covariance of values (draws, parameters)."""
    deviation = (values - values.mean(axis=0)) / np.sqrt(len(values) - 1)
    scale = np.maximum(np.linalg.norm(deviation, axis=0), np.finfo(float).tiny)
    _, size, axes = np.linalg.svd(deviation / scale, full_matrices=False)
    kept = size > _KEPT * size[0]
    return scale[:, None] * axes[kept].T * size[kept]
