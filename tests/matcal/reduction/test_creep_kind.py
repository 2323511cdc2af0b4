"""A creep test is known by its held load; ramps, plateaus and relaxation are not taken for one."""

from pathlib import Path

import numpy as np
import pytest

from matcal.reduction.inspect import inspect
from matcal.reduction.reduce import reduce_tests
from touchcal.errors import InputFileError

TIME = np.geomspace(0.1, 1000, 80)


def _write(folder: Path, strain: np.ndarray, stress: np.ndarray, name: str = "relaxation.csv") -> Path:
    path = folder / name
    rows = "".join(f"{t:.6g},{e:.8f},{p:.8f}\n" for t, e, p in zip(TIME, strain, stress, strict=True))
    path.write_text("time,strain,stress\ns,-,kPa\n" + rows, encoding="utf-8")
    return path


@pytest.mark.parametrize(("seed", "kind"), enumerate(["relaxation", "creep", None]))
def test_a_held_load_is_creep(seed: int, kind: str | None, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    tau = 10 ** rng.uniform(0, 2)
    strain = -0.025 * (1 + rng.uniform(0.2, 2) * (1 - np.exp(-TIME / tau)))
    path = _write(tmp_path, strain, -4 * (1 + 0.01 * rng.standard_normal(TIME.size)))
    (found,) = reduce_tests([(kind, (path,))])
    assert found.kind == "creep"
    np.testing.assert_allclose(found.value, -strain / 4000, rtol=2e-3)
    with pytest.raises(InputFileError, match=r"creep=relaxation\.csv"):
        reduce_tests([("uniaxial", (path,))])


@pytest.mark.parametrize("head", ["J(t)", "J", "D", "compliance"])
def test_a_compliance_by_its_letter_and_unit(head: str, tmp_path: Path) -> None:
    rows = "".join(f"{t:.6g},{2 + np.log10(t):.9g}\n" for t in TIME)
    (tmp_path / "creep.csv").write_text(f"t,{head}\ns,1/MPa\n{rows}", encoding="utf-8")
    (found,) = reduce_tests([(None, (tmp_path / "creep.csv",))])
    np.testing.assert_allclose(found.value, 1e-6 * (2 + np.log10(TIME)), rtol=1e-5)


@pytest.mark.parametrize("case", ["relaxation", "ramp", "plateau"])
def test_no_other_test_is_creep(case: str, tmp_path: Path) -> None:
    strain, stress = {"relaxation": (np.full(80, -0.3), -4 - 2 * np.exp(-TIME / 20)),
                      "ramp": (-5e-4 * TIME, -10e-3 * TIME),
                      "plateau": (-5e-4 * TIME, -4 - 1e-4 * TIME)}[case]
    assert "creep" not in inspect(_write(tmp_path, strain, stress))["kind_reason"]


def test_travel_and_load_of_a_creep_are_refused_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "creep.csv"
    path.write_text("time (s),displacement (mm),force (N)\n" + "".join(f"{t},{1 + 0.01 * t},5\n" for t in range(9)))
    with pytest.raises(InputFileError, match=r"found: time, displacement, force\. Divide .* height and force by its"):
        reduce_tests([("creep", (path,))])
