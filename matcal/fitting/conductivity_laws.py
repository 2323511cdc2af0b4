"""What each law of conduction says of a conductivity outside its tests, and which one a card should hold.

Each law is fitted to all values, and again without the third of the points that is farthest from rest, which it then
predicts: laws that predict it about as well as the best are those that an extrapolation has to reckon with.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from matcal.laws.conduction_laws import CUBIC, ConductionLaw, conduction_laws
from matcal.laws.conductivity import Conductivity, drawn_conductivity
from matcal.reduction.experiment import Experiment
from touchcal.arrays import Array

_KEPT_OUT, _FEWEST = 3, 2  # one of so many points is predicted, and at least so many are
# ratio of errors of prediction up to which a law is as good as the best, and of those of the fit to the cubic's
_ABOUT, _AS_WELL = 2.0, 1.1


@dataclass(frozen=True)
class ComparedLaw:
    """A law of conduction by how it predicts what it did not see."""

    law: str  # its name
    c0_S_per_m: float  # fitted to all values, as well as
    a: tuple[float, ...]
    relative_rms: float  # over all values
    predicted_rms: float  # over those kept out
    counts: bool = True  # whether it predicts about as well as the best


def compared_laws(experiments: Sequence[Experiment]) -> tuple[ComparedLaw, ...]:
    """Every law with its error where it was not fitted; none where the tests hold too few strains for that."""
    e, c = (np.concatenate([getattr(x, name) for x in experiments]) for name in ("strain", "value"))
    inner = np.ones(e.size, dtype=bool)
    inner[np.argsort(np.abs(e), kind="stable")[e.size - max(e.size // _KEPT_OUT, _FEWEST):]] = False
    if np.unique(e[inner]).size < 5:
        return ()
    rows = []
    for name, law in conduction_laws().items():
        whole, part = (numbers_of(law, least(law.basis(e[seen]), *linked(law, c[seen], c[seen])))
                       for seen in (np.ones(e.size, dtype=bool), inner))
        rows.append(ComparedLaw(name, float(whole[0]), tuple((whole[1:] / whole[0]).tolist()),
                                _error(name, whole, e, c), _error(name, part, e[~inner], c[~inner])))
    best = min(row.predicted_rms for row in rows)
    return tuple(replace(row, counts=row.predicted_rms <= _ABOUT * best) for row in rows)


def chosen(compared: Sequence[ComparedLaw]) -> str:
    """Name of the law for a card: the cubic, or where it does not count the one that predicts best of those that count
    and fit as well as it does."""
    cubic = next((row for row in compared if row.law == CUBIC), None)
    if cubic is None or cubic.counts:
        return CUBIC
    as_well = [row for row in compared if row.counts and row.relative_rms <= _AS_WELL * cubic.relative_rms]
    return min([*as_well, cubic], key=lambda row: row.predicted_rms).law


def others(laws: Iterable[Mapping[str, Any]], kind: str, cubic: bool = False) -> list[Conductivity]:
    """The known laws of a card's or a fit's comparison that count, but the one of a kind that the card holds; with
    `cubic` that one too, as outside the tests it may hold after all."""
    known = conduction_laws().keys() - {kind}
    rows = [row for row in laws if row["counts"] or (cubic and row["law"] == CUBIC)]
    return [Conductivity(row["c0_S_per_m"], np.ravel(row["a"] if "a" in row else row["k"]), kind=row["law"])
            for row in rows if row["law"] in known and row.get("c0_S_per_m", 0.0) > 0]


def values_of(laws: Sequence[Conductivity], strain: Array) -> list[Array]:
    """Conductivity, S/m, (n,), of each law, 0 where it would be negative."""
    return [np.maximum(drawn_conductivity(law.kind, law.c0_S_per_m * np.r_[1.0, law.a], strain), 0.0) for law in laws]


def linked(law: ConductionLaw, value: Array, sd: Array) -> tuple[Array, Array]:
    """What the law's basis is linear in, c or ln c, and its deviation."""
    return (np.log(value), sd / value) if law.logarithmic else (value, sd)


def least(basis: Array, value: Array, sd: Array) -> Array:
    """Least squares weighted by deviations."""
    return np.asarray(np.linalg.lstsq(basis / sd[:, None], value / sd, rcond=None)[0], dtype=float)


def numbers_of(law: ConductionLaw, b: Array) -> Array:
    """c_0 (1, a) (..., 1 + m), S/m, of what the basis is multiplied by."""
    if not law.logarithmic:
        return b
    c0 = np.exp(b[..., :1])
    return np.concatenate([c0, c0 * b[..., 1:]], axis=-1)


def _error(name: str, numbers: Array, strain: Array, value: Array) -> float:
    return float(np.sqrt(np.mean((drawn_conductivity(name, numbers, strain) / value - 1) ** 2)))
