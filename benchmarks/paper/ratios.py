"""How this run's numbers stand to the paper's: the worst of each figure, and what follows for its use."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import pandas as pd

from benchmarks.paper.learning import OUTPUTS
from benchmarks.paper.section import Number, Section, against, shown, stated_value
from reports.calibration.card_record import rows_where
from reports.document.numerals import number
from reports.document.page import Table
from reports.document.verdict import NOT_USABLE, Limits, Verdict, graded, real
from reports.surrogate.parity_figures import label

AGREES: Limits = (0.05, 0.25)  # how far a ratio to the paper is from 1, in its larger direction
# use -> the figures it is judged by, and the method where several found them
USES = {"Curves of the material": (("3", "4", "5"), ""), "Single terms of Table 1": (("T1",), ""),
        "A held touch": (("9",), ""),
        "The paper's networks": (tuple(str(k) for k in range(13, 20)), "networks"),
        "The forward map": (tuple(str(k) for k in range(13, 20)), "forward map")}
SETTINGS = ("6", "7", "8", "10", "12")  # figures of which the paper states what was set, not what was found


@dataclass(frozen=True)
class Ratio:
    """One number of this run next to the paper's."""

    figure: str
    found: Number
    paper: float

    @property
    def value(self) -> float:
        """This run's over the paper's."""
        return self.found.value / self.paper

    @property
    def off(self) -> float:
        """How far the ratio is from 1, in its larger direction; of an error, only how much larger it is."""
        if self.value <= 0:
            return float("inf")
        return max(self.value, 1 / self.value) - 1 if not self.found.quantity.startswith("RMSE") else self.value - 1


def ratios(sections: Sequence[Section]) -> list[Ratio]:
    """Of each figure and method, the number that is the farthest from the paper's; squared errors stand as roots."""
    most: dict[tuple[str, str], Ratio] = {}
    for section in sections:
        for found in section.numbers:
            paper = stated_value(section.figure, found.quantity)
            if paper is None or found.quantity.startswith("MSE"):
                continue
            ratio, at = Ratio(section.figure, found, paper), (section.figure, found.method)
            most[at] = max(most.get(at, ratio), ratio, key=lambda one: one.off)
    return list(most.values())


def table(found: Sequence[Ratio], full: pd.DataFrame | None) -> Table:
    """A row a figure and method, the run at full size next to this one where it is given."""
    caption = "Of every figure, the number that is the farthest from the paper's."
    if results := [one for one in found if one.figure not in SETTINGS]:
        largest = max(results, key=lambda one: one.off)
        caption += f" The worst is {_named(largest)}, {against(largest.found.value, largest.paper)}."
    rows = [[one.figure, _quantity(one), one.found.method or "–", one.found.unit,
             shown(one.found.quantity, one.paper), shown(one.found.quantity, one.found.value), number(one.value),
             *([_full(one, full)] if full is not None else [])] for one in found]
    head = ["figure", "quantity", "method", "unit", "paper", "this run", "ratio"]
    return Table(caption, [*head, "ratio, full run"] if full is not None else head, rows,
                 "lwll" + "r" * (3 + (full is not None)))


def _full(one: Ratio, full: pd.DataFrame) -> str:
    rows = rows_where(full, (full["figure"] == one.figure) & (full["quantity"] == one.found.quantity)
                      & (full["method"] == one.found.method))
    return "–" if rows.empty else number(float(rows["value"].iloc[0]) / one.paper)


def _quantity(one: Ratio) -> str:
    """The quantity, with the output of a figure that has one."""
    names = OUTPUTS.get(one.figure, ())
    return f"{label(names[0])}, {one.found.quantity}" if len(names) == 1 else one.found.quantity


def _named(one: Ratio) -> str:
    by = f" by the {one.found.method}" if one.found.method else ""
    return f"{_quantity(one)}{by} ({'' if one.figure.startswith('T') else 'figure '}{one.figure})"


def of_full(full: pd.DataFrame) -> list[Ratio]:
    """As `ratios`, of the numbers of the run at full size."""
    return ratios([Section(str(figure), "", "", "", "", (), numbers=tuple(
        Number(row["quantity"], row["unit"], float(row["value"]), row["method"]) for row in rows.to_dict("records")))
        for figure, rows in full.groupby("figure", sort=False)])


def verdict(found: Sequence[Ratio], synthetic: bool, run: str = "") -> Iterator[Verdict]:
    """A line a use: good within 5 % of the paper at worst, usable within 25 %; stands for nothing measured. run: which
    run the numbers are of, where it is not this one."""
    if not found:
        yield Verdict("Any comparison", NOT_USABLE, "no number of this run stands next to one of the paper's")
    for use, (figures, method) in USES.items():
        if own := [one for one in found if one.figure in figures and one.found.method == method]:
            largest = max(own, key=lambda one: one.off)
            yield Verdict(use, graded(largest.off, AGREES),
                          f"at worst, {_named(largest)} is {against(largest.found.value, largest.paper)}"
                          + (f", in {run}" if run else ""))
    yield from real("A real sensor", synthetic)
