"""Scores of what was read of labelled presses of a recording, by a model or by anything that gives intervals; presses
that a model was trained on have scores of their own. The verdict is on frames without a flag."""

import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from eitsim.sensors.labels import NAMES, PLACE, Labels, unit_of
from eitsim.sensors.recording import Recording
from surrogate.model.recorded.press_model import OUTPUTS, PressModel
from surrogate.recordings.press_frames import press_of_frames
from surrogate.recordings.presses import Presses, labelled, presses_of
from surrogate.recordings.worth import distance
from surrogate.statistics.calibration import LEVELS, expected_coverage, random_point_coverage, rank_histogram
from surrogate.statistics.coverage_check import coverage_check
from surrogate.statistics.metrics import COVERAGES, score
from touchcal.arrays import Array, Index, Mask
from touchcal.csv_numbers import DEAD, csv_rows
from touchcal.errors import InputFileError
from touchcal.json_file import file_digest

ENDS = ("lo90", "hi90")  # of an interval, in the names of columns


def evaluate_reader(model: PressModel, recording: Recording, labels: Labels, source: str) -> dict[str, Any]:
    """Scores as JSON of what `predict` reads of the labelled presses, as `surrogate.evaluate` has them of a data
    set; 50 and 95 % intervals, which readers have not, are None.

    source: file of the labels. ValueError where no press is labelled or can be read, or no label is one that the model
    reads.
    """
    begun = time.process_time()
    lost: list[str] = []
    table = model.predict(recording, lost.append)
    predict_ms = (time.process_time() - begun) / len(table) * 1e3
    presses, known = labelled(model.presses_of(recording), labels, source)
    scores = _scored(table, recording, presses, known, source, model.reader.trained_on(presses))
    return (scores | {"scored": "; ".join(filter(None, (scores["scored"], *lost))), "method": "recording",
                      "fit_s": model.fit_s, "predict_ms": predict_ms})


def read_predictions(path: Path) -> pd.DataFrame:
    """A CSV of predictions, all cells text; InputFileError where it has no rows, or one of another width."""
    (_, names), *rows = csv_rows(path, "one row a touched frame") or [(1, [""])]
    if not rows:
        raise InputFileError(path, "it holds no predictions. Give names of columns and a row a touched frame.")
    for line, cells in rows:
        if len(cells) != len(names):
            raise InputFileError(path, f"{len(cells)} cells under {len(names)} names. Give one a column.", line=line)
    return pd.DataFrame([cells for _, cells in rows], columns=names)


def evaluate_predictions(table: pd.DataFrame, recording: Recording, labels: Labels, source: str) -> dict[str, Any]:
    """The same of a table of predictions from elsewhere, a row a touched frame: `touch`, values and ends of intervals
    as `predict` names them, and a `flag` where there is one; ValueError as above, and where a column is missing,
    a cell is no number, or a value has no interval."""
    if "touch" not in table:
        raise ValueError("the predictions have no column touch, which names what each row reads. Add it.")
    presses, known = labelled(presses_of(recording), labels, source)
    flags = table["flag"].astype(object).fillna("") if "flag" in table else ""
    table = table.assign(touch=table["touch"].astype(str), flag=flags)
    asked = pd.DataFrame({"touch": presses.name}).assign(frame=lambda one: one.groupby("touch").cumcount())
    table = asked.merge(table.assign(frame=table.groupby("touch").cumcount()), "left", ["touch", "frame"],
                        indicator="found")
    if lacking := table.loc[table["found"] != "both", "touch"].tolist():
        raise ValueError(f"the predictions lack a row of touch {lacking[0]}, which is labelled. Give a row a touched "
                         "frame.")
    return (_scored(table, recording, presses, known, source, np.zeros(len(table), bool))
            | {"method": "predictions", "fit_s": 0.0, "predict_ms": 0.0})


def _scored(table: pd.DataFrame, recording: Recording, presses: Presses, known: Labels, source: str,
            seen: Mask) -> dict[str, Any]:
    """Scores of the rows of a table that are labelled."""
    table = table.loc[table["touch"].isin(known.touch.tolist())]
    columns = {name: OUTPUTS.get(name, name) for name in known.names if OUTPUTS.get(name, name) in table}
    if not columns:
        reads = [one for one in NAMES if OUTPUTS.get(one, one) in table]
        raise ValueError(f"{source}: its labels are {', '.join(known.names)}, and the model reads {', '.join(reads)}. "
                         "Give one or more of these.")
    values = {column: _numbers(table, column) for column in columns.values()}
    sound = np.all([np.isfinite(one) for one in values.values()], axis=0)
    if not sound.any():
        raise ValueError(f"{recording.source}: no labelled press can be read; the first has {table['flag'].iloc[0]}.")
    part = np.where(seen, "train", "new" if seen.any() else "all")
    press = press_of_frames(presses, known)
    outputs: dict[str, dict[str, Any]] = {}
    each: dict[str, tuple[Array, ...]] = {}
    for name, column in columns.items():
        target, value = known.values[:, known.names.index(name)], values[column]
        below, above = _ends(table, column, value)
        stem = column.rpartition("_")[0]
        each[stem] = target, value, below, above
        below, above = (np.tile(one, (len(COVERAGES), 1)) for one in (below, above))
        outputs[stem] = {one: asdict(score(target[rows], value[rows], below[:, rows], above[:, rows], unit_of(name)))
                         | {"coverage_50": None, "coverage_95": None}
                         for one in ("train", "new", "all") if (rows := sound & (part == one)).any()}
    flagged = (table["flag"] != "").to_numpy()
    return {"coverage_below": _below(outputs, {one: len(np.unique(press[sound & (part == one)]))
                                               for one in ("new", "all")}),
            "presses": int(press.max()) + 1,
            "dataset": {"sha256": file_digest(recording.source), "rows": len(sound)},
            "scored": _scored_words(sound, [flag for flag in table["flag"] if flag],
                                    [name for name in known.names if name not in columns]),
            "outputs": outputs, "noise": [], "verdict": _verdict(each, sound & ~seen, flagged, press)}


def _numbers(table: pd.DataFrame, column: str) -> Array:
    """(n,) numbers of a column, NaN where a cell is empty; ValueError where one is no number."""
    out = np.full(len(table), np.nan)
    for row, (touch, cell) in enumerate(zip(table["touch"], table[column], strict=True)):
        if str(cell).lower() not in DEAD:
            try:
                out[row] = float(cell)
            except ValueError:
                raise ValueError(f"the predictions have '{cell}' as {column} of touch {touch}. Give a number, or an "
                                 "empty cell where nothing is read.") from None
    return out


def _ends(table: pd.DataFrame, column: str, value: Array) -> tuple[Array, Array]:
    """(n,) how far the 90 % interval of a column reaches below and above its values (n,)."""
    stem, _, unit = column.rpartition("_")
    for end in ENDS:
        if f"{stem}_{end}_{unit}" not in table:
            raise ValueError(f"the predictions have {column} and no {stem}_{end}_{unit}. Give both ends of its 90 % "
                             "interval.")
    names = [f"{stem}_{end}_{unit}" for end in ENDS]
    low, high = (_numbers(table, name) for name in names)
    if len(wrong := np.flatnonzero(np.isfinite(value) & ~(low <= high))):
        raise ValueError(f"the predictions have {column} of touch {table['touch'].iloc[wrong[0]]} and no interval from "
                         f"{names[0]} up to {names[1]}. Give both ends of its 90 % interval, the lower one first.")
    return value - low, high - value


def _verdict(each: Mapping[str, tuple[Array, ...]], unseen: Mask, flagged: Mask,
             press: Index) -> dict[str, Any] | None:
    """Whether intervals hold on unseen frames without a flag, by a binomial test at the number of their presses, and
    diagnostics of them; None where no unseen frame is without a flag."""
    rows = unseen & ~flagged
    if not rows.any():
        return None
    presses = len(np.unique(press[rows]))
    outputs = {}
    for name, parts in each.items():
        target, value, below, above = (one[rows] for one in parts)
        error, half = target - value, np.where(target > value, above, below)
        check = coverage_check(float(np.mean((-error <= below) & (error <= above))), presses, checks=len(each))
        outputs[name] = {"coverage_90": check.measured, "chance": check.chance, "holds": not check.too_low,
                         "half_width_90": float((below + above).mean() / 2),
                         "expected_coverage": expected_coverage(target, value, half),
                         "ranks": rank_histogram(target, value, half)}
    found: dict[str, Any] = {"holds": all(one["holds"] for one in outputs.values()), "presses": presses,
                             "frames": int(rows.sum()), "flagged": float(flagged[unseen].mean()),
                             "levels": [*LEVELS], "outputs": outputs}
    place = [each[name] for name in (OUTPUTS[one].rpartition("_")[0] for one in PLACE) if name in each]
    if len(place) == len(PLACE):
        target, value, below, above = (np.stack(parts, axis=1)[rows] for parts in zip(*place, strict=True))
        found |= {"distance_mm": distance(value, target),
                  "random_points": random_point_coverage(target, value, (below + above) / 2)}
    return found


def _below(outputs: dict[str, dict[str, Any]], presses: dict[str, int]) -> list[dict[str, Any]]:
    """Of which outputs the 90 % intervals hold surely less, on so many presses of each part."""
    scored = [(name, one, parts[one]["coverage_90"]) for name, parts in outputs.items()
              for one in presses if one in parts]
    checks = [(name, one, coverage_check(held, presses[one], checks=len(scored))) for name, one, held in scored]
    return [{"output": name, "part": one} | asdict(check) for name, one, check in checks if check.too_low]


def _scored_words(sound: Mask, flags: list[str], unread: list[str]) -> str:
    """What to know of the scores; empty where there is nothing."""
    words = []
    if not sound.all():
        words.append(f"{np.sum(~sound)} of {len(sound)} frames have no value and are left out")
    if flags:
        words.append(f"{len(flags)} of {len(sound)} frames are flagged, the first: {flags[0]}")
    if unread:
        words.append(f"labels that the model does not read: {', '.join(unread)}")
    return "; ".join(words)
