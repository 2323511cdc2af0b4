"""Readings of a homogeneous skin with an outline, as its sensor file describes it, and how imperfections change them.

On a disc an even ring looks the same from every electrode and in a mirror; on any other skin readings say which
electrode is which, but for the symmetries of its outline.
"""

from dataclasses import dataclass, replace

import numpy as np

from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.electrics.outline.edge_admittance import edge_admittance, sliding_mesh
from eitsim.scene.electrodes import contact_impedances, there
from eitsim.scene.outline_edge import edge_starts
from eitsim.scene.scene import Body, Electrodes
from touchcal.arrays import Array, Index

_SHEET_S = 1.0  # conductance of the sheet: an order and a size leave readings of a homogeneous one the same
_LAYERS = (0.0, 0.3, 1.0, 3.0)  # contact impedances added to those of each electrode, Ohm


@dataclass(frozen=True, eq=False)
class OutlinedSkin:
    """What readings are compared with."""

    impedances: tuple[Array, ...]  # (N, N) Ohm, of several contact impedances, the sensor file's first
    # (p, N, N) changes by the common width's logarithm, by displaced electrodes over their spacing, and by modes of the
    # sheet's logarithm; none of electrodes on the surface
    by_width: Array
    by_place: Array
    by_sheet: Array

    @property
    def count(self) -> int:
        """Number of electrodes."""
        return len(self.impedances[0])


def outlined_skin(body: Body, electrodes: Electrodes) -> OutlinedSkin:
    """The skin of a sensor file; ValueError where an electrode is missing."""
    if not there(electrodes).all():
        raise ValueError("the order of readings on a skin with an outline is judged without missing in "
                         "[electrodes]; leave it out, and leave the cells of readings that need these electrodes empty "
                         "in the recording.")
    count = electrodes.count
    if electrodes.along_edge:
        # contact impedances of a sheet of 1 S have the layer S z of one that conducts as coatings do
        electrodes = _on_unit_sheet(electrodes)
        edge = edge_admittance(sliding_mesh(body, electrodes, _SHEET_S), electrodes, _SHEET_S)
        z = np.linalg.pinv(edge.admittance_S, hermitian=True)
        spacing = edge_starts(body.outline)[-1] / count / body.edge.size_m
        by_width, by_place, by_sheet = (-z @ one @ z for one in (edge.by_width.sum(axis=0)[None],
                                                                 spacing * edge.by_angle, edge.by_sheet))
    else:
        z = untouched_impedance(body, _on_unit_sheet(electrodes), _SHEET_S)
        by_width = by_place = by_sheet = np.empty((0, count, count))
    return OutlinedSkin(tuple(z + layer * np.eye(count) for layer in _LAYERS), by_width, by_place, by_sheet)


def _on_unit_sheet(electrodes: Electrodes) -> Electrodes:
    """The electrodes with contact impedances over those of a sheet that conducts 1 mS."""
    return replace(electrodes, **{electrodes.impedance_key: tuple((1e-3 * contact_impedances(electrodes)).tolist())})


def on_body(pairs: Index, placed: tuple[int, int] | tuple[Index, Index], count: int) -> Index:
    """Pairs as the sensor file counts electrodes, where electrode k of the readings is its electrode way k + turn; -1
    stays the mean of all. Arrays of ways and turns are of several orders."""
    way, turn = placed
    return np.where(pairs < 0, pairs, (way * pairs + turn) % count)


def read_between(impedance: Array, pairs: Index) -> Array:
    """(...,) readings of an impedance matrix (..., N, N) by pairs (..., 4), for 1 A."""
    padded = np.pad(impedance, ((0, 1), (0, 1)))  # the mean of all, -1, which is the last, reads 0 V
    source, sink, plus, minus = np.moveaxis(pairs, -1, 0)
    return padded[source, plus] - padded[source, minus] - padded[sink, plus] + padded[sink, minus]


def changes(skin: OutlinedSkin, pairs: Index) -> tuple[Array, Array, Array, Array]:
    """Readings (m,) of the nominal skin by pairs (m, 4), and their changes by a common width (m, 1 or 0), by places
    (m, N or 0) and by modes of the sheet (m, modes or 0)."""
    width, place, sheet = (np.reshape([read_between(one, pairs) for one in part], (len(part), len(pairs))).T
                           for part in (skin.by_width, skin.by_place, skin.by_sheet))
    return read_between(skin.impedances[0], pairs), width, place, sheet
