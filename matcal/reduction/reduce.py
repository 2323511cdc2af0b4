"""From test files to reduced experiments: which protocol each file needs, and the specimen that belongs to it."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from matcal.readers.column_options import Selection, parse_selection, selections_of
from matcal.readers.detect import files_of, read
from matcal.readers.recording import Recording
from matcal.readers.specimens import specimens_of
from matcal.readers.test_inputs import Input, inputs_of
from matcal.reduction.experiment import NO_UNLOADING, Experiment
from matcal.reduction.holds.relaxation_tables import as_held, reduce_relaxation_table
from matcal.reduction.kind_doubts import doubts
from matcal.reduction.load_cycles import BRANCHES
from matcal.reduction.measured_twice import best_measures, is_table, needs_no_size
from matcal.reduction.replicates import with_scatter
from matcal.reduction.size_checks import compliance_doubt
from matcal.reduction.specimen import Block, Strip
from matcal.reduction.specimen_sizes import specimen_of, stated_direction
from matcal.reduction.tables.creep_tables import reduce_creep
from matcal.reduction.tables.cycled_tables import with_path
from matcal.reduction.tables.dynamic_sweeps import reduce_sweeps
from matcal.reduction.tables.reduced_tables import reduce_table
from matcal.reduction.test_kind import decide_kind, standards_of
from touchcal.errors import InputFileError
from touchcal.toml_file import read_toml

_FEWEST = 30  # rows from which on a conductivity test with a clock is a record and not a table
# tests as a user gives them, one or several: what `inputs_of` takes, and experiments
Given = str | Path | Mapping[str, Any] | Experiment


@dataclass(frozen=True)
class Reduced:
    """Tests, reduced."""

    # one a test, in the order given
    experiments: list[Experiment]
    # files that were given
    files: tuple[Path, ...]
    # files that were read next to those given: specimens' sizes and kinds
    also_read: tuple[Path, ...]


def tests_of(given: Given | Sequence[Given]) -> list[Input | Experiment]:
    """The tests that a user gives, one or several; ValueError as that of `inputs_of`."""
    entries = [given] if isinstance(given, str | Path | Mapping | Experiment) else given
    return [test for entry in entries
            for test in ([entry] if isinstance(entry, Experiment) else inputs_of(entry))]


def read_test(test: Given, specimen: Path | str | None = None, *, columns: Sequence[str] = (),
              branch: str = "last") -> Experiment:
    """One test, read and reduced to strain and stress (or conductivity), ready for `matcal.fit`.

    Parameters
    ----------
    test
        A path, "[KIND=]FILE[,FILE]", or a mapping of one kind to files, arrays or a data frame; see `matcal.fit`.
    specimen
        TOML file with the sizes of the specimens.
    columns
        Which columns mean what, as the option `--columns` of the command: "stress=2:kPa,strain=1".
    branch
        Loading of a cyclic test that is used: "last" (preconditioned) or "first".

    Returns
    -------
    Experiment
        With `strain` (compression negative), `value` (Pa or S/m), perhaps `time_s`, and every decision as a sentence
        in `decisions`. `matcal.inspect` says what the file itself holds.

    Raises
    ------
    InputFileError
        For a file that cannot be used.
    ValueError
        For an unknown kind or branch, or several tests.

    Examples
    --------
    >>> import matcal
    >>> shear = matcal.read_test("shear=data_raw/shear.csv")
    >>> shear.kind, shear.strain.size == shear.value.size
    ('shear', True)
    """
    tests = tests_of(test)
    chosen = selections_of(tests, [parse_selection(text) for text in columns])
    experiments = read_and_reduce(tests, specimen, chosen, branch).experiments
    if len(experiments) != 1:
        why = (" in one file, one specimen each. Give each a file of its own" if len(tests) == 1 else
               ". Call it once for each")
        raise ValueError(f"read_test reads one test, got {len(experiments)}{why}.")
    return experiments[0]


def reduce_tests(inputs: Sequence[Input | Experiment], specimen: Path | str | None = None,
                 columns: Sequence[Mapping[Path, Selection]] = (), branch: str = "last") -> list[Experiment]:
    """The experiments of `read_and_reduce`."""
    return read_and_reduce(inputs, specimen, columns, branch).experiments


def read_and_reduce(inputs: Sequence[Input | Experiment], specimen: Path | str | None = None,
                    columns: Sequence[Mapping[Path, Selection]] = (), branch: str = "last") -> Reduced:
    """One experiment an input, each input being (kind or None, files or recordings), or an experiment, which is passed
    on; every decision is a sentence in its `decisions`.

    The files of one input are one test: one file, the frame's and the potentiostat's of a conductivity test, or the
    parts of a split export (these may also be inputs of their own: they are read once for each kind). `columns` says
    of each input which columns mean what (`matcal.readers.column_options.selections_of`), `branch` which loading of a
    cyclic test is used, one of `branches.BRANCHES`. Raises InputFileError for a file that cannot be used and ValueError
    for a kind or branch that is unknown.
    """
    if branch not in BRANCHES:
        raise ValueError(f"branch '{branch}' is unknown; known: {', '.join(BRANCHES)}.")
    sizes = None if specimen is None else Path(specimen)
    out: list[Experiment] = []
    given: list[Path] = []
    also_read: list[Path] = []
    seen: set[tuple[str, tuple[Path, ...]]] = set()
    contents: dict[tuple[str, ...], tuple[Recording, Experiment, Mapping[Path, Selection]]] = {}
    for test, chosen in zip(inputs, columns or [{}] * len(inputs), strict=True):
        if isinstance(test, Experiment):
            out.append(test)
            given += test.files
            continue
        kind, sources = test
        recordings = _recordings(sources, chosen)
        own = [file for path in sources if isinstance(path, Path) for file in files_of(path)]
        given += own
        key = tuple(path.resolve() for recording in recordings for path in recording.paths if own)
        part = decide_kind(kind, recordings)[0], key
        if len(key) > len(sources) and part in seen:
            continue
        seen.add(part)
        specimens = [[one] for one in specimens_of(recordings[0])] if len(recordings) == 1 else [recordings]
        reduced = [_reduce(kind, specimen, sizes, branch) for specimen in specimens]
        if own:
            content = tuple(hashlib.sha256(path.read_bytes()).hexdigest() for path in key)
            _refuse_twice(contents.get(content), recordings[0], reduced[0][0], chosen)
            contents.setdefault(content, (recordings[0], reduced[0][0], chosen))
        more = [*_sidecars(recordings), *(file for _, used in reduced for file in used)]
        made_up = {} if not any(recording.synthetic for recording in recordings) else {"synthetic": 1.0}
        layout = ", ".join(dict.fromkeys(recording.vendor for recording in recordings)) if own else ""
        files = tuple(dict.fromkeys([*own, *more]))
        out += [replace(experiment, files=files, layout=layout, standards=standards_of(recordings),
                        facts={**experiment.facts, **made_up},
                        cautions=(*(said for one in specimen for said in one.cautions), *experiment.cautions))
                for specimen, (experiment, _) in zip(specimens, reduced, strict=True)]
        also_read += more
    return Reduced(with_scatter(out), tuple(dict.fromkeys(given)), tuple(dict.fromkeys(also_read)))


def _refuse_twice(before: tuple[Recording, Experiment, Mapping[Path, Selection]] | None, recording: Recording,
                  experiment: Experiment, chosen: Mapping[Path, Selection]) -> None:
    """ValueError where the bytes, the kind and the columns of a test are those of one before: it is one specimen."""
    if before is None or before[1].kind != experiment.kind or [*before[2].values()] != [*chosen.values()]:
        return
    names = recording.label if before[0].label == recording.label else f"{before[0].label} and {recording.label}"
    raise ValueError(f"{names}: the same contents are given twice as {experiment.kind} test; one specimen would count "
                     "as two. Give it once.")


def _sidecars(recordings: Sequence[Recording]) -> list[Path]:
    """TOML files of the recordings' names that say their kind."""
    toml = [recording.paths[0].with_suffix(".toml") for recording in recordings]
    return [path for path in toml if path.exists() and "kind" in read_toml(path)]


def _recordings(sources: Sequence[Path | Recording], chosen: Mapping[Path, Selection]) -> list[Recording]:
    """The recordings of one test, a split export counted once."""
    out: list[Recording] = []
    for path in sources:
        if isinstance(path, Recording):
            out.append(path)
        elif not any(Path(path).resolve() == part.resolve() for recording in out for part in recording.paths):
            out.append(read(path, chosen.get(path)))
    return out


def _reduce(explicit: str | None, recordings: list[Recording], specimen: Path | None,
            branch: str) -> tuple[Experiment, tuple[Path, ...]]:
    first = recordings[0]
    kind, why = decide_kind(explicit, recordings)
    if len(recordings) > (2 if kind == "conductivity" else 1):
        raise ValueError(f"{', '.join(r.label for r in recordings)}: these are {len(recordings)} recordings, but a "
                         f"{kind} test takes {'two' if kind == 'conductivity' else 'one'}. Give each "
                         "replicate as a test of its own.")
    doubted = doubts(kind, first)
    made, files = _of_kind(kind, recordings, why, specimen, branch)
    if made.path is not None and not made.path.unloads:
        made, files = _of_kind(kind, recordings, why, specimen, "first")
        said = f"{first.label} has no unloading: it is fitted as one loading, and the softening is that of other tests."
        made = replace(made, facts={**made.facts, NO_UNLOADING: 1.0}, cautions=(*made.cautions, said))
    return replace(made, cautions=(*doubted, *made.cautions)), files


def _of_kind(kind: str, recordings: list[Recording], why: str, specimen: Path | None,
             branch: str) -> tuple[Experiment, tuple[Path, ...]]:
    first = recordings[0]
    if kind == "conductivity":
        return _conductivity(recordings, why, specimen)
    if kind in ("dma", "creep"):
        return _said(reduce_sweeps(first) if kind == "dma" else reduce_creep(first), why), ()
    direction = stated_direction(kind, first, specimen)
    if kind == "relaxation" and (held := as_held(first)) is not None:
        return _said(reduce_relaxation_table(held), why), ()
    if is_table(first):
        cycled = branch == "all" and kind in ("uniaxial", "biaxial", "planar", "shear")
        unused = () if specimen is None else (
            f"{first.label} holds strain and its value already: no size of {specimen.name} was needed.",)
        made = (reduce_relaxation_table(first, direction) if kind == "relaxation" else
                reduce_table(kind, first, direction, cycled=cycled))
        made = with_path(made) if cycled else made
        return _said(made, why, *unused), ()
    sizes, where, files = specimen_of(kind, first, specimen, needed=not needs_no_size(first))
    assert not isinstance(sizes, Strip)
    try:
        used = best_measures(first, sizes or Block(0.0, 0.0, direction=direction))
        made = _by_protocol(kind, used.recording, used.block, branch)
    except InputFileError:
        raise
    except ValueError as error:
        raise _unreduced(first, kind, error) from error
    known = {} if sizes is None else {"specimen_area_mm2": 1e6 * sizes.area_m2,
                                      "specimen_length_mm": 1e3 * sizes.length_m}
    return _said(replace(made, facts={**known, **made.facts}, cautions=(
        *where[1:], *used.cautions, *compliance_doubt(used.recording, used.block), *made.cautions)), why, *where[:1],
                 *used.decisions), files


def _conductivity(recordings: list[Recording], why: str, specimen: Path | None) -> tuple[Experiment, tuple[Path, ...]]:
    from matcal.reduction.electric.hysteresis import with_hysteresis
    from matcal.reduction.electric.strip_conductivity import reduce_rows, reduce_stretch

    first = recordings[0]
    if len(recordings) == 1 and "conductivity" in first.columns and {"strain", "stretch"} & set(first.columns):
        made = reduce_table("conductivity", first, stated_direction("conductivity", first, specimen))
        return _said(with_hysteresis(made), why), ()
    sizes, where, files = specimen_of("conductivity", first, specimen)
    assert isinstance(sizes, Strip)
    try:
        rows = len(recordings) == 1 and ("time" not in first.columns or first.rows < _FEWEST)
        made = reduce_rows(first, sizes) if rows else reduce_stretch(recordings, sizes)
    except InputFileError:
        raise
    except ValueError as error:
        raise _unreduced(first, "conductivity", error) from error
    facts = {"specimen_area_mm2": 1e6 * sizes.ring_area_m2, "specimen_length_mm": 1e3 * sizes.length_m, **made.facts}
    return _said(with_hysteresis(replace(made, facts=facts)), why, *where), files


def _unreduced(recording: Recording, kind: str, error: ValueError) -> InputFileError:
    return InputFileError(recording.paths[0], f"it cannot be reduced as {kind}: {str(error).rstrip('.')}.")


def _by_protocol(kind: str, recording: Recording, block: Block, branch: str) -> Experiment:
    if kind == "relaxation":
        from matcal.reduction.holds.stress_relaxation import reduce_relaxation

        return reduce_relaxation(recording, block)
    from matcal.reduction.quasistatic import reduce_quasistatic

    return reduce_quasistatic(kind, recording, block, branch)


def _said(experiment: Experiment, *sentences: str) -> Experiment:
    return replace(experiment, decisions=(*sentences, *experiment.decisions))
