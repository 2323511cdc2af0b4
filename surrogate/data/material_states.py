"""The material of a row as a touch feels it: stress and conductivity of its card, in principal components.

Moduli and exponents of a hyperfoam make up for one another, so that cards that differ much in them may be almost one.
Cards are therefore compared by what they answer at a few strains, and the directions in which a posterior spreads these
answers are the states that a surrogate learns and later marginalises.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from matcal.laws.conduction_laws import CUBIC
from matcal.laws.conductivity import Conductivity, conductivity
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.known_laws import law_of, law_type
from matcal.laws.prony import Prony, relaxation
from touchcal.arrays import Array

# Strains of the foam and of the skin under punches, and times of a hold, s, at which cards are compared.
FOAM, SKIN, TIMES_S = (-0.02, -0.2, -0.4, -0.6, -0.8), (0.0, -0.2, -0.4, -0.6, -0.8), (1.0, 10.0, 100.0, 1000.0)
# Spread of the answers, over their mean, below which a direction is left out, and most directions.
LEAST, MOST = 1e-3, 4
MIN_CARDS = 5  # fewest different cards that tell a spread


@dataclass(frozen=True, eq=False)
class Spread:
    """Directions in which the answers of some cards spread, each of mean 0 and standard deviation 1."""

    mean: Array  # (q,) mean answers
    axes: Array  # (q, k) states = (answers / mean - 1) @ axes


def answers(rows: pd.DataFrame, held: bool, laws: Mapping[str, str | None]) -> Array:
    """(n, q) stress, Pa, conductivity, S/m, and where touches are held the part of the stress that is left, of the card
    of each row; q = 0 where one card serves all. laws: names of the card's, as in `matcal.card.card_identity`."""
    if "card_sample" not in rows.columns or len(set(rows["card_sample"])) < 2:
        return np.zeros((len(rows), 0))
    _, first, which = np.unique(rows["card_sample"], return_index=True, return_inverse=True)
    cards = rows.iloc[first]
    foam, skin = laws.get("law") or "hyperfoam", laws.get("conductivity") or CUBIC
    blocks = [_answered(cards, [p.numbered.format(r"\d+") for p in law_type(foam).parameters],
                        lambda *values: nominal_stress(law_of(foam, values), "uniaxial", FOAM)),
              _answered(cards, ("c0_S_per_m", r"a_\d+"),
                        lambda c0, a: conductivity(Conductivity(float(c0[0]), a, kind=skin), SKIN))]
    blocks += [_answered(cards, (r"g_\d+", r"tau_\d+_s"), _left)] * held
    return np.column_stack(blocks)[which.ravel()]


def _answered(cards: pd.DataFrame, patterns: Sequence[str], answer: Callable[..., Array]) -> Array:
    """(cards, q) what laws of the columns of these patterns answer; q = 0 where the first has none."""
    laws = [cards[[name for name in cards.columns if re.fullmatch(pattern, name)]].to_numpy(np.float64)
            for pattern in patterns]
    return np.array([answer(*law) for law in zip(*laws, strict=True)]) if laws[0].size else np.zeros((len(cards), 0))


def _left(g: Array, tau: Array) -> Array:
    return relaxation(Prony(g, tau), np.array(TIMES_S))


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
