from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from eitsim.sweeps.dataset.parquet import read_dataset
from reports.document.style import house
from reports.sweep import sweep_report
from reports.sweep.sweep_report import write
from reports.touch import touch_report
from touchcal.errors import InputFileError

Make = Callable[..., Path]
Reader = Callable[[Path], Any]


def sentences(source: Path) -> str:
    """Findings, captions and tables of the report of a touch, not set on a page."""
    with house():
        made = touch_report.report(source)
    cells = (cell for table in made.tables.values() for row in ([table.caption], *table.rows) for cell in row)
    return " ".join([*made.findings, *(plate.caption for plate in made.plates), *cells])


def test_a_touch_report_holds_the_numbers_of_its_result(tmp_path: Path, write_result: Make, read_pdf: Reader) -> None:
    source, out = write_result(), tmp_path / "touch.pdf"
    write(source, out)
    text = read_pdf(out).whole
    for value in ("3.65", "18.9", "6.52", "153", "3.13", "0.45 %", "0.12 %", "1.23 s", "312 MB", "1.3 %"):
        assert value in text
    for unit in ("x (mm)", "y (mm)", "Displacement (mm)", "Pressure (kPa)", "Stretch (–)", "Voltage V (V)"):
        assert unit in text
    assert hashlib.sha256(source.read_bytes()).hexdigest()[:16] in text
    assert "Synthetic foam" in text
    assert "ab" * 32 in text
    assert "timed from the end of loading" not in text
    assert "3 decisions that may together cost 0.20 % of the signal" in text
    assert "mechanics axisymmetric about the punch" in text
    assert "its edge is 70.6 mm from the rim" in text


def test_reading_curves_are_the_readings_of_the_result(tmp_path: Path, write_result: Make, read_pdf: Reader) -> None:
    baseline = np.ones((16, 13))
    touched = baseline.copy()
    touched[5, 9] += 4e-3
    write(write_result(readings_V=touched.tolist(), baseline_V=baseline.tolist()), tmp_path / "t.pdf")
    table = pd.read_csv(tmp_path / "t_files" / "readings.csv")
    assert np.array_equal(table["touched_V"].to_numpy().reshape(16, 13), touched)
    assert table.loc[table["signal_V"].idxmax(), ["pattern", "reading"]].tolist() == [5, 9]
    text = read_pdf(tmp_path / "t.pdf").whole
    assert "at most 4.00 mV" in text
    assert "pattern 5, reading 9" in text
    assert "Pattern 5 has the largest sum of squares, 100 %" in text
    assert f"{-20 * np.log10(4e-3 / np.sqrt(208)):.1f} dB" in text


def test_a_report_of_two_touches_shows_both(tmp_path: Path, write_result: Make, read_pdf: Reader) -> None:
    one = json.loads(write_result().read_text())
    keys = ("force_N", "delta_max_mm", "sigma_max_kPa", "sigma_ave_kPa", "A_c_mm2", "wall_contact_mm2")
    lists = {key: [one[key], 2 * one[key]] for key in keys}
    punch = one["scene"]["punch"][0]
    scene = one["scene"] | {"punch": [punch, punch | {"x_mm": -43.0, "diameter_mm": 10.0}]}
    bounds = {"signal": 0.077, "depth": 0.0}
    deeper = one["profile"][0] | {"u_z_mm": [2 * u for u in one["profile"][0]["u_z_mm"]]}
    source = write_result(**lists, scene=scene, profile=[*one["profile"], deeper], interaction=bounds)
    write(source, tmp_path / "t.pdf")
    text = read_pdf(tmp_path / "t.pdf").whole
    assert "Touch 2. The surface sinks by up to 7.29 mm" in text
    assert (tmp_path / "t_files" / "profile_2.svg").is_file()
    for words in ("punch 1", "punch 2", "touch 2", "x = -43", "7.7 %", "7.29"):
        assert words in text or words.replace("-", "−") in text
    assert {path.name for path in (tmp_path / "t_files").glob("profile_*.csv")} == {"profile_1.csv", "profile_2.csv"}


def test_a_touch_without_any_signal_is_said(tmp_path: Path, write_result: Make, read_pdf: Reader) -> None:
    same = np.ones((16, 13)).tolist()
    write(write_result(readings_V=same, baseline_V=same), tmp_path / "t.pdf")
    assert "none of the voltages changes" in read_pdf(tmp_path / "t.pdf").whole


def test_a_failed_result_says_what_it_lacks(tmp_path: Path, write_result: Make, read_pdf: Reader) -> None:
    gone = dict.fromkeys(("readings_V", "baseline_V", "profile", "delta_max_mm", "force_N", "sigma_max_kPa",
                          "sigma_ave_kPa", "A_c_mm2", "wall_contact_mm2", "error_estimate", "stability", "scene",
                          "card"))
    source = write_result(outcome="not_converged", message="The Newton iteration stopped at 0.7 of the load.", **gone)
    write(source, tmp_path / "t.pdf")
    text = read_pdf(tmp_path / "t.pdf").whole
    assert "Outcome not_converged: The Newton iteration stopped at 0.7 of the load." in text
    for sentence in ("No mechanical outputs", "No surface profile", "No voltages", "does not hold its scene"):
        assert sentence in text
    assert not list((tmp_path / "t_files").glob("*.svg"))


@pytest.mark.parametrize("kind", ["nearest_edge", "all_edges", "whole_disc", "pair"])
def test_a_profile_of_the_touch_alone_is_said(kind: str, write_result: Make) -> None:
    said = "The touch alone, without what edges or another touch change; the table holds that."
    assert said not in sentences(write_result())
    plan = [{"kind": kind, "decision": "any", "reason": "any", "error_bound": 0.0, "unbounded": False}]
    assert said in sentences(write_result(plan=plan))


def test_a_hold_says_its_time_and_shows_all_times(tmp_path: Path, write_result: Make, read_pdf: Reader) -> None:
    baseline = np.ones((16, 13))
    touched = baseline.copy()
    touched[5, 9] -= 4.37e-3
    early = {"time_s": 0.0, "force_N": 1.0, "delta_max_mm": 2.917, "sigma_max_kPa": 17.71,
             "readings_V": (baseline + 1.23e-3).tolist()}
    late = early | {"time_s": 180.0, "delta_max_mm": 3.646, "sigma_max_kPa": 18.87, "readings_V": touched.tolist()}
    write(write_result(readings_V=touched.tolist(), baseline_V=baseline.tolist(), times=[early, late]),
          tmp_path / "t.pdf")
    text = read_pdf(tmp_path / "t.pdf")
    assert "After 180 s, 1.00 N presses the punch 3.65 mm deep" in text.pages[0]
    for words in ("time (s)", "force (N)", "depth (mm)", "largest signal (mV)", "0 1.00 2.92 17.7 1.23",
                  "180 1.00 3.65 18.9 4.37", "timed from the end of loading", "The mechanical outputs after 180 s",
                  "the force stays at 1.00 N and the depth goes from 2.92 to 3.65 mm"):
        assert words in text.whole, words


def test_errors_and_equal_ratios_are_stated_in_words(write_result: Make) -> None:
    keys = ("force_N", "delta_max_mm", "sigma_max_kPa", "sigma_ave_kPa", "A_c_mm2", "wall_contact_mm2")
    one = json.loads(write_result().read_text())
    text = sentences(write_result(**{key: [one[key]] * 2 for key in keys}, profile=2 * one["profile"],
                                  error_estimate={"signal": 0.004, "depth": 0.001, "sigma_max": 0.02, "A_c": 0.003,
                                                  "strain": 0.05})).replace("\u00a0", " ")
    for words in ("error of the largest pressure 2.0 %", "error of the contact area 0.30 %",
                  "error of the surface strain 5.0 %", "the peak pressure is 2.90 times the mean in each touch."):
        assert words in text, words


@pytest.mark.parametrize(("name", "content"), [("a.json", "not json"), ("a.json", '{"mu_Pa": 1}'), ("a.json", "[1]")])
def test_a_file_that_is_no_result_is_named(tmp_path: Path, name: str, content: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(InputFileError, match=name):
        write(tmp_path / name, tmp_path / "t.pdf")
    assert not (tmp_path / "t.pdf").exists()


def test_a_sweep_report_holds_the_numbers_of_its_set(tmp_path: Path, write_set: Make, read_pdf: Reader) -> None:
    folder, out = write_set(24, refused=3), tmp_path / "set.pdf"
    write(folder, out)
    page, ok = read_pdf(out), read_dataset(folder).ok
    text, first = page.whole, " ".join(page.pages[0].split())
    assert "Rows as designed not usable 21 of 24 scenes ended ok" in first
    assert "Signals by the card's law good 95 % of them to" in first
    assert "21 of 24 scenes ended ok; 3 did not" in text
    assert "too near the rim" in text
    assert f"{ok['delta_max_mm'].max():.2f} mm" in text
    assert f"{100 * ok['signal_error'].max():.2g} %" in text
    assert hashlib.sha256((folder / "design.json").read_bytes()).hexdigest()[:16] in text
    assert "seed 7" in text
    for unit in ("Depth (mm)", "Peak pressure (kPa)", "Contact area (mm²)", "Force (N)", "error (%)", "scene (s)"):
        assert unit in text
    assert len(page.pages) == 1
    drawn = pd.read_csv(tmp_path / "set_files" / "map.csv")  # coloured by the signal
    signal = ok.filter(regex=r"^dv_").to_numpy()
    assert np.allclose(drawn["signal_rms_V"], np.sqrt(np.mean(signal**2, axis=1)), rtol=1e-12)
    assert np.allclose(drawn[["x_mm", "y_mm"]], ok[["x_mm", "y_mm"]])


def test_the_footer_hash_of_a_sweep_follows_its_rows(write_set: Make) -> None:
    folder = write_set(8)
    before = sweep_report.report(folder).footer["inputs"]
    part = sorted(folder.glob("*.parquet"))[0]
    table = pd.read_parquet(part)
    table["v_000"] += 1e-9
    table.to_parquet(part, index=False)
    after = sweep_report.report(folder).footer["inputs"]
    assert before[0] == after[0]
    assert before[1]["sha256"] != after[1]["sha256"]


def test_an_unfinished_sweep_is_said(write_set: Make) -> None:
    findings = " ".join(sweep_report.report(write_set(8, scenes=30)).findings)
    assert "unfinished: the design asks for 30 scenes, 8 are there" in findings


def test_a_sweep_without_a_solved_scene_draws_nothing(tmp_path: Path, write_set: Make, read_pdf: Reader) -> None:
    write(write_set(4, refused=4), tmp_path / "set.pdf")
    text = read_pdf(tmp_path / "set.pdf").whole
    assert "0 of 4 scenes ended ok" in text
    assert "no scene of the set has the outcome" in text
    assert not list((tmp_path / "set_files").glob("*.svg"))


def test_one_solved_scene_is_enough(tmp_path: Path, write_set: Make, read_pdf: Reader) -> None:
    write(write_set(2, refused=1), tmp_path / "set.pdf")
    assert "1 of 2 scenes ended ok" in read_pdf(tmp_path / "set.pdf").whole


def test_a_folder_that_is_no_set_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"design\.json"):
        write(tmp_path, tmp_path / "set.pdf")


def test_a_touch_begins_with_its_verdict_and_says_the_share_of_the_signal(tmp_path: Path, write_result: Make,
                                                                         read_pdf: Reader) -> None:
    stability = {"elliptic": True, "fraction_non_elliptic": 0.0, "skin_fraction_extrapolated": 0.0063,
                 "signal_share_extrapolated": 0.89, "signal_past_law": 0.021, "least_strain": -0.9, "law": "yeoh",
                 "fitted_law_strain": [-0.8, 0.0], "fitted_skin_strain": [0.0, 0.4]}
    plan = [{"kind": "no_load_in_skin", "decision": "the skin carries no load", "reason": "a sprayed layer",
             "error_bound": 0.0, "unbounded": True}]
    card = {"name": "Foam", "file": "card.json", "sha256": "ab" * 32, "synthetic": True}
    write(write_result(stability=stability, plan=plan, card=card), tmp_path / "t.pdf")
    first = " ".join(read_pdf(tmp_path / "t.pdf").pages[0].split())
    for line in ("Depth and contact area usable depth to 0.12 %, yeoh strained to −0.900, tested to −0.800",
                 "Signal by the card's law good to 0.45 %", "Signal of a real skin not usable 89 % of it comes from "
                 "extrapolated conductivity, measured for strains of 0 to 0.400", "A real sensor not usable",
                 "Before you use these numbers", "At a cost that is unknown and in no error: the skin carries no load"):
        assert line in first, line
    assert first.index("Depth and contact area") < first.index("1.00 N presses")
    assert "0.63 % of the skin is strained outside the range in which the conductivity was measured, and 89 % of the " \
        "signal comes from there" in read_pdf(tmp_path / "t.pdf").whole
    assert "law is not positive, in its error 2.1 %" in read_pdf(tmp_path / "t.pdf").whole


def test_a_result_written_before_laws_had_names_keeps_its_caution(write_result: Make) -> None:
    stability = {"elliptic": True, "least_strain": -0.9, "fitted_foam_strain": [-0.8, 0.0]}
    (found,) = [line for line in touch_report.report(write_result(stability=stability)).verdict
                if line.what == "Depth and contact area"]
    assert "foam strained to −0.900, tested to −0.800" in found.why


def test_a_depth_is_good_where_only_the_largest_pressure_is_not(write_result: Make) -> None:
    error = {"signal": 0.007, "depth": 0.0026, "A_c": 0.0036, "sigma_max": 0.055}
    for least, grades in ((-0.5, ["good", "not usable"]), (-0.95, ["not usable", "not usable"])):
        stability = {"elliptic": True, "least_strain": least, "fitted_law_strain": [-0.8, 0.0]}
        depth, pressure = touch_report.report(write_result(stability=stability, error_estimate=error)).verdict[:2]
        assert [depth.what, pressure.what] == ["Depth and contact area", "Largest pressure"]
        assert [depth.grade, pressure.grade] == grades
        assert pressure.why.startswith("to 5.5 %")


def test_the_signal_of_a_real_skin_is_no_better_than_by_the_card_s_law(write_result: Make) -> None:
    for signal, share, grade, words in ((0.82, 0.0, "not usable", '; no better than "Signal by the card\'s law"'),
                                        (0.03, 0.0, "usable", '; no better than "Signal by the card\'s law"'),
                                        (0.82, 0.89, "not usable", ""), (0.004, 0.0, "good", "")):
        stability = {"elliptic": True, "signal_share_extrapolated": share}
        error = {"signal": signal, "depth": 0.001}
        lines = touch_report.report(write_result(stability=stability, error_estimate=error)).verdict
        (found,) = [line for line in lines if line.what == "Signal of a real skin"]
        assert found.grade == grade
        assert found.why == f"{100 * share:.0f} % of it comes from extrapolated conductivity{words}"


def test_what_has_no_effect_on_a_flat_punch_is_left_out_of_its_scene(write_result: Make) -> None:
    for profile, shown in (("flat", False), ("cone", True)):
        scene = json.loads(write_result().read_text())["scene"]
        scene["punch"][0] |= {"profile": profile, "half_angle_deg": 60.0}
        rows = touch_report.report(write_result(scene=scene)).tables["scene"].rows
        assert ("half_angle_deg" in str(rows)) is shown
