"""Work-precision diagrams: error, or size, against CPU time, one line a method, one panel a problem."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from benchmarks.report.catalogue import Bench, Point, by_problem, cheapest
from benchmarks.report.stored_tables import CURRENT, State
from reports.document import style
from reports.document.numerals import counted, number, percent, prefixed
from reports.document.page import ReportFigure

ROW_MM, LINE_MM = 42.0, 4.2  # height of a row of panels and of a line of the legend, mm
# letters of the longest method above which the legend of a sheet as wide as the text has two columns, not three
LONG = 30
# problems above which panels stand in three columns, and the span of an axis below which it has plain numbers
FEW, NARROW = 4, 50.0
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "*", "h", "p")


def diagram(bench: Bench, found: Sequence[Point], rows: int, state: State) -> ReportFigure:
    """The plate of a benchmark's points, of so many rows of its file, which stands so to the code."""
    problems, methods = by_problem(found), list(dict.fromkeys(p.method for p in found))
    columns = min(2 if len(problems) <= FEW else 3, len(problems))
    down, width = math.ceil(len(problems) / columns), style.TEXT_WIDTH_MM if columns > 1 else style.HALF_WIDTH_MM
    across = 1 if columns == 1 else 2 if max(map(len, methods)) > LONG else 3
    figure = style.sheet(ROW_MM * down + LINE_MM * math.ceil(len(methods) / across) + 6, width)
    panels = figure.subplots(down, columns, sharex=True, sharey=True, squeeze=False)
    for i, (axes, (problem, own)) in enumerate(zip(panels.flat, problems.items(), strict=False)):
        panel(axes, bench, own, methods)
        last = i + columns >= len(problems)
        axes.tick_params(labelbottom=last)
        words = ("CPU time (s)", bench.label) if bench.is_error else (bench.label, "CPU time (s)")
        style.label(axes, words[0] if last else "", "" if i % columns else words[1], problem)
    for axes in panels.flat[len(problems):]:
        axes.set_visible(False)
    shared = panels[0, 0]
    for axis, (low, high) in ((shared.xaxis, shared.get_xlim()), (shared.yaxis, shared.get_ylim())):
        if high < NARROW * low:
            style.plain_log(axis)
    lines = {line.get_label(): line for axes in panels.flat for line in axes.get_lines()}
    figure.legend([lines[method] for method in methods], methods, loc="outside lower center", ncols=across)
    data = pd.DataFrame([asdict(p) for p in found]).drop(columns="line").rename(columns={"measure": bench.measure})
    return ReportFigure(bench.name, figure, _caption(bench, found, rows, state), {bench.name: data})


def _look(i: int) -> dict[str, Any]:
    """Colour, mark and dashes: no two of the first twelve methods share a mark, nor colour and dashes."""
    return {"color": style.SERIES[i % len(style.SERIES)], "marker": MARKS[i % len(MARKS)],
            "ls": style.DASHES[i // len(style.SERIES) % len(style.DASHES)], "ms": 3.4}


def panel(axes: Axes, bench: Bench, found: Sequence[Point], methods: Sequence[str]) -> None:
    """One problem: lines join the settings of a method in the order of their cost; looks follow the order of `methods`.
    An error stands above its cost, a cost above the size.
    """
    ordered = sorted(found, key=lambda p: p.cost_s)
    cost, measure = np.array([[p.cost_s, p.measure] for p in ordered]).T
    if bench.is_error:
        axes.step(cost, np.minimum.accumulate(measure), where="post", color=style.FAINT, lw=3.5, zorder=0)
    for method, line in dict.fromkeys((p.method, p.line) for p in found):
        own = [p for p in ordered if (p.method, p.line) == (method, line)]
        drawn = [(p.cost_s, p.measure) if bench.is_error else (p.measure, p.cost_s) for p in own]
        axes.plot(*zip(*drawn, strict=True), label=method, **_look(methods.index(method)))
    axes.set_xscale("log")
    axes.set_yscale("log")


def finding(bench: Bench, found: Sequence[Point]) -> str:
    """What a benchmark's points come to, one sentence."""
    if not bench.is_error:
        return f"{_titled(bench)}: {_largest(found)}."
    spoken = bench.requested[1]
    if min(p.measure for p in found) > spoken:
        return f"{_titled(bench)}: no method comes within {percent(spoken, 1)}; {_least(found)}."
    words = f"{_titled(bench)}: within {percent(spoken, 1)} the cheapest is {_best(found, spoken, again=False)}"
    return words + (f"; with the set-up already done, {_best(found, spoken, again=True)}." if bench.once else ".")


def seconds(*values: float) -> str:
    """A time, or the least and the largest of several, in the unit that suits them."""
    factor, unit = prefixed(values, "s", ("", "m"))
    first, last = number(factor * min(values)), number(factor * max(values))
    return f"{first if first == last else f'{first} to {last}'}\u00a0{unit}"


def _titled(bench: Bench) -> str:
    return bench.title[0].upper() + bench.title[1:]


def _caption(bench: Bench, found: Sequence[Point], rows: int, state: State) -> str:
    said = [finding(bench, found)]
    if bench.is_error:
        said.append("The broad grey line is the least error that a cost has bought.")
    if bench.note:
        said.append(bench.note)
    if rows > len(found):
        said.append(f"{rows - len(found)} of {counted(rows, 'row')} of the file hold no error (a run that failed, work "
                    "done once, or what errors are taken against) and are not drawn.")
    if state.kind != CURRENT:
        said.append(f"{state.file} is {state.words}.")
    return " ".join(said)


def _best(found: Sequence[Point], spoken: float, *, again: bool) -> str:
    """Which methods are the cheapest within the error that is spoken of, in how many problems, at what cost."""
    problems = by_problem(found)
    best = [point for own in problems.values() if (point := cheapest(own, spoken, again=again)) is not None]
    parts = []
    for method in dict.fromkeys(p.method for p in best):
        costs = [p.cost_s + (0.0 if again else p.once_s) for p in best if p.method == method]
        where = f" in {len(costs)} of {counted(len(problems), 'problem')}" if len(problems) > 1 else ""
        parts.append(f"“{method}”{where} ({seconds(*costs)})")
    return ", ".join(parts)


def _least(found: Sequence[Point]) -> str:
    least = min(found, key=lambda p: p.measure)
    return f"the least error, {percent(least.measure)}, is that of “{least.method}” in {seconds(least.cost_s)}"


def _largest(found: Sequence[Point]) -> str:
    """What every method takes for the largest system."""
    size = max(p.measure for p in found)
    own = sorted((p for p in found if p.measure == size), key=lambda p: p.cost_s)
    parts = [f"{p.method} {seconds(p.cost_s)}" + (f" ({number(p.cost_s / own[0].cost_s)} times)" if i else "")
             for i, p in enumerate(own)]
    return f"with {size:.0f} unknowns, {', '.join(parts)}"
