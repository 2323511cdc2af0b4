import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from matcal.card import MaterialCard, write_card
from matcal.fitting.hyperfoam.curves import weigh, with_history
from matcal.fitting.hyperfoam.hyperfoam_fit import modelled
from matcal.laws.conductivity import Conductivity, conductivity
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.laws.stability import stability
from matcal.posterior.drawn_laws import stress_band
from matcal.posterior.draws import Draws, foam_draws, write_draws
from matcal.record.bands import stress_bands
from matcal.reduction.experiment import Experiment
from reports.calibration import calibration_report
from reports.calibration.calibration_report import write
from reports.calibration.card_record import Test
from reports.calibration.stress_figures import StatedLaw, along_history
from reports.document.page import write_pdf
from reports.document.style import house
from touchcal.errors import InputFileError

Reader = Callable[[Path], Any]
LAW = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3), "longterm",
                {"uniaxial": (-0.8, 0.0), "shear": (0.0, 1.0)})
PRONY = Prony(np.array([0.1505, 0.1696, 0.0611]), np.array([0.2936, 5.85, 81.672]))
SKIN = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
WEAK = Hyperfoam(np.array([9530.0]), np.array([2.0]), np.zeros(1))


def rms(residual: np.ndarray, value: np.ndarray) -> float:
    return float(np.sqrt(np.mean(residual**2) / np.mean(value**2)))


def reduced(kind: str) -> pd.DataFrame:
    """A synthetic reduced test: the law along the test's history and a deterministic wiggle of 1 % on it."""
    if kind == "conductivity":
        strain = np.linspace(0, 0.4, 40)
        fitted = conductivity(SKIN, strain)
        return pd.DataFrame({"strain": strain, "conductivity_S_per_m": fitted * (1 + 0.01 * np.sin(40 * strain)),
                             "fit_conductivity_S_per_m": fitted, "time_s": 100 * strain})
    time = {"relaxation": np.r_[np.linspace(0, 1, 40), np.geomspace(1.02, 180, 60)]}.get(kind, np.linspace(0, 192, 60))
    strain = {"uniaxial": -0.8 * time / 192, "shear": time / 192, "relaxation": -0.8 * np.minimum(time, 1.0)}[kind]
    mode = "uniaxial" if kind == "relaxation" else kind
    fitted = along_history(LAW, PRONY, Test("x", mode, strain, strain, None, time))
    return pd.DataFrame({"strain": strain, "stress_Pa": fitted * (1 + 0.01 * np.sin(time)), "fit_stress_Pa": fitted,
                         "time_s": time})


def fit_part(tables: dict[str, pd.DataFrame]) -> dict[str, Any]:
    part: dict[str, Any] = {}
    for label, table in tables.items():
        value, fitted = table.iloc[:, 1].to_numpy(), table.iloc[:, 2].to_numpy()
        part[label] = {"kind": label[:-2], "n": len(table), "weight": 0.5, "unit": "Pa", "source": [f"{label}.txt"],
                       "rms": float(np.std(value - fitted)), "relative_rms": rms(value - fitted, value), "r2": 0.999}
    alone = {"mu_Pa": WEAK.mu_Pa, "alpha": WEAK.alpha, "nu": WEAK.nu}
    part["derived"] = {"mu_0_Pa": {"value": 9530.0, "sd": 70.0, "lo": 9390.0, "hi": 9670.0, "sd_from_order": 1.0}}
    part["parameters"] = {"mu_0_Pa": {"value": 9530.0, "stderr": 7.0}, "mu_1_Pa": {"value": 14420.0, "stderr": 2500.0},
                          "alpha_1": {"value": 0.288, "stderr": None}}
    part["orders"] = [{"order": 2, "rms": 0.074, "bic": -2088.0, "confluence": ""},
                      {"order": 3, "rms": 0.0181, "bic": -5071.0, "confluence": ""}]
    part["cross_prediction"] = {"uniaxial": alone | {"relative_rms": {"uniaxial": 0.0123, "shear": 0.456}},
                                "shear": alone | {"relative_rms": {"uniaxial": 78.9, "shear": 0.0111}}}
    part["prony"] = {"g_sd": [0.003, 0.001, 0.004], "tau_sd_s": [0.008, 0.04, 5.0]}
    part["conductivity"] = {"chi_square": 113.67, "freedom": 98, "c0_sd_S_per_m": 0.01, "a_sd": [0.03, 0.2, 0.4]}
    return part


@pytest.fixture(scope="module")
def unstable() -> dict[str, Any]:
    return stability(LAW)


@pytest.fixture
def card_path(tmp_path: Path, unstable: dict[str, Any]) -> Path:
    """A synthetic card with every part but a posterior, in the layout of `matcal fit`."""
    kinds = ("uniaxial", "shear", "relaxation", "conductivity")
    tables = {f"{kind}_1": reduced(kind) for kind in kinds}
    folder = tmp_path / "card.d"
    folder.mkdir()
    for label, table in tables.items():
        table.to_parquet(folder / f"{label}.parquet", index=False)
    decisions = ["uniaxial_1: toe of 0.05 mm found.", "Order 3, by BIC.", "Sign: $compression$ taken as #negative."]
    provenance = {"files": [{"name": "mts_uniaxial.txt", "sha256": "12" * 32}], "versions": {"numpy": "2.4.6"},
                  "seed": 31, "date": "2026-01-02", "decisions": decisions, "cpu_s": {"all": 2.75}}
    card = MaterialCard("Synthetic foam", LAW, PRONY, SKIN, fit_part(tables), unstable, {}, provenance, "card.d")
    write_card(card, tmp_path / "card.json")
    return tmp_path / "card.json"


def write_bands(folder: Path, draws: Draws) -> None:
    """The tables of bands as `matcal fit` writes them."""
    pd.DataFrame(stress_bands(LAW, draws)).to_parquet(folder / "bands.parquet")
    strain = np.linspace(-0.9, 0.4, 40)
    assert draws.conductivity_S_per_m is not None
    drawn = np.vander(strain, 4, increasing=True) @ draws.conductivity_S_per_m.T
    low, middle, high = np.quantile(drawn, [0.025, 0.5, 0.975], axis=1)
    pd.DataFrame({"strain": strain, "conductivity_S_per_m": middle, "conductivity_lo_S_per_m": low,
                  "conductivity_hi_S_per_m": high, "extrapolated": strain < 0}
                 ).to_parquet(folder / "conductivity_band.parquet")


def change(path: Path, drop: tuple[str, ...] = (), **parts: Any) -> None:
    raw = json.loads(path.read_text())
    path.write_text(json.dumps({key: value for key, value in (raw | parts).items() if key not in drop}))


@pytest.mark.thorough
def test_a_calibration_begins_with_its_verdict_and_holds_the_numbers_of_its_card(tmp_path: Path, card_path: Path,
                                                                                  read_pdf: Reader) -> None:
    raw = json.loads(card_path.read_text())
    change(card_path, provenance=raw["provenance"] | {"synthetic": True})
    write(card_path, tmp_path / "c.pdf")
    page = read_pdf(tmp_path / "c.pdf")
    text = page.whole
    for value in ("9.53", "9.39 to 9.67", "14.4 ± 2.5", "0.2880", "0.1505 ± 0.0030", "81.7 ± 5.0", "30.000 ± 0.010",
                  "−2.000 ± 0.030", "113.7 on 98", "45.6 %", "7890 %",
                  "1.81 %", "−0.546 to −0.306", "0.748 to 1.75", "38.1 %", "2.75 s",
                  "seed 31"):
        assert value in text, value
    for unit in ("Nominal stress (kPa)", "Nominal strain (–)", "Residual (Pa)", "γ (–)", "Conductivity (S/m)",
                 "Residual (S/m)", "Time from the start of loading (s)", "Normalised stress (–)"):
        assert unit in text, unit
    assert hashlib.sha256(card_path.read_bytes()).hexdigest()[:16] in text
    assert "12" * 32 in text
    for line in raw["provenance"]["decisions"]:
        assert line in text
    first = " ".join(page.pages[0].split())
    for line in ("Stress, uniaxial −0.800 to 0, shear γ 0 to 1.00 usable misses its tests by at most",
                 "one specimen of each kind", "Finite elements over these strains usable Drucker stability is lost in "
                 "uniaxial",
                 "Conductivity under a touch usable measured for strains of 0 to 0.400; touches stretch the skin",
                 "A real material not usable the data are synthetic"):
        assert line in first, line
    assert first.index("A real material") < first.index("Foam: hyperfoam law")


def test_a_law_of_others_is_drawn_as_it_stands_and_labelled_as_theirs(card_path: Path) -> None:
    theirs = StatedLaw("a stiffer law", replace(LAW, mu_Pa=1.1 * LAW.mu_Pa), replace(PRONY, g=0.5 * PRONY.g))
    with house():
        plates = {plate.name: plate for plate in calibration_report.report(card_path, theirs).plates}
    for mode in ("uniaxial", "shear"):
        drawn = plates[mode].data[f"{mode}_stated"]
        assert np.allclose(drawn["stated_stress_Pa"], 1.1 * nominal_stress(LAW, mode, drawn["strain"]))
        assert "a stiffer law is 10 % off" in plates[mode].caption
        (line,) = [one for one in plates[mode].figure.axes[0].get_lines() if one.get_label() == "a stiffer law"]
        assert np.allclose(np.asarray(line.get_ydata()), drawn["stated_stress_Pa"] / 1e3)
    drawn = plates["relaxation"].data["relaxation_stated"]
    assert np.allclose(drawn["stated_relaxation"] - 1, 0.5 * (drawn["fit_relaxation"] - 1))
    assert "the series of a stiffer law is at most" in plates["relaxation"].caption
    with house():
        plain = {plate.name: plate for plate in calibration_report.report(card_path).plates}
    assert not [stem for plate in plain.values() for stem in plate.data if stem.endswith("_stated")]


def test_one_shear_modulus_is_quoted(card_path: Path) -> None:
    derived = {"mu_0_Pa": {"median": 9500.0, "sd": 500.0, "lo": 8456.0, "hi": 10567.0}}
    checks = {"rhat": 1.0, "ess": 7000.0, "converged": True}
    for converged, ends in ((True, "8.5 to 10.6"), (False, "9.39 to 9.67")):
        change(card_path, posterior={"file": "card.d/no.nc", "n": 60, "derived": derived,
                                     "checks": checks | {"converged": converged}})
        report = calibration_report.report(card_path)
        (row,) = [row for row in report.tables["results"].rows if "shear modulus" in row[0]]
        assert row[3] == ends
        assert any(ends in sentence for sentence in report.findings)
        others = [end for end in ("8.5 to 10.6", "9.39 to 9.67") if end != ends]
        assert others[0] not in str(report.tables) + str(report.findings)
        assert "μ₀ to" not in report.tables["parameters"].caption


def test_captions_and_tables_state_the_errors_of_the_drawn_data(card_path: Path) -> None:
    report = calibration_report.report(card_path)
    table = pd.read_parquet(card_path.parent / "card.d" / "shear_1.parquet")
    error = rms(table["stress_Pa"].to_numpy() - table["fit_stress_Pa"].to_numpy(), table["stress_Pa"].to_numpy())
    plates = {plate.name: plate for plate in report.plates}
    assert f"misses these data by {100 * error:#.3g} %" in plates["shear"].caption
    assert "fitted to uniaxial alone it misses them by 45.6 %" in plates["shear"].caption
    drawn = plates["shear"].data["shear_1"]
    assert np.array_equal(drawn["stress_Pa"], table["stress_Pa"])
    strain, time = table["strain"].to_numpy(), table["time_s"].to_numpy()
    other = along_history(WEAK, PRONY, Test("x", "shear", strain, strain, None, time))
    assert np.allclose(drawn["uniaxial_alone_stress_Pa"], other)
    assert "Drucker stability in uniaxial" in plates["stability"].caption


def test_laws_are_drawn_along_the_history_that_the_fit_used() -> None:
    table = reduced("shear")
    strain, stress, time = (table[name].to_numpy() for name in ("strain", "stress_Pa", "time_s"))
    (curve,) = weigh([Experiment("shear", strain, stress, time)])
    test = Test("shear_1", "shear", strain, stress, None, time)
    assert np.allclose(along_history(LAW, PRONY, test), modelled(LAW, with_history(curve, PRONY)), rtol=1e-9, atol=1e-6)
    assert np.allclose(along_history(LAW, None, test), nominal_stress(LAW, "shear", strain), rtol=1e-12)
    assert np.all(along_history(LAW, PRONY, test)[1:] > nominal_stress(LAW, "shear", strain)[1:])


def test_relaxation_is_normalised_by_an_ideal_step(card_path: Path) -> None:
    plates = {plate.name: plate for plate in calibration_report.report(card_path).plates}
    drawn = plates["relaxation"].data["relaxation_1"]
    time, fitted = drawn["time_s"].to_numpy(), drawn["fit_normalised_stress"].to_numpy()
    ideal = 1 - (1 - np.exp(-time[:, None] / PRONY.tau_s)) @ PRONY.g
    assert np.allclose(fitted[time > 50], ideal[time > 50], rtol=2e-3)
    assert fitted.max() < 1


@pytest.mark.slow
def test_a_posterior_gives_bands_and_its_checks(tmp_path: Path, card_path: Path, read_pdf: Reader) -> None:
    rng = np.random.default_rng(2)
    scale = 1 + 0.05 * rng.normal(size=(60, 1))
    draws = foam_draws(LAW.mu_Pa * scale, np.repeat(LAW.alpha[None], 60, axis=0), 0.0,
                       conductivity_S_per_m=SKIN.c0_S_per_m * np.r_[1.0, SKIN.a] * scale)
    write_draws(draws, card_path.parent / "card.d" / "posterior.nc", {})
    write_bands(card_path.parent / "card.d", draws)
    change(card_path, posterior={"file": "card.d/posterior.nc", "n": 60, "prior": "alpha flat.",
                                 "derived": {"mu_0_Pa": {"median": 9500.0, "sd": 500.0, "lo": 8456.0, "hi": 10567.0}},
                                 "checks": {"rhat": 1.0042, "ess": 7000.0, "converged": True}})
    with house():
        made = calibration_report.report(card_path)
        write_pdf(made, tmp_path / "c.pdf")
    text = read_pdf(tmp_path / "c.pdf").whole
    lo, hi = np.quantile(9.53 * scale, [0.025, 0.975])
    assert f"{lo:.2f} to {hi:.2f}" in text
    assert "R-hat 1.004" in text
    (drawn_posterior,) = (plate for plate in made.plates if plate.name == "posterior")
    assert "orange" not in drawn_posterior.caption
    assert "Initial shear modulus μ₀" in drawn_posterior.caption
    assert "Prior: α flat." in text
    assert text.count("its 95 % band") == 3  # two legends, and the caption of all modes
    assert "60 draws" in text
    assert "8.5 to 10.6" in text
    drawn = pd.read_csv(tmp_path / "c_files" / "shear_band.csv")
    low, high = stress_band(draws, "shear", drawn["strain"])
    assert np.allclose(drawn["stress_lo_Pa"], low)
    assert np.allclose(drawn["stress_hi_Pa"], high)


def test_chains_that_did_not_converge_are_said(card_path: Path) -> None:
    draws = foam_draws(np.repeat(LAW.mu_Pa[None], 10, axis=0), np.repeat(LAW.alpha[None], 10, axis=0), 0.0)
    write_draws(draws, card_path.parent / "card.d" / "posterior.nc", {})
    change(card_path, posterior={"file": "card.d/posterior.nc", "n": 10,
                                 "checks": {"rhat": 2.4, "ess": 30.0, "converged": False}})
    captions = " ".join(plate.caption for plate in calibration_report.report(card_path).plates)
    assert "did NOT converge: R-hat 2.400" in captions


def test_a_card_alone_says_what_it_lacks(tmp_path: Path, read_pdf: Reader) -> None:
    card = MaterialCard("Table 1", replace(LAW, moduli="instantaneous", strain_range={}))
    write_card(card, tmp_path / "card.json")
    write(tmp_path / "card.json", tmp_path / "c.pdf")
    text = read_pdf(tmp_path / "c.pdf").whole
    for sentence in ("no data are drawn", "no Prony series", "no conductivity law", "no posterior", "instantaneous",
                     "no stability ranges", "no errors of fit", "no measurement files", "not in the card",
                     "no seed recorded", "records no decisions"):
        assert sentence in text, sentence
    assert not list((tmp_path / "c_files").glob("*.svg"))


def test_a_missing_folder_is_said(tmp_path: Path, card_path: Path, read_pdf: Reader) -> None:
    (card_path.parent / "card.d").rename(tmp_path / "elsewhere")
    write(card_path, tmp_path / "c.pdf")
    text = read_pdf(tmp_path / "c.pdf").whole
    assert "The folder card.d that the card names is not next to it" in text
    assert sorted(p.name for p in (tmp_path / "c_files").glob("*.svg")) == ["orders.svg", "stability.svg"]


def test_a_card_of_the_skin_alone(tmp_path: Path, card_path: Path, read_pdf: Reader) -> None:
    change(card_path, drop=("hyperfoam", "prony", "stability"))
    write(card_path, tmp_path / "c.pdf")
    text = read_pdf(tmp_path / "c.pdf").whole
    assert "no hyperelastic law" in text
    assert "Conductivity (S/m)" in text
    assert "Nominal stress in uniaxial loading" not in text


def test_a_cubic_that_turns_negative_is_said(card_path: Path) -> None:
    change(card_path, conductivity={"c0_S_per_m": 30.0, "a": [2.0, 0.0, 0.0], "strain_range": [0.0, 0.4]})
    captions = {plate.name: plate.caption for plate in calibration_report.report(card_path).plates}
    assert "stops being positive below a strain of −0.49" in captions["conductivity"]


def test_errors_name_the_file(tmp_path: Path, card_path: Path) -> None:
    table = pd.read_parquet(card_path.parent / "card.d" / "shear_1.parquet").drop(columns="stress_Pa")
    table.to_parquet(card_path.parent / "card.d" / "shear_1.parquet")
    with pytest.raises(InputFileError, match=r"shear_1\.parquet.*stress_Pa"):
        write(card_path, tmp_path / "c.pdf")
    (card_path.parent / "card.d" / "shear_1.parquet").write_bytes(b"")
    with pytest.raises(InputFileError, match=r"shear_1\.parquet.* or a damaged one .*Fit the card again"):
        write(card_path, tmp_path / "c.pdf")
    card_path.write_text("{}")
    with pytest.raises(InputFileError, match="not a card"):
        write(card_path, tmp_path / "c.pdf")


def test_compression_is_negative_in_every_figure(card_path: Path) -> None:
    plates = {plate.name: plate for plate in calibration_report.report(card_path).plates}
    for axes in plates["uniaxial"].figure.axes[:1]:
        for line in axes.get_lines():
            assert np.max(np.asarray(line.get_xdata(), float)) <= 1e-9, line.get_label()
