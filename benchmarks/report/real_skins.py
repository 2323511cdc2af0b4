"""The page of real skins: error and coverage against labels, from the table that benchmarks/real_skins.py wrote."""

from collections.abc import Hashable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from benchmarks.report.stored_tables import cautions, condition_table, present_code, state
from reports.document import provenance, style
from reports.document.numerals import counted, number, percent
from reports.document.page import Report, ReportFigure, Table
from reports.document.verdict import NOT_USABLE, SHORTFALL, Verdict, graded
from touchcal.arrays import Array
from touchcal.errors import InputFileError

TEMPLATE = Path(__file__).with_suffix(".typ")

NAME = "real_skins"
FILE = f"{NAME}.csv"
COLUMNS = ("skin", "labels", "split", "taken", "drift", "output", "unit", "trained", "tested", "error", "kernel_ridge",
           "mean", "x_in_90", "y_in_90")
OF_MEAN = (0.1, 0.3)  # error over that of the mean place that is good, and that is usable
READERS = {"error": ("readers combined", "-", "o"), "kernel_ridge": ("kernel ridge regression", "--", "s"),
           "mean": ("the mean place", ":", "")}


def report(results: Path) -> Report:
    """Everything that the template `real_skins.typ` shows; InputFileError where the table lacks a column."""
    path = results / FILE
    title, subtitle = "Presses on real skins", "places read from recorded presses that others measured"
    if not path.is_file():
        why = f"Not there: {FILE}. Run benchmarks/{NAME}.py, which writes it."
        return Report(TEMPLATE, title, subtitle, provenance.footer([], "no seed"), (), absent={NAME: why, "rows": why},
                      verdict=[Verdict("Places on real skins", NOT_USABLE, "the benchmark has not been run")])
    table = pd.read_csv(path)
    if missing := [name for name in COLUMNS if name not in table]:
        raise InputFileError(path, f"no column {missing[0]}. Run benchmarks/{NAME}.py again.")
    known = state(pd.read_csv(path, dtype=str), FILE, NAME)
    footer = provenance.footer([provenance.source(path)], "seeds fixed in benchmarks/")
    return Report(TEMPLATE, title, subtitle, footer, (), [plate(table)],
                  {"rows": other_rows(table), "conditions": condition_table([(FILE, table, known)])},
                  cautions=cautions([known]), verdict=[*verdict(table), *present_code("These figures, with the code "
                                                                                      "that is here", [known])])


def places(table: pd.DataFrame) -> pd.DataFrame:
    """Rows of places whose untouched frames are as recorded."""
    return pd.DataFrame(table[(table["output"] == "place") & table["drift"].isna()])


def latest(table: pd.DataFrame) -> pd.DataFrame:
    """Of these, those that test the last presses in time with labels just before them."""
    rows = places(table).sort_values(by="trained")
    return pd.DataFrame(rows[(rows["split"] == "time") & (rows["taken"] == "last")])


def plate(table: pd.DataFrame) -> ReportFigure:
    """Error against labels, and coverage below it, a column a skin."""
    skins = list(dict.fromkeys(places(table)["skin"]))
    figure = style.sheet(105)
    panels = figure.subplots(2, len(skins), sharex="col", sharey="row", squeeze=False,
                             gridspec_kw={"height_ratios": [3, 2]})
    for k, skin in enumerate(skins):
        rows, held = latest(table), places(table)
        _errors(panels[0][k], pd.DataFrame(rows[rows["skin"] == skin]), skin, k == 0)
        _coverage(panels[1][k], pd.DataFrame(held[held["skin"] == skin]), k == 0)
    handles, names = panels[0][0].get_legend_handles_labels()
    more, further = panels[1][0].get_legend_handles_labels()
    figure.legend(handles + more, names + further, loc="outside lower center", ncols=3)
    drawn = places(table)[[*COLUMNS]]
    return ReportFigure(NAME, figure, _caption(table), {f"{NAME}_drawn": pd.DataFrame(drawn)})


def _errors(axes: Axes, rows: pd.DataFrame, skin: str, first: bool) -> None:
    for (column, (name, line, mark)), colour in zip(READERS.items(), (style.ACCENT, style.SECOND, style.GREY),
                                                    strict=True):
        axes.loglog(rows["trained"], rows[column], line, color=colour, marker=mark, markersize=4, label=name)
    style.plain_log(axes.yaxis)
    style.label(axes, "", "Mean distance (mm)" if first else "", skin.replace("skin_", "").capitalize())


def _coverage(axes: Axes, rows: pd.DataFrame, first: bool) -> None:
    axes.axhspan(85, 95, color=style.FAINT, linewidth=0, label="85 to 95 %")
    for split, mark, face in (("time", "^", style.INK), ("random", "o", "white")):
        own = rows[rows["split"] == split]
        for k, axis in enumerate(("x_in_90", "y_in_90")):
            axes.plot(own["trained"], 100 * own[axis], mark, color=style.INK, markerfacecolor=face, markersize=3.5,
                      linestyle="none", label=f"x and y, {split} split" if not k else "_nolegend_")
    axes.set_ylim(65, 101)
    labels = sorted(set(rows["trained"]))
    axes.set_xscale("log")
    axes.set_xticks(labels, [f"{count:,}" for count in labels])
    axes.minorticks_off()
    axes.set_xlim(0.6 * labels[0], 1.7 * labels[-1])
    style.label(axes, "Labels (–)", "In 90 % intervals (%)" if first else "")


def _held_parts(rows: pd.DataFrame) -> Array:
    """What intervals of x and of y hold in some rows of places."""
    return rows[["x_in_90", "y_in_90"]].to_numpy(dtype=float).ravel()


def _caption(table: pd.DataFrame) -> str:
    rows = places(table)
    held, many = _held_parts(rows), _held_parts(pd.DataFrame(rows[rows["trained"] >= 100]))
    return ("Above, mean distance on the last fifth of the presses in time, read from the labels just before them. "
            f"Below, the part of tested presses that 90 % intervals hold: {percent(held.min())} to "
            f"{percent(held.max())}; from 100 labels on {int(((many >= 0.85) & (many <= 0.95)).sum())} of "
            f"{len(many)} values lie within 85 to 95 %.")


def verdict(table: pd.DataFrame) -> Iterator[Verdict]:
    """A line for each skin, of its most labels; and one for intervals."""
    for skin, rows in latest(table).groupby("skin", sort=False):
        best = rows.iloc[-1]
        yield Verdict(f"Places on {skin}", graded(best["error"] / best["mean"], OF_MEAN),
                      f"{number(best['error'])} mm from {counted(int(best['trained']), 'press', 'presses')}, where the "
                      f"mean place has {number(best['mean'])} mm and kernel ridge regression "
                      f"{number(best['kernel_ridge'])} mm")
    rows = places(table)
    for many, words in ((False, "from fewer than 100 labels"), (True, "from 100 labels on")):
        own = _held_parts(pd.DataFrame(rows[(rows["trained"] >= 100) == many]))
        if len(own):
            least = float(own.min())
            yield Verdict(f"90 % intervals {words}", graded(0.9 - least, SHORTFALL),
                          f"hold {percent(least)} or more of the tested presses")


def other_rows(table: pd.DataFrame) -> Table:
    """Labels other than the place, and places against old untouched frames."""
    rows = pd.DataFrame(table[(table["output"] != "place") | table["drift"].notna()])
    cells = [[row["skin"], str(row["trained"]), f"{row['split']}, {row['taken']}",
              "-" if pd.isna(row["drift"]) else row["drift"], row["output"], f"{number(row['error'])} {row['unit']}",
              number(row["kernel_ridge"]), number(row["mean"]), _held(row)] for row in rows.to_dict("records")]
    return Table("Labels other than the place, and presses against untouched frames that are old.",
                 ["skin", "labels", "split, labels", "untouched", "output", "error", "kernel ridge", "mean", "in 90 %"],
                 cells, "wrllllrrl")


def _held(row: Mapping[Hashable, Any]) -> str:
    parts = [row[name] for name in ("x_in_90", "y_in_90", "label_in_90") if name in row]
    return ", ".join(percent(part) for part in parts if pd.notna(part))
