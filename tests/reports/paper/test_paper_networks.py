"""The eight networks next to the paper's, the search over sensors, and what models read from other choices."""

from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd
import pytest

from benchmarks.paper import choices, learning, networks_table, touches
from benchmarks.paper.networks_table import OUTPUTS, Cause, paper_rmse
from benchmarks.paper.section import paper_value, shown
from eitsim.scene.scene import Punch, Skin
from reports.document.style import house
from surrogate.statistics.metrics import score

NAMES = [name for names in OUTPUTS.values() for name in names]
UNITS = dict.fromkeys(NAMES, "mm") | {"F": "N", "sigma_max": "kPa", "sigma_ave": "kPa", "A_c": "mm2"}


def scored(factor: float) -> tuple[dict[str, Any], pd.DataFrame]:
    """Scores and predictions of networks whose errors are `factor` times the paper's, and of F five times that."""
    sign, tables, scores = np.array([1.0, -1.0, -1.0, 1.0]), [], {}
    for figure, names in OUTPUTS.items():
        for name in names:
            for part, words in (("train", "training"), ("test", "test")):
                error = factor * (5 if name == "F" else 1) * paper_rmse(figure, name, words)
                target = error * np.array([10.0, 20.0, 30.0, 40.0])
                value = target + error * sign
                half = np.full((3, 4), 2 * error)
                tables.append(pd.DataFrame({"part": part, "scene": range(4), "output": name, "unit": UNITS[name],
                                            "target": target, "value": value, "half_width_90": 2 * error}))
                scores.setdefault(name, {})[part] = asdict(score(target, value, half, half, UNITS[name]))
    return scores, pd.concat(tables)


def searched(own: float, other: float) -> list[dict[str, Any]]:
    """A search of two sensors, whose ratios are the same for every output."""
    return [{"variant": variant, "output": name, "over_paper": ratio, "rows": 420, "epochs": 150}
            for variant, ratio in (("normal, insulated", own), ("areal, conducting by 0.001 Ohm m2", other))
            for name in NAMES]


def test_all_eight_networks_stand_next_to_the_papers_errors() -> None:
    scores, predictions = scored(1.2)
    table = networks_table.errors(scores, predictions)
    assert list(table.head) == ["figure", "output", "unit", "training", "paper", "test", "paper", "ratio", "R²", "R"]
    assert len(table.rows) == 8
    for row in table.rows:
        assert row[7] == ("6.0" if row[1] == "Force" else "1.2")
    force = next(row for row in table.rows if row[1] == "Force")
    assert force[3:7] == ["0.360", "0.0600", "0.910", "0.152"]
    rows = predictions[(predictions["output"] == "F") & (predictions["part"] == "test")]
    r = np.corrcoef(rows["target"], rows["value"])[0, 1]
    assert force[8:] == [f"{scores['F']['test']['r2']:.4f}", f"{r:.4f}"]
    assert "1 of 8 are more than 1.5 times" in table.caption


def test_the_papers_errors_of_positions_are_those_over_the_radius() -> None:
    assert paper_rmse("13", "x0", "test") == pytest.approx(paper_value("13", "RMSE of x₀, test rows"), rel=1e-3)
    assert paper_rmse("19", "A_c", "training") == pytest.approx(np.sqrt(49.06))


@pytest.mark.parametrize(("own", "other", "cause"), [(4.0, 1.2, Cause.SENSOR), (1.1, 0.9, Cause.HERE),
                                                     (4.0, 3.0, "none of these sensors")])
def test_a_cause_is_what_the_search_over_sensors_shows(own: float, other: float, cause: str) -> None:
    table = networks_table.causes(scored(1.2)[0], searched(own, other), ("normal", 0))
    assert table.rows == [["Force", "6.0", f"{own:.1f}", "areal, conducting by 0.001 Ω m²",
                           f"{other:#.2g}", cause]]


def test_a_sensor_that_the_search_lacks_is_no_cause() -> None:
    table = networks_table.causes(scored(1.2)[0], searched(4.0, 1.2), ("principal", 1))
    assert table.rows[0][2] == "–"
    assert networks_table.causes(scored(1.2)[0], [], ("normal", 0)).rows == []


def test_positions_are_drawn_over_the_radius_with_the_papers_measure() -> None:
    scores, predictions = scored(2.0)
    rows = predictions[predictions["output"] == "x0"]
    with house():
        plate = learning._plate("x0", pd.DataFrame(rows), scores["x0"])
    drawn = plate.data["parity_x0"]
    assert np.allclose(drawn["target"], rows["target"] / 100)
    assert set(drawn["unit"]) == {"–"}
    mse = 4 * paper_value("13", "MSE of x₀/r, test rows")
    assert f"test rows MSE {shown('MSE', mse)}. The" in plate.caption
    assert plate.caption.startswith("x₀/r, predicted by the networks")
    words = plate.figure.axes[1].texts[0].get_text().splitlines()
    r = np.corrcoef(rows.loc[rows["part"] == "test", ["target", "value"]].to_numpy().T)[0, 1]
    assert words[1] == f"R² {scores['x0']['test']['r2']:.4f}, R {r:.4f}"


def test_the_own_choice_is_read_from_the_design_and_from_nothing_else() -> None:
    assert touches.taken({}) == (Skin().strain, int(Punch().conductor))
    assert touches.taken({"skin": {"strain": "areal"}, "punch": {"conductor": True}}) == ("areal", 1)


def test_readings_of_other_choices_stand_next_to_the_touch() -> None:
    value = {("normal", 0): 1.1, ("areal", 1): 1.5}
    table = pd.DataFrame([{"model": "networks", "skin_strain": strain, "punch_conductor": float(punch), "output": name,
                           "unit": UNITS[name], "target": 1.0, "value": np.nan if name == "d" and punch else read}
                          for (strain, punch), read in value.items() for name in NAMES])
    found = choices.readings(table)
    shown_table = choices.read_by(found, UNITS, ("normal", 0))
    assert [row[:3] for row in shown_table.rows[1:]] == [
        ["the touch itself", "", "1.00"], ["networks", "normal, insulated (own)", "1.10"],
        ["networks", "areal, conducting", "1.50"]]
    assert shown_table.rows[3][2 + NAMES.index("d")] == "–"
    assert "the networks by up to 0.50 N (0.10 N on their own)" in choices.misread(found, ("normal", 0))
    assert choices.misread(found, ("principal", 0)) == ""
