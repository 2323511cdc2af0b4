"""How networks were trained: error, effective parameters, alpha and beta after every step (paper, figure 12)."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reports.document import style
from reports.document.numerals import counted, number
from reports.document.page import ReportFigure
from reports.surrogate.parity_figures import label

# columns of surrogate.learners.bayesian_network.bayesian_regularisation.Training.history
COLUMNS = ("squared_error", "squared_weights", "gamma", "alpha", "beta")
NAME = "history"


def history(found: Mapping[str, NDArray[np.float64]], rows: int) -> ReportFigure:
    """One line an output in each panel, for histories (steps, 5) of networks trained on so many rows."""
    tables = {output: table(steps, rows) for output, steps in found.items()}
    figure = style.sheet(96)
    panels = figure.subplots(2, 2, sharex=True)
    shown = (("rms_error", "RMS error in half spans (–)", True), ("gamma", "Effective parameters γ (–)", False),
             ("alpha", "α, weight of the weights (–)", True), ("beta", "β, weight of the errors (–)", True))
    for axes, (column, words, logarithmic) in zip(panels.flat, shown, strict=True):
        for k, (output, steps) in enumerate(tables.items()):
            axes.plot(steps["step"], steps[column], label=label(output), color=style.SERIES[k % 4],
                      ls=style.DASHES[k // 4 % 4])
        style.label(axes, "Step (–)" if axes in panels[1] else "", words)
        if logarithmic:
            axes.set_yscale("log")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(4, len(labels)))
    data = pd.concat([steps.assign(output=output) for output, steps in tables.items()], ignore_index=True)
    return ReportFigure(NAME, figure, _caption(tables), {NAME: data})


def table(steps: NDArray[np.float64], rows: int) -> pd.DataFrame:
    """A history by column, and the RMS error of the training rows in half spans of the targets."""
    whole = pd.DataFrame(steps, columns=pd.Index(COLUMNS))
    whole.insert(0, "step", np.arange(1, len(steps) + 1))
    whole["rms_error"] = np.sqrt(whole["squared_error"] / rows)
    return whole


def _caption(tables: Mapping[str, pd.DataFrame]) -> str:
    last = {output: steps.iloc[-1] for output, steps in tables.items()}
    longest = max(len(steps) for steps in tables.values())
    falling = {output: _late_fall(steps) for output, steps in tables.items()}
    most = max(falling, key=falling.__getitem__)
    errors = [end["rms_error"] for end in last.values()]
    found = [end["gamma"] for end in last.values() if not np.isnan(end["gamma"])]
    effective = f", with {number(min(found))} to {number(max(found))} effective parameters" if found else ""
    return (f"Training of {counted(len(tables), 'network')} over up to {counted(longest, 'step')}: the error of the "
            f"training rows ends at {number(min(errors))} to {number(max(errors))} of half the span{effective}. Over "
            f"the last tenth of the steps the error fell by at most {number(100 * falling[most], 2)} % "
            f"({label(most).lower()}).")


def _late_fall(steps: pd.DataFrame) -> float:
    """Part of the error that the last tenth of the steps took away."""
    error = steps["rms_error"].to_numpy(float)
    before = error[-1 - len(error) // 10]
    return float(max(1 - error[-1] / before, 0.0)) if before > 0 else 0.0
