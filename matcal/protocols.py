"""From test files to reduced experiments: which protocol each file needs, and the specimen that belongs to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from matcal.errors import TestFileError
from matcal.experiment import Experiment
from matcal.kinds import decide_kind
from matcal.readers.detect import read
from matcal.readers.recording import Recording
from matcal.readers.selection import Selection
from matcal.specimen import Block, Strip, read_specimen
from matcal.tables import reduce_table

# kinds that have a protocol
REDUCED = ("uniaxial", "shear", "relaxation", "conductivity")


def reduce_tests(inputs: Sequence[tuple[str | None, tuple[Path, ...]]],
                 specimen: Path | None = None,
                 columns: Sequence[Mapping[Path, Selection]] = ()) -> list[Experiment]:
    """One experiment an input, each input being (kind or None, files); every decision is a sentence in its `decisions`.

    The files of one input are one test: one file, the frame's and the potentiostat's of a conductivity test, or the
    parts of a split export (these may also be inputs of their own: they are read once). `columns` says of each
    input which columns mean what (`matcal.readers.selection.selections_of`). Raises TestFileError for a file that
    cannot be used and ValueError for a kind that is unknown or has no protocol.
    """
    out: list[Experiment] = []
    seen: set[tuple[Path, ...]] = set()
    for (kind, paths), chosen in zip(inputs, columns or [{}] * len(inputs), strict=True):
        recordings = _recordings(paths, chosen)
        key = tuple(path.resolve() for recording in recordings for path in recording.paths)
        if len(key) > len(paths) and key in seen:
            continue
        seen.add(key)
        out.append(_reduce(kind, recordings, specimen))
    return out


def _recordings(paths: tuple[Path, ...], chosen: Mapping[Path, Selection]) -> list[Recording]:
    """The recordings of one test, a split export counted once."""
    out: list[Recording] = []
    for path in paths:
        if not any(Path(path).resolve() == part.resolve() for recording in out for part in recording.paths):
            out.append(read(path, chosen.get(path)))
    return out


def _reduce(explicit: str | None, recordings: list[Recording], specimen: Path | None) -> Experiment:
    first = recordings[0]
    kind, why = decide_kind(explicit, recordings)
    if kind not in REDUCED:
        raise ValueError(f"{first.label}: reducing {kind} tests is not built yet; built: {', '.join(REDUCED)}.")
    if len(recordings) > (2 if kind == "conductivity" else 1):
        raise ValueError(f"{', '.join(r.label for r in recordings)}: these are {len(recordings)} recordings, but a "
                         f"{kind} test takes {'two' if kind == 'conductivity' else 'one'}. Give replicates apart.")
    if len(recordings) == 1 and _is_reduced(first):
        return _said(reduce_table(kind, first), why)
    sizes, where = _specimen_of(kind, first, specimen)
    try:
        return _said(_by_protocol(kind, recordings, sizes), why, where)
    except TestFileError:
        raise
    except ValueError as error:
        raise TestFileError(first.paths[0], f"it cannot be reduced as {kind}: {str(error).rstrip('.')}.") from error


def _is_reduced(recording: Recording) -> bool:
    return not {"displacement", "current"} & set(recording.columns)


def _by_protocol(kind: str, recordings: list[Recording], sizes: Block | Strip) -> Experiment:
    if isinstance(sizes, Strip):
        from matcal.stretching import reduce_stretch

        return reduce_stretch(recordings, sizes)
    if kind == "relaxation":
        from matcal.relaxing import reduce_relaxation

        return reduce_relaxation(recordings[0], sizes)
    from matcal.quasistatic import reduce_quasistatic

    return reduce_quasistatic(kind, recordings[0], sizes)


def _specimen_of(kind: str, recording: Recording, specimen: Path | None) -> tuple[Block | Strip, str]:
    """Sizes for `kind` from `specimen`, else a TOML of the file's name, else specimen.toml beside it; and which."""
    path = recording.paths[0]
    candidates = [specimen] if specimen else [path.with_suffix(".toml"), path.parent / "specimen.toml"]
    for candidate in candidates:
        if candidate == specimen or candidate.exists():
            sizes = read_specimen(candidate)
            if kind in sizes:
                return sizes[kind], f"Specimen from [{kind}] of {candidate.name}."
    looked = " or ".join(str(candidate) for candidate in candidates)
    raise TestFileError(path, f"displacement and force need the specimen's size: no table [{kind}] in {looked}. "
                              "Give --specimen specimen.toml.")


def _said(experiment: Experiment, *sentences: str) -> Experiment:
    return replace(experiment, decisions=(*sentences, *experiment.decisions))
