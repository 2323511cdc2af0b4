"""Records made of a known material: strain and stress come back, areas and corrections worked out by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from matcal.reduction.experiment import Experiment
from matcal.reduction.reduce import read_and_reduce

SHEAR_MODULUS_Pa, YOUNG_Pa = 2.0e4, 5.0e4
LOADING_S, REST_S = 40.0, 4.0


def _reduced(folder: Path, kind: str, travel_mm: np.ndarray, force_N: np.ndarray, time_s: np.ndarray,
             sizes: str) -> Experiment:
    rows = "\n".join(f"{t:.9g},{u:.9g},{f:.9g}" for t, u, f in zip(time_s, travel_mm, force_N, strict=True))
    (folder / "t.csv").write_text(f"time (s),displacement (mm),force (N)\n{rows}\n", encoding="utf-8")
    (folder / "s.toml").write_text(f"[{kind}]\n{sizes}", encoding="utf-8")
    (experiment,) = read_and_reduce([(kind, (folder / "t.csv",))], folder / "s.toml").experiments
    return experiment


def _ramp(highest: float) -> tuple[np.ndarray, np.ndarray]:
    """Time at 25 Hz, s, and a strain that rests and then grows steadily."""
    time = np.arange(0, REST_S + LOADING_S, 0.04)
    return time, highest * np.maximum(time - REST_S, 0) / LOADING_S


def _slope(experiment: Experiment) -> float:
    return float(np.polyfit(experiment.strain, experiment.value, 1)[0])


@pytest.mark.parametrize(("faces", "compliance_mm_per_N"), [(1, 0.0), (2, 0.05)])
def test_shear_counts_every_face_and_takes_the_frames_own_travel_off(faces: int, compliance_mm_per_N: float,
                                                                     tmp_path: Path) -> None:
    """tau = F/(faces x 50 mm x 20 mm), gamma = (u - c F)/10 mm; the frame's travel is a sixth of the whole."""
    time, gamma = _ramp(0.4)
    force = SHEAR_MODULUS_Pa * gamma * faces * 50e-3 * 20e-3
    travel = 10.0 * gamma + compliance_mm_per_N * force
    sizes = "length_mm = 50\nwidth_mm = 20\nthickness_mm = 10\n"
    got = _reduced(tmp_path, "shear", travel, force + _noise(time), time,
                   f"faces = {faces}\n{sizes}compliance_mm_per_N = {compliance_mm_per_N}\n")
    assert got.facts["area_mm2"] == pytest.approx(faces * 1000.0)
    assert got.facts["compliance_mm_per_N"] == pytest.approx(compliance_mm_per_N)
    assert _slope(got) == pytest.approx(SHEAR_MODULUS_Pa, rel=2e-3)
    assert got.strain.max() == pytest.approx(0.4, rel=5e-3)
    assert got.value.max() == pytest.approx(0.4 * SHEAR_MODULUS_Pa, rel=5e-3)


def test_compression_counts_its_section_its_height_and_the_frames_compliance(tmp_path: Path) -> None:
    """s = F/(pi 15^2 mm2), e = -(u - c F)/25 mm; the noise is that of means."""
    time, strain = _ramp(0.3)
    area = np.pi * 0.015**2
    force = YOUNG_Pa * strain * area
    got = _reduced(tmp_path, "uniaxial", 25.0 * strain + 0.1 * force, force + _noise(time), time,
                   "diameter_mm = 30\nheight_mm = 25\ncompliance_mm_per_N = 0.1\ndirection = \"compression\"\n")
    assert _slope(got) == pytest.approx(YOUNG_Pa, rel=2e-3)
    assert got.strain.min() == pytest.approx(-0.3, rel=5e-3)
    assert got.value.min() == pytest.approx(-0.3 * YOUNG_Pa, rel=5e-3)
    samples = round(LOADING_S / 0.04 / got.value.size)
    assert samples > 1
    assert got.noise == pytest.approx(1e-3 / area / np.sqrt(samples), rel=0.1)
    assert got.time_s is not None
    assert got.strain == pytest.approx(-0.3 * got.time_s / LOADING_S, abs=2e-4)


def _noise(time: np.ndarray) -> np.ndarray:
    """1 mN of white noise."""
    return 1e-3 * np.random.default_rng(7).standard_normal(time.size)
