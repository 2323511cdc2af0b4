"""Tutorials run as they stand, warn of nothing, and print what is true of the sensors that they simulate.

`make docs` runs them too: where MADE_TUTORIALS names the folder of its pages, what they print is read from there; that
nothing is warned of is then checked by `.ci/run`, which makes the pages."""

import os
import re
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
OUTPUT = re.compile(r"^\.\. rst-class:: sphx-glr-script-out\n\n \.\. code-block:: none\n\n((?:    .*\n|\n)*)", re.M)


def printed_on(page: str) -> str:
    """What the blocks of an example printed, of the page that sphinx-gallery made of it."""
    return "".join(textwrap.dedent(found).strip("\n") + "\n" for found in OUTPUT.findall(page))


@pytest.fixture
def printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[int], str]:
    """What the tutorial of a number prints, in a folder of its own."""
    if made := os.environ.get("MADE_TUTORIALS"):
        return lambda number: printed_on(next((ROOT / made).glob(f"{number}_*.rst")).read_text(encoding="utf-8"))
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


def test_what_is_printed_on_a_page_is_found_as_it_was_printed() -> None:
    block = ".. rst-class:: sphx-glr-script-out\n\n .. code-block:: none\n\n"
    page = (f"First\n\n{block}    a  1\n\n      b\n\n\n\n.. GENERATED\n\n.. code-block:: Python\n\n    print(3)\n\n"
            f"{block}    c\n")
    assert printed_on(page) == "a  1\n\n  b\nc\n"
    assert printed_on("Nothing.\n\n.. code-block:: none\n\n    of another kind\n") == ""


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


@pytest.mark.slow
def test_touches_that_no_sweep_held_are_read_to_a_millimetre(printed: Callable[[int], str]) -> None:
    out = printed(3)
    kept = dict(re.findall(r"^(x0|y0|F) +root mean square error ([0-9.]+) ", out, re.M))
    assert max(float(kept["x0"]), float(kept["y0"])) < 1
    assert float(kept["F"]) < 0.1
    rows = np.array(re.findall(r"^\d +" + r"([-0-9.]+) +" * 6, out, re.M), dtype=float)
    x, y, _, _, least, most = rows.T  # and no flag, which would be a word behind them
    assert np.hypot(x - [0.020, -0.030, 0.005, -0.010], y - [0.005, 0.015, -0.040, -0.025]).max() < 1e-3
    assert np.sum((least <= [0.5, 1.0, 1.5, 0.8]) & (most >= [0.5, 1.0, 1.5, 0.8])) >= 3
    assert "!" not in out


@pytest.mark.slow
def test_a_recording_says_its_order_or_asks_and_teaches_a_reader(printed: Callable[[int], str]) -> None:
    out = " ".join(printed(4).split())
    assert "in a sensor file [drive] pattern = \"adjacent\", reading = \"single-ended\"" in out  # the simulator's own
    of_time = re.search(r" time +120 +30 +place +([0-9.]+) mm .*? (\d+), (\d+) ", out)
    assert of_time
    assert float(of_time[1]) < 1
    assert min(int(of_time[2]), int(of_time[3])) > 75
    assert "predictions.csv: 150 frames, none flagged." in out


@pytest.mark.slow
def test_a_moving_touch_is_followed_from_first_to_last(printed: Callable[[int], str]) -> None:
    out = printed(6)
    states = [line.rsplit(maxsplit=1)[0].strip() for line in out.splitlines() if re.fullmatch(r" *[a-z]+ +\d+", line)]
    assert states == ["calibrating", "untouched", "touch", "untouched"]
    off_mm, held = re.findall(r"place off by ([0-9.]+) mm in the median; (\d+)%", out)[0]
    assert float(off_mm) < 0.5
    assert int(held) >= 75
    assert "!" not in out
