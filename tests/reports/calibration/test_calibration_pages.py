"""Reports of every kind of card that `matcal fit` writes: they are made, hold their figures' numbers, waste no page."""

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from matcal.cli.main import app
from reports.calibration import calibration_report
from reports.document.numerals import percent

Reader = Callable[[Path], Any]
DATA = Path(__file__).parents[3] / "data_raw"
SPECIMEN = ("--specimen", DATA / "specimen.toml")
FOAM = Path(__file__).parents[3] / ".." / "shared" / "rawsamples" / "foam_leap"
# lowest ink over the height of the text, of any page but the last
LEAST_FILLED, LEAST_LAST = 0.5, 0.2


def fit(folder: Path, *arguments: object) -> Path:
    """The card of a calibration, its report next to it as card.pdf."""
    folder.mkdir(parents=True)
    card = folder / "card.json"
    words = ["fit", *arguments, "--out", card, "--report", folder / "card.pdf"]
    app([str(word) for word in words], standalone_mode=False)
    return card


def scaled(path: Path, factor: float) -> Path:
    """A second, stiffer specimen of the synthetic compression."""
    head, rows = (DATA / "uniaxial.csv").read_text().splitlines()[:3], pd.read_csv(DATA / "uniaxial.csv", skiprows=3)
    lines = [f"{strain},{stress * factor}" for strain, stress in rows.itertuples(index=False)]
    path.write_text("\n".join([*head, *lines]) + "\n")
    return path


@pytest.fixture(scope="module")
def cards(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One card of each kind, with its report."""
    folder = tmp_path_factory.mktemp("cards")
    skin = [f"conductivity={DATA / f'mts_{name}.txt'},{DATA / f'nova_{name}.txt'}" for name in ("cyclic", "stretch")]
    replicate = scaled(folder / "stiffer.csv", 1.05)
    return {
        "replicates": fit(folder / "replicates", f"uniaxial={DATA / 'uniaxial.csv'}", f"uniaxial={replicate}",
                          "--order", 3, "--predict", f"shear={DATA / 'shear.csv'}", "--stable", "drucker"),
        "skin": fit(folder / "skin", *skin, *SPECIMEN),
        "relaxation": fit(folder / "relaxation", DATA / "mts_relaxation.txt", *SPECIMEN)}


def filled(pdf: Path, folder: Path) -> list[float]:
    """Where the lowest ink above the footer stands on each page, as a share of the height of the text."""
    subprocess.run(["pdftoppm", "-r", "20", "-gray", pdf, folder / "page"], check=True)
    out = []
    for path in sorted(folder.glob("page*.pgm")):
        rows = np.asarray(Image.open(path)).min(axis=1) < 200
        text = rows[: int(0.915 * rows.size)]
        out.append(float(np.flatnonzero(text)[-1]) / text.size)
    return out


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("pdftoppm") is None, reason="pdftoppm renders the pages")
def test_no_page_is_nearly_empty(cards: dict[str, Path], tmp_path: Path) -> None:
    for name, card in cards.items():
        (tmp_path / name).mkdir()
        *pages, last = filled(card.with_suffix(".pdf"), tmp_path / name)
        assert min(pages, default=1.0) > LEAST_FILLED, (name, pages)
        assert last > LEAST_LAST, (name, last)


def test_figures_hold_the_numbers_of_the_card(cards: dict[str, Path]) -> None:
    for name, card in cards.items():
        found, files = json.loads(card.read_text()), card.with_name("card_files")
        for label, row in found["fit"].items():
            if not (isinstance(row, dict) and row.get("kind") in ("uniaxial", "conductivity")):
                continue
            drawn = pd.read_csv(files / f"{label}.csv")
            value, fitted = drawn.iloc[:, 1], drawn.filter(like="fit_").iloc[:, 0]
            assert len(drawn) == row["n"], (name, label)
            assert np.sqrt(((value - fitted) ** 2).mean()) == pytest.approx(row["rms"], rel=1e-6), (name, label)
        for figure in files.glob("*.svg"):
            assert figure.stat().st_size > 5000, (name, figure.name)


def test_replicates_predictions_and_stability_are_told(cards: dict[str, Path], read_pdf: Reader) -> None:
    card = json.loads(cards["replicates"].read_text())
    text = read_pdf(cards["replicates"].with_suffix(".pdf")).whole
    (predicted,) = card["fit"]["predicted"]
    assert f"the law of all modes misses it by {percent(predicted['relative_rms']['combined'], 3)}" in text
    free = card["fit"]["without_stability"]["relative_rms_of"]
    assert all(percent(share, 3) in text for share in free.values())
    assert percent(card["fit"]["uniaxial_1"]["stiffness_factor_sd"]) in text
    assert "violated by the record itself" in text
    further = card["fit"]["next_specimen"]["mu_0_Pa"]
    assert further["next_lo"] < further["lo"] < further["value"] < further["hi"] < further["next_hi"]
    assert "The next specimen, Pa" in text
    drawn = pd.read_csv(cards["replicates"].with_name("card_files") / "predicted_1.csv")
    measured, error = drawn["stress_Pa"], drawn["stress_Pa"] - drawn["predicted_stress_Pa"]
    share = np.sqrt((error**2).mean() / (measured**2).mean())
    assert share == pytest.approx(predicted["relative_rms"]["combined"], rel=1e-6)


def test_the_settling_of_the_skin_is_drawn(cards: dict[str, Path], read_pdf: Reader) -> None:
    card = json.loads(cards["skin"].read_text())
    text = read_pdf(cards["skin"].with_suffix(".pdf")).whole
    drawn = pd.read_csv(cards["skin"].with_name("card_files") / "conductivity_1_cycles.csv")
    row = card["fit"]["conductivity_1"]
    last = drawn["fit_resistance_rest_Ohm"].to_numpy()[-1]
    assert abs(last / row["settling_final_Ohm"] - 1) < 0.02
    assert f"resistance over {len(drawn)} cycles" in text
    assert f"{row['settling_final_Ohm'] / 1e3:.2f}" in text
    assert "Stability and export" not in text


def test_a_relaxation_alone_is_warned_of(cards: dict[str, Path], read_pdf: Reader) -> None:
    text = read_pdf(cards["relaxation"].with_suffix(".pdf")).whole
    assert "Before you use these numbers" in text
    assert "fitted without a stress-strain curve" in text
    assert "The data are synthetic" in text


@pytest.mark.thorough
@pytest.mark.skipif(not FOAM.exists(), reason="third-party files are not next to this checkout")
def test_a_real_foam_is_reported_with_the_tension_it_misses(tmp_path: Path, read_pdf: Reader) -> None:
    card = fit(tmp_path / "foam", f"uniaxial={FOAM / 'foam_leap_UC.csv'}", f"shear={FOAM / 'foam_leap_SS.csv'}",
               "--order", 3, "--predict", f"uniaxial={FOAM / 'foam_leap_UT.csv'}")
    found, text = json.loads(card.read_text()), read_pdf(card.with_suffix(".pdf")).whole
    assert "synthetic" not in text
    assert found["provenance"]["synthetic"] is False
    missed = found["fit"]["predicted"][0]["relative_rms"]["combined"]
    assert missed > 0.1
    assert "Tests kept out of the fit are missed" in text
    assert percent(missed, 3) in text


def test_what_the_record_holds_of_each_test_is_stated(cards: dict[str, Path]) -> None:
    """1963 mm2 is the disc of 50 mm that specimen.toml gives; the plain table states neither sizes nor a clock."""
    (row,) = calibration_report.report(cards["relaxation"]).tables["recorded"].rows
    assert row[1] == "ISO 3384-1"
    assert row[2] == "loaded area 1960 mm², length 20.0 mm"
    assert row[3] == "0.77"
    assert row[4:] == ["MTS TestSuite", "1"]
    rows = calibration_report.report(cards["replicates"]).tables["recorded"].rows
    assert [row[5] for row in rows] == ["2", "2"]
    assert {row[2] for row in rows} == {"not recorded"}
