"""Scores of a trained reader on labelled presses of a recording; those that it was trained on have scores of their
own."""

import time
from dataclasses import asdict
from typing import Any

import numpy as np

from eitsim.sensors.labels import Labels, unit_of
from eitsim.sensors.recording import Recording
from surrogate.model.recorded.press_model import OUTPUTS, PressModel
from surrogate.recordings.press_frames import press_of_frames
from surrogate.recordings.presses import labelled
from surrogate.statistics.coverage_check import coverage_check
from surrogate.statistics.metrics import COVERAGES, score
from touchcal.arrays import Mask
from touchcal.json_file import file_digest


def evaluate_reader(model: PressModel, recording: Recording, labels: Labels, source: str) -> dict[str, Any]:
    """Scores as JSON of what `predict` reads of the labelled presses, as `surrogate.evaluate` has them of a data
    set; 50 and 95 % intervals, which readers have not, are None.

    source: file of the labels. ValueError where no press is labelled or can be read, or no label is one that the model
    reads.
    """
    begun = time.process_time()
    table = model.predict(recording)
    predict_ms = (time.process_time() - begun) / len(table) * 1e3
    presses, known = labelled(model.presses_of(recording), labels, source)
    table = table.loc[table["touch"].isin(known.touch.tolist())]
    columns = {name: OUTPUTS.get(name, name) for name in known.names if OUTPUTS.get(name, name) in table}
    if not columns:
        raise ValueError(f"{source}: its labels are {', '.join(known.names)}, and the model reads "
                         f"{', '.join(model.labels)}. "
                         "Give one or more of these.")
    sound = table.loc[:, [*columns.values()]].notna().to_numpy().all(axis=1)
    if not sound.any():
        raise ValueError(f"{recording.source}: no labelled press can be read; the first has {table['flag'].iloc[0]}.")
    seen = model.reader.trained_on(presses)
    part = np.where(seen, "train", "new" if seen.any() else "all")
    outputs: dict[str, dict[str, Any]] = {}
    press = press_of_frames(presses, known)
    for name, column in columns.items():
        stem, _, unit = column.rpartition("_")
        value = table[column].to_numpy()
        half = np.tile(table[f"{stem}_hi90_{unit}"].to_numpy() - value, (len(COVERAGES), 1))
        target = known.values[:, known.names.index(name)]
        outputs[stem] = {one: asdict(score(target[rows], value[rows], half[:, rows], half[:, rows], unit_of(name)))
                         | {"coverage_50": None, "coverage_95": None}
                         for one in ("train", "new", "all") if (rows := sound & (part == one)).any()}
    return {"coverage_below": _below(outputs, {one: len(np.unique(press[sound & (part == one)]))
                                               for one in ("new", "all")}),
            "presses": int(press.max()) + 1, "method": "recording",
            "dataset": {"sha256": file_digest(recording.source), "rows": len(sound)},
            "scored": _scored_words(sound, [flag for flag in table["flag"] if flag],
                                    [name for name in known.names if name not in columns]),
            "fit_s": model.fit_s, "predict_ms": predict_ms, "outputs": outputs, "noise": []}


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
