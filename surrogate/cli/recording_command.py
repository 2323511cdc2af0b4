"""`surrogate train` and `surrogate predict` on recordings: touches learnt from recorded presses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from touchcal.terminal import print_json

if TYPE_CHECKING:
    import pandas as pd

    from surrogate.recordings.train_reader import TrainedReader


def train_recording(recording: Path, labels: Path | None, sensor: Path | None, out: Path, seed: int, workers: int,
                    as_json: bool) -> None:
    """Train on a recording, write the model, print its scores."""
    from eitsim.sensors.labels import read_labels
    from eitsim.sensors.recording import read_recording
    from eitsim.sensors.sensor_file import read_sensor
    from surrogate.recordings import reader_store
    from surrogate.recordings.train_reader import train_reader

    if labels is None or sensor is None:
        raise ValueError(f"{recording} is a recording, which needs its labels and its sensor: give --labels "
                         "touches.csv and --sensor sensor.toml.")
    known = read_sensor(sensor)
    frames = read_recording(recording, kind=known.kind, readings=len(known.protocol.weights.reshape(-1,
                            known.electrodes.count)))
    model = train_reader(frames, read_labels(labels), seed, workers)
    reader_store.save(model, out)
    if as_json:
        print_json(_described(model) | {"model": out})
    else:
        _print_trained(model)
        print(f"model: {out}")


def predict_recording(model_folder: Path, recording: Path) -> pd.DataFrame:
    """Read the touched frames of a recording."""
    from eitsim.sensors.recording import read_recording
    from surrogate.recordings import reader_store
    from surrogate.recordings.reader_table import read_touches

    model = reader_store.load(model_folder)
    return read_touches(model, read_recording(recording, kind=model.kind, readings=len(model.reader.readings.mean)))


def _described(model: TrainedReader) -> dict[str, Any]:
    from dataclasses import asdict

    from surrogate.recordings.train_reader import choice

    return {"presses": model.presses, "fit_s": model.fit_s, "choice": choice(model.reader),
            "scores": [asdict(one) for one in model.scores]}


def _print_trained(model: TrainedReader) -> None:
    from rich.console import Console
    from rich.table import Table

    from surrogate.recordings.train_reader import choice

    table = Table("split", "trained", "tested", "distance, mm", "kernel ridge, mm", "mean place, mm",
                  "x, y in 90 %", "+-90 %, mm", title="mean distance on presses that were not trained on")
    for one in model.scores:
        x, y = one.coverage
        table.add_row(one.split, str(one.trained), str(one.tested), f"{one.distance_mm:.3g}", f"{one.ridge_mm:.3g}",
                      f"{one.centre_mm:.3g}", f"{100 * x:.0f}, {100 * y:.0f}",
                      f"{one.width_mm[0]:.3g}, {one.width_mm[1]:.3g}")
    Console().print(table)
    print(f"families: {choice(model.reader)}")
    print(f"fit {model.fit_s:.1f} CPU s on {model.presses} presses")
