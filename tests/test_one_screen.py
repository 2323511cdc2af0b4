"""What a documented command prints by default fits a screen; `surrogate train` and `evaluate` have theirs in their own
tests."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from eitsim.sweeps.run import forecast
from matcal.posterior import ensembles

SCREEN = 40
ROOT = Path(__file__).parents[1]
RAW = ROOT / "data_raw"
FIT = [RAW / "mts_uniaxial.txt", RAW / "mts_shear.txt", RAW / "mts_relaxation.txt",
       f"conductivity={RAW / 'mts_stretch.txt'},{RAW / 'nova_stretch.txt'}", "--specimen", RAW / "specimen.toml",
       "--posterior", "--seed", "1", "--out", "card.json"]
AFTER = [("matcal", "check", "card.json"), ("matcal", "inspect", RAW / "mts_uniaxial.txt"),
         ("matcal", "predict", "card.json", "uniaxial", "--strain=-0.4"), ("matcal", "predict", "card.json", "shear"),
         ("matcal", "export", "card.json", "--to", "abaqus", "--out", "card.inp"),
         ("eitsim", "plan", ROOT / "examples" / "scene.toml", "--card", "card.json"),
         ("eitsim", "plan", ROOT / "examples" / "two_touches.toml", "--card", "card.json"),
         ("eitsim", "plan", ROOT / "examples" / "design.toml", "--card", "card.json"),
         ("eitsim", "run", ROOT / "examples" / "scene.toml", "--card", "card.json")]


@pytest.mark.thorough
def test_default_outputs_fit_a_screen(command: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Short chains, and a forecast by one row, print as many lines as long ones and by many."""
    monkeypatch.setenv("COLUMNS", "80")
    for name, value in {"CHUNK": 120, "_COOLING_STEPS": 8, "RHAT": 10.0, "ESS": 1.0, "TIMES": 0.0}.items():
        monkeypatch.setattr(ensembles, name, value)
    monkeypatch.setattr(forecast, "SAMPLED", 1)
    for program, *words in [("matcal", "fit", *FIT), *AFTER]:
        done = command(program, *words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert len((done.stdout + done.stderr).splitlines()) <= SCREEN, f"{program} {words[0]}: {done.stdout}"


def test_eight_laws_of_a_silicone_fit_a_screen_and_its_table_without_a_clock_is_named(
        command: Callable, tmp_path: Path) -> None:
    """A dynamic test gives the series here, which corrects no curve without a clock."""
    stretch, pulse = np.linspace(1, 4, 40), np.geomspace(0.1, 100, 16) * 2 * np.pi
    stress = 25e3 * (stretch - stretch**-2) + 40 * (stretch**4 - stretch**-3)
    storage, loss = 0.12e6 - 0.02e6 / (1 + (0.1 * pulse)**2), 0.002e6 * pulse / (1 + (0.1 * pulse)**2)
    np.savetxt(tmp_path / "tension.csv", np.c_[stretch, stress], "%.7g", ",", comments="",
               header="stretch (-),stress (Pa)")
    np.savetxt(tmp_path / "dma.csv", np.c_[pulse / (2 * np.pi), storage, loss], "%.7g", ",", comments="",
               header="Frequency (Hz),Storage modulus (Pa),Loss modulus (Pa)")
    done = command("matcal", "fit", "tension.csv", "dma=dma.csv", "--law", "auto", "--out", "card.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) <= SCREEN, done.stdout
    assert "uniaxial_1 has no clock" in done.stdout
    assert "5 laws of less weight left out" in done.stdout


def test_images_of_a_recording_fit_a_screen(capsys: pytest.CaptureFixture[str]) -> None:
    from eitsim.cli.display import show_images

    images = [{"line": n, "x_mm": None, "y_mm": None, "area_mm2": 1.0, "peak": 2.0, "note": "no place"}
              for n in range(2, 102)]
    show_images({"frames": images, "misfit": None, "differences": "given", "prior": "laplace", "noise_figure": 0.5,
                 "cautions": ["a", "b"]}, None)
    printed = capsys.readouterr().out
    assert len(printed.splitlines()) <= SCREEN
    assert "84 more lines and 92 more notes: --json holds all." in printed
