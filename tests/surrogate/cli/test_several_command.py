"""Several touches at once through the commands, on a synthetic recording."""

from pathlib import Path

import numpy as np
import pandas as pd
from typer.testing import CliRunner

from eitsim.sensors.recording import Recording, write_recording
from surrogate.cli.main import app

RUN = CliRunner()


def written(folder: Path, seed: int) -> tuple[Path, Path]:
    """A recording of presses of three places and its labels, a row a place that is pressed."""
    rng = np.random.default_rng(seed)
    down = np.array([*np.eye(3, dtype=int), [1, 1, 0], [0, 1, 1], [1, 1, 1]])[rng.integers(6, size=60)]
    frames = 10 + 0.05 * rng.standard_normal((120, 12))
    frames[1::2] += down @ np.random.default_rng(7).standard_normal((3, 12))
    touch = np.array(["" if row % 2 == 0 else f"t{row}" for row in range(120)], np.str_)
    recording, labels = folder / f"frames{seed}.csv", folder / f"touches{seed}.csv"
    write_recording(Recording(frames, np.arange(120), None, touch, "voltage", recording), recording)
    rows = [f"t{2 * row + 1},{'ABC'[place]}" for row in range(60) for place in np.flatnonzero(down[row])]
    labels.write_text("\n".join(["touch,place", *rows]) + "\n")
    return recording, labels


def test_places_are_learnt_predicted_and_scored(tmp_path: Path) -> None:
    (recording, labels), (new, new_labels) = written(tmp_path, 1), written(tmp_path, 2)
    model, out = str(tmp_path / "model"), tmp_path / "predictions.csv"
    learnt = RUN.invoke(app, ["learn", str(recording), "--labels", str(labels), "--out", model])
    assert learnt.exit_code == 0, learnt.output
    assert "places: A; B; C" in learnt.output
    predicted = RUN.invoke(app, ["predict", model, str(new), "--out", str(out)])
    assert predicted.exit_code == 0
    assert "60 presses" in predicted.output
    table = pd.read_csv(out)
    assert {"touch", "count", "count_probability", "places", "p_A", "flag"} <= {*table.columns}
    assert len(table) == 60
    scored = RUN.invoke(app, ["evaluate", model, str(new), "--labels", str(new_labels), "--json"])
    assert '"all_right": 1.0' in scored.output


def test_what_reads_one_touch_a_frame_says_why_it_does_not_take_such_a_model(tmp_path: Path) -> None:
    recording, labels = written(tmp_path, 1)
    model = str(tmp_path / "model")
    RUN.invoke(app, ["learn", str(recording), "--labels", str(labels), "--out", model])
    for words in (["live", model, "-"], ["report", model, "--out", str(tmp_path / "report.pdf")]):
        assert "several touches" in str(RUN.invoke(app, words).exception)
    assert "--method" in str(RUN.invoke(app, ["learn", str(recording), "--labels", str(labels), "--out", model,
                                              "--method", "ridge"]).exception)
