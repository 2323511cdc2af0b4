"""What a documented command prints by default fits a screen; `surrogate train` and `evaluate` have theirs in their own
tests."""

from collections.abc import Callable
from pathlib import Path

import pytest

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


def test_default_outputs_fit_a_screen(command: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for program, *words in [("matcal", "fit", *FIT), *AFTER]:
        done = command(program, *words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert len((done.stdout + done.stderr).splitlines()) <= SCREEN, f"{program} {words[0]}: {done.stdout}"
