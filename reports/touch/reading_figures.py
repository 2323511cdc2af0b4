"""Reading curves: the voltages of every drive pattern, touched and untouched, and the signal between them."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from reports.document import style
from reports.document.numerals import number, volts
from reports.document.page import ReportFigure
from touchcal.arrays import Array


def size_words(signal: Array, baseline: Array) -> str:
    """The largest signal with its unit, and the RMS of all of them against that of the baseline, dB."""
    signal, baseline = signal[np.isfinite(signal)], baseline[np.isfinite(signal)]
    if not np.any(signal):
        return "none of the voltages changes"
    factor, unit = volts(signal)
    level = -10 * np.log10(np.mean(signal**2) / np.mean(baseline**2))
    return (f"the voltages change by at most {number(np.abs(signal).max() * factor)} {unit}, and the RMS of the change "
            f"lies {number(level)} dB below that of the baseline")


def largest(signal: Array) -> tuple[int, int]:
    """Pattern and reading with the largest signal of a (patterns, readings) array."""
    pattern, reading = np.unravel_index(int(np.nanargmax(np.abs(signal))), signal.shape)
    return int(pattern), int(reading)


def curves(touched_V: Array, baseline_V: Array) -> ReportFigure:
    """Voltages and signal of all patterns in a row (paper, figure 10); both (patterns, readings), V."""
    signal = touched_V - baseline_V
    figure = style.sheet(58)
    upper, lower = figure.subplots(2, 1, sharex=True)
    factor, unit = curve_panels(upper, lower, touched_V, baseline_V)
    pattern, reading = largest(signal)
    caption = (f"Under the touch {size_words(signal, baseline_V)}; the change is largest in pattern {pattern}, reading "
               f"{reading}. The largest voltage of the baseline is {number(np.nanmax(np.abs(baseline_V)) * factor)} "
               f"{unit}. Vertical lines part the drive patterns.")
    return ReportFigure("readings", figure, caption, {"readings": _table(touched_V, baseline_V)})


def curve_panels(upper: Axes, lower: Axes, touched_V: Array, baseline_V: Array) -> tuple[float, str]:
    """Draw voltages above and their signal below; the factor and the unit of the voltages."""
    signal = touched_V - baseline_V
    factor, unit = volts(touched_V)
    at = _parted(np.arange(float(touched_V.size)).reshape(touched_V.shape))
    upper.plot(at, _parted(touched_V) * factor, color=style.ACCENT, lw=0.9, label="touched")
    upper.plot(at, _parted(baseline_V) * factor, color=style.SECOND, ls="--", lw=0.9, label="untouched")
    upper.legend(loc="lower right", ncols=2, bbox_to_anchor=(1, 0.98), borderaxespad=0)
    style.label(upper, "", f"Voltage V ({unit})")
    fine, fine_unit = volts(signal)
    lower.stairs(np.nan_to_num(signal.ravel() * fine), np.arange(signal.size + 1) - 0.5, fill=True, color=style.ACCENT,
                 lw=0)
    style.label(lower, f"Reading, {touched_V.shape[1]} a pattern in drive order (–)", f"Signal ΔV ({fine_unit})")
    for axes in (upper, lower):
        _patterns(axes, touched_V.shape)
    return factor, unit


def _parted(values: Array) -> Array:
    """(patterns, readings) values in a row, with a gap after each pattern."""
    return np.column_stack([values, np.full(len(values), np.nan)]).ravel()


def _patterns(axes: Axes, shape: tuple[int, ...]) -> None:
    patterns, readings = shape
    axes.set_xlim(-1, patterns * readings)
    axes.set_xticks(np.arange(patterns + 1) * readings)
    axes.grid(False)
    axes.grid(True, axis="x")
    axes.axhline(0, color=style.GREY, lw=0.5)


def signal_map(touched_V: Array, baseline_V: Array) -> ReportFigure:
    """Signal over drive pattern and reading, both counted from 0; arrays (patterns, readings), V."""
    signal = touched_V - baseline_V
    factor, unit = volts(signal)
    top = float(np.nanmax(np.abs(signal))) * factor or 1.0
    figure = style.sheet(52, 110)
    axes = figure.subplots()
    axes.grid(False)
    patterns, readings = signal.shape
    mesh = axes.pcolormesh(np.arange(readings + 1) - 0.5, np.arange(patterns + 1) - 0.5, signal * factor,
                           cmap=style.DIVERGING, vmin=-top, vmax=top, edgecolor="face", linewidth=0.1)
    axes.invert_yaxis()
    axes.set_xticks(range(0, readings, 2))
    axes.set_yticks(range(0, patterns, 3))
    style.label(axes, "Reading of the pattern, from the electrode after the sink (–)", "Drive pattern (–)")
    figure.colorbar(mesh, ax=axes, label=f"Signal ΔV ({unit})").outline.set_linewidth(0.4)  # pyright: ignore
    energy = np.nansum(signal**2, axis=1)
    strongest = int(np.argmax(energy))
    share = energy[strongest] / energy.sum() if energy.sum() > 0 else 0.0
    caption = (f"The signal by pattern and reading. Pattern {strongest} has the largest sum of squares, "
               f"{number(100 * share, 2)} % of the whole; an even spread would give {number(100 / patterns, 2)} %.")
    grid = pd.DataFrame(signal, columns=[f"reading_{i}_V" for i in range(readings)])
    grid.insert(0, "pattern", np.arange(patterns))
    return ReportFigure("signal_map", figure, caption, {"signal_map": grid})


def _table(touched_V: Array, baseline_V: Array) -> pd.DataFrame:
    patterns, readings = touched_V.shape
    return pd.DataFrame({"pattern": np.repeat(np.arange(patterns), readings),
                         "reading": np.tile(np.arange(readings), patterns), "touched_V": touched_V.ravel(),
                         "baseline_V": baseline_V.ravel(), "signal_V": (touched_V - baseline_V).ravel()})
