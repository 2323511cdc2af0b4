"""Tables of load paths for laws of the foam near one another: one that is solved, and what other laws change of it.

At equal depth the surface is nearly the same for all of them, and the pressure a little different: what a law changes
is a weighted sum of what a few laws change (`ReducedBasis`), solved at a few diameters and depths.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from eitsim.mechanics.load_paths.reduced_basis import ReducedBasis
from eitsim.mechanics.load_paths.table import lagrange_weights, of_law
from eitsim.mechanics.load_paths.types import Table
from matcal.laws.known_laws import law_of
from matcal.laws.law import Law, values_of
from touchcal.arrays import Array

# Most diameters at which the changes are solved, and every which depth of the table they are.
_DIAMETERS, _EVERY = 3, 2
# Tables that a process holds at a time.
_HELD = 4


@dataclass(frozen=True, eq=False)
class Family:
    """Touches of a shape over force, diameter and law."""

    table: Table  # of the central law, as deep as the paths of all; error, checks and CPU time are those of all
    span: ReducedBasis  # which laws are weighted how
    # (K, D, k, 6 r + 6) changes of a table's values and slopes at the diameters and depths of `places`
    values: Array
    slopes: Array


def places(table: Table) -> tuple[list[int], list[int]]:
    """Positions of the diameters and the depths of a table at which other laws are solved."""
    depths = len(table.depths)
    return places_among(len(table.shape.solved)), sorted({*range(0, depths, _EVERY), depths - 1})


def places_among(diameters: int) -> list[int]:
    """Positions among so many diameters of those at which other laws are solved."""
    return np.linspace(0, diameters - 1, min(diameters, _DIAMETERS)).round().astype(int).tolist()


def table_of(source: Table | Family | None, law: Law) -> Table | None:
    """The table that serves a law, if there is one: of a family the weighted mean, None for a law outside it."""
    if not isinstance(source, Family):
        return source
    return _mean(source, law.name, values_of(law))


def central_of(source: Table | Family | None) -> Table | None:
    """The table itself, or that of a family's central law, which holds the errors and the CPU time of all."""
    return source.table if isinstance(source, Family) else source


@lru_cache(maxsize=_HELD)
def _mean(family: Family, name: str, values: tuple[tuple[float, ...], ...]) -> Table | None:
    own = law_of(name, values)
    weights = family.span.weights(own)
    if weights is None:
        return None
    table = family.table
    changes, slopes = (np.tensordot(weights, part, 1) for part in (family.values, family.slopes))
    changes, slopes = _everywhere(table, changes, slopes)
    return replace(table, shape=of_law(table.shape, own), values=table.values + changes, slopes=table.slopes + slopes,
                   laws=len(weights) + 1)


def _everywhere(table: Table, values: Array, slopes: Array) -> tuple[Array, Array]:
    """Changes at all diameters and depths of a table: polynomials in the diameter's logarithm, cubics in the depth."""
    some, depths = places(table)
    x = np.log(table.shape.solved)
    across = np.array([lagrange_weights(x[some], at) for at in x.tolist()])
    values, slopes = (np.tensordot(across, part, 1) for part in (values, slopes))
    cubic = CubicHermiteSpline(table.depths[depths], values, slopes, axis=1)
    return cubic(table.depths), cubic(table.depths, 1)

