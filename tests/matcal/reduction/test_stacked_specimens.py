"""Several specimens below one another in one table: each is a test, and three in one file are three in three files."""

from pathlib import Path

import numpy as np
import pytest

import matcal
from matcal.reduction.experiment import Experiment
from matcal.reduction.inspect import inspect
from matcal.reduction.reduce import read_and_reduce

CASE = Path(__file__).parents[4] / "shared" / "cases" / "material" / "29_stacked_specimens"
STIFFNESS_kPa = (16.0, 20.0, 24.0)


def _experiments(path: Path, text: str, specimen: Path | None = None) -> list[Experiment]:
    path.write_text(text, encoding="utf-8")
    return read_and_reduce([("uniaxial", (path,))], specimen).experiments


def _table(head: str, labels: tuple[str, ...] = (), order: str = "stacked") -> str:
    strain = np.linspace(0, -0.6, 31)
    rows = [(k, n, e, young * (e - 0.5 * e**2)) for k, young in enumerate(STIFFNESS_kPa) for n, e in enumerate(strain)]
    if order == "mixed":
        rows = sorted(rows, key=lambda row: row[1])
    return "\n".join([head, *((f"{labels[k]}," if labels else "") + f"{e:.6g},{p:.6g}" for k, _, e, p in rows), ""])


@pytest.mark.parametrize(("name", "labels"), [
    ("Specimen", ("A1", "A2", "A3")), ("Sample ID", ("1", "2", "3")), ("Probe", ("P 1", "P 2", "P 3")),
    ("run", ("0", "1", "2")), ("ID", ("x", "y", "z")), ("replicate", ("1", "2", "3")), ("Prüfkörper Nr.", "abc")])
@pytest.mark.parametrize("order", ["stacked", "mixed"])
def test_a_column_that_names_specimens_parts_them(name: str, labels: tuple[str, ...], order: str,
                                                  tmp_path: Path) -> None:
    found = _experiments(tmp_path / "t.csv", _table(f"{name},strain,stress (kPa)", labels, order))
    assert [e.value.min() for e in found] == pytest.approx([-0.78e3 * young for young in STIFFNESS_kPa], rel=1e-5)
    assert [e.facts["stiffness_factor"] for e in found] == pytest.approx([0.8, 1.0, 1.2])
    assert not any(e.cautions for e in found)
    assert list(inspect(tmp_path / "t.csv", kind="uniaxial")["specimens"].values()) == [31, 31, 31]


def test_a_strain_that_begins_again_parts_them_and_is_said(tmp_path: Path) -> None:
    found = _experiments(tmp_path / "t.csv", _table("strain,stress (kPa)"))
    assert [e.strain.size for e in found] == [31, 31, 31]
    assert all("taken as 3 specimens" in e.cautions[0] for e in found)


@pytest.mark.parametrize("labelled", [True, False])
def test_records_of_a_machine_whose_clock_begins_again(labelled: bool, tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text("[uniaxial]\narea_mm2 = 1000\nheight_mm = 20\ndirection = \"compression\"\n",
                                     encoding="utf-8")
    time = np.arange(0, 20, 0.1)
    strain = 0.5 * np.clip(time - 2, 0, None) / 18
    rows = [("AB"[k] + ",") * labelled + f"{t:.4g},{20 * e:.8g},{young * e:.8g}"
            for k, young in enumerate((20.0, 30.0)) for t, e in zip(time, strain, strict=True)]
    text = "\n".join(["Coupon," * labelled + "time (s),displacement (mm),force (N)", *rows, ""])
    found = _experiments(tmp_path / "t.csv", text, tmp_path / "s.toml")
    assert [np.polyfit(e.strain, e.value, 1)[0] for e in found] == pytest.approx([20e3, 30e3], rel=5e-3)
    assert [bool(e.cautions) for e in found] == [not labelled] * 2


def test_a_number_of_each_row_names_no_specimen(tmp_path: Path) -> None:
    rows = "\n".join(f"{k},{-0.01 * k:.6g},{-0.2 * k:.6g}" for k in range(40))
    assert len(_experiments(tmp_path / "t.csv", f"ID,strain,stress (kPa)\n{rows}\n")) == 1


def test_one_table_of_three_specimens_is_fitted_as_three_files(tmp_path: Path) -> None:
    whole = _table("Coupon,strain,stress (kPa)", ("a", "b", "c"))
    (tmp_path / "uniaxial_all.csv").write_text(whole, encoding="utf-8")
    for name in "abc":
        lines = [line for line in whole.splitlines() if line.startswith((f"{name},", "Coupon"))]
        (tmp_path / f"uniaxial_{name}.csv").write_text("\n".join([*lines, ""]), encoding="utf-8")
    one = matcal.fit(tmp_path / "uniaxial_all.csv", order=2).card
    three = matcal.fit([tmp_path / f"uniaxial_{name}.csv" for name in "abc"], order=2).card
    assert one.hyperfoam is not None
    assert three.hyperfoam is not None
    assert one.hyperfoam.mu_0_Pa == pytest.approx(three.hyperfoam.mu_0_Pa, rel=1e-9)
    assert one.fit["derived"]["mu_0_Pa"] == pytest.approx(three.fit["derived"]["mu_0_Pa"], rel=1e-6)


@pytest.mark.skipif(not CASE.exists(), reason="the shared cases are not here")
def test_stacked_coupons() -> None:
    """Three specimens with 20 % scatter about 10,200 Pa."""
    card = matcal.fit(CASE / "uniaxial_long.csv").card
    mu_0 = card.fit["derived"]["mu_0_Pa"]
    assert mu_0["value"] == pytest.approx(10200, rel=0.02)
    assert mu_0["lo"] < 10200 < mu_0["hi"]
    assert mu_0["hi"] - mu_0["lo"] < 6500
    assert {"uniaxial_1", "uniaxial_2", "uniaxial_3"} <= set(card.fit)
