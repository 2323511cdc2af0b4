"""`surrogate train`, `evaluate` and `predict` on recordings: touches learnt from recorded presses."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from touchcal.terminal import print_json, print_table, waiting

if TYPE_CHECKING:
    import pandas as pd

    from eitsim.sensors.recording import Recording
    from surrogate.recordings.suggestion.next_presses import NextPresses
    from surrogate.recordings.trained.train_reader import TrainedReader

NO_DISC = "The body is no disc, so that no model of the sensor is used."
NO_SENSOR = ("No sensor file is given: readings are plain channels, taken as signed voltages, and no model of the "
             "sensor is used.")
SLOW = "surrogate: the presses are learnt once for the model and once a split for its scores, which takes minutes."


def train_recording(recording: Path, labels: Path | None, sensor: Path | None, simulated: Path | None,
                    suggest: int | None, out: Path, seed: int, workers: int, as_json: bool) -> None:
    """Train on a recording, write the model, print its scores, and where asked the places to press next; with fewer
    labels than can be learnt from, these places alone."""
    from eitsim.sensors.calibration.calibration_file import read_described_sensor
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.labels import PLACE, places_of, read_labels
    from surrogate.data.skin_from_above import skin_of
    from surrogate.recordings.physics.expectation import expectation_of
    from surrogate.recordings.signals import FEWEST
    from surrogate.recordings.suggestion.next_presses import next_presses
    from surrogate.recordings.trained import reader_store
    from surrogate.recordings.trained.train_reader import train_reader
    from surrogate.recordings.worth import NothingToRead

    if labels is None and suggest is None:
        raise ValueError(f"{recording} is a recording, which needs its labels: give --labels touches.csv, and --sensor "
                         "sensor.toml where it has one. Where nothing is pressed yet, give --sensor and --suggest 20, "
                         "which names the places to press first.")
    if sensor is None:
        if (suggest, simulated) != (None, None):
            raise ValueError("--suggest and --simulated need the sensor: give --sensor sensor.toml, or leave them out.")
        assert labels is not None
        _train_plain(recording, labels, out, seed, workers, as_json)
        return
    known, file_kind = read_described_sensor(sensor)
    given = read_labels(labels) if labels is not None else None
    is_disc = known.body.edge.is_round
    if not is_disc and (suggest, simulated) != (None, None):
        raise ValueError(f"--suggest and --simulated are for discs, and the body of {sensor} has the outline "
                         f"'{known.body.outline.kind}'. Leave them out.")
    if simulated is not None and given is not None and not {*PLACE} <= {*given.names}:
        raise ValueError(f"--simulated says how patterns depend on the place, and {labels} lacks {' or '.join(PLACE)}. "
                         "Add them, or leave it out.")
    expectation = expectation_of(known, simulated) if is_disc else None
    ahead = None if suggest is None else next_presses(
        known.body.radius_m * 1e3, np.empty((0, 2)) if given is None else places_of(given), suggest)
    if given is None or (ahead is not None and len(given.touch) < FEWEST):
        _write_suggested(ahead, out)
        _say_untrained(0 if given is None else len(given.touch), FEWEST, ahead, out, as_json)
        return
    frames = open_recording(recording, kind=known.kind, readings=len(known.protocol.weights.reshape(-1,
                            known.electrodes.count)))
    if not as_json and len(given.touch) >= FEWEST:
        print(SLOW, file=sys.stderr)
    try:
        with waiting("learning the presses"):
            model = train_reader(frames, given, seed, workers, expectation)
    except NothingToRead:
        _write_suggested(ahead, out)
        if not as_json:
            _print_suggested(ahead)
        raise
    if expectation is None:
        model = replace(model, left_out=(*model.left_out, NO_DISC), skin=skin_of(known.body.outline, known.electrodes))
    reader_store.save_reader(model, out)
    _write_suggested(ahead, out)
    if as_json:
        print_json(_described(model) | {"model": out, "sensor": file_kind} | _listed(ahead))
    else:
        _print_trained(model)
        print(f"sensor: {sensor}, a {file_kind}")
        print(f"model: {out}")
        _print_suggested(ahead)


def _train_plain(recording: Path, labels: Path, out: Path, seed: int, workers: int, as_json: bool) -> None:
    """Train on a recording of which no sensor is known, write the model and print its scores."""
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.labels import read_labels
    from surrogate.recordings.trained import reader_store
    from surrogate.recordings.trained.train_reader import train_reader

    frames, given = open_recording(recording), read_labels(labels)
    if not as_json:
        print(SLOW, file=sys.stderr)
    with waiting("learning the presses"):
        model = train_reader(frames, given, seed, workers)
    model = replace(model, left_out=(*model.left_out, NO_SENSOR))
    reader_store.save_reader(model, out)
    if as_json:
        print_json(_described(model) | {"model": out, "sensor": None})
    else:
        _print_trained(model)
        print(f"model: {out}")


def _write_suggested(ahead: NextPresses | None, out: Path) -> None:
    """The places to press next, if any, into the model's folder."""
    from surrogate.recordings.suggestion.next_presses import SUGGESTED
    from touchcal.whole_file import written

    if ahead is None:
        return
    out.mkdir(parents=True, exist_ok=True)
    with written(out / SUGGESTED) as file:
        file.write(ahead.table().to_csv(index=False, float_format="%.6g").encode())


def _say_untrained(labels: int, fewest: int, ahead: NextPresses | None, out: Path, as_json: bool) -> None:
    from surrogate.recordings.trained.reader_store import DESCRIPTION

    earlier = (out / DESCRIPTION).exists()
    if as_json:
        print_json({"presses": labels, "model": None, "earlier_model": out if earlier else None} | _listed(ahead))
        return
    print(f"{labels} labelled presses, and {fewest} are the fewest to learn from: no model is trained yet"
          + f"; that of an earlier training stays in {out}" * earlier)
    _print_suggested(ahead)


def _listed(ahead: NextPresses | None) -> dict[str, Any]:
    return {} if ahead is None else {"suggested": ahead.table().to_dict("records")}


def _print_suggested(ahead: NextPresses | None) -> None:
    if ahead is None:
        return
    from rich.table import Table

    from surrogate.recordings.suggestion.next_presses import SHARE, SUGGESTED

    table = Table("press", "x, mm", "y, mm", "gain, %", title="press next")
    for number, ((x, y), gain) in enumerate(zip(ahead.place, ahead.gain, strict=True), start=1):
        table.add_row(str(number), f"{x:.1f}", f"{y:.1f}", f"{100 * gain:.1f}")
    print_table(table)
    x, y = ahead.middle
    print(f"places to press next, the best first, within {100 * SHARE:.0f} % of the radius about ({x:.4g}, {y:.4g}) "
          f"mm, also in {SUGGESTED}; gain: the part of the map's variance that a press takes away after those before")


def predict_recording(model_folder: Path, recording: Path) -> pd.DataFrame:
    """Read the touched frames of a recording."""
    from surrogate.recordings.trained import reader_store
    from surrogate.recordings.trained.reader_table import read_touches

    model = reader_store.load_reader(model_folder)
    return read_touches(model, _recorded(model, recording))


def evaluate_recordings(model_folder: Path, recordings: list[Path], labels: list[Path]) -> dict[str, dict[str, Any]]:
    """Scores of each recording by its name and that of its labels, which are in the same order."""
    from eitsim.sensors.labels import read_labels
    from surrogate.recordings.trained import reader_store
    from surrogate.recordings.trained.reader_evaluation import evaluate_reader

    if len(labels) != len(recordings):
        raise ValueError(f"{model_folder} was trained on a recording, and is scored on labelled recordings: got "
                         f"{len(labels)} files of labels for {', '.join(map(str, recordings))}. Give one --labels "
                         "touches.csv for each, in the same order, with touch and any of x_mm, y_mm, d_mm, F_N, "
                         "depth_mm, z_mm.")
    model = reader_store.load_reader(model_folder)
    return {f"{path}, {one}": evaluate_reader(model, _recorded(model, path), read_labels(one), str(one))
            for path, one in zip(recordings, labels, strict=True)}


def _recorded(model: TrainedReader, path: Path) -> Recording:
    from eitsim.sensors.formats.open_file import open_recording

    return open_recording(path, kind=model.kind, readings=model.reader.signals.channels)


def _described(model: TrainedReader) -> dict[str, Any]:
    from dataclasses import asdict

    from surrogate.recordings.trained.reader_scores import found_wanting
    from surrogate.recordings.trained.train_reader import choice

    return {"presses": model.presses, "frames": model.frames, "fit_s": model.fit_s, "choice": choice(model.reader),
            "left_out": model.left_out, "scores": [asdict(one.score) for one in model.tested],
            **found_wanting(one.score for one in model.tested)}


def _print_trained(model: TrainedReader) -> None:
    from rich.table import Table

    from surrogate.recordings.press_frames import counted
    from surrogate.recordings.trained.reader_scores import wanting_words
    from surrogate.recordings.trained.train_reader import choice

    table = Table("split", "trained", "tested", "output", "error", "kernel ridge", "mean", "in 90 %", "+-90 %",
                  "in ellipse of 90 %",
                  title="mean error on presses that were not trained on, which trained and tested count; of a place, "
                        "the distance; in 90 % of x, y")
    for one in (tested.score for tested in model.tested):
        table.add_row(one.split, str(one.trained), str(one.tested), one.output, f"{one.error:.3g} {one.unit}",
                      f"{one.ridge_error:.3g}", f"{one.mean_error:.3g}",
                      ", ".join(f"{100 * part:.0f}" for part in one.coverage),
                      ", ".join(f"{half:.3g}" for half in one.half_width),
                      "-" if one.in_ellipse is None else f"{100 * one.in_ellipse:.0f}")
    print_table(table)
    for line in (*model.left_out, *choice(model.reader)):
        print(line)
    print(f"fit {model.fit_s:.1f} CPU s on {counted(model.presses, model.frames)}, without the scores")
    for caution in wanting_words(one.score for one in model.tested):
        print(f"caution: {caution}")
