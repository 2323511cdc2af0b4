"""Signals of a data set's rows, read part by part so that no more than one part is held at a time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from eitsim.sweeps.dataset import parquet
from reports.touch.reading_figures import Array
from touchcal.errors import InputFileError


def rms_of(folder: Path, scenes: NDArray[np.int64]) -> Array:
    """(scenes,) RMS of the signals dV of these scenes, V, over the readings that each has. InputFileError where one has
    no columns of signals."""
    found = [pd.Series(np.sqrt(np.nanmean(table.to_numpy(dtype=float)**2, axis=1)), table.index)
             for table in _parts_of(folder, scenes)]
    return pd.concat(found).loc[scenes].to_numpy(dtype=float)


def _parts_of(folder: Path, scenes: NDArray[np.int64]) -> Iterator[pd.DataFrame]:
    """Signals of these scenes, V, by scene and part by part."""
    for path in parquet.parts(folder):
        asked = np.isin(parquet.read_part(path, ["scene"])["scene"].to_numpy(), scenes)
        if not asked.any():
            continue
        columns = sorted(name for name in parquet.columns_of(path) if name.startswith("dv_"))
        if not columns:
            raise InputFileError(
                folder, "the data set has scenes that ended ok but no columns dv_000 ...; sweep again."
            )
        yield parquet.read_part(path, ["scene", *columns]).loc[asked].set_index("scene")
