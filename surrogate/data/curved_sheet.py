"""The sheet of a curved skin as a surrogate needs it: places all over it, and the electrodes' fields there."""

from dataclasses import dataclass

import numpy as np

from eitsim.electrics.curved.untouched_fields import UntouchedFields, untouched_fields
from eitsim.scene.curved.curved_scene import CurvedScene
from eitsim.scene.drive import read_out
from touchcal.arrays import Array

# Places, about, the error of the fields' readings, and sheet conductances that are tried for the untouched readings.
_PLACES, _READINGS, _TRIES = 9000, 1e-3, 1


@dataclass(frozen=True, eq=False)
class CurvedSheet:
    """Places of a curved skin with the fields of its electrodes."""

    electrode_mm: Array  # (electrodes, 3) places of the electrodes
    points_mm: Array  # (n, 3) places of the skin
    areas_mm2: Array  # (n,) that they stand for
    frames: Array  # (n, 3, 3) two tangents and the normal there, in rows
    slopes: Array  # (n, 2, electrodes) of potentials, along the tangents, of a current into one electrode


def same_curved(one: CurvedSheet | None, other: CurvedSheet | None) -> bool:
    """Whether two skins have the same electrodes, or are both none."""
    if one is None or other is None:
        return one is other
    return np.array_equal(one.electrode_mm, other.electrode_mm)


def curved_sheet(scene: CurvedScene, usual_S: float, baseline_V: Array | None) -> CurvedSheet:
    """The sheet of a scene, of the conductance whose untouched readings are as large as those given, (readings,), V, on
    a usual one without."""
    found, sheet_S = _fields(scene, usual_S), usual_S
    for _ in range(_TRIES if baseline_V is not None else 0):
        read = read_out(scene.drive, found.impedance_Ohm)
        sheet_S *= float(np.linalg.norm(read) / np.linalg.norm(baseline_V))  # pyright: ignore[reportArgumentType]
        found = _fields(scene, sheet_S)
    return CurvedSheet(1e3 * _middles(scene), 1e3 * found.points_m, 1e6 * found.areas_m2, found.frames, found.slopes)


def _fields(scene: CurvedScene, sheet_S: float) -> UntouchedFields:
    return untouched_fields(scene.sheet(sheet_S), _PLACES, _READINGS)


def _middles(scene: CurvedScene) -> Array:
    sheet = scene.sheet(1.0)
    if not sheet.groups:
        return np.array(sheet.places_m)
    nodes, cells = sheet.mesh.nodes_m, sheet.mesh.cells
    return np.array([nodes[cells[sheet.mesh.groups[group], :3]].mean(axis=(0, 1)) for group in sheet.groups])
