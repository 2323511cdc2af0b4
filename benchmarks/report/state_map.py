"""Maps of states: cells that hold, hold with a caution, or are lost; shown by colour, by hatch and by words."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from reports.document import style

KEPT, CAUTION, LOST = "kept", "caution", "lost"
COLOURS = {KEPT: "#d3e5f2", CAUTION: "#f3c774", LOST: style.SECOND}
HATCHES = {KEPT: "", CAUTION: "....", LOST: "////"}


@dataclass(frozen=True)
class Cell:
    """One cell of a map."""

    state: str  # one of STATES
    words: str = ""  # what stands in it, a few letters


def cells(axes: Axes, rows: Sequence[Sequence[Cell | None]], across: Sequence[str], down: Sequence[str]) -> None:
    """Draw a table of cells from its first row downwards; None leaves a place empty. ValueError where widths differ."""
    if len(rows) != len(down) or any(len(row) != len(across) for row in rows):
        raise ValueError(f"a map of {len(down)} rows and {len(across)} columns got {len(rows)} rows of "
                         f"{sorted({len(row) for row in rows})} cells.")
    for y, row in enumerate(rows):
        for x, cell in enumerate(row):
            if cell is not None:
                box(axes, (x - 0.5, y - 0.5), 1.0, 1.0, cell.state)
                axes.text(x, y, cell.words, ha="center", va="center", fontsize=6.5,
                          bbox={"facecolor": "white", "alpha": 0.9, "lw": 0, "pad": 0.6} if cell.words else None)
    axes.set_xlim(-0.5, len(across) - 0.5)
    axes.set_ylim(len(down) - 0.5, -0.5)
    axes.set_xticks(range(len(across)), across)
    axes.set_yticks(range(len(down)), down)
    axes.grid(visible=False)
    axes.tick_params(length=0)


def box(axes: Axes, corner: tuple[float, float], width: float, height: float, state: str) -> None:
    """One rectangle in the look of its state."""
    axes.add_patch(Rectangle(corner, width, height, facecolor=COLOURS[state], hatch=HATCHES[state], edgecolor="white",
                             lw=0.8))


def legend(figure: Figure, words: dict[str, str]) -> None:
    """Below the figure, what each state means here."""
    figure.legend(handles=[Patch(facecolor=COLOURS[state], hatch=HATCHES[state], edgecolor="white", label=text)
                           for state, text in words.items()], loc="outside lower center", ncols=len(words))
