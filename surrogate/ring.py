"""The ring of electrodes as a surrogate needs it: where they are, and which four make a reading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.drive import read_electrodes, stride
from eitsim.scene import Scene, scene_from

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SENSOR_TABLES = ("body", "electrodes", "drive")


@dataclass(frozen=True)
class Ring:
    """Electrodes on the rim of a disc and the readings in the order of the data set's columns."""

    # radius of the disc, mm
    radius_mm: float
    # (electrodes,) angle of each electrode from +x, counter-clockwise, rad
    angle_rad: Array
    # (readings,) electrode that injects the current
    source: Index
    # (readings,) electrode that takes it out
    sink: Index
    # (readings,) electrode that is read
    read: Index
    # (readings,) electrode that is 0 V
    ground: Index


def same_ring(one: Ring, other: Ring) -> bool:
    """Whether two rings give the same readings in the same order."""
    return all(np.array_equal(getattr(one, field.name), getattr(other, field.name)) for field in fields(Ring))


def ring_of(scene: Scene) -> Ring:
    """The ring of a scene's body, electrodes and drive."""
    count = scene.electrodes.count
    read = read_electrodes(scene.drive, count)
    source = np.repeat(np.arange(count), read.shape[1])
    angle = scene.electrodes.first_angle_rad + 2 * np.pi * np.arange(count) / count
    return Ring(scene.body.radius_m * 1e3, angle, source, (source + stride(scene.drive, count)) % count,
                read.ravel().astype(np.int64), (source - 1) % count)


def ring_of_design(tables: Mapping[str, Any]) -> Ring:
    """The ring of a design's tables; ValueError where the sensor itself varies between rows."""
    fixed = {name: tables[name] for name in SENSOR_TABLES if name in tables}
    for name, table in fixed.items():
        if varied := [key for key, value in table.items() if isinstance(value, list | Mapping)]:
            raise ValueError(f"{varied[0]} in [{name}] varies between the rows; a surrogate learns one sensor. Sweep "
                             "with it fixed.")
    return ring_of(scene_from(fixed))
