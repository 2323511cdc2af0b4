"""Readings of a sheet in space, untouched and touched, on triangles that its own solutions halve where they are off."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.cem.assembly import Array, SkinMesh, centred, dissection, potentials, weights
from eitsim.electrics.curved.facets import Facets, halved
from eitsim.electrics.mesh.p2_triangles import uniform_refinement
from eitsim.electrics.outline.adapted_mesh import readings_difference
from eitsim.numerics.nested_dissection import Dissection
from touchcal.errors import NotConverged

# Sheet conductance of a state, S, at the quadrature points of a mesh, each triangle of the sheet being cut in so many.
State = Callable[[SkinMesh, Facets, int], Array]

# What halving once more leaves of the change by halving, at most: of readings; and of the signal, whose conductance is
# seen at few points of a triangle where strains are steep.
_LEFT, _LEFT_SIGNAL = 0.5, 1.0
_STEPS = 40  # Refinements, at most.
_MOST = 100_000  # Triangles, before they are halved, at most.
_ROUNDING = 1e-13  # A change smaller than this part of the readings is one of rounding.
_SHARE = 0.7  # Part of the error in the triangles that are halved.
_PAIRS = 15  # Pairs of the nodes of a triangle.
_TOGETHER = 2000  # Triangles that are looked at together.


@dataclass(frozen=True, eq=False)
class SheetReadings:
    """A sheet solved in one state or two."""

    impedance_Ohm: Array  # (electrodes, electrodes) untouched, Ohm
    touched_Ohm: Array  # the same touched
    readings_error: float  # estimated relative error of untouched readings between neighbours, 2-norm
    signal_error: float | None  # the same of what the touch changes; None without one
    facets: Facets  # the triangles before they were halved once more
    mesh: SkinMesh  # the halved ones


def solve_sheet(facets: Facets, z: Array, untouched: State, touched: State | None, readings: float, signal: float
                ) -> SheetReadings:
    """Complete electrode model on P2 triangles, halved until the readings between neighbouring electrodes and what a
    touch changes of them are as exact as asked; z (electrodes,), Ohm m^2.

    Errors are _LEFT or _LEFT_SIGNAL times what halving all triangles changes. That change of the impedance matrix is,
    up to quadrature, the energy of the difference between both solutions, triangle by triangle; of what a touch
    changes, the difference of both states' energies. The triangles that hold most of what misses its error are halved,
    those alone.
    NotConverged where too many would be needed.
    """
    states = [untouched] if touched is None else [untouched, touched]
    for _ in range(_STEPS):
        mesh = skin_mesh(facets, len(z))
        finer = uniform_refinement(mesh)
        order, finer_order = dissection(mesh), dissection(finer)
        pairs = [_halving(mesh, finer, [state(mesh, facets, 1), state(finer, facets, 4)], z, [order, finer_order])
                 for state in states]
        off = _LEFT * readings_difference(pairs[0].coarse_Ohm, pairs[0].fine_Ohm)
        change_off = _change_error(*pairs) if touched is not None else None
        late = change_off is not None and change_off > signal
        if off <= readings and not late:
            return SheetReadings(pairs[0].fine_Ohm, pairs[-1].fine_Ohm, off, change_off, facets, finer)
        if len(facets.cells) > _MOST:
            break
        marked = np.zeros(len(facets.cells), dtype=bool)
        if off > readings:
            marked |= _most(_local_change(finer, pairs[:1], [1.0]))
        if late:
            marked |= _most(_local_change(finer, pairs, [-1.0, 1.0]))
        facets = halved(facets, marked)
    missed = [f"the {name} of the curved skin {verb} known to {found:.1e} only, {asked:g} was asked for"
              for name, verb, found, asked in (("readings", "are", off, readings), ("signal", "is", change_off, signal))
              if found is not None and not found <= asked]
    raise NotConverged(f"{' and '.join(missed)}; give wider electrodes or larger contact impedances.")


def skin_mesh(facets: Facets, count: int) -> SkinMesh:
    """The sheet as a mesh with what of it lies under electrodes."""
    covered = facets.electrode >= 0
    return SkinMesh(facets.nodes_m, facets.cells, facets.cells[covered], facets.electrode[covered], count, "P2")


@dataclass(frozen=True, eq=False)
class _Halving:
    """One state on a mesh and on the same one halved."""

    coarse_Ohm: Array
    fine_Ohm: Array
    away: Array  # (nodes, electrodes) what halving changes of the potentials of the halved mesh
    weight: Array  # (4 t, pairs) weights of the pairs of its triangles' nodes, 1/Ohm


def _halving(mesh: SkinMesh, finer: SkinMesh, sheets: Sequence[Array], z: Array, orders: Sequence[Dissection]
             ) -> _Halving:
    coarse, fine = (centred(one, potentials(one, sheet, z, order=order))
                    for one, sheet, order in zip((mesh, finer), sheets, orders, strict=True))
    away = fine[:len(finer.nodes_m)] - prolonged(mesh, coarse[:len(mesh.nodes_m)])
    weight = weights(finer, sheets[1], z)[:_PAIRS * len(finer.cells)].reshape(-1, _PAIRS)
    return _Halving(coarse[-mesh.count:], fine[-mesh.count:], away, weight)


def _local_change(finer: SkinMesh, pairs: Sequence[_Halving], signs: Sequence[float]) -> Array:
    """(t,) Frobenius norm of what each triangle adds to the change of the impedance matrix by halving, Ohm, summed over
    states with signs."""
    i, j = np.triu_indices(6, 1)
    parts = []
    for first in range(0, len(finer.cells), _TOGETHER):
        cells = finer.cells[first:first + _TOGETHER]
        steps = np.concatenate([pair.away[cells[:, i]] - pair.away[cells[:, j]] for pair in pairs], axis=1)
        weight = np.concatenate([sign * pair.weight[first:first + _TOGETHER]
                                 for sign, pair in zip(signs, pairs, strict=True)], axis=1)
        inner = steps @ steps.swapaxes(1, 2)
        parts.append(np.einsum("tp,tpq,tq->t", weight, inner**2, weight, optimize=True))
    return np.sqrt(np.maximum(np.concatenate(parts), 0)).reshape(-1, 4).sum(axis=1)


def prolonged(mesh: SkinMesh, potential: Array) -> Array:
    """Potentials (nodes, k) of a P2 mesh at the nodes of the same mesh halved: they go over as its nodes' places do."""
    return uniform_refinement(replace(mesh, nodes_m=potential)).nodes_m


def _change_error(untouched: _Halving, touched: _Halving) -> float:
    """Estimated relative error of what a touch changes, 2-norm; 0 where that is rounding of the readings."""
    if readings_difference(touched.fine_Ohm, untouched.fine_Ohm) < _ROUNDING:
        return 0.0
    return _LEFT_SIGNAL * readings_difference(touched.coarse_Ohm - untouched.coarse_Ohm,
                                              touched.fine_Ohm - untouched.fine_Ohm)


def _most(error: Array) -> NDArray[np.bool_]:
    """Which of the triangles (t,) hold most of the error: the fewest that have _SHARE of it."""
    order = np.argsort(-error)
    total = np.cumsum(error[order])
    out = np.zeros(len(error), dtype=bool)
    out[order[:int(np.searchsorted(total, _SHARE * total[-1])) + 1]] = True
    return out
