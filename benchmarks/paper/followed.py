"""What models read from one touch of sensors that differ in what the paper leaves open, as a table.

Run as `python -m benchmarks.paper.followed CHOICES OUT MODEL...`, a stage of the paper's report.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from benchmarks.paper.touches import CHOICE
from eitsim.sweeps.dataset.parquet import read_dataset
from surrogate import evaluate, load


def table(choices: Path, models: Sequence[Path]) -> pd.DataFrame:
    """One row a model, choice and output: the model's folder, what was chosen, output, unit, target and value read."""
    chosen = read_dataset(choices).ok[["scene", *CHOICE]]
    read = [evaluate(load(model), choices).predictions.assign(model=model.name) for model in models]
    kept = ["model", *CHOICE, "output", "unit", "target", "value"]
    return pd.DataFrame(pd.concat(read).merge(chosen, on="scene"), columns=kept)


def main(choices: str, out: str, *models: str) -> None:
    """Write the table as CSV."""
    table(Path(choices), [Path(model) for model in models]).to_csv(out, index=False)


if __name__ == "__main__":
    main(*sys.argv[1:])
