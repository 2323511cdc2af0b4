"""`surrogate learn` and `surrogate evaluate` of several touches at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from touchcal.terminal import print_json, print_table, waiting

if TYPE_CHECKING:
    from surrogate.model.recorded.set_model import SetModel, SetScore


def check_alone(labels: Path, given: Mapping[str, object]) -> None:
    """ValueError where options of single touches are given with labels of several."""
    if odd := [flag for flag, value in given.items() if value is not None]:
        raise ValueError(f"{labels} labels several touches at once, whose patterns are learnt from the recording "
                         f"alone. Leave out {', '.join(odd)}.")


def learn_several(recording: Path, labels: Path, sensor: Path | None, out: Path, as_json: bool) -> None:
    """Learn a model of several touches at once, write it and print its scores."""
    import surrogate
    from eitsim.sensors.calibration.calibration_file import read_described_sensor
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.touch_sets import read_touch_sets

    known = None if sensor is None else read_described_sensor(sensor)[0]
    frames = open_recording(recording) if known is None else open_recording(
        recording, kind=known.kind, readings=known.protocol.weights.size // known.electrodes.count)
    with waiting("learning the patterns of places"):
        model = surrogate.learn_sets(frames, read_touch_sets(labels))
    model.save(out)
    if as_json:
        print_json({"model": out, **model.described(), "fit_s": model.fit_s})
        return
    print_set_scores(model.scores)
    print(f"places: {'; '.join(model.places)}. {len(model.reader.superposition.pairs)} pairs interact.")
    for line in model.left_out:
        print(line)
    print(f"fit {model.fit_s:.1f} CPU s on {model.presses} labelled presses\nmodel: {out}")


def evaluate_several(model: SetModel, recordings: Sequence[Path], labels: Sequence[Path], as_json: bool) -> None:
    """Score a model on recordings and their labels, and print the scores."""
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.touch_sets import read_touch_sets

    if len(labels) != len(recordings):
        raise ValueError(f"{len(labels)} files of labels for {len(recordings)} recordings. Give one --labels "
                         "touches.csv for each, in the same order, whose places are the model's.")
    scores = {f"{path}, {one}": model.score(open_recording(path, kind=model.kind, readings=model.readings),
                                            read_touch_sets(one)) for path, one in zip(recordings, labels, strict=True)}
    if as_json:
        print_json({"sets": {name: asdict(one) for name, one in scores.items()}})
        return
    for name, one in scores.items():
        print(f"{name}:")
        print_set_scores([one])


def print_set_scores(scores: Iterable[SetScore]) -> None:
    """A table of scores."""
    from rich.table import Table

    table = Table("split", "trained", "tested", "all places right, %", "count right, %", "its probability, %",
                  "probability of the true places, %",
                  title="presses that were not trained on; the count's probability should be its share")
    for one in scores:
        table.add_row(one.split, str(one.trained), str(one.tested), *(f"{100 * share:.0f}" for share in (
            one.all_right, one.count_right, one.count_probability, one.true_probability)))
    print_table(table)
