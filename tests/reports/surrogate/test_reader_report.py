"""The report of a reader of presses, on synthetic presses; no skin measured."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from eitsim.sensors.labels import Labels
from eitsim.sensors.recording import Recording
from reports.surrogate.reader_report import report
from surrogate.cli.main import app
from surrogate.model.recorded.learn_presses import learn
from surrogate.model.recorded.press_model import PressModel
from surrogate.recordings import networks


@pytest.fixture(scope="module")
def model() -> PressModel:
    """Presses whose readings are smooth in place and in proportion to depth; the force says nothing."""
    rng = np.random.default_rng(0)
    place, depth = rng.uniform(-40, 40, (40, 2)), rng.uniform(5, 15, 40)
    centre = rng.uniform(-50, 50, (30, 2))
    apart = np.linalg.norm(place[:, None] - centre, axis=2)
    signal = depth[:, None] * np.exp(-(apart**2) / 1500) + 0.05 * rng.standard_normal((40, 30))
    names = np.arange(40).astype(np.str_)
    frames = Recording(signal, np.arange(40), None, names, "difference", Path("synthetic.csv"))
    labels = Labels(names, ("x_mm", "y_mm", "F_N", "depth_mm"), np.column_stack([place, np.full(40, 0.5), depth]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(networks, "MOST_STEPS", 20)
        patch.setattr(networks, "HIDDEN", (16,))
        return learn(frames, labels)


@pytest.mark.thorough
def test_the_command_writes_verdict_scores_families_and_errors(
        model: PressModel, tmp_path: Path, read_pdf: Callable[[Path], Any], drawn: list[Figure]) -> None:
    model.save(tmp_path / "model")
    done = CliRunner().invoke(app, ["report", f"{tmp_path}/model", "--out", f"{tmp_path}/reader.pdf"])
    assert done.exit_code == 0, done.output
    assert len(drawn) == 2
    text = " ".join(read_pdf(tmp_path / "reader.pdf").whole.split())
    for words in ("All labelled presses have one F_N, 0.5", "kernel ridge on place and size", "the last in time",
                  "90 % intervals"):
        assert words in text
    assert (tmp_path / "reader_files" / "map.csv").is_file()


def test_the_verdict_is_that_of_the_worse_split(model: PressModel, tmp_path: Path) -> None:
    model.save(tmp_path)
    bad = tuple(replace(one, score=replace(one.score, error=one.score.mean_error)) if one.score.split == "time" else one
                for one in model.tested)
    found = report(replace(model, tested=bad), tmp_path)
    assert {line.grade for line in found.verdict if line.what in ("Place", "depth_mm")} == {"not usable"}
    unscored = report(replace(model, tested=()), tmp_path)
    assert "scores" in unscored.absent
    assert unscored.verdict[0].grade == "not usable"
