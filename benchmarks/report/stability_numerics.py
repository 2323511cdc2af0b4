"""Maps of what rounding costs: time ratios of a Prony series, conductance contrast and contact impedance."""

import math
import sys
from collections.abc import Iterable

from benchmarks.report.state_map import CAUTION, KEPT, LOST, Cell, cells, legend
from benchmarks.report.stored_tables import Rows, distinct, frame, where
from reports.document import style
from reports.document.numerals import counted, number, percent
from reports.document.page import ReportFigure, Table

# lost digits of sixteen from which a cell carries a caution, and from which it is lost
SOME, MANY = 4.0, 8.0
LOST_DIGITS = {KEPT: f"under {SOME:g} of 16 digits lost", CAUTION: f"{SOME:g} to {MANY:g}", LOST: "more, or no answer"}
HISTORY, OF_DISC = "history in shear", "disc of 15 mm"
Digits = dict[tuple[float, float], float]  # cell of (row, column) -> digits lost, infinite without an answer


def relaxation(rows: Rows, file: str) -> ReportFigure:
    """Digits that the hereditary integral loses, by ratio of two relaxation times and step over the shorter one."""
    own = where(rows, what=HISTORY)
    found: Digits = {(row["step_over_tau_1"], row["ratio"]): digits_of(row["error"]) for row in own}
    figure = style.sheet(62, 120)
    axes = figure.subplots()
    cells(axes, *_grid(found))
    style.label(axes, "Longer over shorter relaxation time (–)", "Step over the shorter one (–)")
    legend(figure, LOST_DIGITS)
    caption = (f"Stress along a ramp and a hold through a series of two times, against its closed form: "
               f"{_most(found.values())} over all ratios of the times and steps.{_creep(rows)}")
    return ReportFigure("relaxation", figure, caption, {file: frame(rows)})


def _creep(rows: Rows) -> str:
    own = [row for row in rows if row["what"] != HISTORY]
    if not own:
        return ""
    good = [row["error"] for row in own if row["outcome"] == "ok"]
    most = f", error estimate of the depth at most {percent(max(good))}" if good else ""
    ratio = number(max(row["ratio"] for row in own), 2)
    return (f" Touches that creep under their force with two times of ratio up to {ratio}: {len(good)} of "
            f"{counted(len(own), 'touch', 'touches')} ok{most}.")


def digits_of(error: float) -> float:
    """Decimal digits by which an error exceeds rounding; infinite where there is none to tell."""
    epsilon = sys.float_info.epsilon
    return math.log10(max(error, epsilon) / epsilon) if math.isfinite(error) else math.inf


def _most(digits: Iterable[float]) -> str:
    largest = max(digits)
    return f"at most {largest:.1f} of 16 digits are lost" if math.isfinite(largest) else "some have no answer"


def electrics(rows: Rows, file: str) -> ReportFigure:
    """Digits that the elimination and an LU factorisation lose, by contrast of a disc and contact impedance."""
    own = where(rows, of=OF_DISC)
    methods = distinct(own, "method")
    figure = style.sheet(62)
    panels = figure.subplots(1, len(methods), sharey=True, squeeze=False)[0]
    said = []
    for i, (axes, method) in enumerate(zip(panels, methods, strict=True)):
        found = _worst(where(own, method=method, refinements=min(distinct(own, "refinements"))))
        said.append(f"by {method} {_most(found.values())}")
        cells(axes, *_grid(found))
        style.label(axes, "Conductance over that of the skin (–)", "" if i else "Contact impedance (Ω m)", method)
    legend(figure, LOST_DIGITS)
    caption = (f"A disc of 15 mm of another conductance in the skin: {', '.join(said)}; the worse of "
               f"{counted(len(distinct(own, 'elements')), 'mesh', 'meshes')}, without refinement of the answer.")
    return ReportFigure("electrics", figure, caption, {file: frame(rows)})


def _worst(own: Rows) -> Digits:
    found: Digits = {}
    for row in own:
        at = row["z_Ohm_m"], row["contrast"]
        found[at] = max(found.get(at, 0.0), row["digits_lost"] if row["outcome"] == "solved" else math.inf)
    return found


def _grid(found: Digits) -> tuple[list[list[Cell | None]], list[str], list[str]]:
    """Cells, and the values along both sides."""
    down, across = sorted({y for y, _ in found}, reverse=True), sorted({x for _, x in found})
    drawn = [[_cell(found.get((y, x))) for x in across] for y in down]
    return drawn, [_power(x) for x in across], [_power(y) for y in down]


def _cell(digits: float | None) -> Cell | None:
    if digits is None:
        return None
    if not math.isfinite(digits):
        return Cell(LOST, "none")
    return Cell(KEPT if digits < SOME else CAUTION if digits < MANY else LOST, f"{max(digits, 0):.1f}")


def _power(value: float) -> str:
    power = round(math.log10(value))
    return "1" if power == 0 else f"$10^{{{power}}}$"


def others(rows: Rows) -> Table:
    """Cuts through the skin and turned anisotropic tensors: the most digits lost, by method."""
    own = [row for row in rows if row["of"] != OF_DISC]
    methods = distinct(own, "method")
    shown = [[of, number(contrast, 2), *(_most_of(where(own, of=of, contrast=contrast, method=m)) for m in methods)]
            for of, contrast in dict.fromkeys((row["of"], row["contrast"]) for row in own)]
    return Table("Digits lost where the skin is cut, and with tensors that turn from place to place: the most over "
                 "meshes and refinements.", ["skin", "contrast or anisotropy (–)", *methods], shown,
                 "lr" + "r" * len(methods))


def _most_of(own: Rows) -> str:
    if not own:
        return "not measured"
    if all(str(row["outcome"]).startswith("refused") for row in own):
        return "refused"
    if any(row["outcome"] != "solved" or not math.isfinite(row["digits_lost"]) for row in own):
        return "no answer"
    return number(max(row["digits_lost"] for row in own), 2)


def cases(rows: Rows) -> Table:
    """Extreme touches and laws, one a row."""
    shown = [[row["case"], row["outcome"].split(". ")[0], "" if math.isnan(row["cpu_s"]) else number(row["cpu_s"])]
            for row in rows]
    lost = sum(math.isnan(row["error"]) and not math.isnan(row["cpu_s"]) for row in rows)  # tried, nothing found
    said = f"{lost} of {counted(len(rows), 'case')} did not converge" if lost else "all touches converged"
    return Table(f"Extreme cases of law and touch: {said}.", ["case", "outcome", "CPU (s)"], shown, "wwr")
