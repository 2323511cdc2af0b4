"""Loadings that are not steady, not whole or not from contact on: each is used as far as it is one, and said."""

from pathlib import Path

import numpy as np
import pytest

from matcal.reduction.experiment import Experiment
from matcal.reduction.inspect import inspect
from matcal.reduction.loading_doubts import collapse, loading_doubts, ramp_speed
from matcal.reduction.reduce import read_and_reduce

CASES = Path(__file__).parents[4] / "shared" / "cases" / "material"
YOUNG_Pa = 40e3


def _machine(folder: Path, time: np.ndarray, strain: np.ndarray, force: np.ndarray) -> Experiment:
    rows = "\n".join(f"{t:.6g},{20 * e:.8g},{f:.8g}" for t, e, f in zip(time, strain, force, strict=True))
    (folder / "t.csv").write_text(f"time (s),displacement (mm),force (N)\n{rows}\n", encoding="utf-8")
    (folder / "s.toml").write_text("[uniaxial]\narea_mm2 = 1000\nheight_mm = 20\ndirection = \"compression\"\n",
                                   encoding="utf-8")
    (got,) = read_and_reduce([("uniaxial", (folder / "t.csv",))], folder / "s.toml").experiments
    return got


@pytest.mark.parametrize("step", [0.01, 0.02, 0.04, 0.05, 0.1, 0.15])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_coarse_table_carries_load_from_its_first_step_on(step: float, side: int) -> None:
    e = side * np.arange(0, 0.61, step)
    assert loading_doubts("t", e, 20 * e - 10 * side * e**2) == []


@pytest.mark.parametrize("step", [0.005, 0.01, 0.02])
@pytest.mark.parametrize("gap", [0.04, 0.06])
def test_strain_before_contact_is_said_with_its_size(step: float, gap: float) -> None:
    e = np.arange(0, 0.61, step)
    (said,) = loading_doubts("t", -e, -20 * np.maximum(e - gap, 0))
    assert float(said.split("strain of -")[1].split(",")[0]) == pytest.approx(gap, abs=max(step, 0.01))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noise", [1e-3, 0.05])
def test_a_displacement_that_counts_on_after_the_peak_ends_the_loading_there(seed: int, noise: float,
                                                                             tmp_path: Path) -> None:
    """Contact at 0.05, peak at a strain of 0.45 past it, and the counter goes on to twice the travel."""
    time = np.arange(0, 100, 0.1)
    strain = time / 100
    force = YOUNG_Pa * 1e-3 * np.where(strain < 0.5, np.maximum(strain - 0.05, 0), 0)
    got = _machine(tmp_path, time, strain, force + noise * np.random.default_rng(seed).normal(size=time.size))
    assert got.strain.min() == pytest.approx(-0.45, abs=0.005 + 3 * got.facts["strain_zero_sd"])
    assert np.polyfit(got.strain, got.value, 1)[0] == pytest.approx(YOUNG_Pa, rel=0.02)
    assert any("up to the largest load is used" in caution for caution in got.cautions)


def test_a_table_of_a_specimen_that_breaks_is_used_up_to_there(tmp_path: Path) -> None:
    e = np.linspace(0, 1.0, 101)
    rows = "\n".join(f"{x:.6g},{y:.6g}" for x, y in zip(e, np.where(e < 0.805, 20 * e, 0.1), strict=True))
    (tmp_path / "tension.csv").write_text(f"strain (-),stress (kPa)\n{rows}\n", encoding="utf-8")
    (got,) = read_and_reduce([("uniaxial", (tmp_path / "tension.csv",))]).experiments
    assert got.strain.max() == pytest.approx(0.8)
    assert "a strain of 0.8" in got.cautions[0]


@pytest.mark.parametrize("name", ["uniaxial.csv", "uniaxial_compression_and_tension.csv"])
def test_a_table_from_compression_to_tension_is_whole(name: str, tmp_path: Path) -> None:
    """It begins with a stress in compression that is larger than any of its tension."""
    e = np.linspace(-0.5, 1.2, 35)
    rows = "\n".join(f"{x:.6g},{y:.6g}" for x, y in zip(e, np.where(e < 0, 3 * e, 0.6 * e), strict=True))
    (tmp_path / name).write_text(f"strain (-),stress (kPa)\n{rows}\n", encoding="utf-8")
    (got,) = read_and_reduce([("uniaxial", (tmp_path / name,))]).experiments
    assert got.strain.tolist() == pytest.approx(e, rel=1e-5)
    assert got.cautions == ()


@pytest.mark.parametrize("load", [lambda u: u, lambda u: np.minimum(u, 0.1 + 0.05 * u), lambda u: u - 0.8 * u**2,
                                  lambda u: 0 * u,
                                  lambda u: np.where(u < 0.3, u, 0.3 * np.exp(-(u - 0.3)))])
def test_a_plateau_or_a_softening_is_no_collapse(load: object) -> None:
    u = np.linspace(0, 1, 300)
    assert collapse(u, load(u)) is None  # type: ignore[operator]


@pytest.mark.parametrize("steps", [3, 7])
@pytest.mark.parametrize("hold_s", [5.0, 30.0])
def test_steps_with_holds_are_said_with_their_ramp_speed(steps: int, hold_s: float, tmp_path: Path) -> None:
    """Steps at 0.05/s; the stress relaxes by a fifth in each hold."""
    rise = 0.6 / steps / 0.05
    ends = np.cumsum(np.tile([rise, hold_s], steps))
    time = np.arange(0, 5 + ends[-1], 0.1)
    strain = np.interp(time - 5, np.r_[0, ends], np.r_[0, np.repeat(np.linspace(0, 0.6, steps + 1)[1:], 2)])
    since = np.array([min((t - 5 - b for b in ends[::2] if t - 5 >= b), default=0.0) for t in time])
    force = YOUNG_Pa * 1e-3 * strain * (1 - 0.2 * (1 - np.exp(-since / 2)))
    got = _machine(tmp_path, time, strain, force + 1e-3 * np.random.default_rng(0).normal(size=time.size))
    (said,) = got.cautions
    assert f"held {steps - 1} times on the way" in said
    assert "at some 0.05/s" in said
    found = inspect(tmp_path / "t.csv", kind="uniaxial")
    assert (found["holds_on_the_way"], found["ramp_speed_mm_per_min"]) == (steps - 1, pytest.approx(60.0, rel=0.05))
    assert found["hold_s"] == pytest.approx(hold_s, rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_a_steady_loading_is_no_row_of_steps(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    time = np.arange(0, 60, 0.1)
    strain = np.clip((time - 5) / 100, 0, None) + 1e-5 * rng.normal(size=time.size)
    got = _machine(tmp_path, time, strain, 40 * np.clip(strain, 0, None) + 2e-3 * rng.normal(size=time.size))
    assert got.cautions == ()
    assert ramp_speed(time, np.clip((time - 5) / 100, 0, None)) == pytest.approx(0.01)


@pytest.mark.skipif(not CASES.exists(), reason="the shared cases are not here")
def test_public_records_of_steps_and_of_a_counter_that_goes_on() -> None:
    """Seven steps at 10 mm/min; a largest load of 12 gf at 4.80 mm of 10.41 mm."""
    folder = CASES / "01_instron_pu_foam"
    found = inspect(folder / "PU_U1comp_1.csv", kind="uniaxial")
    assert (found["holds_on_the_way"], found["ramp_speed_mm_per_min"]) == (6, pytest.approx(10.0, rel=0.05))
    folder = CASES / "06_mecmesin_gf_comma"
    whole, cut = (read_and_reduce([("uniaxial", (folder / name,))], folder / "specimen.toml").experiments[0]
                  for name in ("sample-2.txt", "loading.txt"))
    assert "at 4.80" in whole.cautions[0]
    assert whole.strain.min() == pytest.approx(cut.strain.min(), abs=0.01)
