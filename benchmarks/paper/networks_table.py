"""All eight networks next to the paper's, and the tested cause where one misses by far, for the first pages."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.paper import variants
from benchmarks.paper.section import paper_value
from benchmarks.paper.touches import PUNCHES
from benchmarks.report.stored_tables import Rows
from reports.document.numerals import number, r_squared
from reports.document.page import Table
from reports.surrogate.parity_figures import correlations, label, points, unit

# figure -> its outputs; what positions are called; radius by which the paper divides them, mm
OUTPUTS: dict[str, tuple[str, ...]] = {"13": ("x0", "y0"), "14": ("d",), "15": ("F",), "16": ("sigma_max",),
                                       "17": ("sigma_ave",), "18": ("delta_max",), "19": ("A_c",)}
SYMBOLS = {"x0": "x₀", "y0": "y₀"}
RADIUS_MM = paper_value("7", "radius of the disc")
FAR = 1.5  # ratio to the paper's error above which a cause is asked for
PAPER_R = ("The paper calls its R² the coefficient of determination, but training by Bayesian regularisation in MATLAB "
           "prints R, the correlation of target and value. Both stand here, for the paper may have printed R as R².")


class Cause(StrEnum):
    """What the search says of an output that is far off, in words."""

    HERE = "touches or training"
    SENSOR = "the sensor"  # only another one brings it to the paper's
    NONE = "none of these sensors"


def paper_rmse(figure: str, name: str, part: str) -> float:
    """Root of the MSE that the paper states, mm where it states it of a position over the radius."""
    if name in SYMBOLS:
        return RADIUS_MM * paper_value(figure, f"MSE of {SYMBOLS[name]}/r, {part} rows") ** 0.5
    return paper_value(figure, f"MSE, {part} rows") ** 0.5


def far_off(scores: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """Output -> ratio of the error on test rows to the paper's, where it is above FAR."""
    ratio = {name: scores[name]["test"]["rmse"] / paper_rmse(figure, name, "test")
             for figure, names in OUTPUTS.items() for name in names if "test" in scores.get(name, {})}
    return {name: value for name, value in ratio.items() if value > FAR}


def errors(scores: Mapping[str, Mapping[str, Any]], predictions: pd.DataFrame) -> Table:
    """A row an output: RMSE of training and test rows, ours and the paper's, ratio, R² and R on test rows."""
    rows = []
    for figure, names in OUTPUTS.items():
        for name in names:
            parts, r = scores[name], correlations(points(predictions, name)).get("test")
            ours = [parts[part]["rmse"] if part in parts else np.nan for part in ("train", "test")]
            paper = [paper_rmse(figure, name, words) for words in ("training", "test")]
            r2 = parts.get("test", {}).get("r2")
            rows.append([figure, label(name), unit(parts), _cell(ours[0]), number(paper[0]), _cell(ours[1]),
                         number(paper[1]), _cell(ours[1] / paper[1], 2), "–" if r2 is None else r_squared(r2),
                         "–" if r is None else r_squared(r)])
    far = far_off(scores)
    caption = (f"The paper's eight networks, RMSE here and the paper's (root of its MSE): on test rows {len(far)} of "
               f"{len(rows)} are more than {FAR:g} times the paper's. R² and R are of the test rows.")
    return Table(caption, ["figure", "output", "unit", "training", "paper", "test", "paper", "ratio", "R²", "R"], rows,
                 "lwlrrrrrrr")


def _cell(value: float, digits: int = 3) -> str:
    return number(value, digits) if np.isfinite(value) else "–"


def causes(scores: Mapping[str, Mapping[str, Any]], search: Rows, own: tuple[str, int]) -> Table:
    """Of each output far off the paper: its ratio here, under the own choice of sensor in the search, and under the
    best sensor of the search, and what follows."""
    mine, rows = f"{own[0]}, {PUNCHES[own[1]]}", []
    for name, ratio in far_off(scores).items():
        if best := variants.best(search, name):
            there = variants.ratio(search, mine, name)
            rows.append([label(name), number(ratio, 2), "–" if there is None else number(there, 2),
                         variants.words(best["variant"]), number(best[variants.RATIO], 2),
                         cause(there, best[variants.RATIO])])
    explained = sum(row[-1] is Cause.SENSOR for row in rows)
    caption = (f"Tested causes of ratios above {FAR:g}: of {len(rows)}, {explained} fall below it under another "
               f"sensor. “In the search” is this report's sensor ({mine}) on the search's touches.")
    return Table(caption, ["output", "ratio here", "in the search", "best sensor tried", "its ratio", "cause"], rows,
                 "lrrwrl")


def cause(own: float | None, best: float) -> Cause:
    """The cause by ratios of the own sensor in the search, None where it is not there, and of the best."""
    if own is not None and own <= FAR:
        return Cause.HERE
    return Cause.SENSOR if best <= FAR else Cause.NONE
