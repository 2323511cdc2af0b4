"""Updates condensed to where a touch changes the skin: what is left of the mesh is eliminated once, on to the nodes
that both parts share and the electrodes, and joins every new solution as one dense element (a Schur complement)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eitsim.electrics.cem.assembly import SkinMesh, quadrature_points, weights
from eitsim.numerics.conductor_elimination import eliminate, impedance_alone, solve
from eitsim.numerics.nested_dissection import dissect
from touchcal.arrays import Array

Indices = NDArray[np.integer]


def condensed(mesh: SkinMesh, inside: NDArray[np.bool_], conductance_S: float,
              z_Ohm_m: ArrayLike) -> tuple[SkinMesh, Callable[[Array], Array]]:
    """The cells inside (cells,) as a mesh without electrodes, and the function from their conductance to the impedance
    matrix, Ohm, all other cells keeping theirs."""
    nodes = len(mesh.nodes_m)
    parts = np.column_stack([mesh.under, nodes + mesh.electrode])
    given = weights(mesh, np.full(len(mesh.cells), conductance_S), z_Ohm_m)
    cell = given[:-len(parts) * _pairs(parts)].reshape(len(mesh.cells), -1)
    part = given[-len(parts) * _pairs(parts):].reshape(len(parts), -1)
    outer = mesh.cells[~inside]
    out_there = np.isin(parts[:, :-1], outer).all(axis=1)
    kept = np.append(np.intersect1d(mesh.cells[inside], outer), np.unique(parts[out_there, -1]))
    dense = _on_to(kept, [outer, parts[out_there]], np.concatenate([cell[~inside].ravel(), part[out_there].ravel()]),
                   quadrature_points(mesh).mean(axis=1)[~inside])
    patch = replace(mesh, cells=mesh.cells[inside], under=mesh.under[:0], electrode=mesh.electrode[:0], count=0)
    number = np.append(np.unique(patch.cells), nodes + np.arange(mesh.count))
    given_blocks = (patch.cells, parts[~out_there], kept[None])
    blocks: list[Indices] = [np.searchsorted(number, block) for block in given_blocks if len(block)]
    order = dissect(quadrature_points(patch).mean(axis=1), blocks, mesh.count)
    fixed = np.concatenate([part[~out_there].ravel(), dense])

    def impedance(touched_S: Array) -> Array:
        return impedance_alone(order, np.concatenate([weights(patch, touched_S, 1.0), fixed]), mesh.count)

    return patch, impedance


def _pairs(block: Indices) -> int:
    return block.shape[1] * (block.shape[1] - 1) // 2


def _on_to(kept: Indices, blocks: list[Indices], given: Array, points: Array) -> Array:
    """Weights, 1/Ohm, between all pairs of kept unknowns that replace a network with these weights: the inverse of the
    potentials of all of them but the last, for currents into one at a time."""
    number = np.unique(np.concatenate([block.ravel() for block in blocks]))
    renumbered: list[Indices] = [np.searchsorted(number, block) for block in blocks]
    done = eliminate(dissect(points, renumbered, len(number) - np.searchsorted(number, blocks[1][:, -1].min())), given)
    place = np.searchsorted(number, kept)
    currents = np.zeros((len(number), len(kept)))
    currents[place, np.arange(len(kept))] = 1.0
    schur = np.linalg.inv(solve(done, currents)[place][:-1, :-1])
    joined = -np.column_stack([schur, -schur.sum(axis=1)])
    return joined[np.triu_indices(len(kept), 1)]
