"""`surrogate train` and `surrogate predict` on recordings: touches learnt from recorded presses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from touchcal.terminal import print_json

if TYPE_CHECKING:
    import pandas as pd

    from surrogate.recordings.trained.train_reader import TrainedReader


def train_recording(recording: Path, labels: Path | None, sensor: Path | None, out: Path, seed: int, workers: int,
                    as_json: bool) -> None:
    """Train on a recording, write the model, print its scores."""
    from eitsim.sensors.recording import read_recording
    from eitsim.sensors.sensor_file import read_sensor
    from surrogate.recordings.labels import read_labels
    from surrogate.recordings.trained import reader_store
    from surrogate.recordings.trained.train_reader import train_reader

    if labels is None or sensor is None:
        raise ValueError(f"{recording} is a recording, which needs its labels and its sensor: give --labels "
                         "touches.csv and --sensor sensor.toml.")
    known = read_sensor(sensor)
    frames = read_recording(recording, kind=known.kind, readings=len(known.protocol.weights.reshape(-1,
                            known.electrodes.count)))
    model = train_reader(frames, read_labels(labels), seed, workers)
    reader_store.save_reader(model, out)
    if as_json:
        print_json(_described(model) | {"model": out})
    else:
        _print_trained(model)
        print(f"model: {out}")


def predict_recording(model_folder: Path, recording: Path) -> pd.DataFrame:
    """Read the touched frames of a recording."""
    from eitsim.sensors.recording import read_recording
    from surrogate.recordings.trained import reader_store
    from surrogate.recordings.trained.reader_table import read_touches

    model = reader_store.load_reader(model_folder)
    return read_touches(model, read_recording(recording, kind=model.kind, readings=model.reader.signals.channels))


def _described(model: TrainedReader) -> dict[str, Any]:
    from dataclasses import asdict

    from surrogate.recordings.trained.train_reader import choice

    return {"presses": model.presses, "fit_s": model.fit_s, "choice": choice(model.reader),
            "scores": [asdict(one.score) for one in model.tested]}


def _print_trained(model: TrainedReader) -> None:
    from rich.console import Console
    from rich.table import Table

    from surrogate.recordings.trained.train_reader import choice

    table = Table("split", "trained", "tested", "output", "error", "kernel ridge", "mean", "in 90 %", "+-90 %",
                  "in ellipse of 90 %",
                  title="mean error on presses that were not trained on; of a place, the distance; in 90 % of x, y")
    for one in (tested.score for tested in model.tested):
        table.add_row(one.split, str(one.trained), str(one.tested), one.output, f"{one.error:.3g} {one.unit}",
                      f"{one.ridge_error:.3g}", f"{one.mean_error:.3g}",
                      ", ".join(f"{100 * part:.0f}" for part in one.coverage),
                      ", ".join(f"{half:.3g}" for half in one.half_width),
                      "-" if one.in_ellipse is None else f"{100 * one.in_ellipse:.0f}")
    Console().print(table)
    for line in choice(model.reader):
        print(line)
    print(f"fit {model.fit_s:.1f} CPU s on {model.presses} presses")
