"""What other laws than the cubic say of a conductivity outside its tests: exponential and power of the stretch.

ln c is linear in the strain (tunnelling between particles), or in ln(1 + e). Each law is fitted to all values, and
again without the third of the points that is farthest from rest, which it then predicts: laws that predict it about as
well as the best are those that an extrapolation has to reckon with.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from matcal.reduction.experiment import Experiment
from touchcal.arrays import Array

_KEPT_OUT, _FEWEST = 3, 2  # one of so many points is predicted, and at least so many are
_ABOUT = 2.0  # ratio of errors of prediction up to which a law is as good as the best
OTHERS: Mapping[str, Callable[[Array], Array]] = {"exponential": lambda e: e, "power": np.log1p}


@dataclass(frozen=True)
class OtherLaw:
    """ln c = ln c_0 + k x, with x the strain or ln(1 + strain)."""

    name: str  # one of OTHERS, or cubic, of which c_0 and k are nan
    c0_S_per_m: float
    k: float
    relative_rms: float  # over all values
    predicted_rms: float  # over those kept out; nan where too few are
    counts: bool  # whether it predicts about as well as the best


def other_laws(experiments: Sequence[Experiment]) -> tuple[OtherLaw, ...]:
    """The cubic and the other laws, each with its error where it was not fitted; none where the tests hold too few
    strains for that."""
    e, c = (np.concatenate([getattr(x, name) for x in experiments]) for name in ("strain", "value"))
    inner = np.ones(e.size, dtype=bool)
    inner[np.argsort(np.abs(e), kind="stable")[e.size - max(e.size // _KEPT_OUT, _FEWEST):]] = False
    if np.unique(e[inner]).size < 5:
        return ()

    def error(values: Array, seen: NDArray[np.bool_]) -> float:
        return float(np.sqrt(np.mean((values[seen] / c[seen] - 1) ** 2)))

    every, outer = np.ones(e.size, dtype=bool), ~inner
    found = [("cubic", np.nan, np.nan, error(_cubic(e, c, every), every), error(_cubic(e, c, inner), outer))]
    for name, measure in OTHERS.items():
        (start, k), (inner_start, inner_k) = (_line(measure(e[part]), np.log(c[part])) for part in (every, inner))
        found.append((name, float(np.exp(start)), k, error(np.exp(start + k * measure(e)), every),
                      error(np.exp(inner_start + inner_k * measure(e)), outer)))
    best = min(row[-1] for row in found)
    return tuple(OtherLaw(*row, row[-1] <= _ABOUT * best) for row in found)


def values_of(laws: Sequence[Mapping[str, object]], strain: Array) -> list[Array]:
    """Conductivity, S/m, (n,), of every law of a card but the cubic that counts."""
    return [float(str(row["c0_S_per_m"])) * np.exp(float(str(row["k"])) * OTHERS[str(row["law"])](strain))
            for row in laws if row["law"] in OTHERS and row["counts"]]


def _cubic(e: Array, c: Array, part: NDArray[np.bool_]) -> Array:
    basis = np.vander(e, 4)
    return np.asarray(basis @ np.linalg.lstsq(basis[part] / c[part, None], np.ones(int(part.sum())), rcond=None)[0])


def _line(x: Array, y: Array) -> tuple[float, float]:
    k, start = np.polyfit(x, y, 1)
    return float(start), float(k)
