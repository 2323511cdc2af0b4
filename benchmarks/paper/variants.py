"""The search over sensors: which skin and punch the paper's networks fit, as benchmarks/variants.py wrote it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.report.stored_tables import Rows, distinct, frame, read_rows, state, where
from reports.document.numerals import counted, number
from reports.document.page import Table
from reports.surrogate.parity_figures import label
from touchcal.code_version import ROOT

BENCHMARK = "variants"
FILE = ROOT / "benchmarks" / "results" / f"{BENCHMARK}.csv"
NOT_RUN = (f"The search over sensors has not been run: benchmarks/results/{FILE.name} is not there; "
           f"`python benchmarks/{BENCHMARK}.py CARD` writes it.")
RATIO = "over_paper"  # column of the RMSE on unseen rows over the paper's
# heads of outputs that are as narrow as a number
SHORT = {"x0": "x₀", "y0": "y₀", "sigma_max": "σ max", "sigma_ave": "σ ave", "delta_max": "δ max", "A_c": "A"}


def read(path: Path = FILE) -> Rows:
    """One row a variant and output, with the networks' errors over the paper's; none where it was not run."""
    return read_rows(path) if path.is_file() else []


def words(variant: str) -> str:
    """A variant on a page."""
    return variant.replace("Ohm m2", "Ω m²")


def best(rows: Rows, output: str) -> Mapping[str, Any] | None:
    """The row of an output whose error is the least; None where the search does not have it."""
    return min(where(rows, output=output), key=lambda row: row[RATIO], default=None)


def ratio(rows: Rows, variant: str, output: str) -> float | None:
    """An output's error over the paper's under a variant; None where the search does not have it."""
    return next((row[RATIO] for row in where(rows, variant=variant, output=output)), None)


def table(rows: Rows, outputs: Sequence[str]) -> Table:
    """A row a variant, the one whose largest ratio is the least first, a column an output."""
    known = {variant: [ratio(rows, variant, output) for output in outputs] for variant in distinct(rows, "variant")}
    order = sorted(known, key=lambda variant: max(value for value in known[variant] if value is not None))
    cells = [[words(variant), *("–" if value is None else number(value, 2) for value in known[variant])]
             for variant in order]
    least = sorted((found for output in outputs if (found := best(rows, output))), key=lambda row: row[RATIO])
    ends = " and ".join(f"{number(row[RATIO], 2)} ({label(row['output']).lower()})" for row in (least[0], least[-1]))
    caption = (f"{counted(len(order), 'sensor')} tried, by the largest of their ratios: RMSE of the paper's networks "
               f"on unseen rows over the paper's, {_span(rows, 'rows')} training rows and at most "
               f"{_span(rows, 'epochs')} steps. The best of each output lies between {ends}. State of the table: "
               f"{state(frame(rows), FILE.name, BENCHMARK).words}.")
    return Table(caption, ["sensor", *(SHORT.get(name, name) for name in outputs)], cells, "w" + "r" * len(outputs))


def _span(rows: Rows, column: str) -> str:
    ends = sorted({int(row[column]) for row in rows})
    return " to ".join(f"{end}" for end in dict.fromkeys((ends[0], ends[-1])))


def followed(rows: Rows, names: Sequence[str]) -> str:
    """What the sensor does to the errors of some outputs, in words; empty where the search does not have them."""
    said = []
    for name in names:
        if own := sorted(where(rows, output=name), key=lambda row: row[RATIO]):
            ends = " to ".join(f"{number(row[RATIO], 2)} ({words(row['variant'])})" for row in (own[0], own[-1]))
            said.append(f"of {label(name).lower()} from {ends}")
    if not said:
        return ""
    return (f"Of {counted(len(distinct(rows, 'variant')), 'sensor')} tried, the networks' error over the paper's goes, "
            f"{'; '.join(said)}.")
