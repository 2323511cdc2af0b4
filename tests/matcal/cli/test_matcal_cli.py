"""Command line: what fit leaves behind, predict and check on a card, exit status and plain errors."""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pypdf import PdfReader

from matcal.card import MaterialCard, read_card, write_card
from matcal.cli.main import app
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.posterior import ensembles as sampler
from matcal.posterior.draws import read_draws
from touchcal.terminal import run

DATA = Path(__file__).parents[3] / "data_raw"
TABLE_1 = MaterialCard("Table 1", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0]),
                       Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672]),
                       Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))


@pytest.fixture
def matcal(monkeypatch, capsys):
    """Runs a command line; (exit status, standard output, standard error)."""

    def call(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["matcal", *map(str, words)])
        try:
            run(app, "matcal")
            status = 0
        except SystemExit as stop:
            status = int(stop.code or 0)
        out = capsys.readouterr()
        return status, out.out, out.err

    return call


@pytest.fixture
def card(tmp_path: Path) -> Path:
    write_card(TABLE_1, tmp_path / "table1.json")
    return tmp_path / "table1.json"


def test_fit_leaves_a_card_and_its_data(matcal, tmp_path: Path) -> None:
    out = tmp_path / "foam.json"
    (tmp_path / "foam.d").mkdir()
    (tmp_path / "foam.d" / "old.parquet").write_text("from an earlier fit")
    status, text, _ = matcal("fit", DATA / "uniaxial.csv", DATA / "shear.csv", "--order", 3, "--out", out, "--verbose")
    assert status == 0
    assert "mu_0_Pa" in text
    assert "not corrected for" in text
    made = read_card(out)
    assert made.hyperfoam is not None
    assert made.hyperfoam.moduli == "longterm"
    assert {"rms", "relative_rms", "r2", "n", "weight"} <= made.fit["uniaxial_1"].keys()
    assert made.fit["derived"]["mu_0_Pa"]["lo"] < 9790 < made.fit["derived"]["mu_0_Pa"]["hi"]
    assert set(made.fit["cross_prediction"]["shear"]["relative_rms"]) == {"uniaxial", "shear"}
    assert [f["name"] for f in made.provenance["files"]] == ["uniaxial.csv", "shear.csv"]
    assert all(len(f["sha256"]) == 64 for f in made.provenance["files"])
    assert made.stability["drucker"]["uniaxial"]["stable"] is False
    assert sorted(p.name for p in (tmp_path / "foam.d").iterdir()) == ["bands.parquet", "decisions.json",
                                                                      "shear_1.parquet", "uniaxial_1.parquet"]
    table = pd.read_parquet(tmp_path / "foam.d" / "uniaxial_1.parquet")
    assert {"strain", "stress_Pa", "fit_stress_Pa", "longterm_stress_Pa"} <= set(table)
    error = table["fit_stress_Pa"] - table["stress_Pa"]
    assert np.sqrt((error**2).mean()) == pytest.approx(made.fit["uniaxial_1"]["rms"], rel=1e-9)


def test_json_is_one_object_and_options_arrive(matcal, tmp_path: Path) -> None:
    chosen = ("--order", 2, "--residual", "absolute", "--weight", "shear=3", "--poisson", 0.1)
    status, text, _ = matcal("fit", DATA / "uniaxial.csv", f"shear={DATA / 'shear.csv'}", *chosen, "--out",
                             tmp_path / "c.json", "--json")
    found = json.loads(text)
    assert status == 0
    assert len(found["hyperfoam"]["mu_Pa"]) == 2
    assert found["hyperfoam"]["nu"] == [0.1, 0.1]
    assert found["fit"]["shear_1"]["weight"] == 0.75


@pytest.mark.thorough
def test_an_unfinished_posterior_is_saved_and_ends_with_status_3(matcal, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(sampler, "MOST_STEPS", 100)
    monkeypatch.setattr(sampler, "CHUNK", 100)
    out = tmp_path / "c.json"
    status, text, error = matcal("fit", DATA / "uniaxial.csv", DATA / "shear.csv", "--order", 3, "--posterior",
                                 "--seed", 5, "--out", out)
    assert status == 3
    assert "autocorrelation times" in error
    assert "posterior" in text
    made = read_card(out)
    assert made.posterior["checks"]["converged"] is False
    assert made.provenance["seed"] == 5
    assert len(read_draws(out)) == made.posterior["n"]
    for words in (("uniaxial", "--strain=-0.3"), ("shear", "--strain=0.3")):
        found = json.loads(matcal("predict", out, *words, "--json")[1])
        assert found["stress_lo_Pa"][0] < found["stress_Pa"][0] < found["stress_hi_Pa"][0]
    (tmp_path / "c.d" / "posterior.nc").unlink()
    status, text, error = matcal("predict", out, "shear", "--strain=0.3", "--json")
    assert status == 0
    assert "stress_lo_Pa" not in json.loads(text)
    assert "no band" in error


def test_predict_takes_the_fitted_range_and_says_what_lies_beyond(matcal, tmp_path: Path) -> None:
    out = tmp_path / "card.json"
    matcal("fit", DATA / "uniaxial.csv", DATA / "shear.csv", "--order", "2", "--out", out)
    status, text, error = matcal("predict", out, "uniaxial", "--json")
    strain = json.loads(text)["strain"]
    assert (status, error, round(strain[0], 3), round(strain[-1], 3)) == (0, "", -0.8, -0.01)
    said = matcal("predict", out, "uniaxial", "--strain=-0.95")[2]
    assert f"fitted from {strain[0]:.4g} to {strain[-1]:.4g}, the farthest is 0.15 outside" in said
    assert "no planar test was fitted" in matcal("predict", out, "planar", "--strain=-0.1")[2]
    assert "Give --strain A,B" in matcal("predict", out, "planar")[2]
    assert "no finite stress_Pa" in matcal("predict", out, "uniaxial", "--strain=1e300")[2]
    assert "no such file" in matcal("predict", tmp_path / "none.json", "uniaxial")[2]


def test_predict_gives_every_mode(matcal, card: Path) -> None:
    for mode, at, key, value in (("uniaxial", "--strain=-0.1", "stress_Pa", -1611.949),
                                 ("shear", "--strain=0.5", "stress_Pa", 6092.268),
                                 ("volumetric", "--strain=1", "stress_Pa", 0.0),
                                 ("relaxation", "--time=0", "normalised_stress", 1.0),
                                 ("conductivity", "--strain=0.4", "conductivity_S_per_m", 13.68)):
        status, text, _ = matcal("predict", card, mode, at, "--json")
        assert status == 0
        assert json.loads(text)[key][0] == pytest.approx(value, rel=1e-6, abs=1e-9)
    assert matcal("predict", card, "planar", "--strain=0.1,0.2")[0] == 0


def test_check_says_where(matcal, card: Path) -> None:
    found = json.loads(matcal("check", card, "--json")[1])
    assert set(found) == {"drucker", "elliptic"}
    assert found["drucker"]["uniaxial"]["unstable_strain"][0][1] == pytest.approx(-0.306, abs=1e-3)
    printed = matcal("check", card)[1]
    assert "biaxial" in printed
    assert "Neither criterion implies the other." in printed


@pytest.mark.parametrize(("words", "named"), [
    (("predict", "CARD", "torsion", "--strain=1"), "torsion"), (("predict", "CARD", "shear", "--time=1"), "--strain"),
    (("predict", "CARD", "shear", "--strain=a"), "'a'"), (("predict", "none.json", "shear", "--strain=1"), "none.json"),
    (("fit", "none.csv"), "none.csv"), (("fit", "UNIAXIAL", "--order", "x"), "--order"),
    (("fit", "UNIAXIAL", "--weight", "shear"), "KIND=W"), (("fit", "UNIAXIAL", "--stable", "hill"), "drucker"),
    (("fit", "UNIAXIAL", "--residual", "cubed"), "relative"), (("fit", "UNIAXIAL", "--poisson", "0.7"), "0.7"),
    (("fit", "twist=UNIAXIAL"), "twist"), (("export", "CARD"), "export")])
def test_bad_usage_ends_with_status_2_and_a_plain_sentence(matcal, card: Path, tmp_path: Path, words, named) -> None:
    places = {"CARD": str(card), "UNIAXIAL": str(DATA / "uniaxial.csv")}
    filled = [w.replace("UNIAXIAL", places["UNIAXIAL"]).replace("CARD", places["CARD"]) for w in words]
    if words[0] == "fit":
        filled += ["--out", str(tmp_path / "x.json")]
    status, _, error = matcal(*filled)
    assert status == 2
    assert named in error
    assert "Traceback" not in error
    assert not (tmp_path / "x.json").exists()
    assert not list(tmp_path.glob("*.part"))


def test_parts_that_a_card_lacks_are_named(matcal, tmp_path: Path) -> None:
    write_card(MaterialCard("bare"), tmp_path / "bare.json")
    for words in (("check",), ("predict", "uniaxial", "--strain=-0.1"), ("predict", "relaxation", "--time=1"),
                  ("predict", "conductivity", "--strain=0.1")):
        status, _, error = matcal(words[0], tmp_path / "bare.json", *words[1:])
        assert status == 2
        assert "bare" in error
        assert "matcal fit" in error


def test_two_cards_are_compared_in_standard_deviations(matcal, card: Path, tmp_path: Path) -> None:
    one, other = (MaterialCard(name, TABLE_1.hyperfoam, TABLE_1.prony, fit={"derived": {
        "mu_0_Pa": {"value": 9530.0 + more, "sd": sd, "lo": 0.0, "hi": 1.0},
        "plateau_Pa": {"value": 4000.0 + more, "sd": sd, "lo": 0.0, "hi": 1.0}}})
        for name, more, sd in (("one", 0.0, 30.0), ("other", 125.0, 40.0)))
    paths = tmp_path / "a.json", tmp_path / "b.json"
    for made, path in zip((one, other), paths, strict=True):
        write_card(made, path)
    status, text, _ = matcal("compare", *paths, "--json")
    found = {row["name"]: row for row in json.loads(text)}
    assert status == 0
    assert found["plateau_Pa"]["sds"] == pytest.approx(125 / 50)
    assert found["g_infinity"]["sds"] is None
    out = tmp_path / "both.pdf"
    status, text, _ = matcal("compare", *paths, "--out", out)
    assert status == 0
    assert "4000 +- 30" in text
    assert "4125 +- 40" in text
    assert out.is_file()
    words = " ".join("".join(page.extract_text() for page in PdfReader(out).pages).split())
    assert "not usable largest difference 2.5 standard deviations, in plateau stress at 40 % strain" in words
    drawn = pd.read_csv(tmp_path / "both_files" / "curves.csv")
    assert set(drawn["card"]) == {"a", "b"}
    assert "conductivity" not in set(drawn["kind"])


def test_cards_that_cannot_be_compared_are_refused(matcal, card: Path, tmp_path: Path) -> None:
    write_card(MaterialCard("skin", conductivity=TABLE_1.conductivity), tmp_path / "skin.json")
    write_card(MaterialCard("foam", TABLE_1.hyperfoam), tmp_path / "foam.json")
    write_card(MaterialCard("fast", Hyperfoam([9530.0], [2.0], [0.0], "instantaneous")), tmp_path / "fast.json")
    for first, words in (("skin", "no fitted part in common"), ("fast", "instantaneous and longterm")):
        status, _, error = matcal("compare", tmp_path / f"{first}.json", tmp_path / "foam.json", "--out",
                                  tmp_path / "no.pdf")
        assert status == 2
        assert words in error
        assert not (tmp_path / "no.pdf").exists()
