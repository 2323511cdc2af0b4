"""The report of error against run time, from the tables that the benchmarks wrote."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pandas as pd

from benchmarks.report.catalogue import BENCHES, Bench, Point, by_problem, cheapest, points
from benchmarks.report.precision_figures import diagram, seconds
from benchmarks.report.stored_tables import State, cautions, condition_table, present_code, state
from reports.document import provenance
from reports.document.numerals import counted, number, percent
from reports.document.page import Report, Table
from reports.document.verdict import NOT_USABLE, Verdict, graded

TEMPLATE = Path(__file__).with_suffix(".typ")

Found = dict[Bench, list[Point]]
OWN = "eitsim"  # how the names of our own methods begin
SLOWER = (1.0, 2.0)  # run time over that of the fastest other program that is good, and that is usable


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
        states[bench] = state(stored[bench], bench.file, bench.benchmark)
        plates.append(diagram(bench, found, rows, states[bench]))
    tables = {}
    if drawn:
        tables["conditions"] = condition_table([(b.file, table, states[b]) for b, table in stored.items()])
    errors = {bench: found for bench, found in drawn.items() if bench.is_error}
    if errors:
        tables |= _cheapest(errors)
    else:
        absent["cheapest"] = "Not there: no benchmark with errors was found."
    sources = [provenance.source(results / bench.file) for bench in drawn]
    footer = provenance.footer(sources, "seeds fixed in benchmarks/")
    subtitle = f"{len(drawn)} of {counted(len(benches), 'benchmark')}"
    verdict = [*_verdict(drawn), *present_code("These times, with the code that is here", [*states.values()])]
    return Report(TEMPLATE, "Error against run time", subtitle, footer, (), plates, tables, absent,
                  {"order": [bench.name for bench in benches]}, cautions([*states.values()]), verdict=verdict)


def _verdict(drawn: Mapping[Bench, Sequence[Point]]) -> Iterator[Verdict]:
    """A line for each benchmark that has a use: the errors it reaches at what cost, or how fast it is."""
    if not drawn:
        yield Verdict("Any statement on error or run time", NOT_USABLE, "no benchmark has been run")
    for bench, found in drawn.items():
        if bench.use:
            yield _reached(bench, found) if bench.is_error else _speed(bench, found)


def _reached(bench: Bench, found: Sequence[Point]) -> Verdict:
    """Good where some method solves every problem within the second requested error, usable within the first."""
    problems, (usable, good, *_) = by_problem(found), bench.requested
    costs = [best.cost_s + best.once_s for own in problems.values() if (best := cheapest(own, good)) is not None]
    least = max(min(point.measure for point in own) for own in problems.values())
    why = f"error within {percent(good, 1)} in {len(costs)} of {counted(len(problems), 'problem')}"
    why += f", in {seconds(*costs)} of CPU" if costs else ""
    return Verdict(bench.use, graded(least, (good, usable)), why + ("" if least <= good else
                                                                    f"; {percent(least)} in the worst"))


def _speed(bench: Bench, found: Sequence[Point]) -> Verdict:
    """Good where no other program is faster on the largest system."""
    largest = [point for point in found if point.measure == max(p.measure for p in found)]
    own = min((p.cost_s for p in largest if p.method.startswith(OWN)), default=None)
    others = {p.method: p.cost_s for p in largest if not p.method.startswith(OWN)}
    if own is None or not others:
        return Verdict(bench.use, NOT_USABLE, f"{OWN} and another program were not both measured")
    times = ", ".join(f"{number(cost / own, 2)} times as fast as {name}" for name, cost in others.items())
    return Verdict(bench.use, graded(own / min(others.values()), SLOWER), f"{OWN} is {times}, on the same mesh")


def _cheapest(drawn: Found) -> dict[str, Table]:
    """A table for the benchmarks that are asked for the same errors: one row a problem, one column an error."""
    tables = {}
    for i, errors in enumerate(sorted({bench.requested for bench in drawn})):
        own = {bench: found for bench, found in drawn.items() if bench.requested == errors}
        tables[f"cheapest_{i}" if i else "cheapest"] = _cheapest_of(own, errors)
    return tables


def _cheapest_of(drawn: Found, errors: Sequence[float]) -> Table:
    rows, within = [], 0
    for bench, found in drawn.items():
        for problem, own in by_problem(found).items():
            best = [cheapest(own, error) for error in errors]
            within += best[-1] is not None
            rows.append([f"{bench.title}: {problem}", *(_words(point) for point in best)])
    caption = (f"For a requested error, the cheapest method and setting, and its CPU time; {percent(errors[-1], 1)} is "
               f"reached in {within} of {counted(len(rows), 'problem')}.")
    head = ["problem", *(f"within {percent(error, 1)}" for error in errors)]
    return Table(caption, head, rows, "w" * len(head))


def _words(point: Point | None) -> str:
    if point is None:
        return "none"
    once = f", {seconds(point.once_s)} of it set-up" if point.once_s > 0 else ""
    name = f"{point.method}, {point.setting}" if point.setting else point.method
    return f"{name}: {seconds(point.cost_s + point.once_s)}{once}"
