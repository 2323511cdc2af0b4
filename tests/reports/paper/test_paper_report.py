"""The walk through the paper, drawn from tiny synthetic results."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from benchmarks.paper import paper_report, ratios
from benchmarks.paper.learning import OUTPUTS
from benchmarks.paper.meshes import course
from benchmarks.paper.network import hidden_units
from benchmarks.paper.section import FULL, KEY, Number, Section, comparison, paper_value, published
from benchmarks.paper.stages import RECORD, content, key
from benchmarks.paper.stages_plan import COST, QUICK, Run, planned
from benchmarks.paper.touches import conducting_share
from eitsim.sweeps.run.folder import sole_writer
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony, relaxation
from reports.__main__ import app
from reports.document.verdict import GOOD, NOT_USABLE
from surrogate.statistics.metrics import score

Reader = Callable[[Path], Any]
Writer = Callable[..., Path]
UNITS = {"x0": "mm", "y0": "mm", "d": "mm", "F": "N", "sigma_max": "kPa", "sigma_ave": "kPa", "delta_max": "mm",
         "A_c": "mm2"}
TABLE_1 = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3), "longterm")
SERIES = Prony(np.array([0.1505, 0.1696, 0.0604]), np.array([0.2936, 5.85, 81.672]))


def write_convergence(folder: Path) -> None:
    """Values that fall with the second power of the element size."""
    sizes = np.array([4.0, 2.0, 1.0])
    rows = [pd.DataFrame({"order": order, "size_over_default": sizes, "elements": (100 / sizes**2).astype(int),
                          "delta_max_mm": 3.5 - 0.01 * sizes**2, "sigma_ave_kPa": 6.5 + 0.02 * sizes**2})
            for order in (1, 2)]
    pd.concat(rows).to_csv(folder / "convergence.csv", index=False)


def write_hold(folder: Path, write_result: Writer, relaxes: bool, **hold: Any) -> None:
    """A hold whose pressure falls by Table 1's series, or stays."""
    result = json.loads(write_result().read_text())
    result["scene"]["hold"] |= hold
    block = {name: result[name] for name in ("force_N", "delta_max_mm", "readings_V")}
    result["times"] = [block | {"time_s": t, "sigma_ave_kPa": 6.5 * float(relaxation(SERIES, t) if relaxes else 1.0)}
                       for t in (0.0, 2.0, 5.0, 60.0, 120.0, 180.0)]
    (folder / "touch.json").write_text(json.dumps(result))


def write_models(folder: Path) -> None:
    """A model of one kind with scores of the predictions next to it."""
    rng, tables, scores = np.random.default_rng(5), [], {}
    for name, unit in UNITS.items():
        for part, count in (("train", 20), ("test", 8)):
            target = rng.uniform(1, 2, count)
            value = target + 0.1 * rng.normal(size=count)
            tables.append(pd.DataFrame({"part": part, "scene": range(count), "output": name, "unit": unit,
                                        "target": target, "value": value, "half_width_90": 0.2}))
            half = np.full((3, count), 0.2)
            scores.setdefault(name, {})[part] = asdict(score(target, value, half, half, unit))
    net = {"gamma": 25.5, "parameters": 4201, "epochs": 60, "stop": "epochs", "collapsed": False}
    split = {"train": 20, "val": 4, "test": 8}
    (folder / "model.json").write_text(json.dumps({
        "method": "trainbr", "seed": 1, "dataset": {"sha256": "cd" * 32, "rows": 32, "split": split},
        "training": dict.fromkeys(UNITS, net)}))
    turned = {"d_mm": 10.0, "rms_V": [1e-3, 4e-3, 2e-3], "peak_N": 0.5, "two_answers_N": [0.2, 2.0]}
    amplitude = {"radius_mm": 0.0, "force_N": [0.1, 0.5, 2.0], "diameters": [turned]}
    (folder / "evaluation.json").write_text(json.dumps({"outputs": scores, "noise": [], "amplitude": amplitude}))
    pd.concat(tables).to_parquet(folder / "predictions.parquet", index=False)


def finished(run: Run, name: str, write: Callable[[Path], None]) -> None:
    """Results of a stage, and the record of one that is finished."""
    stage = run.stages[name]
    stage.folder.mkdir(parents=True)
    write(stage.folder)
    record = {"name": name, "key": key(stage), "results": content(stage.folder).sha256, "cpu_s": 1.25, "wall_s": 2.5,
              "machine": "a machine", "date": "2026-01-01"}
    (stage.folder / RECORD).write_text(json.dumps(record))


@pytest.fixture
def run(tmp_path: Path, write_result: Writer) -> Run:
    """A run with a card's place, a convergence and three holds."""
    card = tmp_path / "foam.json"
    made = planned(QUICK, tmp_path / "stages", card=card)
    card.write_text("{}")
    finished(made, "convergence", write_convergence)
    finished(made, "hold_force", lambda folder: write_hold(folder, write_result, relaxes=False))
    finished(made, "hold_depth", lambda folder: write_hold(folder, write_result, relaxes=True, control="depth"))
    finished(made, "hold_loaded", lambda folder: write_hold(folder, write_result, relaxes=True, control="depth",
                                                            loading_s=1.25))
    card.unlink()  # a card that is no card: its sections say so, and what was made from it is stale
    return made


@pytest.mark.thorough
def test_what_is_there_is_drawn_and_what_is_not_is_said(run: Run, tmp_path: Path, read_pdf: Reader) -> None:
    text = read_pdf(paper_report.write(run, tmp_path, png=False)).whole
    lost = 100 * (1 - float(relaxation(SERIES, 2.0)))
    for words in ("Figure 8: mesh convergence", "Mean contact stress (kPa)", "Depth (mm)", "falls at order 2.0",
                  "Figure 9: a held touch", "Mean contact pressure (kPa)", "Time from the end of loading (s)",
                  f"{lost:.1f} % are lost in 2 s", "Not there: the card was not fitted.",
                  "Not there: the networks were not trained.", "Stale: convergence. See the first page.",
                  "force kept, loaded at once", "depth kept, loaded at once", "depth kept, loaded over 1.25 s",
                  "at 2, 5, 60, 120, 180 s and at the end of loading", "constant rate of force in 1.25 s",
                  "Stale: hold_force, hold_depth, hold_loaded, convergence: command, inputs",
                  "Stale: hold_force, hold_depth, hold_loaded. See", f"a quick run from nothing takes {COST}",
                  "quantity unit paper this run",
                  "figure quantity method unit paper this run ratio ratio, full run", "A held touch"):
        assert words in text, words
    places = [text.index(words) for words in ("Figure 8: mesh convergence", "Mean contact stress (kPa)",
                                              "Figure 9: a held touch", "Time from the end of loading (s)")]
    assert places == sorted(places)
    assert sorted(path.name for path in (tmp_path / "paper_files").glob("*.svg")) == ["figure_8.svg", "figure_9.svg"]
    numbers = pd.read_csv(tmp_path / "numbers.csv", dtype={"figure": str})
    assert np.isfinite(numbers["value"]).all()
    here = numbers.loc[numbers["quantity"] == "mean pressure lost in 2 s, hold at depth", "value"]
    assert here.tolist() == pytest.approx([lost], rel=1e-4)


@pytest.mark.slow
def test_every_figure_of_the_networks_is_drawn(tmp_path: Path, read_pdf: Reader) -> None:
    run = planned(QUICK, tmp_path / "stages", card=tmp_path / "card.json", sweep=tmp_path / "stages")
    for name in ("networks", "forward"):
        finished(run, name, write_models)
    run = planned(QUICK, tmp_path / "stages", card=tmp_path / "card.json")
    text = read_pdf(paper_report.write(run, tmp_path)).whole
    for figure in ("12", *OUTPUTS):
        assert f"Figure {figure}: " in text
        assert list((tmp_path / "paper_files").glob(f"figure_{figure}*.png"))
    for words in ("Force, predicted (N)", "Contact area, predicted (mm²)", "/r, predicted (–)", "20 hidden units",
                  "Networks next to the paper", "learned from 20 rows in at most 60 steps",
                  "Amplitude: size of the signal", "it has a top at 0.50 N",
                  "paper networks networks, full forward map forward map, full",
                  "8 of 8 networks stopped at 60 steps", "Stale: networks"):
        assert words in text, words


def test_stated_values_of_curves_are_those_of_table_1() -> None:
    for strain in (0.1, 0.4, 0.7):
        stress = -float(nominal_stress(TABLE_1, "uniaxial", -strain)) / 1e3
        assert paper_value("3", f"compressive stress at a strain of {strain:.2f}") == pytest.approx(stress, abs=5e-4)
    for shear in (0.5, 0.9):
        stress = float(nominal_stress(TABLE_1, "shear", shear)) / 1e3
        assert paper_value("4", f"shear stress at a strain γ of {shear}") == pytest.approx(stress, abs=5e-4)
    for time in (2, 180):
        left = float(relaxation(SERIES, float(time)))
        assert paper_value("5", f"modulus left {time} s after a step") == pytest.approx(left, abs=5e-4)


def test_stated_errors_are_roots_of_the_stated_squares() -> None:
    for figure, names in OUTPUTS.items():
        for of, over, scale in ([(f" of {s}", "/r", 100.0) for s in ("x₀", "y₀")] if len(names) > 1 else [("", "", 1)]):
            square = paper_value(figure, f"MSE{of}{over}, test rows")
            assert paper_value(figure, f"RMSE{of}, test rows") == pytest.approx(scale * square**0.5, rel=5e-4)


def test_committed_numbers_of_the_full_run_answer_all_that_the_paper_states() -> None:
    full = pd.read_csv(FULL, dtype={"figure": str})
    assert not full.duplicated(KEY).any()
    assert np.isfinite(full["value"]).all()
    known = set(zip(full["figure"], full["quantity"], full["unit"], strict=True))
    asked = published()
    assert set(zip(asked["figure"], asked["quantity"], asked["unit"], strict=True)) <= known


def test_a_comparison_sets_paper_run_and_full_run_side_by_side() -> None:
    part = section("10", Number("drive current", "mA", 4.0))
    full = pd.DataFrame({"figure": ["10"], "quantity": ["drive current"], "unit": ["mA"], "method": [""],
                         "value": [4.5]})
    table = comparison(part, full)
    assert table is not None
    assert list(table.head) == ["quantity", "unit", "paper", "this run", "full run"]
    assert list(table.rows) == [["drive current", "mA", "5", "4", "4.50"]]
    with pytest.raises(ValueError, match=r"drive current.* is in mA, found in A"):
        comparison(section("10", Number("drive current", "A", 4.0)), None)


def section(figure: str, *numbers: Number) -> Section:
    return Section(figure, "", "", "", "", (), numbers=numbers)


def test_the_worst_of_every_figure_stands_on_the_first_page() -> None:
    parts = [section("5", Number("modulus left 2 s after a step", "–", 0.8)),
             section("12", Number("scenes", "–", 4.0)),
             section("T1", Number("μ₁", "kPa", -8.1)),
             section("13", Number("RMSE of x₀, test rows", "mm", 7.5, "networks"),
                     Number("RMSE of y₀, test rows", "mm", 0.55, "networks"),
                     Number("RMSE of x₀, test rows", "mm", 0.05, "forward map")),
             section("17", Number("MSE, test rows", "kPa²", 1e6, "networks"),
                     Number("RMSE, test rows", "kPa", 5.69, "networks"), Number("R², test rows", "–", 0.1, "networks"))]
    found = ratios.ratios(parts)
    full = pd.DataFrame({"figure": ["17"], "quantity": ["RMSE, test rows"], "unit": ["kPa"], "method": ["networks"],
                         "value": [1.307]})
    table = ratios.table(found, full)
    assert [row[0] for row in table.rows] == ["5", "12", "T1", "13", "13", "17"]
    assert table.rows[3][1:] == ["RMSE of x₀, test rows", "networks", "mm", "0.579", "7.50", "13.0", "–"]
    assert table.rows[5][1:] == ["Mean pressure, RMSE, test rows", "networks", "kPa", "0.653", "5.69", "8.71", "2.00"]
    assert "The worst is μ₁ (T1), of the other sign" in table.caption
    lines = {line.what: (line.grade, line.why) for line in ratios.verdict(found, synthetic=True)}
    assert lines["Curves of the material"][0] == GOOD
    assert lines["Single terms of Table 1"][0] == NOT_USABLE
    assert lines["The paper's networks"] == (
        NOT_USABLE, "at worst, RMSE of x₀, test rows by the networks (figure 13) is 13 times the paper's")
    assert lines["The forward map"][0] == GOOD
    assert lines["A real sensor"][0] == NOT_USABLE
    assert [line.grade for line in ratios.verdict([], synthetic=False)] == [NOT_USABLE]


def test_a_quick_run_is_judged_by_the_run_at_full_size(run: Run) -> None:
    """40 times the paper's in a quick run, 13 times at full size."""
    name, stated = "RMSE of x₀, test rows", paper_value("13", "RMSE of x₀, test rows")
    quick = ratios.ratios([section("13", Number(name, "mm", 40 * stated, "networks"))])
    full = pd.DataFrame({"figure": ["13"], "quantity": [name], "unit": ["mm"], "method": ["networks"],
                         "value": [13 * stated]})
    (line,) = [one for one in paper_report._verdict(run, quick, full) if "networks" in one.what]
    assert "is 13 times the paper's, in the run at full size" in line.why
    (line,) = [one for one in paper_report._verdict(run, quick, None) if "networks" in one.what]
    assert line.why.endswith("is 40 times the paper's")


@pytest.mark.parametrize("power", [1.0, 2.0, 3.5])
def test_an_exact_power_is_found_with_its_error(power: float) -> None:
    sizes = np.array([8.0, 4.0, 2.0, 1.0])
    found = course(pd.DataFrame({"elements": 1 / sizes, "value": 5 + sizes**power}), "value")
    assert found.observed == pytest.approx(power)
    assert found.error[1:] == pytest.approx(sizes[1:] ** power)


def test_values_that_diverge_have_no_order() -> None:
    rows = pd.DataFrame({"elements": [1.0, 2.0, 4.0], "value": [1.0, 2.0, 4.0]})
    assert course(rows, "value").observed is None


def test_units_of_a_network_follow_from_its_parameters() -> None:
    assert hidden_units(4201) == 20
    with pytest.raises(ValueError, match="208 inputs has 4200 parameters"):
        hidden_units(4200)


def test_a_conducting_punch_is_measured_against_an_insulated_one() -> None:
    rows = pd.DataFrame({"skin_strain": "normal", "punch_conductor": [0.0, 1.0], "dv_000": [3.0, 3.0],
                         "dv_001": [4.0, 9.0]})
    assert conducting_share(rows, "normal") == pytest.approx(1.0)


def test_results_that_are_not_there_are_refused_before_any_work(tmp_path: Path) -> None:
    for given, words in ((["--card", tmp_path / "no.json"], "no.json is not there"),
                         (["--sweep", tmp_path], "design.json is not there")):
        with pytest.raises(ValueError, match=words):
            app([str(word) for word in ("paper", "--out", tmp_path / "out", *given)], standalone_mode=False)
    assert not (tmp_path / "out").exists()


def test_two_runs_do_not_write_to_one_folder(tmp_path: Path) -> None:
    with sole_writer(tmp_path, "report"), pytest.raises(ValueError, match="another report is writing to it"):
        app(["paper", "--draw-only", "--out", str(tmp_path)], standalone_mode=False)
    assert [path.name for path in tmp_path.iterdir()] == [".lock"]
