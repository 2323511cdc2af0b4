"""Fields of a data set's rows on disk: next to each Parquet part an HDF5 file of the same name, written before it."""

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.forward import gridded_fields as gridded
from eitsim.electrics.forward.gridded_fields import QUANTITIES, TABLE, StoredFields, coordinates, inside
from eitsim.scene.scene import Body, scene_from
from eitsim.sweeps.dataset import parquet
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
    return _checked(path, lambda: joined(stored, body, [path.read_bytes(), content]))


def _file(place: Path | io.BytesIO, mode: Any) -> Any:
    """An HDF5 file, whose items h5py has no types for."""
    return h5py.File(place, mode)


@dataclass(frozen=True)
class FieldsOnDisk:
    """The fields of a data set, read as they are asked for."""

    folder: Path  # folder of the data set
    stored: StoredFields  # what is stored and on which grid
    coordinates: Mapping[str, NDArray[np.float64]]  # axes of the grid, as stored_fields.coordinates
    inside: NDArray[np.bool_]  # (*shape,) which points lie on the disc
    where: Mapping[int, tuple[Path, int]]  # scene number -> its file, and its row in it

    def read(self, name: str, scenes: Sequence[int]) -> NDArray[np.float32]:
        """Field (scenes, *shape) or (scenes, *shape, parts); NaN outside the disc and where a scene was not solved.

        name: one of stored.names. InputFileError for a field or scene that the set does not hold, and for a damaged
        file.
        """
        if name not in self.stored.names:
            raise InputFileError(self.folder, f"field '{name}' is not stored; stored: {', '.join(self.stored.names)}.")
        if unknown := [scene for scene in scenes if scene not in self.where]:
            raise InputFileError(self.folder, f"scene {unknown[0]} is not in the data set, which holds "
                                              f"{len(self.where)} of them.")
        out = np.empty((len(scenes), *gridded.blank(self.stored, name).shape), dtype=np.float32)
        by_file: dict[Path, list[tuple[int, int]]] = {}
        for place, scene in enumerate(scenes):
            path, row = self.where[scene]
            by_file.setdefault(path, []).append((place, row))
        for path, requested in by_file.items():
            out[[place for place, _ in requested]] = _opened(path, lambda file, rows: [
                file[QUANTITIES[name].dataset][row] for row in rows], [row for _, row in requested])
        return out


def read_fields(folder: Path | str) -> FieldsOnDisk:
    """The stored fields of a data set; of its files only the scene numbers are read until a field is asked for.

    InputFileError where the set has none, or the file of a part is missing, cut, or not of its scenes.
    """
    folder = Path(folder)
    manifest = parquet.read_manifest(folder)
    if not (raw := manifest["design"].get(TABLE)):
        raise InputFileError(folder, f"its design has no [{TABLE}], so none are stored. Add it to the design and sweep "
                                     "into another folder.")
    if "clean" in manifest:
        raise InputFileError(folder, "its rows are measured; the fields stand in the clean set that they were made "
                                     f"from, {manifest['clean']['folder']}.")
    stored = gridded.fields_from({key: value for key, value in raw.items() if value is not None})
    body = scene_from({"body": manifest["design"]["tables"].get("body", {})}).body
    where: dict[int, tuple[Path, int]] = {}
    for part in parquet.parts(folder):
        path = part.with_suffix(SUFFIX)
        scenes = parquet.read_part(part, ["scene"], manifest)["scene"].tolist()
        # a sweep that was stopped between both files leaves more scenes in the first
        if scenes != _opened(path, lambda file, count: file["scene"][:count].tolist(), len(scenes)):
            raise _damaged(path, "it is not of the scenes of its part")
        where |= {scene: (path, row) for row, scene in enumerate(scenes)}
    return FieldsOnDisk(folder, stored, coordinates(stored, body), inside(stored, body), where)


def _opened(path: Path, read: Callable[[Any, Any], Any], what: Any) -> Any:
    def found() -> Any:
        with _file(path, "r") as file:
            return read(file, what)

    return _checked(path, found)


def _checked(path: Path, read: Callable[[], Any]) -> Any:
    if not path.is_file():
        raise _damaged(path, "it is missing")
    try:
        return read()
    except (OSError, KeyError, ValueError, IndexError) as error:
        raise _damaged(path, f"it is cut or no file of fields ({error})") from None


def _damaged(path: Path, problem: str) -> InputFileError:
    return InputFileError(path, f"{problem}. Remove {path.stem}.parquet next to it and continue the sweep: both are "
                                "made again.")
