"""The report of error against run time, from the tables that the benchmarks wrote."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reports import provenance
from reports.benches import BENCHES, Bench, Point, by_problem, cheapest, conditions, points
from reports.numerals import counted, percent
from reports.page import Report, Table, write_pdf
from reports.precision_plates import diagram, finding, seconds
from reports.style import house

WANTED = (1e-2, 1e-3, 1e-4)
Found = dict[Bench, list[Point]]


def write(results: Path, out: Path, benches: Sequence[Bench] = BENCHES) -> None:
    """Write the PDF of the benchmarks' tables in a folder, `out`; what is not there is said on the page.

    ValueError where a folder is missing; TestFileError where a table lacks a column.
    """
    if not results.is_dir():
        raise ValueError(f"{results}: no such folder of results. Run `make bench`, or name the folder with --results.")
    with house():
        write_pdf(report(results, benches), out)


def report(results: Path, benches: Sequence[Bench] = BENCHES) -> Report:
    """Everything that the template `precision.typ` shows; TestFileError where a table lacks a column."""
    drawn: Found = {}
    plates, absent = [], {}
    for bench in benches:
        if not (results / bench.file).is_file():
            absent[bench.name] = f"Not there: {bench.file}. Run benchmarks/{Path(bench.file).stem}.py, which writes it."
            continue
        found, rows = points(bench, results)
        if not found:
            absent[bench.name] = f"Not drawn: no row of {bench.file} ({counted(rows, 'row')}) holds a number."
            continue
        drawn[bench] = found
        plates.append(diagram(bench, found, rows))
    tables = {"conditions": _conditions(list(drawn), results)} if drawn else {}
    errors = {bench: found for bench, found in drawn.items() if bench.is_error}
    if errors:
        tables["cheapest"] = _cheapest(errors)
    else:
        absent["cheapest"] = "Not there: no benchmark with errors was found."
    sources = [provenance.source(results / bench.file) for bench in drawn]
    footer = provenance.footer(sources, "seeds fixed in benchmarks/")
    subtitle = f"{len(drawn)} of {counted(len(benches), 'benchmark')}"
    return Report("precision", "Error against run time", subtitle, footer, _findings(drawn), plates, tables,
                  absent, {"order": [bench.name for bench in benches]})


def _findings(drawn: Found) -> list[str]:
    if not drawn:
        return ["No benchmark has been run."]
    return [finding(bench, found) for bench, found in drawn.items()]


def _cheapest(drawn: Found) -> Table:
    """One row a problem, one column a wanted error."""
    rows, within = [], 0
    for bench, found in drawn.items():
        for problem, own in by_problem(found).items():
            best = [cheapest(own, wanted) for wanted in WANTED]
            within += best[-1] is not None
            rows.append([f"{bench.title}: {problem}", *(_words(point) for point in best)])
    caption = (f"For a wanted error, the cheapest method and setting, and its CPU time; {within} of "
               f"{counted(len(rows), 'problem')} are solved to {percent(WANTED[-1], 1)}.")
    return Table(caption, ["problem", *(f"within {percent(wanted, 1)}" for wanted in WANTED)], rows, "wwww")


def _words(point: Point | None) -> str:
    if point is None:
        return "none"
    once = f", {seconds(point.once_s)} of it once" if point.once_s > 0 else ""
    return f"{point.method}, {point.setting}: {seconds(point.cost_s + point.once_s)}{once}"


def _conditions(benches: Sequence[Bench], results: Path) -> Table:
    rows = [[bench.file, *conditions(bench, results)] for bench in benches]
    told = sum(row[-1] != "not recorded" for row in rows)
    return Table(f"Under what conditions they ran: {told} of {counted(len(rows), 'file')} tell it.",
                 ["file", "machine", "threads", "versions", "date"], rows, "lllwl")
