"""Sweeps: rows depend on design and card alone, a stopped sweep goes on, another design or card is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from eitsim.dataset import MANIFEST, parts, read_dataset
from eitsim.design import Design, design_from
from eitsim.sweep import Account, sweep
from matcal.card import MaterialCard, write_card
from matcal.conductivity import Conductivity
from matcal.hyperfoam import Hyperfoam

RAW = {"seed": 7, "punch": {"x_mm": [-35, 35], "y_mm": [-35, 35], "diameter_mm": [12, 16], "force_N": [0.2, 1.0]},
       "accuracy": {"signal": 0.05}}
COST = ["cpu_s"]


@pytest.fixture
def card(tmp_path: Path) -> Path:
    foam = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
    write_card(MaterialCard("Table 1", foam, None, Conductivity(30.0, [-2, 2, -1], (0, 0.4))), tmp_path / "card.json")
    return tmp_path / "card.json"


def account(design: Design, card: Path, folder: Path, workers: int = 1) -> Account:
    *_, last = sweep(design, card, folder, workers=workers)
    assert isinstance(last, Account)
    return last


def test_a_continued_sweep_equals_one_in_a_go_on_any_number_of_workers(card: Path, tmp_path: Path) -> None:
    assert account(design_from(RAW, 3), card, tmp_path / "a").solved == 3
    first = read_dataset(tmp_path / "a").table
    grown = account(design_from(RAW, 10), card, tmp_path / "a", workers=2)
    assert (grown.kept, grown.solved, dict(grown.outcomes)) == (3, 7, {"ok": 10})
    account(design_from(RAW, 10), card, tmp_path / "b")
    a, b = (read_dataset(tmp_path / name).table.drop(columns=COST) for name in "ab")
    pd.testing.assert_frame_equal(a, b)
    pd.testing.assert_frame_equal(a.head(3), first.drop(columns=COST))


def test_a_lost_part_is_made_again(card: Path, tmp_path: Path) -> None:
    account(design_from(RAW, 9), card, tmp_path / "a")
    whole = read_dataset(tmp_path / "a").table.drop(columns=COST)
    parts(tmp_path / "a")[1].unlink()
    assert account(design_from(RAW, 9), card, tmp_path / "a").solved == 1
    pd.testing.assert_frame_equal(read_dataset(tmp_path / "a").table.drop(columns=COST), whole)


def test_failures_are_rows(card: Path, tmp_path: Path) -> None:
    raw = RAW | {"punch": {"x_mm": {"choice": [20.0, 95.0]}, "y_mm": 0.0, "force_N": [0.2, 0.4]}}
    account(design_from(raw, 6), card, tmp_path / "a")
    table = read_dataset(tmp_path / "a").table
    refused = table[table["x_mm"] == 95.0]
    assert set(refused["outcome"]) == {"refused"}
    assert refused["message"].str.contains("rim").all()
    assert set(table.loc[table["x_mm"] == 20.0, "outcome"]) == {"ok"}
    assert np.isfinite(table.loc[table["outcome"] == "ok", "dv_207"]).all()


def test_another_design_or_card_is_refused(card: Path, tmp_path: Path) -> None:
    account(design_from(RAW, 1), card, tmp_path / "a")
    with pytest.raises(ValueError, match="seed is 7, here 8"):
        account(design_from(RAW | {"seed": 8}, 1), card, tmp_path / "a")
    content = json.loads(card.read_text())
    content["hyperfoam"]["mu_Pa"][0] *= 1.01
    card.write_text(json.dumps(content))
    with pytest.raises(ValueError, match="another folder"):
        account(design_from(RAW, 1), card, tmp_path / "a")
    assert (tmp_path / "a" / MANIFEST).exists()


def test_a_card_without_what_is_needed_starts_nothing(card: Path, tmp_path: Path) -> None:
    content = json.loads(card.read_text())
    del content["conductivity"]
    card.write_text(json.dumps(content))
    with pytest.raises(ValueError, match="no conductivity"):
        account(design_from(RAW, 1), card, tmp_path / "a")
    assert not (tmp_path / "a").exists()


def test_columns_follow_the_drive(card: Path, tmp_path: Path) -> None:
    raw = RAW | {"drive": {"pattern": "opposite", "reading": "differential"}}
    assert account(design_from(raw, 2), card, tmp_path / "a").outcomes == {"ok": 2}
    table = read_dataset(tmp_path / "a").ok
    volts = table[[name for name in table.columns if name.startswith("dv_")]]
    assert volts.shape == (2, 16 * 12)
    assert np.all(np.isfinite(volts))
