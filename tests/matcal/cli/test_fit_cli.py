"""Flags of `matcal fit` that choose the law, and what they leave on the card and on the terminal."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from matcal.cli.main import app
from matcal.fitting.hyperfoam.curves import weigh
from matcal.laws.deformation_modes import lateral_strain, nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.stability import is_stable
from matcal.reduction.experiment import Experiment

DATA = Path(__file__).parents[3] / "data_raw"
MIXED = Hyperfoam([9000.0, 4000.0], [2.0, 8.0], [0.3, 0.1])


def table(path: Path, columns: dict[str, np.ndarray], units: str) -> Path:
    rows = "\n".join(",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True))
    path.write_text(",".join(columns) + f"\n{units}\n{rows}\n")
    return path


def card(*arguments: str) -> dict:
    done = CliRunner().invoke(app, [*arguments, "--json"], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def test_a_file_is_predicted_and_not_fitted(tmp_path: Path) -> None:
    found = card("fit", str(DATA / "uniaxial.csv"), "--predict", str(DATA / "shear.csv"), "--order", "3",
                 "--out", str(tmp_path / "card.json"))
    assert list(found["hyperfoam"]["strain_range"]) == ["uniaxial"]
    (row,) = found["fit"]["predicted"]
    assert row["kind"] == "shear"
    assert row["source"] == ["shear.csv"]
    assert list(row["relative_rms"]) == ["combined"]
    assert 0.005 < row["relative_rms"]["combined"] < 0.5
    assert any("no cross prediction is possible" in d for d in found["provenance"]["decisions"])
    assert any(f["name"] == "shear.csv" for f in found["provenance"]["files"])


def test_stability_is_held_over_the_range_asked_for_and_the_records_are_checked(tmp_path: Path) -> None:
    out = tmp_path / "card.json"
    found = card("fit", str(DATA / "uniaxial.csv"), str(DATA / "shear.csv"), "--order", "3", "--stable", "drucker",
                 "--stable-range", "0.3,1.4", "--out", str(out))
    law = Hyperfoam(*(np.array(found["hyperfoam"][k]) for k in ("mu_Pa", "alpha", "nu")))
    assert is_stable(law, "drucker", "uniaxial", np.linspace(-0.7, 0.4, 200)).all()
    free = found["fit"]["without_stability"]["relative_rms_of"]
    assert found["fit"]["uniaxial_1"]["relative_rms"] > 2 * free["uniaxial_1"]
    checked = card("check", str(out))
    assert checked["data"][0]["criterion"] == "drucker"
    assert checked["data"][0]["violated_strain"]
    printed = CliRunner().invoke(app, ["check", str(out)]).stdout
    assert "uniaxial_1, record itself, drucker: violated at" in printed


@pytest.mark.thorough
def test_nu_term_by_term_from_a_column_of_lateral_strain(tmp_path: Path) -> None:
    e, gamma = np.linspace(-0.6, 0.3, 40), np.linspace(0.01, 0.8, 25)
    uniaxial = table(tmp_path / "uniaxial.csv", {"strain": e, "stress": nominal_stress(MIXED, "uniaxial", e) / 1e3,
                                                 "lateral strain": lateral_strain(MIXED, "uniaxial", e)}, "-,kPa,-")
    shear = table(tmp_path / "shear.csv", {"gamma": gamma, "stress": nominal_stress(MIXED, "shear", gamma) / 1e3},
                  "-,kPa")
    files = (str(uniaxial), str(shear), "--out", str(tmp_path / "card.json"))
    each = card("fit", *files, "--poisson", "fit-each", "--order", "2")
    np.testing.assert_allclose(each["hyperfoam"]["nu"], MIXED.nu, atol=5e-3)
    listed = card("fit", *files, "--poisson", "0.3,0.1")
    np.testing.assert_allclose(listed["hyperfoam"]["mu_Pa"], MIXED.mu_Pa, rtol=1e-3)


@pytest.mark.parametrize(("flags", "word"), [
    (("--order", "7"), "known: auto, 1"), (("--stable", "hill"), "known: drucker, elliptic"),
    (("--stable", "drucker", "--stable-range", "0.5"), "two principal stretches"),
    (("--poisson", "fit-each"), "lateral strain"), (("--predict", "relaxation={relax}"), "cannot be predicted")])
def test_flags_that_cannot_be_met_are_refused(tmp_path: Path, flags: tuple[str, ...], word: str) -> None:
    relax = table(tmp_path / "hold.csv", {"time": np.r_[0, 1.0, np.geomspace(2, 100, 30)],
                                          "strain": np.r_[0, -0.5 * np.ones(31)],
                                          "stress": np.r_[0, -5 + np.linspace(0, 1, 31)]}, "s,-,kPa")
    with pytest.raises(ValueError, match=word):
        CliRunner().invoke(app, ["fit", str(DATA / "uniaxial.csv"), "--out", str(tmp_path / "card.json"),
                                 *(f.format(relax=relax) for f in flags)], catch_exceptions=False)
    assert not (tmp_path / "card.json").exists()


def test_stated_deviations_weigh_point_by_point() -> None:
    e = np.linspace(-0.6, -0.01, 40)
    stress = nominal_stress(MIXED, "uniaxial", e)
    deviation = np.where(e < -0.3, 500.0, 10.0)
    stated = Experiment("uniaxial", e, stress, source=("a.csv",), deviation=deviation)
    bare = Experiment("shear", -e, nominal_stress(MIXED, "shear", -e), source=("b.csv",))
    curve, other = weigh([stated, bare], "deviation")
    assert curve.scale_Pa.max() / curve.scale_Pa.min() == pytest.approx(500 / (0.2 * np.median(deviation)))
    assert "stated in the file" in curve.unit
    assert "5% of the stress itself" in other.unit
    with pytest.raises(ValueError, match="deviations are 0"):
        weigh([Experiment("uniaxial", e, stress, source=("a.csv",), deviation=np.zeros(40))], "deviation")
