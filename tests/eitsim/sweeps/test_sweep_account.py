"""The account of a sweep: errors counted as numpy would, every CPU second in one stage, runs kept in the manifest."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from eitsim.cli.main import app
from eitsim.mechanics.load_paths import build_table
from eitsim.scene.choices import Kind
from eitsim.simulation import reuse
from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.dataset.outcome_counts import OutcomeCounts, count_outcomes
from eitsim.sweeps.dataset.sweep_record import Account
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run.account import Accounted, Errors, account_of, document, lines
from eitsim.sweeps.run.omissions import Omission
from eitsim.sweeps.run.sweep import sweep
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

RAW = {"seed": 7, "punch": {"x_mm": [-35, 35], "y_mm": [-35, 35], "diameter_mm": 14, "force_N": [0.25, 0.298]},
       "skin": {"strain": "normal"}, "accuracy": {"signal": [0.005, 0.03]}, "fields": {"names": ["strain"], "side": 8}}
FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3), "longterm")
CARD = MaterialCard("Table 1", FOAM, None, Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0, 0.4)))


def rows_of(errors: np.ndarray, first: int = 0) -> pd.DataFrame:
    return pd.DataFrame({"scene": np.arange(first, first + errors.size), "outcome": "ok", "message": "",
                         "signal_error": errors, "cpu_s": 0.5})


def test_errors_are_counted_to_a_per_cent_and_add_up() -> None:
    errors = np.random.default_rng(2).lognormal(-5, 1.5, 3001)
    whole = count_outcomes(rows_of(errors))
    parts = sum((count_outcomes(rows_of(part, k)) for k, part in enumerate(np.array_split(errors, 7))), OutcomeCounts())
    for share in (0.1, 0.5, 0.95, 1.0):
        assert whole.error_below(share) == pytest.approx(np.quantile(errors, share, method="inverted_cdf"), rel=0.0051)
        assert parts.error_below(share) == whole.error_below(share)
    assert parts.cpu_s == pytest.approx(0.5 * errors.size)
    assert OutcomeCounts().error_below(0.5) is None


def test_what_weighs_most_is_named_where_rows_miss_the_wanted_error() -> None:
    rim, sheet = (Omission(name, "", bound, False, 3, 8) for name, bound in (("rim left out", 0.18), ("sheet", 0.001)))
    found = Accounted(8, 8, {"ok": 8}, Errors(0.0064, 0.02, 0.032, 0.215, 0.01), (), 1.0, 0.0, (), (rim, sheet))
    assert lines(found)[:2] == [
        "signal error 0.64 % in the median, 95 % below 2 %, at most 3.2 %; 21.5 % of ok rows above the requested 1 %",
        "what the plans count most for: rim left out, at most 18 % (3 rows of the 8 looked at)"]
    assert found.errors is not None
    met = replace(found, errors=replace(found.errors, share_above=0.0))
    assert not any("rim left out" in line for line in lines(met))


def test_failed_rows_have_no_error() -> None:
    table = rows_of(np.array([0.01, np.nan, 0.04])).assign(outcome=["ok", "refused", "bottomed_out"])
    assert count_outcomes(table).error_below(1.0) == pytest.approx(0.01, rel=0.0051)
    assert count_outcomes(table).first.keys() == {"refused", "bottomed_out"}


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Account]]:
    """A set of two runs from a table, with fields; one touch is beyond the table."""
    place = tmp_path_factory.mktemp("account")
    write_card(CARD, place / "card.json")
    accounts = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TOUCHCAL_CACHE", str(place / "cache"))
        patch.setattr(reuse, "DEPTHS", (0.065, 0.07, 0.075))
        patch.setattr(build_table, "_CHECKS", 3)
        for scenes in (3, 5):
            last = sweep(design_from(RAW, scenes), place / "card.json", place / "set", reuse=True).account
            assert last is not None
            accounts.append(last)
    return place / "set", accounts


def test_every_cpu_second_of_rows_is_in_one_stage(swept: tuple[Path, list[Account]]) -> None:
    folder, _ = swept
    account, table = account_of(folder), parquet.read_dataset(folder).table
    spent = {stage.name: stage.cpu_s for stage in account.stages}
    beside = {"table: load paths", "encoding parts", "writing parts"}
    assert sum(cost for name, cost in spent.items() if name not in beside) == pytest.approx(table["cpu_s"].sum())
    assert min(spent.values()) >= 0
    counts = {stage.name: stage.count for stage in account.stages}
    for column, name in (("mechanics_method", "touches"), ("electrics_method", "readings")):
        assert {f"{name}: {how}": n for how, n in table[column].value_counts().items()}.items() <= counts.items()
    assert counts["fields on the skin"] == 5
    assert set(table["mechanics_method"]) == {"table", "solved"}
    solved = table["mechanics_method"] == "solved"
    assert table.loc[solved, "mechanics_cpu_s"].min() > 10 * table.loc[~solved, "mechanics_cpu_s"].max()


def test_errors_are_those_of_the_rows(swept: tuple[Path, list[Account]]) -> None:
    folder, _ = swept
    errors, table = account_of(folder).errors, parquet.read_dataset(folder).table
    assert errors is not None
    assert [errors.median, errors.p95] == pytest.approx(np.quantile(table["signal_error"], [0.5, 0.95]))
    assert errors.requested is None


def test_every_row_tells_what_share_of_its_signal_is_extrapolated(swept: tuple[Path, list[Account]]) -> None:
    folder, _ = swept
    account, shares = account_of(folder), parquet.read_dataset(folder).table[parquet.EXTRAPOLATED].to_numpy()
    assert ((shares > 0.5) & (shares < 1)).all()  # fitted in tension, touches compress the thickness
    assert len(set(shares)) == shares.size
    assert account.extrapolated == (np.median(shares), shares.max())
    assert (f"{100 * np.median(shares):.3g} % of the signal comes from extrapolated conductivity in the median row, at "
            f"most {100 * shares.max():.3g} %") in lines(account)


@pytest.mark.parametrize(("signal", "share"), [(0.003, 2 / 3), ([0.001, 0.03], 1 / 3)])
def test_errors_are_held_against_the_wanted_ones(tmp_path: Path, signal: Any, share: float) -> None:
    parquet.write_manifest(tmp_path, {"design": {"scenes": 3, "tables": {"accuracy": {"signal": signal}}}})
    rows = rows_of(np.array([0.002, 0.02, 0.004])).assign(accuracy_signal=[0.001, 0.03, 0.02])
    parquet.write_part(tmp_path, rows.to_dict("records"))
    errors = account_of(tmp_path).errors
    assert errors is not None
    assert errors.share_above == pytest.approx(share)


def test_runs_are_kept(swept: tuple[Path, list[Account]]) -> None:
    folder, accounts = swept
    account = account_of(folder)
    assert [run.rows for run in account.runs] == [3, 2]
    assert [*account.runs] == [last.run for last in accounts]
    cpu_s = parquet.read_dataset(folder).table["cpu_s"].sum()
    assert sum(run.rows_cpu_s for run in account.runs) == pytest.approx(cpu_s)
    for run in account.runs:
        assert run.efficiency == pytest.approx(run.rows_cpu_s / run.rows_wall_s)
        assert 0 < run.writing_wall_s < run.rows_wall_s
        assert run.paths_cpu_s > 1
    assert account.bytes_per_row == pytest.approx(sum(p.stat().st_size for p in parquet.parts(folder)) / 5)
    assert account.field_bytes_per_row > 0
    assert Kind.SHEET in {one.kind for one in account.left_out}
    assert all(0 < one.rows <= one.of for one in account.left_out)
    assert {one.of for one in account.left_out} == {5}
    assert any("last run: 2 rows" in told for told in lines(account))
    json.dumps(document(account), allow_nan=False)


def test_sets_without_times_have_an_account(tmp_path: Path) -> None:
    parquet.write_manifest(tmp_path, {"design": {"scenes": 3, "tables": {}}})
    parquet.write_part(tmp_path, rows_of(np.array([0.002, 0.02, 0.004])).drop(columns="cpu_s").to_dict("records"))
    account = account_of(tmp_path)
    assert account.errors is not None
    assert account.errors.share_above == pytest.approx(1 / 3)
    assert (account.stages, account.rows_per_core_hour) == ((), None)


def test_the_command_prints_the_account(tmp_path: Path) -> None:
    write_card(CARD, tmp_path / "card.json")
    (tmp_path / "design.toml").write_text("scenes = 1\n[punch]\nx_mm = 5\ny_mm = 0\nforce_N = 0.3\n"
                                          "[accuracy]\nsignal = 0.05\n[measurement]\nnoise_V = 1e-4\n")
    command = ["sweep", str(tmp_path / "design.toml"), "--card", str(tmp_path / "card.json"), "--workers", "1",
               "--out", str(tmp_path / "set")]
    told = CliRunner().invoke(app, [*command, "--report", str(tmp_path / "set.pdf")], catch_exceptions=False)
    assert told.exit_code == 0
    assert all(words in told.stdout for words in ("touches: solved", "readings: multipole", "rows per core-hour",
                                                    "rows are clean: `eitsim measure"))
    assert (tmp_path / "set.pdf").read_bytes().startswith(b"%PDF")
    found = json.loads(CliRunner().invoke(app, [*command, "--json"], catch_exceptions=False).stdout)
    assert (found["solved"], found["kept"], found["outcomes"]) == (0, 1, {"ok": 1})
    assert {stage["name"] for stage in found["stages"]} >= {"touches: solved", "writing parts"}
