"""What commands print for people."""

from pathlib import Path

import pytest

from eitsim.cli.display import show_calibration, show_images


def test_parameters_that_the_data_do_not_determine_are_said_by_group(capsys: pytest.CaptureFixture[str]) -> None:
    names = ["ln_width_factor", *(f"{group}_{k:02d}" for group in ("gain", "offset_mm", "leak_uS") for k in range(16))]
    one: dict[str, float] = {"value": 0.0, "sd": 1.0, "prior_sd": 1.0}
    few = ["offset_mm_00", "offset_mm_10"]
    open_ = ["ln_width_factor", *names[1:17], *few, *(f"leak_uS_{k:02d}" for k in range(5))]
    show_calibration({"unexplained": {}, "parameters": dict.fromkeys(names, one), "absolute_model": "refused",
                      "left_out": {}, "presses": None, "skin": None, "not_determined": open_, "reason": "why"},
                     Path("sensor.json"))
    assert ("not determined by the data: ln_width_factor, gain (all 16), offset_mm (2 of 16: 0, 10), "
            "leak_uS (5 of 16)\n") in capsys.readouterr().out


def test_notes_of_many_images_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    images = [{"line": k, "x_mm": None, "y_mm": None, "area_mm2": 1.0, "peak": 0.1, "note": f"note {k}."}
              for k in range(1, 12)]
    show_images({"frames": images, "conductance_S": 6e-4, "misfit": 1e-4, "prior": "laplace", "noise_figure": 0.5,
                 "differences": "volts", "cautions": ["one thing."]}, None)
    out = capsys.readouterr().out
    assert [f"line {k}: note {k}." in out for k in range(1, 12)] == [True] * 8 + [False] * 3
    assert "3 more lines have a note: --json holds all." in out
    assert "Mind:\n- one thing." in out
