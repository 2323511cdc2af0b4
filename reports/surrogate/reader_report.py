"""The report of a reader of recorded presses: scores on both splits, families, errors over the skin."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from eitsim.sensors.labels import unit_of
from reports.document import provenance, style
from reports.document.numerals import counted, in_figure, number, percent, typeset
from reports.document.page import Report, ReportFigure, Table
from reports.document.verdict import NOT_USABLE, SHORTFALL, Verdict, graded
from surrogate.model import store
from surrogate.model.recorded.plain_reader import PlainReader
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.recorded.reader_scores import Tested
from surrogate.recordings.scalar_reader import FAMILIES as OF_LABELS
from surrogate.recordings.touch_reader import FAMILIES
from touchcal.arrays import Array

OF_MEAN = (0.1, 0.3)  # error over that of the mean that is good, and that is usable
PLACE = "place"
NO_SCORES = "Not scored: the cautions say why."
PARTS = {"time": "the last in time", "random": "at random"}


def report(model: PressModel, model_dir: Path) -> Report:
    """Everything that the template `reader.typ` shows."""
    sources = [provenance.source(model_dir / name) for name in (store.DESCRIPTION, store.ARRAYS)]
    plates = [_map([one for one in model.tested if one.score.output == PLACE])] if _has(model, PLACE) else []
    plates += [_parity(name, [one for one in model.tested if one.score.output == name])
               for name in dict.fromkeys(one.score.output for one in model.tested) if name != PLACE]
    tables = {"families": _families(model)} | ({"scores": _scores(model.tested)} if model.tested else {})
    absent = {} if model.tested else {"scores": NO_SCORES}
    findings = [f"The reader was trained in {number(model.fit_s)} s of CPU on {_presses(model)}."]
    return Report("reader", "Reader of presses", f"{_presses(model)}, readings of the kind {model.kind}",
                  provenance.footer(sources, provenance.seed_words(model.seed)), findings, plates, tables, absent,
                  cautions=[typeset(words[0].upper() + words[1:])
                            for words in (*model.left_out, *model.reader.left_out)],
                  verdict=[*_verdict(model)])


def _has(model: PressModel, output: str) -> bool:
    return any(one.score.output == output for one in model.tested)


def _presses(model: PressModel) -> str:
    frames = f" of {counted(model.frames, 'frame')}" * (model.frames > model.presses)
    return counted(model.presses, "labelled press", "labelled presses") + frames


def _verdict(model: PressModel) -> Iterator[Verdict]:
    """Outputs by their worse split against the mean, and the intervals that hold least."""
    if not model.tested:
        yield Verdict("Any statement on errors", NOT_USABLE, "too few presses to test on")
    for name in dict.fromkeys(one.score.output for one in model.tested):
        score = max((one.score for one in model.tested if one.score.output == name),
                    key=lambda score: score.error / score.mean_error)
        yield Verdict(_title(name), graded(score.error / score.mean_error, OF_MEAN),
                      f"{number(score.error)} {score.unit} on presses {PARTS[score.split]}, where the mean has "
                      f"{number(score.mean_error)} {score.unit}")
    if model.tested:
        where = min((one.score for one in model.tested), key=lambda score: min(score.coverage))
        least = min(where.coverage)
        yield Verdict("90 % intervals", graded(0.9 - least, SHORTFALL),
                      f"hold {percent(least)} of {where.tested} presses {PARTS[where.split]}, the least of all")


def _title(output: str) -> str:
    return "Place" if output == PLACE else output


def _scores(tested: Sequence[Tested]) -> Table:
    rows = [[_title(one.output), PARTS[one.split], str(one.trained), str(one.tested), f"{number(one.error)} {one.unit}",
             number(one.ridge_error), number(one.mean_error), ", ".join(percent(part) for part in one.coverage),
             ", ".join(number(half) for half in one.half_width),
             "-" if one.in_ellipse is None else percent(one.in_ellipse)] for one in (part.score for part in tested)]
    return Table("Mean error on presses that were not trained on (of a place, the distance), and what 90 % intervals "
                 "(of a place: of x, of y) and ellipses hold.",
                 ["output", "tested", "trained", "n", "error", "kernel ridge", "mean", "in 90 %", "± 90 %", "ellipse"],
                 rows, "llrrrrrwwr")


def _families(model: PressModel) -> Table:
    rows, reader = [], model.reader
    if isinstance(reader, PlainReader):
        return _of_families([[_title(one.name), model.method, "1", f"{number(one.held_out[0])}"]
                             for one in reader.outputs])
    if place := reader.place:
        rows += _family_rows("Place", FAMILIES, place.weights, place.held_out, "mm")
    for one in reader.scalars:
        rows += _family_rows(one.name, OF_LABELS, one.weights, one.held_out, unit_of(one.name))
    return _of_families(rows)


def _of_families(rows: list[list[str]]) -> Table:
    return Table("Families of readers: their weights, and their mean errors on held-out blocks in time.",
                 ["output", "family", "weight", "error"], rows, "lwrr")


def _family_rows(output: str, names: Sequence[str], weights: Array, held_out: Array, unit: str) -> list[list[str]]:
    words = [number(weight, 2) if weight > 0 else "-" for weight in weights]
    tried = zip((*names[:len(words)], "combined", "the mean"), (*words, "", ""), held_out, strict=True)
    return [[output if not k else "", name, word, f"{number(error)} {unit}"]
            for k, (name, word, error) in enumerate(tried)]


def _map(tested: Sequence[Tested]) -> ReportFigure:
    """Errors at the places of the tested presses, a panel a split."""
    figure = style.sheet(72)
    panels = figure.subplots(1, len(tested), sharex=True, sharey=True, squeeze=False)[0]
    most = max(float(np.quantile(_distance(one), 0.95)) for one in tested)
    for axes, one in zip(panels, tested, strict=True):
        points = axes.scatter(*one.target.T, c=_distance(one), s=10, cmap=style.SEQUENTIAL, vmin=0, vmax=most,
                              linewidths=0)
        _arrows(axes, one)
        axes.set_aspect("equal")
        style.label(axes, "x (mm)", "y (mm)" if one is tested[0] else "",
                    f"{one.score.tested} presses {PARTS[one.score.split]}")
        if one is tested[-1]:
            figure.colorbar(points, ax=list(panels), label="Distance (mm)", extend="max")
    worst = max(float(_distance(one).max()) for one in tested)
    data = pd.concat([pd.DataFrame({"split": one.score.split, "x_mm": one.target[:, 0], "y_mm": one.target[:, 1],
                                    "x0_mm": one.value[:, 0], "y0_mm": one.value[:, 1]}) for one in tested])
    return ReportFigure("map", figure, f"Distance of each tested press from where it is read, at its place, with a "
                        f"line between both; the largest is {number(worst)} mm. Colours end at {number(most)} mm, "
                        "which 95 % do not pass.", {"map": data})


def _arrows(axes: Axes, one: Tested) -> None:
    for start, end in zip(one.target, one.value, strict=True):
        axes.plot(*np.stack([start, end]).T, "-", color=style.GREY, linewidth=0.4, zorder=0)


def _distance(one: Tested) -> Array:
    return np.linalg.norm(one.value - one.target, axis=1)


def _parity(name: str, tested: Sequence[Tested]) -> ReportFigure:
    """Value over label with 90 % intervals, a panel a split."""
    figure = style.sheet(52, style.HALF_WIDTH_MM if len(tested) == 1 else style.TEXT_WIDTH_MM)
    panels = figure.subplots(1, len(tested), sharex=True, sharey=True, squeeze=False)[0]
    unit, symbol = unit_of(name), name.rpartition("_")[0]
    for axes, one in zip(panels, tested, strict=True):
        axes.errorbar(one.target[:, 0], one.value[:, 0], one.half_width[:, 0], fmt="o", color=style.ACCENT,
                      ecolor=style.GREY, markersize=2.6, elinewidth=0.6)
        ends = [float(one.target.min()), float(one.target.max())]
        axes.plot(ends, ends, "--", color=style.INK, linewidth=0.8)
        style.label(axes, f"{symbol} of the label ({unit})", f"{symbol} read ({unit})" if one is tested[0] else "",
                    f"{one.score.tested} presses {PARTS[one.score.split]}")
    held = ", ".join(f"{percent(one.score.coverage[0])} {PARTS[one.score.split]}" for one in tested)
    data = pd.concat([pd.DataFrame({"split": one.score.split, f"{name}_label": one.target[:, 0], name: one.value[:, 0],
                                    f"{symbol}_half_width_{unit}": one.half_width[:, 0]}) for one in tested])
    return ReportFigure(f"parity_{name}", figure, in_figure(f"{name} as read over its label, with 90 % intervals, "
                        f"which hold {held}; dashed, where they are the same."), {f"parity_{name}": data})
