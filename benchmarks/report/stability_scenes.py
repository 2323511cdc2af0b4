"""Map of random scenes: by card, diameter and force, how many converge, stay elliptic or are lost."""

import itertools
import math

import numpy as np
from matplotlib.axes import Axes

from benchmarks.report.state_map import CAUTION, KEPT, LOST, Cell, cells, legend
from benchmarks.report.stored_tables import Rows, distinct, frame, where
from reports.document import style
from reports.document.numerals import counted, number, prefixed
from reports.document.page import ReportFigure, Table

COLUMNS, DIAMETERS, FORCES = 3, 4, 6
ANSWERED = ("ok", "bottomed_out")  # outcomes that are an answer: the foam is flat under less than the force


def scenes(rows: Rows, file: str) -> ReportFigure:
    """One panel a card: cells of diameter and force, with the scenes in them and those that were lost."""
    cards = distinct(rows, "card")
    down = math.ceil(len(cards) / COLUMNS)
    figure = style.sheet(50 * down + 8)
    panels = figure.subplots(down, COLUMNS, squeeze=False)
    for i, (axes, card) in enumerate(zip(panels.flat, cards, strict=False)):
        unit = _panel(axes, where(rows, card=card))
        style.label(axes, "Diameter (mm)" if i + COLUMNS >= len(cards) else "", f"Force, up to ({unit})", card)
    for axes in panels.flat[len(cards):]:
        axes.set_visible(False)
    legend(figure, {KEPT: "all converged, all points elliptic", CAUTION: "some lost ellipticity at a point",
                    LOST: "a scene lost"})
    return ReportFigure("scenes", figure, _caption(rows), {file: frame(rows)})


def _panel(axes: Axes, own: Rows) -> str:
    """Cells hold "lost of scenes", or the number of scenes where none was lost; the unit of the forces."""
    diameter, force = np.array([[row["d_mm"], row["F_N"]] for row in own]).T
    across = np.linspace(diameter.min(), diameter.max(), DIAMETERS + 1)
    up = np.geomspace(force.min(), force.max(), FORCES + 1)
    column = np.clip(np.searchsorted(across, diameter, side="right") - 1, 0, DIAMETERS - 1)
    line = np.clip(np.searchsorted(up, force, side="right") - 1, 0, FORCES - 1)
    factor, unit = prefixed(up[len(up) // 2:], "N", ("k", "", "m", "µ"))
    drawn = [[_cell([row for row, x, y in zip(own, column, line, strict=True) if (x, y) == (i, j)])
              for i in range(DIAMETERS)] for j in reversed(range(FORCES))]
    cells(axes, drawn, [f"{a:.0f}–{b:.0f}" for a, b in itertools.pairwise(across)],
          [number(factor * top, 2) for top in reversed(up[1:])])
    return unit


def lost_scenes(rows: Rows) -> list[dict]:
    return [dict(row) for row in rows if row["outcome"] not in ANSWERED]


def not_elliptic(rows: Rows) -> list[float]:
    """Shares of points without ellipticity, of the scenes that have such points."""
    return [row["fraction_non_elliptic"] for row in rows if row["fraction_non_elliptic"] > 0]


def _cell(own: Rows) -> Cell | None:
    if not own:
        return None
    if lost := len(lost_scenes(own)):
        return Cell(LOST, f"{lost} of {len(own)}")
    return Cell(CAUTION if not_elliptic(own) else KEPT, str(len(own)))


def _caption(rows: Rows) -> str:
    shares = not_elliptic(rows)
    most = f", at most {number(100 * max(shares), 2)} % of the points" if shares else ""
    return (f"Random scenes anywhere on the disc, frictionless and sticking: {len(lost_scenes(rows))} of "
            f"{counted(len(rows), 'scene')} lost; {len(shares)} converged with points that lost ellipticity{most}. "
            "Numbers count scenes; forces are the upper ends of a row.")


def lost_table(rows: Rows) -> Table | None:
    """The lost scenes themselves; None where there is none."""
    lost = lost_scenes(rows)
    if not lost:
        return None
    shown = [[row["card"], number(row["d_mm"]), number(row["F_N"]), number(math.hypot(row["x_mm"], row["y_mm"])),
             row["friction"], ". ".join(str(row["message"]).split(". ")[:2]).rstrip(".") + "."] for row in lost]
    return Table(f"Scenes that were lost: {counted(len(shown), 'scene')}.",
                 ["card", "d (mm)", "F (N)", "from the centre (mm)", "friction", "what was said"], shown, "lrrrlw")
