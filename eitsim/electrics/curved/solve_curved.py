"""The complete electrode model on a sheet in space: untouched readings, and those with prescribed conductances."""

import hashlib
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.cem.assembly import Array, SkinMesh
from eitsim.electrics.curved.adapted_sheet import State, solve_sheet
from eitsim.electrics.curved.facets import Facets
from eitsim.electrics.curved.rounds import Ball, cut_out, refined_at
from eitsim.electrics.mesh.p2_triangles import EDGES, sides
from eitsim.scene.curved_skin import CurvedSkin, read_curved_skin
from eitsim.scene.drive import read_out
from eitsim.scene.triangles.triangle_files import TriangleMesh
from touchcal.errors import InputFileError
from touchcal.jit import cpu_s
from touchcal.provenance import versions

READINGS, SIGNAL = 1e-4, 1e-3  # Relative errors of the untouched readings and of the signal, unless given.


@dataclass(frozen=True, eq=False)
class CurvedReadings:
    """A curved skin, solved."""

    impedance_Ohm: Array  # (electrodes, electrodes) impedance, untouched, Ohm; rows and columns sum to zero
    touched_Ohm: Array  # the same with the patches' conductances
    baseline_V: Array  # (patterns, readings) untouched, V
    signal_V: Array  # (patterns, readings) what the patches change, V
    readings_error: float  # estimated relative error of untouched readings between neighbouring electrodes, 2-norm
    signal_error: float | None  # the same of what the patches change; None without any
    triangles: int  # of the mesh that was solved
    nodes: int
    cpu_s: float  # CPU time spent, s

    @property
    def touched_V(self) -> Array:
        return self.baseline_V + self.signal_V


def solve_curved_skin(skin: CurvedSkin | Path | str, *, readings: float = READINGS,
                      signal: float = SIGNAL) -> CurvedReadings:
    """Complete electrode model on a sheet in space, on P2 triangles that its own solution halves.

    Parameters
    ----------
    skin
        A `CurvedSkin`, or its file (TOML). Its triangles are the body: flat ones stay flat.
    readings, signal
        Relative errors asked of the readings between neighbouring electrodes, and of what patches change of them.

    Returns
    -------
    CurvedReadings
        Impedance matrices (Ohm), readings and signal (V), and their estimated errors: half of what halving all
        triangles changes of readings, and all that it changes of the signal.

    Raises
    ------
    ValueError, InputFileError
        Where the sheet or an electrode cannot be as it is given.
    NotConverged
        Where the errors asked for need too many triangles.

    Examples
    --------
    >>> import eitsim
    >>> eitsim.solve_curved_skin("absent.toml")
    Traceback (most recent call last):
    touchcal.errors.InputFileError: absent.toml: no such file. Check the name and the folder.
    """
    begun = cpu_s()
    skin = skin if isinstance(skin, CurvedSkin) else read_curved_skin(skin)
    at_rest, pressed = uniform(skin.conductance_S), partial(_conductance, skin.conductance_S, touched=True)
    found = solve_sheet(_prepared(skin), contact_impedances(skin), at_rest, pressed if skin.patches else None, readings,
                        signal)
    return CurvedReadings(
        found.impedance_Ohm, found.touched_Ohm, read_out(skin.drive, found.impedance_Ohm),
        read_out(skin.drive, found.touched_Ohm - found.impedance_Ohm), found.readings_error, found.signal_error,
        len(found.mesh.cells), len(found.mesh.nodes_m), cpu_s() - begun)


def uniform(sheet_S: float) -> State:
    """The state of an untouched sheet of a conductance, S."""
    return partial(_conductance, sheet_S, touched=False)


def _conductance(sheet_S: float, mesh: SkinMesh, facets: Facets, parts: int, *, touched: bool) -> Array:
    """(cells,) sheet conductance, S, of triangles cut in parts, with the patches' factors where touched."""
    return np.repeat(sheet_S * (facets.factor if touched else np.ones_like(facets.factor)), parts)


def curved_document(path: Path, skin: CurvedSkin, solved: CurvedReadings) -> dict[str, Any]:
    """A solved curved skin as plain JSON values, units in the names of the keys; `readings_V` are touched where there
    are patches, and the untouched ones and the signal follow then; `conductance_S` is that without patches."""
    document: dict[str, Any] = {
        "schema": 1,
        "model": {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
                  "variable": skin.mesh.name, "electrodes": skin.count, "nodes": solved.nodes,
                  "triangles": solved.triangles, "element": "P2",
                  "conductance_S": [skin.conductance_S] * 2,
                  "contact_impedance_Ohm_m2": contact_impedances(skin).tolist(),
                  "patch_factors": [patch.factor for patch in skin.patches]},
        "impedance_Ohm": solved.touched_Ohm.tolist(), "readings_V": solved.touched_V.tolist(),
        "error_estimate": {"readings": solved.readings_error},
        "cost": {"cpu_s": solved.cpu_s, "unknowns": solved.nodes + skin.count - 1}, "versions": versions()}
    if solved.signal_error is not None:
        document |= {"baseline_V": solved.baseline_V.tolist(), "signal_V": solved.signal_V.tolist()}
        document["error_estimate"]["signal"] = solved.signal_error
    return document


def contact_impedances(skin: CurvedSkin) -> Array:
    """(electrodes,) contact impedances, Ohm m^2."""
    return np.broadcast_to(np.asarray(skin.contact_impedance_Ohm_m2, dtype=float), skin.count)


def _prepared(skin: CurvedSkin) -> Facets:
    """As `prepared`, with the file in what it raises."""
    try:
        return prepared(skin)
    except ValueError as error:
        if skin.file is None or isinstance(error, InputFileError):
            raise
        raise InputFileError(skin.file, str(error)) from None


def prepared(skin: CurvedSkin) -> Facets:
    """The sheet with electrodes and patches cut out of it. ValueError where an electrode or a patch is off the sheet,
    or two electrodes overlap."""
    facets = facets_of(skin.mesh)
    widths = np.broadcast_to(np.asarray(skin.widths_m, dtype=float), skin.count)
    rounds = [*zip(skin.places_m, widths, strict=False), *((p.centre_m, p.width_m) for p in skin.patches)]
    facets = refined_at(facets, [Ball(np.asarray(place), width / 2) for place, width in rounds])
    for k, group in enumerate(skin.groups):
        if group not in skin.mesh.groups:
            raise ValueError(f"groups in [electrodes]: {skin.mesh.name} has no group {group!r}; it has "
                             f"{', '.join(map(str, skin.mesh.groups)) or 'none'}.")
        facets = _under(facets, np.isin(facets.parent, skin.mesh.groups[group]), k)
    for k, (place, width) in enumerate(rounds):
        what = f"electrode {k}" if k < len(skin.places_m) else f"patch {k - len(skin.places_m)}"
        facets, inside = cut_out(facets, np.asarray(place), width / 2)
        if not inside.any():
            away = 1e3 * np.linalg.norm(facets.nodes_m - place, axis=1).min()
            raise ValueError(f"{what} (from 0) lies off the sheet, whose nearest point is {away:.3g} mm from it, more "
                             "than half of its width_mm; move it or make it wider.")
        if k < len(skin.places_m):
            facets = _under(facets, inside, k)
        else:
            factor = skin.patches[k - len(skin.places_m)].factor
            facets = replace(facets, factor=np.where(inside, facets.factor * factor, facets.factor))
    return facets


def _under(facets: Facets, inside: NDArray[np.bool_], k: int) -> Facets:
    taken = facets.electrode[inside]
    if np.any(taken >= 0):
        raise ValueError(f"electrodes {taken.max()} and {k} (from 0) overlap; place them further from each other or "
                         "make them smaller.")
    return replace(facets, electrode=np.where(inside, k, facets.electrode))


def facets_of(mesh: TriangleMesh) -> Facets:
    """The triangles of a file as quadratic ones, flat ones with the middles of their edges halfway."""
    nodes, cells = mesh.nodes_m, mesh.cells
    if cells.shape[1] == 3:
        edges, number = np.unique(sides(cells), axis=0, return_inverse=True)
        cells = np.column_stack([cells, len(nodes) + number.reshape(len(EDGES), -1).T])
        nodes = np.vstack([nodes, nodes[edges].mean(axis=1)])
    count = len(cells)
    return Facets(nodes, cells, np.full(count, -1), np.ones(count), np.arange(count))
