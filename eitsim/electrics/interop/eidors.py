"""EIDORS's forward models from MATLAB files: mesh, electrodes, contact impedances, conductances, stimulation.

Fields as in EIDORS 3 (Adler and Lionheart, doi:10.1088/0967-3334/27/5/S03; eidors3d.sourceforge.net): a fwd_model has
nodes, elems, electrode(k).nodes or .faces, electrode(k).z_contact, and optionally boundary and
stimulation(k).stim_pattern and .meas_pattern; an image has elem_data with its fwd_model. Numbers of nodes count
from 1 in the file, from 0 here.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from struct import unpack
from typing import Any
from zlib import decompressobj
from zlib import error as CompressionError

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError, mat_struct
from scipy.sparse import issparse

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh
from eitsim.electrics.mesh.p2_triangles import sides
from eitsim.scene.drive import Protocol, matrices
from touchcal.errors import InputFileError
from touchcal.input_file import check_unpacked, regular

_COMPRESSED = 15  # type of an element that zlib has packed, in MATLAB files of v5


@dataclass(frozen=True, eq=False)
class Model:
    """A forward model of a sheet."""

    # file that it was read from, and name of its variable
    file: Path
    name: str
    mesh: SkinMesh  # linear triangles, with the boundary edges under each electrode; lengths in m
    contact_impedance_Ohm_m: Array  # (electrodes,) contact impedances, Ohm m
    # (triangles,) sheet conductances, S, or (triangles, 2, 2) tensors; None where the file holds none
    conductance_S: Array | None
    # one for each stimulation, with one pattern each, since the number of readings may differ; empty without any
    stimulation: tuple[Protocol, ...]


def read_eidors(path: Path | str, variable: str | None = None) -> Model:
    """Read the fwd_model, image or inv_model that a MATLAB file (v5 to v7) holds, or the one named `variable`.

    Stimulation currents are taken as A and lengths as m, as EIDORS's solvers do. InputFileError says why a model is not
    one of a sheet with complete electrodes: three dimensions, point electrodes, complex values, voltage drives, and
    stimulations or readings that refer to the ground node.
    """
    path = Path(path)
    try:
        name, found = _chosen(_variables(path), variable)
        forward = found.fwd_model if hasattr(found, "fwd_model") else found
        mesh, z = _mesh(forward)
        given = getattr(forward, "stimulation", None)
        stimulation = () if given is None or not np.size(given) else _protocols(np.atleast_1d(given), mesh.count)
        return Model(path, name, mesh, z, _conductance(found, len(mesh.cells)), tuple(stimulation))
    except InputFileError:
        raise
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def _variables(path: Path) -> dict[str, Any]:
    _check_unpacked(regular(path))
    try:
        raw = loadmat(path, struct_as_record=False, squeeze_me=True)
    except NotImplementedError:
        raise InputFileError(path, "a MATLAB v7.3 file, which is not read; save it again with `save -v7`.") from None
    except (ValueError, TypeError, MatReadError, EOFError, IndexError, OSError, MemoryError, CompressionError) as error:
        raise InputFileError(path, f"not a MATLAB file of v5 to v7, or one that was cut short ({error}); copy it "
                                   "again, or save the model with `save -v7`.") from None
    return {name: value for name, value in raw.items() if not name.startswith("__")}


mat_variables = _variables  # recordings of readings are read from such files too


def _check_unpacked(path: Path) -> None:
    """InputFileError where the compressed variables of a MATLAB file of v5 state more bytes than such a file holds."""
    with open(path, "rb") as file:
        head, total = file.read(128), 0
        order = ">" if head[126:] == b"MI" else "<"
        while head[124:126] in (b"\0\1", b"\1\0") and len(tag := file.read(8)) == 8:
            kind, size = unpack(f"{order}II", tag)
            if kind == _COMPRESSED:
                inner = decompressobj().decompress(file.read(min(size, 256)), 8)
                total += unpack(f"{order}II", inner)[1] if len(inner) == 8 else 0
                size -= min(size, 256)
            file.seek(size, 1)
    check_unpacked(path, total)


def _chosen(variables: Mapping[str, Any], requested: str | None) -> tuple[str, Any]:
    """The one variable, or the one named, that is or holds a forward model; nodes and elems may also stand alone."""
    if {"nodes", "elems"} <= variables.keys():
        whole = mat_struct()
        for name, value in variables.items():
            setattr(whole, name, value)
        variables = {"fwd_model": whole, **variables}
    models = {name: value for name, value in variables.items() if isinstance(value, mat_struct)
              and hasattr(getattr(value, "fwd_model", value), "nodes")}
    if requested is not None and requested not in models:
        raise ValueError(f"no forward model named '{requested}'; models in the file: {', '.join(models) or 'none'}.")
    if not models:
        raise ValueError("no forward model: a structure with nodes and elems, or one with such a fwd_model. Save the "
                         "fwd_model or the image itself.")
    if requested is None and len(models) > 1:
        raise ValueError(f"several models: {', '.join(models)}; say which one with --variable.")
    name = requested if requested is not None else next(iter(models))
    return name, models[name]


def _mesh(forward: Any) -> tuple[SkinMesh, Array]:
    """The mesh, and the contact impedances (electrodes,)."""
    nodes, cells = _dense(_field(forward, "nodes"), "nodes"), _numbers(_field(forward, "elems"), "elems")
    if nodes.ndim != 2 or nodes.shape[1] != 2 or cells.ndim != 2 or cells.shape[1] != 3:
        raise ValueError(f"nodes of {nodes.shape[-1]} coordinates and elements of {cells.shape[-1]} nodes; a sheet is "
                         "solved here, which needs triangles in the plane: 2 and 3.")
    _check_range(cells, len(nodes), "elems")
    unused = np.setdiff1d(np.arange(len(nodes)), cells)
    if unused.size:
        raise ValueError(f"node {unused[0] + 1} belongs to no element; take it out with remove_unused_nodes.")
    boundary = _boundary(forward, cells, len(nodes))
    electrodes = list(np.atleast_1d(_field(forward, "electrode")))
    if len(electrodes) < 2:
        raise ValueError(f"{len(electrodes)} electrode; at least 2 are needed for a current.")
    under = [_edges(electrode, k, boundary, len(nodes)) for k, electrode in enumerate(electrodes, start=1)]
    edges = np.vstack(under)
    _, seen = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    if seen.max() > 1:
        raise ValueError("two electrodes cover the same edge; part them.")
    electrode = np.repeat(np.arange(len(under)), [len(part) for part in under])
    return SkinMesh(nodes, cells, edges, electrode, len(under)), np.array(
        [_contact_impedance(electrode, k) for k, electrode in enumerate(electrodes, start=1)])


def _boundary(forward: Any, cells: Indices, nodes: int) -> Indices:
    """Edges (n, 2) of the model's boundary, or else those of one element alone."""
    given = getattr(forward, "boundary", None)
    if given is not None and np.size(given):
        edges = np.atleast_2d(_numbers(given, "boundary"))
        if edges.shape[1] != 2:
            raise ValueError(f"boundary has {edges.shape[1]} nodes a row; an edge has 2.")
        _check_range(edges, nodes, "boundary")
        return edges
    edges, seen = np.unique(sides(cells), axis=0, return_counts=True)
    return edges[seen == 1]


def _edges(electrode: Any, number: int, boundary: Indices, nodes: int) -> Indices:
    """Boundary edges (n, 2) with both ends among the electrode's nodes, or the faces that it names itself."""
    faces = getattr(electrode, "faces", None)
    if faces is not None and np.size(faces):
        edges = np.atleast_2d(_numbers(faces, f"faces of electrode {number}"))
        _check_range(edges, nodes, f"faces of electrode {number}")
        return edges
    own = np.unique(_numbers(_field(electrode, "nodes"), f"nodes of electrode {number}"))
    _check_range(own, nodes, f"nodes of electrode {number}")
    edges = boundary[np.isin(boundary, own).all(axis=1)]
    alone = np.setdiff1d(own, edges)
    if alone.size:
        raise ValueError(f"node {alone[0] + 1} of electrode {number} lies on no boundary edge between its nodes: a "
                         "point electrode, which has no contact. Give each electrode both ends of an edge or more.")
    return edges


def _contact_impedance(electrode: Any, number: int) -> float:
    z = _dense(_field(electrode, "z_contact"), "z_contact")
    if z.size != 1 or not (np.isfinite(z).all() and z.item() > 0):
        raise ValueError(f"z_contact of electrode {number} is {z.tolist()}; it must be one positive number, Ohm m.")
    return z.item()


def _conductance(found: Any, cells: int) -> Array | None:
    """elem_data of an image, one a triangle."""
    if not hasattr(found, "fwd_model") or not hasattr(found, "elem_data"):
        for other in ("node_data", "resistivity", "conductivity"):
            if hasattr(found, other):
                raise ValueError(f"the image holds {other}, not elem_data; make it elem_data of conductivity, or give "
                                 "one value with --conductance-S.")
        return None
    data = _dense(found.elem_data, "elem_data")
    if data.shape[:1] != (cells,) or data.shape[1:] not in ((), (2, 2)):
        raise ValueError(f"elem_data of shape {data.shape}; {cells} triangles need one number or 2 x 2 tensor each. "
                         "Map a coarse model to the fine one first (coarse2fine).")
    return data


def _protocols(given: Any, count: int) -> Iterator[Protocol]:
    for number, part in enumerate(given, start=1):
        where = f"stimulation {number}"
        for drive in ("volt_pattern", "interior_sources"):
            if hasattr(part, drive) and np.size(getattr(part, drive)):
                raise ValueError(f"{where} has {drive}; currents into electrodes are solved for here.")
        currents, weights = (_dense(_field(part, name)) for name in ("stim_pattern", "meas_pattern"))
        currents, weights = currents.reshape(-1), weights.reshape(-1, count) if weights.ndim == 1 else weights
        if currents.size != count or weights.shape[-1] != count:
            raise ValueError(f"{where} has a stim_pattern of {currents.size} numbers and a meas_pattern of "
                             f"{weights.shape[-1]} columns; both must be {count}, one an electrode.")
        try:
            made = matrices(currents[None], weights[None])
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
        if np.abs(weights.sum(axis=1)).max() > 1e-9 * np.abs(weights).max():
            raise ValueError(f"{where} reads voltages against the ground node (weights that do not sum to zero), which "
                             "the model's electrodes do not give. Read differences, or use balance_meas.")
        yield made


def _field(structure: Any, name: str) -> Any:
    if not hasattr(structure, name):
        raise ValueError(f"the model has no field {name}.")
    return getattr(structure, name)


def _dense(value: Any, name: str = "a pattern") -> Array:
    array = np.asarray(value.toarray() if issparse(value) else value)
    if np.iscomplexobj(array) and np.any(np.imag(array)):
        raise ValueError(f"{name} is complex; real values are solved for here.")
    if array.dtype.kind not in "buifc":
        raise ValueError(f"{name} holds no numbers.")
    return np.real(array).astype(float)


def _numbers(value: Any, name: str) -> Indices:
    """Numbers of nodes from 0, of those from 1 in the file."""
    array = _dense(value, name)
    if np.any(array != np.round(array)):
        raise ValueError(f"{name} must hold whole numbers of nodes.")
    return array.astype(np.int64) - 1


def _check_range(numbers: Indices, nodes: int, name: str) -> None:
    if numbers.size and not (numbers.min() >= 0 and numbers.max() < nodes):
        wrong = numbers.min() if numbers.min() < 0 else numbers.max()
        raise ValueError(f"{name} names node {wrong + 1}; there are {nodes}.")
