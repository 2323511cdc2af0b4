"""Cycles of growing travel: the last loading counts, from the contact of the first, and none of it is rest."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from matcal.reduction.experiment import Experiment
from matcal.reduction.reduce import read_and_reduce

AREA_m2, HEIGHT_mm = 2e-3, 20.0
SIZES = "[uniaxial]\narea_mm2 = 2000\nheight_mm = 20\ndirection = \"compression\"\n"


def _stress_kPa(strain: np.ndarray) -> np.ndarray:
    return 40 * strain * (1 - strain + 4 * strain**3)


def _reduced(folder: Path, corners: list[float], gap_mm: float, seed: int) -> Experiment:
    """The record of a crosshead that goes from corner to corner, mm, a specimen of no memory `gap_mm` away."""
    at = np.r_[0.0, np.cumsum(np.abs(np.diff(corners)))]
    travel = np.interp(np.arange(0, at[-1], 0.02), at, corners)
    strain = np.clip(travel - gap_mm, 0, None) / HEIGHT_mm
    load = 1e3 * AREA_m2 * _stress_kPa(strain) + 0.03 * np.random.default_rng(seed).normal(size=strain.size)
    rows = "\n".join(f"{0.1 * k:.6g},{x:.8g},{f:.8g}" for k, (x, f) in enumerate(zip(travel, load, strict=True)))
    (folder / "t.csv").write_text(f"Time (s),Displacement (mm),Force (N)\n{rows}\n", encoding="utf-8")
    (folder / "s.toml").write_text(SIZES, encoding="utf-8")
    (found,) = read_and_reduce([("uniaxial", (folder / "t.csv",))], folder / "s.toml").experiments
    return found


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("gap_mm", [0.0, 1.0])
@pytest.mark.parametrize("corners", [
    [0, 4, 0, 8, 0, 12, 0], [0, 4, 1, 8, 1, 12, 1], [0, 2, 0, 12], [0, 1.5, 0, 1.5, 0, 12, 0],
    [0, 3, 0, 6, 0, 9, 0, 12, 0, 12, 0]], ids=str)
def test_the_last_loading_has_the_curve_of_the_specimen(corners: list[float], gap_mm: float, seed: int,
                                                        tmp_path: Path) -> None:
    got = _reduced(tmp_path, [gap_mm * (x > 0) + x for x in corners], gap_mm, seed)
    inside = got.strain < -0.05
    assert got.strain.min() == pytest.approx(-0.6, abs=4e-3)
    assert -got.value[inside] / 1e3 == pytest.approx(_stress_kPa(-got.strain[inside]), rel=0.04)
    assert np.all(np.diff(got.strain) < 1e-3)
    assert got.facts["loadings"] == sum(a < b for a, b in pairwise(corners))


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
def test_a_move_that_places_the_crosshead_is_no_loading(seed: int, tmp_path: Path) -> None:
    got, straight = (_reduced(tmp_path, corners, 4.0, seed) for corners in ([0, 3, 1, 16], [0, 16]))
    assert got.facts["loadings"] == 1
    sd = np.hypot(got.facts["contact_sd_mm"], straight.facts["contact_sd_mm"])
    assert abs(got.facts["contact_mm"] - straight.facts["contact_mm"]) < 2 * sd < 0.3


def test_a_specimen_without_memory_loses_no_work_in_cycles_to_both_sides(tmp_path: Path) -> None:
    sizes = "[shear]\nfaces = 2\nlength_mm = 25\nwidth_mm = 20\nthickness_mm = 10\n"
    gamma = np.interp(np.arange(0, 270), [0, 30, 90, 150, 210, 269], [0, 0.3, -0.3, 0.3, -0.3, 0.3])
    load = 20e3 * gamma * 1e-3 + 0.002 * np.random.default_rng(1).normal(size=gamma.size)
    rows = "\n".join(f"{k},{10 * g:.8g},{f:.8g}" for k, (g, f) in enumerate(zip(gamma, load, strict=True)))
    (tmp_path / "shear.csv").write_text(f"Time (s),Displacement (mm),Force (N)\n{rows}\n", encoding="utf-8")
    (tmp_path / "s.toml").write_text(sizes, encoding="utf-8")
    (found,) = read_and_reduce([("shear", (tmp_path / "shear.csv",))], tmp_path / "s.toml").experiments
    assert abs(found.facts["loss_share"]) < 0.02
