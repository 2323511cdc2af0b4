"""The material of a row as a touch feels it: stress and conductivity of its card, in principal components.

Moduli and exponents of a hyperfoam make up for one another, so that cards far apart in them may be almost one. Cards
are therefore compared by what they answer at a few strains, and the directions in which a posterior spreads these
answers are the states that a surrogate learns and later marginalises.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd

from matcal.laws.conductivity import Conductivity, conductivity
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony, relaxation
from touchcal.arrays import Array

# Strains of the foam and of the skin under punches, and times of a hold, s, at which cards are compared.
FOAM, SKIN, TIMES_S = (-0.02, -0.2, -0.4, -0.6, -0.8), (0.0, -0.2, -0.4, -0.6, -0.8), (1.0, 10.0, 100.0, 1000.0)
# Spread of the answers, over their mean, below which a direction is left out, and most directions.
LEAST, MOST = 1e-3, 4
# Fewest different cards that tell a spread.
MIN_CARDS = 5


@dataclass(frozen=True, eq=False)
class Spread:
    """Directions in which the answers of some cards spread, each of mean 0 and standard deviation 1."""

    mean: Array  # (q,) mean answers
    axes: Array  # (q, k) states = (answers / mean - 1) @ axes


def answers(rows: pd.DataFrame, held: bool) -> Array:
    """(n, q) stress, Pa, conductivity, S/m, and where touches are held the part of the stress that is left, of the card
    of each row; q = 0 where one card serves all."""
    if "card_sample" not in rows.columns or len(set(rows["card_sample"])) < 2:
        return np.zeros((len(rows), 0))
    _, first, which = np.unique(rows["card_sample"], return_index=True, return_inverse=True)
    cards = rows.iloc[first]
    blocks = [_foam(cards), _skin(cards)] + [_left(cards)] * held
    return np.column_stack(blocks)[which.ravel()]


def _foam(cards: pd.DataFrame) -> Array:
    mu, alpha, nu = (_columns(cards, pattern) for pattern in (r"mu_\d+_Pa", r"alpha_\d+", r"nu_\d+"))
    if not mu.size:
        return np.zeros((len(cards), 0))
    return np.array([nominal_stress(Hyperfoam(*law), "uniaxial", FOAM) for law in zip(mu, alpha, nu, strict=True)])


def _skin(cards: pd.DataFrame) -> Array:
    c0, a = _columns(cards, "c0_S_per_m"), _columns(cards, r"a_\d+")
    if not c0.size:
        return np.zeros((len(cards), 0))
    return np.array([conductivity(Conductivity(float(c), one), SKIN) for c, one in zip(c0[:, 0], a, strict=True)])


def _left(cards: pd.DataFrame) -> Array:
    g, tau = _columns(cards, r"g_\d+"), _columns(cards, r"tau_\d+_s")
    if not g.size:
        return np.zeros((len(cards), 0))
    return np.array([relaxation(Prony(*law), np.array(TIMES_S)) for law in zip(g, tau, strict=True)])


def _columns(cards: pd.DataFrame, pattern: str) -> Array:
    return cards[[name for name in cards.columns if re.fullmatch(pattern, name)]].to_numpy(np.float64)


def fit(found: Array) -> Spread:
    """Principal components of answers (n, q) over their means, those that matter; none of too few cards."""
    if not found.shape[1] or len(np.unique(found, axis=0)) < MIN_CARDS:
        return Spread(np.ones(found.shape[1]), np.zeros((found.shape[1], 0)))
    mean = found.mean(axis=0)
    _, values, axes = np.linalg.svd(found / mean - 1, full_matrices=False)
    sd = values / np.sqrt(len(found))
    kept = np.flatnonzero(sd[:MOST] > LEAST)
    return Spread(mean, axes[kept].T / sd[kept])


def states(spread: Spread, found: Array) -> Array:
    """(n, k) states of answers (n, q)."""
    return (found / spread.mean - 1) @ spread.axes
