"""The ring of electrodes as a surrogate needs it: where they are, and which four make a reading."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.forward.untouched import sensor_of
from eitsim.scene.drive import protocol
from eitsim.scene.electrodes import identical, middles
from eitsim.scene.scene import Scene
from touchcal.arrays import Array, Index

# Modes of an electrode's field, and the conductivity of a usual skin that they are foreseen with, S/m.
MODES, USUAL_S_PER_M = 120, 30.0


@dataclass(frozen=True)
class Ring:
    """Electrodes on the rim of a disc and the readings in the order of the data set's columns."""

    radius_mm: float  # radius of the disc, mm
    angle_rad: Array  # (electrodes,) angle of each electrode from +x, counter-clockwise, rad
    source: NDArray[np.int64]  # (readings,) electrode that injects the current
    sink: NDArray[np.int64]  # (readings,) electrode that takes it out
    read: NDArray[np.int64]  # (readings,) electrode that is read
    ground: NDArray[np.int64]  # (readings,) electrode that is 0 V
    modes: Array  # (MODES,) foreseen q_m, q_1 = 1: the field of an electrode is the real part of sum_m (q_m / m) z^m

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
    """Whether two rings give the same readings in the same order."""
    return all(np.array_equal(getattr(one, field.name), getattr(other, field.name)) for field in fields(Ring))


def ring_of(scene: Scene) -> Ring:
    """The ring of a scene's body, electrodes and drive; ValueError where the body is no disc, a reading not one
    voltage between two electrodes, or a pattern not the current I from one to another."""
    if scene.body.has_outline:
        raise ValueError("surrogates learn from rings of electrodes on discs; skins with an outline in [body] are not "
                         "learned yet.")
    count = scene.electrodes.count
    if scene.electrodes.missing:
        raise ValueError(f"electrodes {', '.join(map(str, scene.electrodes.missing))} (from 0) are missing in "
                         "[electrodes], and some readings with them; surrogates learn from all readings of a drive. "
                         "Sweep with all electrodes.")
    asked = protocol(scene.drive, count)
    source, sink = _ends(asked.currents_A / scene.drive.current_A, "pattern of currents")
    read, ground = _ends(asked.weights.reshape(-1, count), "measurement")
    each = asked.shape[1]
    return Ring(scene.body.radius_m * 1e3, middles(scene.electrodes), np.repeat(source, each), np.repeat(sink, each),
                read, ground, _modes(scene))


def _modes(scene: Scene) -> Array:
    """q_m of one of equal line electrodes by the complete electrode model; 1, those of points, for others."""
    if scene.electrodes.kind != "line" or not identical(scene.electrodes):
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


def ring_of_design(tables: Mapping[str, Any]) -> Ring:
    """The ring of a design's tables; ValueError where the sensor itself varies between rows."""
    return ring_of(sensor_of(tables))
