"""The ring of electrodes as a surrogate needs it: where they are, and which four make a reading; on a skin with an
outline, its edges too."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.forward.untouched import sensor_of, untouched_readings
from eitsim.scene.curved.curved_body import curved_body
from eitsim.scene.curved.curved_scene import CurvedScene, curved_scene, is_curved
from eitsim.scene.drive import Drive, protocol
from eitsim.scene.electrodes import identical, middles
from eitsim.scene.scene import Scene
from surrogate.data import outlined_sheet
from surrogate.data.curved_sheet import CurvedSheet, curved_sheet, same_curved
from surrogate.data.outlined_sheet import Sheet
from touchcal.arrays import Array, Complex, Index

# Modes of an electrode's field, and the conductivity of a usual skin that they are foreseen with, S/m.
MODES, USUAL_S_PER_M = 120, 30.0
_TRIES = 2  # sheet conductances of a skin with an outline that are tried for its untouched readings


@dataclass(frozen=True)
class Ring:
    """Electrodes on the edge of a skin and the readings in the order of the data set's columns."""

    radius_mm: float  # radius of the disc; with an outline the largest distance of a place to the edges, mm
    angle_rad: Array  # (electrodes,) angle of each electrode from +x about the origin, counter-clockwise, rad
    source: NDArray[np.int64]  # (readings,) electrode that injects the current
    sink: NDArray[np.int64]  # (readings,) electrode that takes it out
    read: NDArray[np.int64]  # (readings,) electrode that is read
    ground: NDArray[np.int64]  # (readings,) electrode that is 0 V
    # (MODES,) foreseen q_m, q_1 = 1: the field of an electrode is the real part of sum_m (q_m / m) z^m; none of a sheet
    modes: Array
    sheet: Sheet | None = None  # the skin with an outline; None for a disc
    curved: CurvedSheet | None = None  # a curved skin; None for a flat one

    @property
    def origin_mm(self) -> Array:
        """(2,) middle of the disc, or the place of a skin that is farthest from its edges."""
        return np.zeros(2) if self.sheet is None else self.sheet.origin_mm

    @cached_property
    def copies(self) -> float:
        """Readings over independent ones: by reciprocity two readings with driving and reading exchanged are one
        impedance, which a map then has wrong twice over."""
        return len(self.read) / int(np.linalg.matrix_rank(impedances_read(self, np.arange(len(self.angle_rad)))))


def impedances_read(ring: Ring, to: Index) -> Array:
    """(readings, N N) each reading as a combination of transfer impedances, which are symmetric, between electrodes
    renumbered by `to`: twice the combination."""
    unit = np.eye(len(to))[to]
    drive, read = unit[ring.source] - unit[ring.sink], unit[ring.read] - unit[ring.ground]
    both = drive[:, :, None] * read[:, None, :]
    return (both + both.transpose(0, 2, 1)).reshape(len(drive), -1)


def same_ring(one: Ring, other: Ring) -> bool:
    """Whether two rings give the same readings in the same order; of skins with an outline, whose sheet conductance may
    differ, whether edges and electrodes are the same."""
    plain = [field.name for field in fields(Ring) if field.name not in ("sheet", "curved")]
    return outlined_sheet.same_sheet(one.sheet, other.sheet) and same_curved(one.curved, other.curved) and all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in plain)


def place(ring: Ring, touch: Array) -> Complex:
    """(n,) x + iy from the origin, over the radius, of touches (n, ...) that begin with x and y in mm."""
    if ring.sheet is None:
        return (touch[:, 0] + 1j * touch[:, 1]) / ring.radius_mm
    return (touch[:, 0] - ring.origin_mm[0] + 1j * (touch[:, 1] - ring.origin_mm[1])) / ring.radius_mm


def radial(ring: Ring, touch: Array) -> Array:
    """(n,) how near touches (n, ...) are to the edge: |z| on a disc, else 1 less the distance over the largest one."""
    if ring.sheet is None:
        return np.abs(place(ring, touch))
    return 1 - outlined_sheet.edge_distance_mm(ring.sheet, touch[:, :2])[0] / ring.radius_mm


def outwards(ring: Ring, radius: Array) -> Array:
    """(n, 2) places, mm, of these `radial` (n,) on the way from the origin to the edge nearest to it."""
    way = np.array([1.0, 0.0])
    if ring.sheet is not None:
        step = 1e-3 * ring.radius_mm * np.exp(1j * np.linspace(0, 2 * np.pi, 720, endpoint=False))
        tried = ring.origin_mm + np.column_stack([step.real, step.imag])
        way = -outlined_sheet.edge_distance_mm(ring.sheet, tried)[1]
        way = way[np.argmin(outlined_sheet.edge_distance_mm(ring.sheet, tried)[0])]
    return ring.origin_mm + ring.radius_mm * radius[:, None] * way


def ring_of(scene: Scene, baseline_V: Array | None = None, places_mm: Array | None = None) -> Ring:
    """The ring of a scene's body, electrodes and drive; ValueError where a reading is not one voltage between two
    electrodes, or a pattern not the current I from one to another.

    The fields on a skin with an outline are those on the sheet conductance whose untouched readings are as large as
    the given ones (readings,), V, on a usual one without, and are exact at places (n, 2), if any are given.
    """
    if scene.electrodes.missing:
        raise ValueError(f"electrodes {', '.join(map(str, scene.electrodes.missing))} (from 0) are missing in "
                         "[electrodes], and some readings with them; surrogates learn from all readings of a drive. "
                         "Sweep with all electrodes.")
    readings = _readings(scene.drive, scene.electrodes.count)
    if not scene.body.has_outline:
        return Ring(scene.body.radius_m * 1e3, middles(scene.electrodes), *readings, _modes(scene))
    sheet, reach_mm = outlined_sheet.sheet_of(scene.body.outline, scene.electrodes, _conductance_S(scene, baseline_V),
                                              None if places_mm is None else places_mm / 1e3)
    x, y = (sheet.electrode[:, :2] - sheet.origin_mm).T
    return Ring(reach_mm, np.arctan2(y, x), *readings, np.zeros(0), sheet)


def ring_of_curved(scene: CurvedScene, baseline_V: Array | None = None) -> Ring:
    """The electrodes of a curved skin, its readings and its fields; ValueError as `ring_of`."""
    readings = _readings(scene.drive, scene.sheet(1.0).count)
    sheet = curved_sheet(scene, USUAL_S_PER_M * scene.skin.thickness_m, baseline_V)
    x, y, _ = sheet.electrode_mm.T
    return Ring(scene.body.size_m * 1e3, np.arctan2(y, x), *readings, np.zeros(0), curved=sheet)


def _readings(drive: Drive, count: int) -> tuple[Index, Index, Index, Index]:
    """Electrodes (readings,) that inject and take out the current, are read and are 0 V."""
    asked = protocol(drive, count)
    source, sink = _ends(asked.currents_A / drive.current_A, "pattern of currents")
    read, ground = _ends(asked.weights.reshape(-1, count), "measurement")
    each = asked.shape[1]
    return np.repeat(source, each), np.repeat(sink, each), read, ground


def _conductance_S(scene: Scene, baseline_V: Array | None) -> float:
    """Sheet conductance, S, whose untouched readings are as large as those given; they are nearly its reciprocal."""
    usual = USUAL_S_PER_M * scene.skin.thickness_m
    if baseline_V is None:
        return usual
    found = usual
    for _ in range(_TRIES):
        found *= float(np.linalg.norm(untouched_readings(scene, found)) / np.linalg.norm(baseline_V))
    return found


def _modes(scene: Scene) -> Array:
    """q_m of one of equal line electrodes by the complete electrode model; 1, those of points, for others."""
    if not scene.electrodes.along_edge or not identical(scene.electrodes):
        return np.ones(MODES)
    driven = solve_rim(scene.body, scene.electrodes, USUAL_S_PER_M * scene.skin.thickness_m).driven[:MODES, 0]
    field = driven.real * np.arange(1, MODES + 1)
    return np.asarray(field / field[0])


def _ends(rows: Array, what: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Electrodes of the 1 and of the -1 in each row."""
    first, last = rows.argmax(axis=1), rows.argmin(axis=1)
    unit = np.eye(rows.shape[1])
    odd = np.flatnonzero(np.abs(rows - unit[first] + unit[last]).max(axis=1) > 1e-12)
    if odd.size:
        raise ValueError(f"{what} {odd[0]} in [drive] is not 1 at one electrode and -1 at another; surrogates learn "
                         "from pairs alone. Sweep with a named pattern, or with matrices of such rows.")
    return first.astype(np.int64), last.astype(np.int64)


def ring_of_design(tables: Mapping[str, Any], baseline_V: Array | None = None, places_mm: Array | None = None) -> Ring:
    """As `ring_of`, of a design's tables; ValueError where the sensor itself varies between rows."""
    if is_curved(tables):
        fixed = {name: tables[name] for name in ("body", "electrodes", "drive") if name in tables}
        somewhere = 1e3 * curved_body(tables["body"], Path()).triangles.nodes_m[0]
        scene = curved_scene({**fixed, "punch": {"at_mm": somewhere.tolist()}}, Path())
        return ring_of_curved(scene, baseline_V)
    return ring_of(sensor_of(tables), baseline_V, places_mm)
