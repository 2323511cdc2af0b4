"""A layer's mesh: the mesh of its plane, drawn through its thickness."""

import numpy as np

from eitsim.electrics.cem.assembly import SkinMesh
from eitsim.electrics.volume.volume_cem import Indices, VolumeMesh
from touchcal.arrays import Array

PLACES = ("rim", "top", "bottom")
_LINES = {"P1": "L1", "P2": "L2", "Q2": "L2"}  # of the elements of a plane, that through the thickness


def extruded(mesh: SkinMesh, heights_m: Array, place: str = "rim", between_m: tuple[float, float] | None = None
             ) -> VolumeMesh:
    """Prisms between heights (n,), m, increasing, on the elements of a flat mesh.

    Electrodes along edges lie on the rim (place "rim"), between two of these heights or on all of it; those on elements
    at the top or at the bottom. ValueError for another place, or heights between which no line lies.
    """
    line = _LINES[mesh.element]
    steps = 1 if line == "L1" else 2
    if place not in PLACES:
        raise ValueError(f"place '{place}' of electrodes is unknown; known: {', '.join(PLACES)}.")
    levels = np.interp(np.arange(steps * (len(heights_m) - 1) + 1) / steps, np.arange(len(heights_m)), heights_m)
    count = len(levels)
    nodes = np.column_stack([np.repeat(mesh.nodes_m, count, axis=0), np.tile(levels, len(mesh.nodes_m))])
    order = np.array([0, 1] if steps == 1 else [0, 2, 1])  # ends first, as scikit-fem counts
    first = steps * np.arange(len(heights_m) - 1)
    through = first[:, None] + order

    def drawn(flat: Indices, levels_of: Indices) -> Indices:
        made = flat[:, None, :, None] * count + levels_of[None, :, None, :]
        return made.reshape(len(flat) * len(levels_of), -1)

    if (place == "rim") != (mesh.under.shape[1] != mesh.cells.shape[1]):
        raise ValueError(f"electrodes at the {place} need a mesh with {'edges' if place == 'rim' else 'elements'} "
                         "under them.")
    if place == "rim":
        low, high = between_m or (heights_m[0], heights_m[-1])
        tiny = 1e-9 * (heights_m[-1] - heights_m[0])
        held = through[(heights_m[:-1] >= low - tiny) & (heights_m[1:] <= high + tiny)]
        if not len(held):
            raise ValueError(f"electrodes from {low:g} to {high:g} m hold no layer of the mesh; give lines of it at "
                             "their ends.")
        under, face, repeat = drawn(mesh.under, held), f"{line}x{line}", len(held)
    else:
        under, face, repeat = mesh.under * count + (count - 1 if place == "top" else 0), mesh.element, 1
    return VolumeMesh(nodes, drawn(mesh.cells, through), under, np.repeat(mesh.electrode, repeat), mesh.count,
                      f"{mesh.element}x{line}", face)


def graded_heights(thickness_m: float, layers: int, between_m: tuple[float, float] | None = None) -> Array:
    """Heights (n,), m, of a layer whose top is at 0, finer towards its faces, and towards two heights where they are
    given."""
    stops = np.unique([-thickness_m, 0.0, *(between_m or ())])
    counts = [max(1, round(layers * part / thickness_m)) for part in np.diff(stops)]
    return np.concatenate([stops[:1], *(a + (b - a) * (1 - np.cos(np.pi * np.arange(1, n + 1) / n)) / 2
                                        for a, b, n in zip(stops[:-1], stops[1:], counts, strict=True))])
