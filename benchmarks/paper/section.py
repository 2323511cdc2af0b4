"""A section of the paper's report: one of its figures, what it states, what was found here, and the numbers of both."""

import functools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from reports.calibration.card_record import rows_where
from reports.document.numerals import counted, number, r_squared
from reports.document.page import ReportFigure, Table

PUBLISHED = Path(__file__).with_name("stated.csv")
# numbers of the run at full size, and what made them, as it was committed
FULL = Path(__file__).with_name("full") / "numbers.csv"
FULL_STAGES = FULL.with_name("stages.csv")
KEY = ["figure", "quantity", "unit", "method"]


@dataclass(frozen=True)
class Number:
    """One number that a run found."""

    quantity: str  # what it is of; with the figure and the unit it names the paper's own value
    unit: str
    value: float
    method: str = ""  # method that found it, where several did


@dataclass(frozen=True)
class Section:
    """One figure or table of the paper."""

    figure: str  # "3", "T1", or a word for what the paper has no figure of
    title: str
    says: str  # what the paper states
    chosen: str  # what was chosen here where it leaves a choice open
    differs: str  # how both differ
    stages: tuple[str, ...]  # names of the stages whose results it is made from
    plates: tuple[ReportFigure, ...] = ()
    numbers: tuple[Number, ...] = ()
    tables: tuple[Table, ...] = ()  # further tables
    missing: str = ""  # why it is empty; "" where it is not
    followed: str = ""  # what the open choices of section C, and what is not known of the material, do to it


@functools.cache
def published() -> pd.DataFrame:
    """What the paper states: figure, quantity, unit, value, and where it says so."""
    return pd.read_csv(PUBLISHED, dtype={"figure": str})


def paper_value(figure: str, quantity: str) -> float:
    """A value that the paper states; KeyError where it states none."""
    if (value := stated_value(figure, quantity)) is None:
        raise KeyError(f"{PUBLISHED.name} holds no '{quantity}' of figure {figure}")
    return value


def stated_value(figure: str, quantity: str) -> float | None:
    """A value that the paper states; None where it states none."""
    rows = _stated_rows(figure, quantity)
    return None if rows.empty else float(rows["value"].iloc[0])


def _stated_rows(figure: str, quantity: str) -> pd.DataFrame:
    table = published()
    return rows_where(table, (table["figure"] == figure) & (table["quantity"] == quantity))


def found(sections: Iterable[Section]) -> pd.DataFrame:
    """Numbers of a run: figure, quantity, unit, method, value."""
    rows = [{"figure": section.figure, "quantity": n.quantity, "unit": n.unit, "method": n.method, "value": n.value}
            for section in sections for n in section.numbers]
    return pd.DataFrame(rows, columns=[*KEY, "value"])


def full_numbers() -> pd.DataFrame | None:
    """Committed numbers of the run at full size; None where there are none."""
    if not FULL.is_file():
        return None
    return pd.read_csv(FULL, dtype={"figure": str, "method": str}).fillna({"method": ""})


def comparison(section: Section, full: pd.DataFrame | None) -> Table | None:
    """The paper's values next to this run's and, where given, those of the run at full size; None without numbers."""
    if not section.numbers:
        return None
    methods = list(dict.fromkeys(n.method for n in section.numbers))
    own = found([section])
    sides = [(False, own), *([(True, full[full["figure"] == section.figure])] if full is not None else [])]
    rows = [[quantity, unit, _stated(section.figure, quantity, unit),
             *(_cell(pd.DataFrame(side), quantity, unit, method) for method in methods for _, side in sides)]
            for quantity, unit in dict.fromkeys((n.quantity, n.unit) for n in section.numbers)]
    # short heads: the quantities need the width
    head = ["quantity", "unit", "paper", *(
        (f"{method}, full" if whole else method) if method else "full run" if whole else "this run"
        for method in methods for whole, _ in sides)]
    known = sum(row[2] != "–" for row in rows)
    caption = f"{counted(len(rows), 'quantity', 'quantities')}, of which the paper gives {known or 'none'}."
    return Table(caption, head, rows, "wl" + "r" * (len(head) - 2))


def _stated(figure: str, quantity: str, unit: str) -> str:
    rows = _stated_rows(figure, quantity)
    if rows.empty:
        return "–"
    if (own := rows["unit"].iloc[0]) != unit:
        raise ValueError(f"{PUBLISHED.name}: '{quantity}' of figure {figure} is in {own}, found in {unit}.")
    return shown(quantity, float(rows["value"].iloc[0]))


def _cell(table: pd.DataFrame, quantity: str, unit: str, method: str) -> str:
    rows = rows_where(table, (table["quantity"] == quantity) & (table["unit"] == unit) & (table["method"] == method))
    return "–" if rows.empty else shown(quantity, float(rows["value"].iloc[0]))


def shown(quantity: str, value: float) -> str:
    """A number of a comparison; whole ones in full, R² and R with what they lack to 1."""
    if quantity.split()[0].rstrip(",") in ("R²", "R"):
        return r_squared(value)
    return f"{value:.0f}" if value == round(value) and abs(value) < 1e6 else number(value)


def renamed(plate: ReportFigure, name: str) -> ReportFigure:
    """A plate under another name, the files of its data with the name before their own."""
    data = {stem if stem.startswith(name) else f"{name}_{stem}": table for stem, table in plate.data.items()}
    return replace(plate, name=name, data=data)


def against(value: float, paper: float) -> str:
    """How a value stands to the paper's, in words."""
    ratio = value / paper
    if math.isclose(ratio, 1, rel_tol=5e-3):
        return "the paper's to 0.5 %"
    if ratio <= 0:
        return "of the other sign than the paper's"
    return f"{number(ratio, 2)} times the paper's" if not 0.5 < ratio < 2 else (
        f"{number(100 * abs(ratio - 1), 2)} % {'above' if ratio > 1 else 'below'} the paper's")


def value_of(numbers: Sequence[Number], quantity: str, method: str = "") -> float:
    """The value of a quantity among a run's numbers."""
    return next(n.value for n in numbers if n.quantity == quantity and n.method == method)
