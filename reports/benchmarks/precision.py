"""The report of error against run time, from the tables that the benchmarks wrote."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from reports.benchmarks import staleness
from reports.benchmarks.catalogue import BENCHES, Bench, Point, by_problem, cheapest, points
from reports.benchmarks.precision_figures import diagram, finding, seconds
from reports.benchmarks.staleness import State
from reports.benchmarks.stored_tables import condition_table
from reports.document import provenance
from reports.document.numerals import counted, percent
from reports.document.page import Report, Table

Found = dict[Bench, list[Point]]


def report(results: Path, benches: Sequence[Bench] = BENCHES) -> Report:
    """Everything that the template `precision.typ` shows; InputFileError where a table lacks a column."""
    drawn: Found = {}
    plates, absent = [], {}
    stored: dict[Bench, pd.DataFrame] = {}
    states: dict[Bench, State] = {}
    for bench in benches:
        if not (results / bench.file).is_file():
            absent[bench.name] = f"Not there: {bench.file}. Run benchmarks/{bench.benchmark}.py, which writes it."
            continue
        found, rows = points(bench, results)
        if not found:
            absent[bench.name] = f"Not drawn: no row of {bench.file} ({counted(rows, 'row')}) holds a number."
            continue
        drawn[bench] = found
        stored[bench] = pd.read_csv(results / bench.file, dtype=str)
        states[bench] = staleness.state(stored[bench], bench.file, bench.benchmark)
        plates.append(diagram(bench, found, rows, states[bench]))
    tables = {}
    if drawn:
        read = [(bench.file, table, states[bench]) for bench, table in stored.items()]
        tables["conditions"] = condition_table(read)
    errors = {bench: found for bench, found in drawn.items() if bench.is_error}
    if errors:
        tables |= _cheapest(errors)
    else:
        absent["cheapest"] = "Not there: no benchmark with errors was found."
    sources = [provenance.source(results / bench.file) for bench in drawn]
    footer = provenance.footer(sources, "seeds fixed in benchmarks/")
    subtitle = f"{len(drawn)} of {counted(len(benches), 'benchmark')}"
    return Report("precision", "Error against run time", subtitle, footer, _findings(drawn), plates, tables,
                  absent, {"order": [bench.name for bench in benches]}, staleness.cautions([*states.values()]))


def _findings(drawn: Found) -> list[str]:
    if not drawn:
        return ["No benchmark has been run."]
    return [finding(bench, found) for bench, found in drawn.items()]


def _cheapest(drawn: Found) -> dict[str, Table]:
    """One table for the benchmarks that are asked for the same errors: one row a problem, one column a wanted error."""
    asked = dict.fromkeys(bench.wanted for bench in drawn)
    return {f"cheapest_{i}" if i else "cheapest": _cheapest_of({b: p for b, p in drawn.items() if b.wanted == wanted},
                                                              wanted)
            for i, wanted in enumerate(sorted(asked))}


def _cheapest_of(drawn: Found, wanted: Sequence[float]) -> Table:
    rows, within = [], 0
    for bench, found in drawn.items():
        for problem, own in by_problem(found).items():
            best = [cheapest(own, error) for error in wanted]
            within += best[-1] is not None
            rows.append([f"{bench.title}: {problem}", *(_words(point) for point in best)])
    caption = (f"For a wanted error, the cheapest method and setting, and its CPU time; {percent(wanted[-1], 1)} is "
               f"reached in {within} of {counted(len(rows), 'problem')}.")
    head = ["problem", *(f"within {percent(error, 1)}" for error in wanted)]
    return Table(caption, head, rows, "w" * len(head))


def _words(point: Point | None) -> str:
    if point is None:
        return "none"
    once = f", {seconds(point.once_s)} of it once" if point.once_s > 0 else ""
    name = f"{point.method}, {point.setting}" if point.setting else point.method
    return f"{name}: {seconds(point.cost_s + point.once_s)}{once}"
