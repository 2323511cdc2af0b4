"""Creep: a load that is held while the strain grows ever more slowly, which no fit here takes."""

import numpy as np

from matcal.readers.recording import Recording
from touchcal.errors import InputFileError

_FEWEST = 8  # rows that show a creep
_HELD, _GROWN, _SLOWING = 0.05, 0.02, 1.5  # spread of a held load, growth of a strain, share of it in the first half


def refuse_creep(kind: str, recording: Recording) -> None:
    """InputFileError where the stress (or force) is held in time and the strain (or displacement) grows, less in the
    second half of the time than in the first."""
    load = next((recording.columns[q] for q in ("stress", "force") if q in recording.columns), None)
    strain = next((recording.columns[q] for q in ("strain", "stretch", "displacement") if q in recording.columns), None)
    time = recording.columns.get("time")
    if kind in ("conductivity", "volumetric") or load is None or strain is None or time is None \
            or recording.rows < _FEWEST or not np.all(np.diff(time) >= 0) or time[-1] <= time[0]:
        return
    low, middle, high = np.quantile(load, (0.05, 0.5, 0.95))
    half = float(np.interp(0.5 * (time[0] + time[-1]), time, strain))
    early, late = half - strain[0], strain[-1] - half
    if high - low <= _HELD * abs(middle) and early * late >= 0 and abs(early + late) > _GROWN * np.max(np.abs(strain)) \
            and abs(early) > _SLOWING * abs(late):
        raise InputFileError(recording.paths[0], "a creep test: the load is held and the strain grows. This version "
                                                 "does not fit creep. Give a relaxation test, with the strain held.")
