"""Tutorials run as they stand, warn of nothing, and print what is true of the sensors that they simulate."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture
def printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[int], str]:
    """What the tutorial of a number prints, in a folder of its own."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    folder = Path(shutil.copytree(ROOT / "docs" / "tutorials", tmp_path / "docs" / "tutorials"))
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")  # of commands

    def run(number: int) -> str:
        (page,) = folder.glob(f"{number}_*.py")
        done = subprocess.run([sys.executable, page.name], cwd=folder, capture_output=True, text=True, timeout=500)
        assert (done.returncode, done.stderr) == (0, "")
        return done.stdout

    return run


@pytest.mark.slow
def test_a_calibrated_sensor_gives_the_ideal_ones_signal_and_an_image_of_volts(printed: Callable[[int], str]) -> None:
    out = printed(5)
    assert "absolute model: usable" in out
    off = {name: float(part) for name, part in re.findall(r"^(as read|corrected): ([0-9.]+)% of the ideal", out, re.M)}
    assert off["as read"] > 30
    assert off["corrected"] < 3
    of_read, of_corrected = out[out.index("as read: image of"):].split("corrected: image of ")
    assert of_read.startswith("as read: image of normalised\n")
    assert "the untouched frame is no uniform skin's" in of_read
    assert of_corrected == "volts\n"  # and nothing to mind
    assert "!" not in out
