"""The search over sensors: which skin and punch the paper's networks fit, as benchmarks/variants.py wrote it."""

from pathlib import Path

import pandas as pd

from reports.benchmarks.stored_tables import State, state
from reports.document.numerals import counted, number
from reports.document.page import Table
from reports.surrogate.parity_figures import label
from touchcal.code_version import ROOT

BENCHMARK = "variants"
FILE = ROOT / "benchmarks" / "results" / f"{BENCHMARK}.csv"
NOT_RUN = (f"The search over sensors has not been run: benchmarks/results/{FILE.name} is not there; "
           f"`python benchmarks/{BENCHMARK}.py CARD` writes it.")


def read(path: Path = FILE) -> pd.DataFrame | None:
    """One row a variant and output, with the networks' errors over the paper's; None where it was not run."""
    return pd.read_csv(path) if path.is_file() else None


def words(variant: str) -> str:
    """A variant on a page."""
    return variant.replace("Ohm m2", "Ω m²")


def best(rows: pd.DataFrame) -> pd.DataFrame:
    """Of each output, which is the index, the row whose error on unseen rows is the least."""
    return rows.loc[rows.groupby("output")["over_paper"].idxmin()].set_index("output")


def table(rows: pd.DataFrame, outputs: list[str]) -> Table:
    """A row a variant, a column an output: the RMSE on unseen rows over the paper's."""
    ratio = rows.pivot(index="variant", columns="output", values="over_paper").reindex(columns=outputs)
    order = ratio.max(axis=1).sort_values().index
    cells = [[words(str(variant)), *("–" if pd.isna(value) else number(value, 2) for value in ratio.loc[variant])]
             for variant in order]
    least = best(rows)["over_paper"]
    caption = (f"Sensors tried, by the largest of their ratios: RMSE of the paper's networks on unseen rows over the "
             f"paper's, {counted(len(order), 'sensor')}, {_sizes(rows)}. The best of each output lies between "
             f"{number(least.min(), 2)} ({label(str(least.idxmin())).lower()}) and {number(least.max(), 2)} "
             f"({label(str(least.idxmax())).lower()}); {_state(rows).words}.")
    return Table(caption, ["sensor", *(short(name) for name in outputs)], cells, "w" + "r" * len(outputs))


def _sizes(rows: pd.DataFrame) -> str:
    """How many rows taught and in how many steps at most."""
    return f"{_span(rows, 'rows')} rows and at most {_span(rows, 'epochs')} steps of training"


def _span(rows: pd.DataFrame, column: str) -> str:
    low, high = int(rows[column].min()), int(rows[column].max())
    return str(low) if low == high else f"{low} to {high}"


def short(name: str) -> str:
    """A head that is as narrow as a number."""
    return {"x0": "x₀", "y0": "y₀", "sigma_max": "σ max", "sigma_ave": "σ ave", "delta_max": "δ max",
            "A_c": "A"}.get(name, name)


def _state(rows: pd.DataFrame) -> State:
    return state(rows, FILE.name, BENCHMARK)


def followed(rows: pd.DataFrame, names: tuple[str, ...]) -> str:
    """What the sensor does to the errors of some outputs, in words."""
    said = []
    for name in names:
        own = rows.loc[rows["output"] == name].sort_values("over_paper")
        if own.empty:
            continue
        first, last = own.iloc[0], own.iloc[-1]
        said.append(f"of {label(name).lower()} from {number(first['over_paper'], 2)} ({words(first['variant'])}) to "
                    f"{number(last['over_paper'], 2)} ({words(last['variant'])}) times the paper's")
    return f"Of {counted(rows['variant'].nunique(), 'sensor')} tried, the networks' error is {'; '.join(said)}." * bool(
        said)
