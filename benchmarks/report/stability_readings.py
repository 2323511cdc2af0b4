"""Maps of surrogates under noise and shift: how much worse they read, and whether their intervals still hold."""

from benchmarks.report.state_map import CAUTION, KEPT, LOST, Cell, cells, legend
from benchmarks.report.stored_tables import Rows, distinct, frame, where
from reports.document import style
from reports.document.numerals import number
from reports.document.page import ReportFigure

# RMSE over that without noise and shift from which a cell carries a caution, and from which it is lost; and the share
# of rows that nominal 90 % intervals must hold
WORSE, MUCH_WORSE, HELD = 2.0, 10.0, 0.8
MEANING = {KEPT: f"under {WORSE:g} times the clean RMSE, intervals hold {100 * HELD:g} % of rows",
           CAUTION: f"{WORSE:g} to {MUCH_WORSE:g} times, intervals hold", LOST: "more, or intervals do not hold"}


def readings(rows: Rows, file: str) -> list[ReportFigure]:
    """One plate a method: cases down, outputs across."""
    return [_plate(method, where(rows, method=method), file) for method in distinct(rows, "method")]


def _plate(method: str, own: Rows, file: str) -> ReportFigure:
    cases, outputs = distinct(own, "case"), distinct(own, "output")
    found = {(row["case"], row["output"]): cell(row["rmse_ratio"], row["coverage_90"]) for row in own}
    drawn = [[found[case, output] for output in outputs] for case in cases]
    figure = style.sheet(14 + 5.6 * len(cases))
    axes = figure.subplots()
    cells(axes, drawn, outputs, [_name(own, case) for case in cases])
    axes.xaxis.tick_top()
    legend(figure, MEANING)
    lost = [f"{case}, {output}" for case, row in zip(cases, drawn, strict=True)
            for output, cell in zip(outputs, row, strict=True) if cell.state == LOST]
    first = f" (first: {lost[0]})" if lost else ""
    said = f"{len(lost)} of {len(cases) * len(outputs)} cells are lost{first}"
    caption = (f"“{method}”, trained without noise: {said}. In a cell, the RMSE over the clean one and the share of "
               "rows in nominal 90 % intervals. The model is given the noise, not the shifts.")
    return ReportFigure(f"readings_{method}", figure, caption, {f"{file}_{method}": frame(own)})


def _name(own: Rows, case: str) -> str:
    return f"noise {case}" if where(own, case=case)[0]["kind"] == "noise" else case


def cell(ratio: float, held: float) -> Cell:
    state = LOST if not ratio < MUCH_WORSE or not held >= HELD else CAUTION if ratio >= WORSE else KEPT
    return Cell(state, f"{number(ratio, 2)}, {100 * held:.0f} %")
