"""The reports of what the programs themselves write, so that writers and readers keep one layout."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from eitsim.cli.main import app as eitsim
from matcal.cli.main import app as matcal
from reports.document.numerals import typeset

Reader = Callable[[Path], Any]
DATA = Path(__file__).parents[2] / "data_raw"
# Table 1 of the paper, and a conductivity of the order of graphite spray
CARD = {"schema": 1, "name": "Table 1",
        "hyperfoam": {"mu_Pa": [14420.0, 16780.0, -21670.0], "alpha": [0.288, 4.249, 0.741], "nu": [0.0, 0.0, 0.0],
                      "moduli": "instantaneous"},
        "conductivity": {"c0_S_per_m": 30.0, "a": [-2.0, 2.0, -1.0], "strain_range": [0.0, 0.4]}}


def call(app: Any, *arguments: object) -> None:
    app([str(a) for a in arguments], standalone_mode=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


@pytest.mark.slow
def test_a_fit_of_plain_curves_is_reported(folder: Path, read_pdf: Reader) -> None:
    call(matcal, "fit", DATA / "uniaxial.csv", DATA / "shear.csv", "--out", folder / "card.json",
         "--report", folder / "card.pdf")
    card, text = json.loads((folder / "card.json").read_text()), read_pdf(folder / "card.pdf").whole
    mu_0 = card["fit"]["derived"]["mu_0_Pa"]
    for value in (sum(card["hyperfoam"]["mu_Pa"]), mu_0["lo"], mu_0["hi"]):
        assert f"{value / 1e3:#.4g}" in text
    for row in card["provenance"]["files"]:
        assert row["sha256"] in text
    for sentence in (s.removeprefix("uniaxial_1: ").removeprefix("shear_1: ") for s in card["provenance"]["decisions"]):
        printed = typeset(sentence)
        assert " ".join(printed.split()) in text.replace("- ", "-") or printed in text, printed
    assert "Nominal stress (kPa)" in text
    assert "fitted to shear alone" in text


@pytest.mark.slow
def test_a_touch_and_a_sweep_are_reported(folder: Path, read_pdf: Reader) -> None:
    card, scene, design = folder / "table1.json", folder / "scene.toml", folder / "design.toml"
    card.write_text(json.dumps(CARD))
    scene.write_text("[punch]\nx_mm = 20\ny_mm = -10\ndiameter_mm = 14\nforce_N = 0.2\n")
    design.write_text("scenes = 2\nseed = 5\n[punch]\nx_mm = [-30, 30]\ny_mm = 0\ndiameter_mm = 14\nforce_N = 0.2\n")
    call(eitsim, "run", scene, "--card", card, "--out", folder / "touch.json", "--report", folder / "touch.pdf")
    result, text = json.loads((folder / "touch.json").read_text()), read_pdf(folder / "touch.pdf").whole
    for key in ("delta_max_mm", "sigma_max_kPa", "sigma_ave_kPa", "A_c_mm2"):
        assert f"{result[key]:#.3g}".rstrip(".") in text, key
    for decision in result["plan"]:
        assert decision["decision"] in text.replace("- ", "-")
    assert result["card"]["sha256"] in text
    call(eitsim, "sweep", design, "--card", card, "--workers", 1, "--out", folder / "sweep")
    call(eitsim, "report", folder / "sweep", "--out", folder / "sweep.pdf")
    assert "2 of 2 scenes ended ok" in read_pdf(folder / "sweep.pdf").whole
