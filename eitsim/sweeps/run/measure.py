"""A clean data set measured: the same rows with readings as an instrument gives them, part by part, in a new folder."""

import hashlib
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from eitsim.electrics.forward.untouched import TABLES, by_contact, conductance_of, sensor_of
from eitsim.scene.curved.curved_scene import electrode_count
from eitsim.scene.drive import voltage_columns
from eitsim.scene.scene import Scene
from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.dataset.parquet import Dataset
from eitsim.sweeps.design.design import design_from, representative_scene
from eitsim.sweeps.measurement.instrument import Array, Indices, Measured, Measurement, channels_of, measured
from eitsim.sweeps.measurement.instrument_table import TABLE, as_table, measurement_from, read_measurement
from eitsim.sweeps.measurement.noise_summary import Sums, volts
from eitsim.sweeps.run.folder import begun, check_own, sole_writer
from touchcal.cache import key_of
from touchcal.errors import InputFileError
from touchcal.json_file import digest

# Rows whose sheet conductances agree to this, relative, share their derivatives by the contact impedances.
_SHEETS = 0.01


@dataclass(frozen=True)
class _Skin:
    """One sensor, and where its rows' sheet conductances are had from."""

    sensor: Scene
    baseline_V: Array  # (readings,) untouched readings of the first ok row, V
    conductance_S: float  # the sheet conductance that they imply, S


@dataclass(frozen=True)
class Lab:
    """A measurement of one data set: all that is the same for every row."""

    measurement: Measurement
    channels: Indices
    skin: _Skin | None  # what the derivatives by contact impedances are taken on; None where no term asks for it


def measure(clean: Dataset | Path | str, out: Path | str, measurement: Measurement | Path | str | None = None, *,
            progress: Callable[[int], None] | None = None) -> Dataset:
    """Turn clean rows into rows as an instrument gives them: noise, gain, drift, contact impedances, quantisation.

    Parts map one to one; those that stand in the folder are kept. A column `clipped` counts samples at the full scale.

    Parameters
    ----------
    clean
        A data set of clean rows, or its folder.
    out
        Folder of the measured set; an unfinished one is continued.
    measurement
        A `Measurement` (voltages in V), or a file (TOML) with one table [measurement]; by default the design's own.
    progress
        Called with the number of rows done after each part.

    Returns
    -------
    Dataset
        `manifest["measured"]` tells what the measurement means for its rows (`NoiseSummary`).

    Raises
    ------
    InputFileError
        Where `clean` is no data set, damaged or measured already.
    ValueError
        Where the folder lies in it or holds another measurement, that of another set, or one by other code.

    Examples
    --------
    >>> import eitsim
    >>> eitsim.measure("sweep", "sweep")
    Traceback (most recent call last):
    ValueError: sweep is the clean data set itself; give another folder.
    """
    clean, folder = clean.folder if isinstance(clean, Dataset) else Path(clean), Path(out)
    if isinstance(measurement, Path | str):
        measurement = read_measurement(measurement)
    elif measurement is not None:
        measurement = measurement_from(as_table(measurement))
    if folder.resolve() == clean.resolve():
        raise ValueError(f"{folder} is the clean data set itself; give another folder.")
    if clean.resolve() in folder.resolve().parents:
        raise ValueError(f"{folder} lies inside the clean data set {clean}; give a folder next to it.")
    manifest, parts = parquet.read_manifest(clean), parquet.parts(clean)
    check_own(folder)
    lab = lab_of(clean, manifest, measurement)
    for path in parts:
        parquet.read_part(path, of=manifest)  # before anything is written: a part fixed later makes it another set
    folder.mkdir(parents=True, exist_ok=True)
    with sole_writer(folder):
        stated = manifest | {TABLE: as_table(lab.measurement), "measured_by": key_of({}, (__name__,)), "clean": {
            "folder": clean.resolve().name, "sha256": _content(parts)}}
        stated[parquet.IDENTITY] = digest({key: stated[key] for key in ("clean", TABLE, "measured_by")})
        _start_or_continue(folder, stated)
        sums = Sums()
        for path in parts:
            before = parquet.read_part(path)
            after = _part(folder / path.name, before, lab, stated)
            sums.add(lab.measurement, before, after)
            if progress is not None:
                progress(sums.all_rows)
        stated |= {"measured": vars(sums.summary(lab.measurement))}
        parquet.write_manifest(folder, stated)
        if (others := clean / parquet.OTHER_PROFILES).is_dir():  # they teach what is left open of clean signals
            shutil.copytree(others, folder / parquet.OTHER_PROFILES, dirs_exist_ok=True)
    return Dataset(folder, stated)


def lab_of(clean: Path, manifest: Mapping[str, Any], measurement: Measurement | None) -> Lab:
    """The measurement, by default that of the design, made ready for the rows of a clean data set; InputFileError where
    there is none, or the rows are measured already."""
    if "clean" in manifest:
        raise InputFileError(clean, "its rows are measured already. Give the clean set that they were made from.")
    if measurement is None:
        if not (given := manifest["design"].get(TABLE)):
            raise InputFileError(clean, f"its design has no [{TABLE}]. Give one with --model measurement.toml.")
        measurement = measurement_from(given)
    tables = manifest["design"]["tables"]
    try:
        first = representative_scene(
            design_from({"scenes": 1} | {name: tables[name] for name in TABLES if name in tables}))
        skin = None
        if measurement.contact_impedance:
            sensor, baseline = sensor_of(tables), _first_baseline(clean)
            skin = _Skin(sensor, baseline, conductance_of(sensor, baseline))
        return Lab(measurement, channels_of(measurement, first.drive, electrode_count(first)), skin)
    except ValueError as error:
        raise InputFileError(clean, str(error)) from None


def read(lab: Lab, touched_V: Array, signal_V: Array, scenes: Indices) -> Measured:
    """Clean readings and signals (rows, readings), V, of these scene numbers (rows,), as the instrument gives them."""
    slopes = None if lab.skin is None else _slopes(lab.skin, touched_V - signal_V)
    return measured(lab.measurement, touched_V, touched_V - signal_V, scenes, by_contact_V=slopes,
                    channels=lab.channels)


def _first_baseline(clean: Path) -> Array:
    for path in parquet.parts(clean):
        table = parquet.read_part(path)
        touched, signal = volts(table.loc[table["outcome"] == "ok"])
        if len(touched):
            return (touched - signal)[0]
    raise ValueError("none of its rows is ok; there is nothing to measure. Fix the design and sweep again.")


def _content(parts: Sequence[Path]) -> str:
    whole = hashlib.sha256()
    for path in parts:
        whole.update(path.name.encode() + hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()


def _start_or_continue(folder: Path, stated: Mapping[str, Any]) -> None:
    if (old := begun(folder, stated)) is None:
        return
    if "clean" not in old:
        raise ValueError(f"{folder} holds a sweep's own rows. Choose another folder for measured ones.")
    if old["clean"]["sha256"] != stated["clean"]["sha256"]:
        raise ValueError(f"{folder} was measured from other rows ({old['clean']['sha256'][:12]}, here "
                         f"{stated['clean']['sha256'][:12]}); the clean set has grown or is another. Choose another "
                         "folder.")
    if old[TABLE] != stated[TABLE]:
        raise ValueError(f"{folder} was measured with {old[TABLE]}, here {stated[TABLE]}. Choose another folder.")
    if old.get("measured_by") != stated["measured_by"]:
        raise ValueError(f"{folder} was measured by other code or libraries than these, whose rows may differ. Choose "
                         "another folder; measuring takes little.")


def _part(path: Path, clean: pd.DataFrame, lab: Lab, manifest: Mapping[str, Any]) -> pd.DataFrame:
    """The measured table of one part, written where it is missing."""
    if path.exists():
        return parquet.read_part(path, of=manifest)
    ok = (clean["outcome"] == "ok").to_numpy()
    (touched, signal), clipped = volts(clean), np.zeros(len(clean), dtype=np.int64)
    if ok.any() and as_table(replace(lab.measurement, seed=0)):
        found = read(lab, touched[ok], signal[ok], clean["scene"].to_numpy()[ok])
        touched[ok], signal[ok], clipped[ok] = found.touched_V, found.signal_V, found.clipped
    names = [*voltage_columns(touched.shape[1]), *voltage_columns(signal.shape[1], "dv")]
    readings = pd.DataFrame(np.hstack([touched, signal]), columns=names, index=clean.index)
    table = pd.concat([clean.drop(columns=names), readings], axis=1)[list(clean.columns)].assign(clipped=clipped)
    parquet.write_table(path, table, manifest[parquet.IDENTITY])
    return table


def _slopes(skin: _Skin, baseline: Array) -> Array:
    """Derivatives (rows, readings, electrodes), V, by the logarithms of the contact impedances, for the sheet
    conductances that the rows' untouched readings tell, which are nearly reciprocal to them."""
    read = np.isfinite(skin.baseline_V)
    first = skin.baseline_V[read]
    sheets = skin.conductance_S * (first @ first) / (baseline[:, read] @ first)
    return np.stack([_slope(skin.sensor, round(step)) for step in np.log(sheets) / _SHEETS])


@lru_cache(maxsize=256)
def _slope(sensor: Scene, step: int) -> Array:
    return by_contact(sensor.body, sensor.electrodes, sensor.drive, float(np.exp(step * _SHEETS)))
