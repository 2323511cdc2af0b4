"""Tables of a surrogate: scores by part of the rows, scores under noise, how the training went."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from reports.document.numerals import counted, number, percent, r_squared
from reports.document.page import Table
from reports.surrogate.parity_figures import TITLES, correlations, label, points, unit, unseen
from surrogate.bounds.bound_files import MATERIALS, floor


def scores(by_output: Mapping[str, Any], predictions: pd.DataFrame) -> Table:
    """One row an output and part of the rows."""
    r = {name: correlations(points(predictions, name)) for name in by_output}
    rows = [[label(name), unit(parts), TITLES.get(part, part), str(s["n"]), number(s["mse"]), number(s["rmse"]),
             number(s["mae"]), "–" if s["r2"] is None else r_squared(s["r2"]),
             r_squared(r[name][part]) if part in r[name] else "–", percent(s["coverage_90"])]
            for name, parts in by_output.items() for part, s in parts.items() if part != "val" or len(parts) == 1]
    head = ["output", "unit", "rows", "n", "MSE", "RMSE", "MAE", "R²", "R", "in 90 %"]
    return Table(_scores_caption(by_output), head, rows, "wllrrrrrrr")


def _scores_caption(by_output: Mapping[str, Any]) -> str:
    r2 = {name: parts[unseen(parts)]["r2"] for name, parts in by_output.items()}
    known = {name: value for name, value in r2.items() if value is not None}
    if not known:
        return "Scores; MSE is in the unit squared. R² is undefined: no target varies."
    best, worst = max(known, key=known.__getitem__), min(known, key=known.__getitem__)
    return ("Scores; MSE is in the unit squared, R is the correlation of target and value. On unseen rows R² is "
            f"{r_squared(known[worst])} at the least ({label(worst).lower()}) and {r_squared(known[best])} at the most "
            f"({label(best).lower()}).")


def noise(by_output: Mapping[str, Any], levels: Sequence[Mapping[str, Any]],
          limits: pd.DataFrame | None = None) -> Table:
    """RMSE on unseen rows, one column a level of noise; below each output the least possible, where it is known."""
    rows = []
    for name, parts in by_output.items():
        part = unseen(parts)
        noisy = [number(level["outputs"][name][part]["rmse"]) for level in levels]
        rows.append([label(name), unit(parts), number(parts[part]["rmse"]), *noisy])
        for material, words in MATERIALS.items():
            if least := floor(limits, name, material):
                known = [least.get(round(level["db_below_baseline"], 1)) for level in levels]
                cells = ["–" if value is None else number(value) for value in known]
                rows.append([words, unit(parts), "–", *cells])
    head = ["RMSE of unseen rows", "unit", "no noise", *(f"{number(v['db_below_baseline'])} dB" for v in levels)]
    caption = (f"RMSE under white noise, by its level below the RMS of the baseline voltages; the last column is "
               f"{number(levels[-1]['db_below_signal'])} dB below the RMS of the signal.")
    return Table(caption, head, rows, "wlr" + "r" * len(levels))


def training(record: Mapping[str, Any]) -> Table:
    """How the training went: a row a network with its effective parameters, or the record's own entries."""
    if record and all(isinstance(value, Mapping) and "gamma" in value for value in record.values()):
        return _networks(record)
    rows = [[label(name.replace("_", " ")), _words(value)] for name, value in record.items()]
    return Table(f"How the training went: {counted(len(rows), 'entry', 'entries')} of the model's own record.",
                 ["entry", "value"], rows, "lw")


def _networks(record: Mapping[str, Any]) -> Table:
    rows = [[label(name), str(net["parameters"]), number(net["gamma"]), str(net["epochs"]), str(net["stop"])]
            for name, net in record.items()]
    shares = [net["gamma"] / net["parameters"] for net in record.values()]
    caption = (f"How each network was trained: of its parameters, {percent(min(shares))} to {percent(max(shares))} are "
               "determined by the data.")
    return Table(caption, ["output", "parameters", "effective", "steps", "stopped because"], rows, "wrrrl")


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_words(v)}" for key, v in value.items())
    return number(value) if isinstance(value, float) else str(value)
