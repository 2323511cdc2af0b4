"""From test files to reduced experiments: which protocol each file needs, and the specimen that belongs to it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matcal.errors import TestFileError
from matcal.experiment import Experiment
from matcal.kinds import decide_kind
from matcal.readers.detect import read
from matcal.readers.recording import Recording

# kinds that have a protocol
REDUCED = ("uniaxial", "shear")


def reduce_tests(inputs: Sequence[tuple[str | None, tuple[Path, ...]]],
                 specimen: Path | None = None) -> list[Experiment]:
    """One experiment an input, each input being (kind or None, files); every decision is a sentence in its `decisions`.

    Raises TestFileError for a file that cannot be used and ValueError for an unknown kind.
    """
    return [_reduce(kind, [read(path) for path in paths]) for kind, paths in inputs]


def _reduce(explicit: str | None, recordings: list[Recording]) -> Experiment:
    kind, why = decide_kind(explicit, recordings[0])
    if kind not in REDUCED:
        raise ValueError(f"{recordings[0].label}: reducing {kind} tests is not built yet; built: {', '.join(REDUCED)}.")
    return reduce_plain(kind, recordings[0], (why,))


def reduce_plain(kind: str, recording: Recording, decisions: tuple[str, ...] = ()) -> Experiment:
    """A table of strain (or stretch) and nominal stress as it stands; TestFileError where either is missing."""
    columns = dict(recording.columns)
    decisions += recording.notes
    if "stretch" in columns and "strain" not in columns:
        columns["strain"] = columns["stretch"] - 1
        decisions += (f"column '{recording.names['stretch']}' is the stretch: strain = stretch - 1.",)
    if missing := [q for q in ("strain", "stress") if q not in columns]:
        raise TestFileError(recording.paths[0], f"no {missing[0]} column; found: "
                                                f"{', '.join(recording.names.values())}.", line=recording.first_line)
    return Experiment(kind=kind, strain=columns["strain"], value=columns["stress"],
                      time_s=columns.get("time"), source=tuple(p.name for p in recording.paths), decisions=decisions)
