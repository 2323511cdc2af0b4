"""Tables that are reduced already: strain with nominal stress, or strain with conductivity."""

from __future__ import annotations

import re

import numpy as np

from matcal.errors import TestFileError
from matcal.experiment import Experiment
from matcal.readers.recording import Recording


def reduce_table(kind: str, recording: Recording) -> Experiment:
    """The table as it stands, stretch turned into strain; TestFileError where a column is missing or signs disagree."""
    columns, notes = dict(recording.columns), list(recording.notes)
    if "strain" not in columns and "stretch" in columns:
        columns["strain"] = columns["stretch"] - 1
        notes.append(f"Column '{recording.names['stretch']}' is the stretch: strain = stretch - 1.")
    wanted = ("strain", "conductivity") if kind == "conductivity" else ("strain", "stress")
    if kind == "relaxation":
        wanted = (*wanted, "time")
    if missing := [q for q in wanted if q not in columns]:
        raise TestFileError(recording.paths[0], f"a {kind} table needs a {missing[0]} column; found: "
                                                f"{', '.join(recording.names.values())}.", line=recording.first_line)
    strain, value = columns["strain"], columns[wanted[1]]
    if kind == "shear" and recording.names.get("stretch") and "strain" not in recording.columns:
        raise TestFileError(recording.paths[0], "a shear test is given by gamma, not by a stretch. Name the column "
                                                "gamma.", line=recording.first_line)
    if kind in ("uniaxial", "relaxation"):
        strain, value = _compression_negative(recording, strain, value, notes)
    time = columns.get("time")
    deviation = columns.get("deviation") if wanted[1] == "stress" else None
    if deviation is not None and np.any(deviation < 0):
        raise TestFileError(recording.paths[0], f"column '{recording.names['deviation']}' is a standard deviation and "
                                                "falls below 0.", line=recording.first_line)
    return Experiment(kind=kind, strain=strain, value=value, time_s=time, deviation=deviation,
                      lateral=columns.get("lateral") if kind in ("uniaxial", "planar", "biaxial") else None,
                      source=tuple(p.name for p in recording.paths), decisions=tuple(notes))


def _compression_negative(recording: Recording, strain: np.ndarray, stress: np.ndarray,
                          notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Strain and stress with compression negative; a table that calls itself compression may count it positive."""
    if float(strain @ stress) < 0:
        raise TestFileError(recording.paths[0], "strain and stress have opposite signs. Give compression as negative "
                                                "in both columns.", line=recording.first_line)
    named = " ".join([*recording.names.values(), recording.paths[0].stem]).lower()
    if re.search(r"compress", named) and np.all(strain >= 0):
        notes.append("Compression by its name and counted positive: both signs turned.")
        return -strain, -stress
    return strain, stress
