"""Fields of a data set's rows on disk: next to each Parquet part an HDF5 file of the same name, written before it."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.forward import gridded_fields as gridded
from eitsim.electrics.forward.gridded_fields import QUANTITIES, StoredFields, coordinates, inside
from eitsim.scene.scene import Body
from touchcal.errors import InputFileError

Fields = Mapping[str, NDArray[np.float32]]

SCHEMA = 1
SUFFIX = ".h5"
_GZIP = 4


def encoded(stored: StoredFields, body: Body, rows: Mapping[int, Fields]) -> bytes:
    """An HDF5 file of the fields of some scenes (number -> name -> values, no names where it was not solved): float32,
    one compressed chunk a scene and field."""
    scenes = sorted(rows)
    place = io.BytesIO()
    with _file(place, "w") as file:
        file.attrs["schema"], file.attrs["grid"] = SCHEMA, stored.grid
        file["scene"] = np.array(scenes, dtype=np.int64)
        for name, axis in coordinates(stored, body).items():
            file[name] = axis
        file["inside"] = inside(stored, body)
        for name in stored.names:
            quantity = QUANTITIES[name]
            values = np.stack([rows[scene].get(name, gridded.blank(stored, name)) for scene in scenes])
            kept = file.create_dataset(quantity.dataset, data=values, chunks=(1, *values.shape[1:]), shuffle=True,
                                       compression="gzip", compression_opts=_GZIP)
            kept.attrs["units"], kept.attrs["meaning"] = quantity.unit, quantity.meaning
    return place.getvalue()


def joined(stored: StoredFields, body: Body, contents: Sequence[bytes]) -> bytes:
    """One file of the scenes of several; of one that stands in two of them what the last says."""
    rows: dict[int, Fields] = {}
    for content in contents:
        with _file(io.BytesIO(content), "r") as file:
            whole = {name: file[QUANTITIES[name].dataset][:] for name in stored.names}
            rows |= {scene: {name: values[row] for name, values in whole.items()}
                     for row, scene in enumerate(file["scene"][:].tolist())}
    return encoded(stored, body, rows)


def continued(path: Path, stored: StoredFields, body: Body, content: bytes) -> bytes:
    """What stands in a file and, after it, what comes; InputFileError where it is missing or cut."""
    try:
        return joined(stored, body, [path.read_bytes(), content])
    except (OSError, KeyError, ValueError, IndexError) as error:
        problem = f"is cut or no file of fields ({error})" if path.is_file() else "is missing"
        raise InputFileError(path, f"it {problem}. Remove {path.stem}.parquet next to it and continue the sweep: both "
                                   "are made again.") from None


def _file(place: Path | io.BytesIO, mode: Any) -> Any:
    """An HDF5 file, whose items h5py has no types for."""
    return h5py.File(place, mode)
