"""Maps of laws: the strains at which each mode keeps Drucker's condition and strong ellipticity, and h(lambda)."""

import math

from benchmarks.report.state_map import CAUTION, COLOURS, HATCHES, KEPT, LOST, box, legend
from benchmarks.report.stored_tables import Rows, distinct, frame, where
from reports.document import style
from reports.document.numerals import counted, interval
from reports.document.page import ReportFigure

_SHORT = {"drucker": "Drucker", "elliptic": "ellipticity"}
_LONG = _SHORT | {"drucker": "Drucker's condition"}
COLUMNS = 3


def ranges(rows: Rows, file: str) -> ReportFigure:
    """One panel a law: kept and lost strains of every mode and criterion, as results/stable_ranges.csv tells them. A
    loss of Drucker's condition alone is a caution: foams of rising stress break it on legitimate plateaus."""
    laws = distinct(rows, "law")
    down = math.ceil(len(laws) / COLUMNS)
    figure = style.sheet(45 * down + 8)
    panels = figure.subplots(down, COLUMNS, sharex=True, sharey=True, squeeze=False)
    names = [(mode, criterion) for mode in distinct(rows, "mode") for criterion in distinct(rows, "criterion")]
    for i, (axes, law) in enumerate(zip(panels.flat, laws, strict=False)):
        for row in where(rows, law=law):
            lost = LOST if row["criterion"] == "elliptic" else CAUTION
            box(axes, (row["strain_from"], names.index((row["mode"], row["criterion"])) - 0.4),
                row["strain_to"] - row["strain_from"], 0.8, KEPT if row["state"] == "kept" else lost)
        axes.set_yticks(range(len(names)), [f"{mode}, {_SHORT.get(c, c)}" for mode, c in names])
        axes.set_xlim(-1, 3)
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.axvline(0, color=style.GREY, lw=0.5)
        axes.grid(axis="y", visible=False)
        last = i + COLUMNS >= len(laws)
        axes.tick_params(labelbottom=last)
        style.label(axes, "Strain (–)" if last else "", "", law)
    for axes in panels.flat[len(laws):]:
        axes.set_visible(False)
    legend(figure, {KEPT: "kept", CAUTION: "Drucker's condition lost", LOST: "ellipticity lost"})
    return ReportFigure("laws", figure, _caption(rows, len(laws)), {file: frame(rows)})


def _caption(rows: Rows, laws: int) -> str:
    parts = []
    for criterion in distinct(rows, "criterion"):
        lost = where(rows, state="lost", criterion=criterion)
        if not lost:
            continue
        first = lost[0]
        name, where_first = _LONG.get(criterion, criterion), interval(first["strain_from"], first["strain_to"])
        parts.append(f"{name} in {counted(len(lost), 'range')} of {counted(len(distinct(lost, 'law')), 'law')} "
                     f"(first: {first['law']}, {first['mode']}, {where_first})")
    said = f"lost is {'; '.join(parts)}" if parts else "nothing is lost"
    return (f"Stability over the scanned strains of {counted(laws, 'law')} in five modes (γ in shear, J in "
            f"volumetric): {said}.")


def functions(rows: Rows, file: str) -> ReportFigure:
    """h(lambda) over mu_0 of every law with nu = 0; what is below zero is shaded."""
    figure = style.sheet(58, 110)
    axes = figure.subplots()
    same: dict[tuple[float, ...], list[str]] = {}
    for law in distinct(rows, "law"):
        same.setdefault(tuple(round(row["h_over_mu_0"], 6) for row in where(rows, law=law)), []).append(law)
    for i, (values, names) in enumerate(same.items()):
        stretch = [row["stretch"] for row in where(rows, law=names[0])]
        axes.plot(stretch, values, color=style.SERIES[i % len(style.SERIES)], ls=style.DASHES[i % len(style.DASHES)],
                  label=", ".join(names))
    axes.axhspan(-10, 0, facecolor=COLOURS[CAUTION], hatch=HATCHES[CAUTION], edgecolor="white", alpha=0.6, lw=0)
    low = min(0.0, *(min(values) for values in same))
    axes.set_ylim(1.3 * low - 0.05, 2.0)
    style.label(axes, "Stretch λ (–)", r"h(λ)/$\mu_0$ (–)")
    axes.legend(loc="center right")
    lost = [", ".join(names) for values, names in same.items() if min(values) <= 0]
    said = f"it is lost, h ≤ 0, for {'; '.join(lost)}" if lost else "it is kept everywhere"
    caption = (f"h(λ) = Σ μᵢ λ^αᵢ decides Drucker's condition where ν = 0: {said}. Laws of one line differ by a factor "
               "alone.")
    return ReportFigure("functions", figure, caption, {file: frame(rows)})
