"""The look of every figure and page, in one place: sizes, fonts, colours that colour-blind readers can distinguish."""

import warnings
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

# the one accent colour, and what stands next to it (Okabe and Ito's palette; line styles differ as well)
ACCENT, SECOND, THIRD = "#0072B2", "#D55E00", "#009E73"
USABLE = "#B07A00"  # Okabe and Ito's orange, darker, so that words in it can be read on white
INK, GREY, FAINT = "#1a1a1a", "#6b6b6b", "#d9d9d9"
# a second mark of each series, so that no line is known by colour alone
DASHES = ("-", "--", ":", "-.")
SERIES = (ACCENT, SECOND, THIRD, "#CC79A7")
SEQUENTIAL, DIVERGING = "cividis", "RdBu_r"  # one hue for magnitudes, two for signed values with white at zero
TEXT_WIDTH_MM = 166.0  # width of the text block of an A4 page, mm
HALF_WIDTH_MM = 81.0  # width of a figure that stands next to another one, mm

_RC: dict[Any, Any] = {
    "font.family": "STIXGeneral", "mathtext.fontset": "stix", "font.size": 8.5, "axes.labelsize": 8.5,
    "axes.titlesize": 8.5, "xtick.labelsize": 7.5, "ytick.labelsize": 7.5, "legend.fontsize": 7.5,
    "text.color": INK, "axes.labelcolor": INK, "axes.edgecolor": GREY, "xtick.color": GREY, "ytick.color": GREY,
    "xtick.labelcolor": INK, "ytick.labelcolor": INK, "axes.linewidth": 0.6, "xtick.major.width": 0.6,
    "ytick.major.width": 0.6, "xtick.minor.width": 0.4, "ytick.minor.width": 0.4, "axes.spines.top": False,
    "axes.spines.right": False, "axes.titlelocation": "left",
    "axes.grid": True, "axes.axisbelow": True, "grid.color": "#ebebeb", "grid.linewidth": 0.5,
    "lines.linewidth": 1.1, "lines.markersize": 2.6, "legend.frameon": False, "legend.handlelength": 2.2,
    "pdf.fonttype": 42, "svg.fonttype": "path", "svg.hashsalt": "touchcal"}


def house() -> AbstractContextManager[None]:
    """The house style as a context: draw and save inside it; nothing outside it changes."""
    return matplotlib.rc_context(_RC)


def sheet(height_mm: float, width_mm: float = TEXT_WIDTH_MM) -> Figure:
    """An empty figure of this size, mm, that owes nothing to pyplot's global state."""
    return Figure(figsize=(width_mm / 25.4, height_mm / 25.4), layout="constrained")


def plain_log(axis: Axis) -> None:
    """Ticks of a logarithmic axis at 1, 2 and 5 of every decade, as plain numbers."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def label(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Name both axes; ValueError where one carries no unit in brackets ("(–)" for a number)."""
    for text in (x, y):
        if text and not text.rstrip().endswith(")"):
            raise ValueError(f"the axis label '{text}' has no unit; end it with one in brackets, (–) for a number.")
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title)


def save(figure: Figure, pdf: Path, svg: Path) -> None:
    """Write a figure as PDF (for the page) and SVG (for reuse); a character that the font lacks is an error. Drawn by
    the canvases themselves, as `savefig` draws everything twice, the first time for nothing here."""
    dpi = figure.dpi
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=r"Glyph .* missing")
        FigureCanvasPdf(figure).print_pdf(pdf, metadata={"CreationDate": None})
        figure.dpi = dpi  # which the canvas leaves at that of its own points
        figure.set_layout_engine("none")  # the places found for the PDF serve the SVG as well
        save_svg(figure, svg)


def save_svg(figure: Figure, svg: Path) -> None:
    """Write a figure as SVG, the same on every day."""
    FigureCanvasSVG(figure).print_svg(svg, metadata={"Date": None})
