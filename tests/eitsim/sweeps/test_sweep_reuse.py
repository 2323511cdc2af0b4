"""Sweeps from a table of load paths: the same rows on any number of workers, told in the manifest, kept to, exact."""

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from unittest.mock import patch

import pandas as pd
import pytest

from eitsim.mechanics.load_paths import build_table
from eitsim.simulation import reuse
from eitsim.simulation.routes import axisymmetric
from eitsim.sweeps.dataset.parquet import COST, read_dataset, read_manifest
from eitsim.sweeps.dataset.sweep_record import Account
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run import sweep as sweeping
from eitsim.sweeps.run.sweep import sweep
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal import cache
from touchcal.parallel.pool import ExecutorPool, PoolUnavailable, WorkerLost

RAW = {"seed": 7, "punch": {"x_mm": [-35, 35], "y_mm": [-35, 35], "diameter_mm": 14, "force_N": [0.262, 0.298]},
       "accuracy": {"signal": 0.05}}
FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")


@pytest.fixture
def card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(reuse, "DEPTHS", (0.065, 0.07, 0.075))
    monkeypatch.setattr(build_table, "_CHECKS", 3)
    write_card(MaterialCard("Table 1", FOAM, None, Conductivity(30.0, [-2, 2, -1], (0, 0.4))), tmp_path / "card.json")
    return tmp_path / "card.json"


def account(card: Path, folder: Path, scenes: int, **options) -> Account:
    last = sweep(design_from(RAW, scenes), card, folder, **options).account
    assert last is not None
    return last


@pytest.mark.thorough
@pytest.mark.usefixtures("solved_once")
def test_another_skin_conductor_drive_or_electrodes_take_the_table_that_is_there(card: Path, tmp_path: Path) -> None:
    assert account(card, tmp_path / "a", 2, reuse=True).outcomes == {"ok": 2}
    first = read_dataset(tmp_path / "a").table
    for change in ({"skin": {"strain": "normal"}}, {"punch": RAW["punch"] | {"conductor": True}},
                   {"drive": {"pattern": "opposite"}}, {"electrodes": {"contact_impedance_Ohm_m": 2.0}}):
        folder = tmp_path / next(iter(change))
        sweep(design_from(RAW | change, 2), card, folder, reuse=True)
        other = read_dataset(folder).table
        assert (other["delta_max_mm"] == first["delta_max_mm"]).all()
        assert (other["dv_000"] != first["dv_000"]).all()
    assert cache.clear() == 1


@pytest.mark.slow
def test_rows_from_a_table_do_not_depend_on_workers_or_the_cache(card: Path, tmp_path: Path,
                                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweeping, "ROWS_FROM_TABLE", 2)
    first = account(card, tmp_path / "a", 3, reuse=True)
    assert "a table of 1 load paths" in first.method
    assert cache.clear() == 1
    account(card, tmp_path / "b", 3, reuse=True, workers=2)
    with ThreadPoolExecutor(2) as threads:
        account(card, tmp_path / "c", 3, reuse=True, scheduler=ExecutorPool(threads, 3))
    a, *others = (read_dataset(tmp_path / name).table.drop(columns=[*COST]) for name in "abc")
    for other in others:
        pd.testing.assert_frame_equal(a, other, check_exact=True)
    fresh = account(card, tmp_path / "d", 2)
    assert "so few touches" in fresh.method
    d = read_dataset(tmp_path / "d").table
    apart = (a["delta_max_mm"].head(2) / d["delta_max_mm"] - 1).abs()
    assert (apart > 0).all()
    assert (apart < 1e-3).all()


def test_a_folder_keeps_to_its_method(card: Path, tmp_path: Path) -> None:
    account(card, tmp_path / "a", 1, reuse=False)
    assert read_manifest(tmp_path / "a")["method"] == {"exact": False, "reuse": False, "rim": False,
                                                     "reason": "as asked for"}
    with pytest.raises(ValueError, match="started with reuse = False"):
        account(card, tmp_path / "a", 2, reuse=True)
    with pytest.raises(ValueError, match="started with exact = False"):
        account(card, tmp_path / "a", 2, exact=True)
    with pytest.raises(ValueError, match="exact solves every touch itself"):
        account(card, tmp_path / "b", 2, exact=True, reuse=True)
    assert account(card, tmp_path / "a", 2).kept == 1


@pytest.mark.slow
def test_exact_rows_are_told(card: Path, tmp_path: Path) -> None:
    assert "every touch solved exactly" in account(card, tmp_path / "a", 1, exact=True).method
    assert read_manifest(tmp_path / "a")["method"]["exact"] is True
    row = read_dataset(tmp_path / "a").table.iloc[0]
    account(card, tmp_path / "b", 1)
    usual = read_dataset(tmp_path / "b").table.iloc[0]
    assert row["depth_error"] < usual["depth_error"]


def test_paths_that_are_not_found_leave_every_touch_solved_directly(card: Path, tmp_path: Path,
                                                           monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reuse, "DEPTHS", (0.07,))
    done = account(card, tmp_path / "a", 1, reuse=True)
    assert "no table" in done.method
    assert dict(done.outcomes) == {"ok": 1}
    assert read_manifest(tmp_path / "a")["method"]["table"]["used"] is False
    monkeypatch.setattr(reuse, "DEPTHS", (0.065, 0.07, 0.075))
    assert account(card, tmp_path / "a", 2).method == done.method
    assert set(read_dataset(tmp_path / "a").table["mechanics_method"]) == {"solved"}
    assert set(read_dataset(tmp_path / "a").table["mechanics_kind"]) == {"axisymmetric"}


class _Deadly:
    """Loses its worker on everything."""

    losses = (WorkerLost,)

    def look(self) -> None:
        pass

    def max_in_flight(self) -> int:
        return 1

    def broadcast(self, task):
        def submit(_):
            done: Future = Future()
            done.set_exception(WorkerLost("its process was killed by signal 9"))
            return done
        return submit


@pytest.mark.thorough
def test_workers_lost_over_the_table_stop_the_sweep_before_any_row(card: Path, tmp_path: Path) -> None:
    with pytest.raises(PoolUnavailable, match="the same command goes on from there"):
        account(card, tmp_path / "a", 2, reuse=True, scheduler=_Deadly())
    assert "table" not in read_manifest(tmp_path / "a")["method"]
    assert "a table of 1 load paths" in account(card, tmp_path / "a", 2, reuse=True).method
    assert set(read_dataset(tmp_path / "a").table["mechanics_method"]) == {"table"}


@pytest.mark.thorough
@pytest.mark.usefixtures("solved_once")
def test_rows_from_a_table_are_not_continued_without_it(card: Path, tmp_path: Path,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    account(card, tmp_path / "a", 1, reuse=True)
    monkeypatch.setattr(reuse, "DEPTHS", (0.07,))
    with pytest.raises(ValueError, match="is not had again"):
        account(card, tmp_path / "a", 2)


@pytest.mark.slow
@pytest.mark.usefixtures("solved_once")
def test_another_strain_solves_no_touch_again(card: Path, tmp_path: Path) -> None:
    """Touches deeper than the table, which are solved, are kept by content."""
    deep = RAW | {"punch": RAW["punch"] | {"force_N": [0.35, 0.4]}}
    tables, counts = [], []
    with patch.object(axisymmetric, "solve_touch", wraps=axisymmetric.solve_touch) as solve:
        for strain in ("principal", "normal"):
            sweep(design_from(deep | {"skin": {"strain": strain}}, 2), card, tmp_path / strain, reuse=True)
            tables.append(read_dataset(tmp_path / strain).table)
            counts.append(solve.call_count)
    first, other = tables
    assert set(first["mechanics_method"]) == set(other["mechanics_method"]) == {"solved"}
    assert counts == [2, 2]
    assert (other["delta_max_mm"] == first["delta_max_mm"]).all()
    assert (other["dv_000"] != first["dv_000"]).all()
