"""Figure of what a network is made of and learns from (paper, figure 12), from the model's own record."""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from reports.document import style
from reports.document.numerals import counted, number
from reports.document.page import ReportFigure
from reports.surrogate import parity_figures

INPUTS = 208


def hidden_units(parameters: int) -> int:
    """Hidden units h of a network with one output and h (n + 2) + 1 weights; ValueError where none has so many."""
    hidden, rest = divmod(parameters - 1, INPUTS + 2)
    if rest or hidden < 1:
        raise ValueError(f"no network with one hidden layer on {INPUTS} inputs has {parameters} parameters.")
    return hidden


def structure(name: str, model: Mapping[str, Any]) -> ReportFigure:
    """The path from a touch to its networks, with the sizes of this model."""
    networks = {key: net for key, net in model["training"].items() if isinstance(net, Mapping) and "parameters" in net}
    hidden = hidden_units(next(iter(networks.values()))["parameters"])
    split = model["dataset"]["split"]
    figure = style.sheet(62)
    axes = figure.subplots()
    axes.set_axis_off()
    _box(axes, 0.0, "random touch\n$x_0$, $y_0$, $d$, $F$")
    _box(axes, 1.55, f"contact and\nelectrics,\n{counted(model['dataset']['rows'], 'scene')}")
    columns = [(3.0, INPUTS, "voltages,\nmin–max"), (4.2, hidden, "hidden units"), (5.2, 1, "output")]
    places = [_column(axes, x, count, title) for x, count, title in columns]
    for left, right in itertools.pairwise(places):
        for a in left:
            for b in right:
                axes.plot([a[0], b[0]], [a[1], b[1]], color=style.FAINT, lw=0.4, zorder=1)
    names = [parity_figures.label(key).lower() for key in networks]
    outputs = "\n".join(", ".join(names[i:i + 2]) for i in range(0, len(names), 2))
    _box(axes, 6.35, f"{counted(len(networks), 'network')},\none for each of\n{outputs}")
    for start, end in ((0.62, 0.93), (2.17, 2.75), (5.35, 5.7)):
        axes.annotate("", (end, 0.5), (start, 0.5), arrowprops={"arrowstyle": "-|>", "color": style.INK, "lw": 0.8})
    axes.set_xlim(-0.65, 7.0)
    axes.set_ylim(-0.12, 1.12)
    shares = [net["gamma"] / net["parameters"] for net in networks.values()]
    caption = (f"The networks: {INPUTS} voltages, each scaled to 0 … 1, {hidden} hidden units and one output, "
               f"{next(iter(networks.values()))['parameters']} parameters each, of which the data determine "
               f"{number(100 * min(shares), 2)} to {number(100 * max(shares), 2)} % (evidence); {split['train']} rows "
               f"train, {split['val']} calibrate the intervals, {split['test']} test.")
    rows = [{"output": key, "hidden_units": hidden, "parameters": net["parameters"], "effective": net["gamma"],
             "steps": net["epochs"], "stop": net["stop"]} for key, net in networks.items()]
    return ReportFigure(name, figure, caption, {name: pd.DataFrame(rows)})


def _box(axes: Axes, x: float, words: str) -> None:
    axes.text(x, 0.5, words, ha="center", va="center", fontsize=7,
              bbox={"boxstyle": "round,pad=0.4", "facecolor": "#eaf2f8", "edgecolor": style.ACCENT, "lw": 0.7})


def _column(axes: Axes, x: float, count: int, title: str) -> list[tuple[float, float]]:
    """A layer of a network: at most seven of its units, and the sign that there are more; where they stand."""
    shown = min(count, 7)
    heights = np.linspace(0.12, 0.88, shown) if shown > 1 else np.array([0.5])
    if count > shown:
        heights = np.delete(heights, shown // 2)
        axes.text(x, 0.5, "⋮", ha="center", va="center", fontsize=9)
    axes.plot(np.full(heights.size, x), heights, "o", ms=6, color=style.ACCENT, mec="white", zorder=2)
    axes.text(x, 1.06, f"{count} {title}", ha="center", va="center", fontsize=7)
    return [(x, float(y)) for y in heights]
