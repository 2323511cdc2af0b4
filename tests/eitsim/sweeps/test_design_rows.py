"""Rows of a data set tell their scene: every drawn key has a column, every touch its own, whatever the outcome."""

import math
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from eitsim.sweeps.dataset.parquet import write_part
from eitsim.sweeps.design.card_draws import cards_for
from eitsim.sweeps.design.design import Design, design_from, tables_at
from eitsim.sweeps.run.row_columns import blank_keys, keys_of, numbered
from eitsim.sweeps.run.rows import solve_rows
from eitsim.sweeps.run.scene_table import read_scene_table
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "instantaneous")
CARD = MaterialCard("Table 1", FOAM, Prony([0.3], [6.0]), Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
QUICK = {"accuracy": {"signal": 0.2}}


def solved(design: Design) -> list[dict[str, Any]]:
    return solve_rows(design, cards_for(None, 0, CARD), list(range(design.scenes)))


def test_columns_of_further_touches_carry_their_number() -> None:
    assert [numbered(name, 1) for name in ("x_mm", "F_N", "A_c_mm2", "sigma_max_kPa")] == [
        "x_2_mm", "F_2_N", "A_c_2_mm2", "sigma_max_2_kPa"]
    assert numbered("delta_max_mm", 0) == "delta_max_mm"


def test_every_drawn_key_has_a_column(tmp_path: Path) -> None:
    raw = {"touches": {"choice": [1, 2]}, "punch": {
        "profile": {"choice": ["flat", "cone"]}, "friction": {"choice": ["none", "coulomb"]},
        "friction_coefficient": [0.2, 0.4], "conductor": {"choice": [True, False]}, "depth_mm": [1, 3]},
        "electrodes": {"contact_impedance_Ohm_m": [0.5, 2], "missing": {"choice": [[], [3, 4]]}},
        "hold": {"time_s": [5], "control": {"choice": ["force", "depth"]}}}
    design = design_from(raw, 40)
    rows = [blank_keys(design) | keys_of(design, tables_at(design, i)) for i in range(40)]
    assert set(rows[0]) == {
        "touches", *(numbered(name, k) for k in (0, 1) for name in (
            "x_mm", "y_mm", "d_mm", "F_N", "sigma_max_kPa", "sigma_ave_kPa", "A_c_mm2", "delta_max_mm",
            "wall_contact_mm2")),
        *(f"punch_{k}{key}" for k in ("", "2_") for key in (
            "profile", "friction", "friction_coefficient", "conductor", "depth_mm")),
        "electrodes_contact_impedance_Ohm_m", "electrodes_missing_0", "electrodes_missing_1", "hold_time_s",
        "hold_control"}
    assert {row["punch_profile"] for row in rows} == {"flat", "cone"}
    assert {row["punch_conductor"] for row in rows} == {0.0, 1.0}
    missing = {tuple(row[f"electrodes_missing_{i}"] for i in (0, 1)) for row in rows}
    assert {pair for pair in missing if not math.isnan(pair[0])} == {(3.0, 4.0)}
    assert len(missing) > 1
    assert {row["hold_time_s"] for row in rows} == {5.0}
    for row in rows:
        slips, coefficient = row["punch_friction"] == "coulomb", row["punch_friction_coefficient"]
        assert 0.2 <= coefficient <= 0.4 if slips else math.isnan(coefficient)
        assert math.isnan(row["x_2_mm"]) == (row["punch_2_profile"] == "") == (row["touches"] == 1)
        assert math.isnan(row["F_N"])
        assert 1 <= row["punch_depth_mm"] <= 3
    types = [pd.read_parquet(write_part(tmp_path, [{"scene": i, **row}])).dtypes for i, row in enumerate(rows)]
    assert all(found.equals(types[0]) for found in types)


def test_rows_of_one_and_of_two_touches_are_solved() -> None:
    raw = QUICK | {"touches": {"list": [1, 2]}, "punch": [
        {"x_mm": -30, "y_mm": 0, "force_N": 0.2}, {"x_mm": 40, "y_mm": 0, "force_N": 0.4, "diameter_mm": 12}]}
    one, two = solved(design_from(raw))
    assert [(row["outcome"], row["touches"], row["x_mm"]) for row in (one, two)] == [("ok", 1, -30), ("ok", 2, -30)]
    assert math.isnan(one["F_2_N"])
    assert math.isnan(one["delta_max_2_mm"])
    assert two["F_2_N"] == pytest.approx(0.4, rel=1e-3)
    assert two["delta_max_2_mm"] > two["delta_max_mm"] == pytest.approx(one["delta_max_mm"])
    assert one["dv_000"] != two["dv_000"]


def test_a_held_row_is_that_of_its_time() -> None:
    raw = QUICK | {"punch": {"x_mm": 10, "y_mm": 0, "force_N": [0.2, 0.3]},
                   "hold": {"time_s": {"list": [1, 60]}, "control": "depth"}}
    rows = solved(design_from(raw))
    assert [row["hold_time_s"] for row in rows] == [1, 60]
    left = [1 - 0.3 * (1 - math.exp(-t / 6)) for t in (1, 60)]
    assert [row["F_N"] / row["punch_force_N"] for row in rows] == pytest.approx(left, rel=1e-3)


def test_a_row_that_is_no_scene_is_told_with_what_was_drawn() -> None:
    punch = {"diameter_mm": 14, "fillet_mm": {"list": [9.0, 0.5]}, "x_mm": 10, "y_mm": 0, "force_N": 0.2}
    rows = solved(design_from(QUICK | {"punch": punch}))
    assert [(row["outcome"], row["punch_fillet_mm"], row["x_mm"]) for row in rows] == [
        ("refused", 9.0, 10.0), ("ok", 0.5, 10.0)]
    assert "at most half of diameter_mm" in rows[0]["message"]


def test_the_keys_of_a_data_set_are_a_table_of_scenes(tmp_path: Path) -> None:
    raw = {"seed": 4, "touches": [1, 2], "punch": {"profile": {"choice": ["flat", "sphere"]}, "force_N": [0.1, 1],
                                                   "diameter_mm": [10, 18]}, "skin": {"thickness_um": [15, 25]}}
    design = design_from(raw, 12)
    rows = [keys_of(design, tables_at(design, i)) for i in range(12)]
    keys = pd.DataFrame(rows).drop(columns="touches")
    keys.to_csv(tmp_path / "scenes.csv", index=False)
    again = read_scene_table(tmp_path / "scenes.csv")
    assert [keys_of(again, tables_at(again, i)) for i in range(12)] == rows
