"""The report of stiff and extreme cases, from stored tables: what holds, holds with a caution, or is lost."""

from collections.abc import Callable
from pathlib import Path

from benchmarks.report import stability_laws, stability_numerics, stability_readings, stability_scenes
from benchmarks.report.stability_verdict import verdict
from benchmarks.report.stored_tables import Rows, cautions, condition_table, frame, present_code, read_rows, state
from reports.document import provenance
from reports.document.numerals import counted
from reports.document.page import Report, ReportFigure, Table
from reports.document.verdict import NOT_USABLE, Verdict
from touchcal.errors import InputFileError

TEMPLATE = Path(__file__).with_suffix(".typ")

# stem of a stored table -> benchmark that writes it
WRITERS = {"stable_ranges": "stable_ranges", "stable_functions": "stable_ranges", "stiff": "stiff",
           "random_scenes": "random_scenes", "relaxation_stiff": "relaxation_stiff",
           "electrics_stiff": "electrics_stiff", "surrogate_noise": "surrogate_noise"}
_PLATES: dict[str, Callable[[Rows, str], ReportFigure]] = {
    "stable_ranges": stability_laws.ranges, "stable_functions": stability_laws.functions,
    "random_scenes": stability_scenes.scenes, "relaxation_stiff": stability_numerics.relaxation,
    "electrics_stiff": stability_numerics.electrics}
_TABLES: dict[str, tuple[str, Callable[[Rows], Table | None]]] = {
    "random_scenes": ("lost_scenes", stability_scenes.lost_table),
    "electrics_stiff": ("skins", stability_numerics.others), "stiff": ("cases", stability_numerics.cases)}
# what a stored table is shown as where it is there
_SHOWN = {"stable_ranges": "laws", "stable_functions": "functions", "random_scenes": "scenes", "stiff": "cases",
          "relaxation_stiff": "relaxation", "electrics_stiff": "electrics", "surrogate_noise": "readings"}


def report(results: Path) -> Report:
    """Everything that the template `stability.typ` shows; InputFileError where a table lacks a column."""
    stored = {stem: read_rows(results / f"{stem}.csv") for stem in WRITERS if (results / f"{stem}.csv").is_file()}
    absent = {_SHOWN[stem]: f"Not there: {stem}.csv. Run benchmarks/{writer}.py, which writes it."
              for stem, writer in WRITERS.items() if stem not in stored}
    read = [(f"{stem}.csv", table := frame(rows), state(table, f"{stem}.csv", WRITERS[stem]))
            for stem, rows in stored.items()]
    plates, tables = [], dict[str, Table]()
    for stem, rows in stored.items():
        try:
            plates += _plates(stem, rows)
            name, make = _TABLES.get(stem, ("", lambda _: None))
            if (table := make(rows)) is not None:
                tables[name] = table
        except KeyError as missing:
            raise InputFileError(results / f"{stem}.csv", f"column {missing} is not there; run benchmarks/"
                                 f"{WRITERS[stem]}.py again.") from None
    if stored:
        tables["conditions"] = condition_table(read)
    sources = [provenance.source(results / f"{stem}.csv") for stem in stored]
    states = [of_table for *_, of_table in read]
    lines = [*verdict(stored), *present_code("These maps, with the code that is here", states)]
    return Report(TEMPLATE, "Stiff and extreme cases", f"{len(stored)} of {counted(len(WRITERS), 'stored table')}",
                  provenance.footer(sources, "seeds fixed in benchmarks/"), (), plates, tables, absent,
                  cautions=cautions(states), verdict=lines or [
                      Verdict("Any statement on extreme cases", NOT_USABLE, "no benchmark has been run")])


def _plates(stem: str, rows: Rows) -> list[ReportFigure]:
    if stem == "surrogate_noise":
        return stability_readings.readings(rows, stem)
    return [_PLATES[stem](rows, stem)] if stem in _PLATES else []
