"""A sensor as a file describes it: body, skin, electrodes and drive of a scene, and what kind of readings it gives.

    [body]
    radius_mm = 45
    [electrodes]
    count = 16
    [drive]
    pairs = "pairs.csv"      # source, sink, plus, minus of each reading; or pattern, or currents with measurements
    [readings]
    kind = "magnitude"
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.scene.calibrated_electrodes import read_fitted
from eitsim.scene.drive import Drive, Protocol, protocol
from eitsim.scene.drive_pairs import PAIRS
from eitsim.scene.drive_pairs import drive_of_pairs as drive_of_pairs
from eitsim.scene.drive_pairs import read_pairs as read_pairs
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Scene, Skin, read_scene, scene_from
from eitsim.scene.scene_files import with_files
from eitsim.sensors.recording import check_kind
from touchcal.document import check_keys
from touchcal.errors import InputFileError
from touchcal.toml_file import read_toml
from touchcal.whole_file import written

TABLES = ("body", "skin", "electrodes", "drive", "readings")


@dataclass(frozen=True)
class Sensor:
    """A sensor as it is built, before any calibration."""

    body: Body
    skin: Skin
    electrodes: Electrodes
    drive: Drive
    kind: str = "voltage"  # what its readings are, one of eitsim.sensors.recording.KINDS

    @property
    def protocol(self) -> Protocol:
        """Its drive as matrices; frames are their readings, pattern by pattern."""
        return protocol(self.drive, self.electrodes.count)

    @property
    def scene(self) -> Scene:
        """The scene of its untouched body, everything else by default."""
        return Scene(self.body, skin=self.skin, electrodes=self.electrodes, drive=self.drive)


def read_sensor(path: Path | str) -> Sensor:
    """Read a sensor file (TOML), or the sensor that a calibration (JSON) was made of, as its file described it;
    InputFileError names the file, and the key or line, of what it may not hold.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import eitsim
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "sensor.toml"
    ...     _ = path.write_text('[electrodes]\\ncount = 8\\n[readings]\\nkind = "magnitude"')
    ...     sensor = eitsim.read_sensor(path)
    >>> sensor.electrodes.count, sensor.kind
    (8, 'magnitude')
    """
    path = Path(path)
    raw = read_fitted(path)["sensor"] if path.suffix == ".json" else read_toml(path)
    try:
        return sensor_from(raw, path.parent)
    except InputFileError:
        raise
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def scene_of_frames(path: Path | str) -> tuple[Scene, str]:
    """The scene whose body, electrodes and drive made frames, and the kind of their readings, one of KINDS: a scene
    file, or the untouched scene of a sensor file; InputFileError as of these."""
    path = Path(path)
    raw = read_toml(path)
    drive = raw.get("drive")
    if "readings" not in raw and not (isinstance(drive, Mapping) and "pairs" in drive):
        return read_scene(path), Sensor.kind
    sensor = read_sensor(path)
    return sensor.scene, sensor.kind


def sensor_from(raw: Mapping[str, Any], folder: Path) -> Sensor:
    """A checked sensor from the tables of a sensor file, whose CSV files are named relative to `folder`; ValueError
    names the key."""
    check_keys(raw, TABLES)
    readings = raw.get("readings", {})
    check_keys(readings, ("kind",), "readings")
    kind = readings.get("kind", Sensor.kind)
    check_kind(kind, "kind in [readings]")
    tables = {name: table for name, table in raw.items() if name != "readings"}
    tables = with_files(tables, folder)
    if "channels" in tables:
        raise ValueError("calibrated in [electrodes] serves scenes and designs; a sensor file describes the sensor as "
                         "it is built. Leave it out.")
    scene = scene_from(tables)
    return Sensor(scene.body, scene.skin, scene.electrodes, scene.drive, kind)


def pairs_of(sensor: Sensor) -> NDArray[np.intp]:
    """(readings, 4) source, sink, plus and minus of each reading, electrodes from 0; ValueError where a pattern is no
    current from one electrode to another, or a reading no difference of two voltages."""
    asked, count = sensor.protocol, sensor.electrodes.count
    currents = asked.currents_A / np.abs(asked.currents_A).max(axis=1, keepdims=True)
    source, sink = _ends(currents, "pattern")
    plus, minus = _ends(asked.weights.reshape(-1, count), "reading")
    each = asked.shape[1]
    return np.stack([np.repeat(source, each), np.repeat(sink, each), plus, minus], axis=1)


def write_pairs(pairs: NDArray[np.intp], path: Path | str) -> None:
    """Write (readings, 4) electrodes from 0 as a CSV that pairs in [drive] names."""
    with written(Path(path)) as file:
        file.write("\n".join([",".join(PAIRS), *(",".join(map(str, one)) for one in pairs.tolist()), ""]).encode())


def _ends(rows: NDArray[np.float64], what: str) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Electrodes of the 1 and of the -1 in each row."""
    first, last = rows.argmax(axis=1), rows.argmin(axis=1)
    unit = np.eye(rows.shape[1])
    odd = np.flatnonzero(np.abs(rows - unit[first] + unit[last]).max(axis=1) > 1e-9)
    if odd.size:
        raise ValueError(f"{what} {odd[0]} in [drive] is not 1 at one electrode and -1 at another, and readings are "
                         "compared by such pairs alone. Describe the drive with pairs.")
    return first, last
