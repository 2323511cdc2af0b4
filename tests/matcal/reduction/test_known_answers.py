"""Records made of a known material: strain and stress come back, areas and corrections worked out by hand."""

from pathlib import Path

import numpy as np
import pytest

from matcal.reduction.experiment import Experiment
from matcal.reduction.reduce import read_and_reduce
from matcal.reduction.specimen import Block, Strip, make_specimen, read_tables
from touchcal.errors import InputFileError

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


def test_drift_between_two_rests_is_taken_off_with_the_error_of_two_means(tmp_path: Path) -> None:
    """0.05 mN/s under 1 mN of noise, 10 s of rest before and 20 s after at 25 Hz: sd = 1 mN hypot(250^-1/2, 500^-1/2)
    over the 100 s between their middles, and no stress is left of the drift."""
    time = np.arange(0, 115, 0.04)
    travel = np.interp(time, [0, 10, 50, 95, 115], [0, 0, 5, 0, 0])
    spring = 4.0 * np.maximum(travel - 1.0, 0.0)
    got = _reduced(tmp_path, "uniaxial", travel, spring + 5e-5 * time + _noise(time), time,
                   "area_mm2 = 100\nheight_mm = 20\ndirection = \"compression\"\n")
    assert got.facts["drift_sd_N_per_s"] == pytest.approx(1e-3 * np.hypot(250**-0.5, 500**-0.5) / 100, rel=0.05)
    assert got.facts["drift_N_per_s"] == pytest.approx(5e-5, abs=4 * got.facts["drift_sd_N_per_s"])
    assert got.facts["load_noise_N"] == pytest.approx(1e-3, rel=0.1)
    assert got.facts["contact_mm"] == pytest.approx(1.0, abs=4 * got.facts["contact_sd_mm"])
    assert got.facts["strain_zero_sd"] == pytest.approx(got.facts["contact_sd_mm"] / 20)
    assert _slope(got) == pytest.approx(4.0 * 20 / 100e-6, rel=2e-3)
    assert got.value.min() == pytest.approx(-16.0 / 100e-6, rel=5e-3)
    assert got.time_s is not None
    assert got.strain[1:] / got.time_s[1:] == pytest.approx(-5.0 / 40 / 20, rel=1e-6)  # time counts from contact on


def test_a_preload_makes_the_contact_and_the_rest_the_zero(tmp_path: Path) -> None:
    """A spring of 2 N/mm met at 1 mm and zeroed 0.3 N off: 0.5 N at 1.25 mm, of which the frame takes 0.1 mm/N."""
    time, travel = np.arange(0, 60, 0.04), np.maximum(np.arange(0, 60, 0.04) - 10, 0) * 0.1
    force = 0.3 + 2.0 * np.maximum(travel - 1.0, 0.0) + _noise(time)
    got = _reduced(tmp_path, "uniaxial", travel, force, time, "area_mm2 = 100\nheight_mm = 20\npreload_N = 0.5\n"
                   "compliance_mm_per_N = 0.1\ndirection = \"compression\"\n")
    assert got.facts["contact_mm"] == pytest.approx(1.25 - 0.05, abs=0.002)
    assert got.facts["zero_load_N"] == pytest.approx(0.3, abs=4e-4)
    assert got.facts["zero_sd_Pa"] * got.facts["area_mm2"] * 1e-6 == pytest.approx(1e-3 / np.sqrt(250), rel=0.1)
    assert got.facts["contact_sd_mm"] == 0
    assert got.value.min() == pytest.approx(-2.0 * (travel[-1] - 1) / 100e-6, rel=0.01)
    assert _slope(got) == pytest.approx(2.0 / (1 - 0.2) * 20 / 100e-6, rel=5e-3)


@pytest.mark.parametrize("points", [17, 81, 200, 2001])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_preload_is_met_between_the_samples_whatever_their_number(points: int, sign: int, tmp_path: Path) -> None:
    """A spring of 2 N/mm met at 1 mm carries 1 N at 1.5 mm: at a sample of 17 or 81, between two of 200. Where the file
    counts both downwards it is compression, and needs no word for it."""
    travel = np.r_[np.zeros(20), np.linspace(0, 8, points)]
    sizes = "area_mm2 = 100\nheight_mm = 20\n" + "direction = \"compression\"\n" * (sign > 0)
    force, time = 2.0 * np.maximum(travel - 1.0, 0.0), 0.1 * np.arange(travel.size)
    got = _reduced(tmp_path, "uniaxial", sign * travel, sign * force, time, sizes + "preload_N = 1\n")
    assert got.facts["contact_mm"] == pytest.approx(1.5, abs=1e-6)
    assert got.strain[-1] == pytest.approx(-6.5 / 20, rel=0.05)
    assert got.value[1:] == pytest.approx(-1.0 / 1e-4 + 2.0 * 20 / 1e-4 * got.strain[1:], rel=1e-6)
    with pytest.raises(InputFileError, match=r"the load reaches 1[34].* N, less than preload_N = 15"):
        _reduced(tmp_path, "uniaxial", sign * travel, sign * force, time, sizes + "preload_N = 15\n")
    with pytest.raises(InputFileError, match=r"the loading ends at a strain of -0.02[45]"):
        _reduced(tmp_path, "uniaxial", sign * travel, sign * force, time, sizes + "preload_N = 13\n")


def test_a_hold_gives_its_times_its_strain_and_how_far_it_relaxed(tmp_path: Path) -> None:
    """Ramp of 2 s to a strain of 0.2, 100 s held, the load falling from 8 N to 6 N with a time of 5 s."""
    time = np.arange(0, 107, 0.04)
    strain = 0.2 * np.clip((time - 5) / 2, 0, 1)
    force = 40.0 * strain * np.where(time > 7, 0.75 + 0.25 * np.exp(-(time - 7) / 5), 1.0)
    got = _reduced(tmp_path, "relaxation", 20 * strain, force + _noise(time), time,
                   "area_mm2 = 100\nheight_mm = 20\ndirection = \"compression\"\n")
    assert got.facts["ramp_s"] == pytest.approx(2.0, abs=0.1)
    assert got.facts["hold_s"] == pytest.approx(100.0, abs=0.2)
    assert got.facts["hold_strain"] == pytest.approx(-0.2, abs=1e-3)
    assert got.facts["hold_strain_change"] == pytest.approx(0.0, abs=2e-3)
    assert got.facts["hold_relaxed"] == pytest.approx(0.25, abs=0.01)
    assert got.time_s is not None
    assert got.value[got.time_s > 60] == pytest.approx(-0.06e6, rel=2e-3)
    assert (got.strain[0], got.value[0], got.time_s[0]) == (0.0, 0.0, 0.0)


def test_a_slow_ramp_keeps_three_hundred_points_and_each_sample_once(tmp_path: Path) -> None:
    """Ramp of 60 s, 1,500 samples, and a hold of 300 s; the state of rest comes first."""
    time = np.arange(0, 365, 0.04)
    strain = 0.3 * np.clip((time - 5) / 60, 0, 1)
    got = _reduced(tmp_path, "relaxation", 20 * strain, 40.0 * strain + _noise(time), time,
                   "area_mm2 = 100\nheight_mm = 20\ndirection = \"compression\"\n")
    assert got.held is not None
    assert got.samples is not None
    assert np.count_nonzero(got.held == 0) == 1 + 300
    toe = np.count_nonzero(strain < 0.01)
    assert got.samples[1:].sum() == pytest.approx(time.size - toe, abs=20)


@pytest.mark.parametrize(("kind", "table", "area_mm2", "length_mm", "share"), [
    ("shear", "faces = 4\nlength_mm = 25\nwidth_mm = 20\nthickness_mm = 10\n", 2000, 10, 1),
    ("planar", "length_mm = 20\nwidth_mm = 100\nthickness_mm = 5\n", 500, 20, 1),
    ("uniaxial", "width_mm = 10\ndepth_mm = 20\nheight_mm = 30\n", 200, 30, 1),
    ("volumetric", "method = \"confined\"\ndiameter_mm = 10\nheight_mm = 20\nlateral_ratio = 0.4\n",
     25 * np.pi, 20, 0.6),
    ("volumetric", "method = \"hydrostatic\"\npiston_diameter_mm = 10\nvolume_mm3 = 2000\n",
     25 * np.pi, 2000 / (25 * np.pi), 1)])
def test_specimens_have_the_areas_and_lengths_of_their_shape(kind: str, table: str, area_mm2: float, length_mm: float,
                                                             share: float, tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(f"[{kind}]\n{table}", encoding="utf-8")
    block = make_specimen(kind, read_tables(tmp_path / "s.toml")[kind], tmp_path / "s.toml")
    assert isinstance(block, Block)
    assert (block.area_m2 * 1e6, block.length_m * 1e3) == (pytest.approx(area_mm2), pytest.approx(length_mm))
    assert block.mean_share == pytest.approx(share)
    assert (block.preload_N, block.compliance_m_per_N) == (0, 0)


def test_the_ring_of_a_strip_is_its_coating_all_around(tmp_path: Path) -> None:
    """2 (20 + 5) mm x 30 um."""
    (tmp_path / "s.toml").write_text("[conductivity]\nlength_mm = 75\nwidth_mm = 20\nthickness_mm = 5\n"
                                     "coating_um = 30\nvoltage_V = 0.5\n", encoding="utf-8")
    strip = make_specimen("conductivity", read_tables(tmp_path / "s.toml")["conductivity"], tmp_path / "s.toml")
    assert isinstance(strip, Strip)
    assert (strip.length_m, strip.ring_area_m2, strip.voltage_V) == (0.075, pytest.approx(1.5e-6), 0.5)


def _noise(time: np.ndarray) -> np.ndarray:
    """1 mN of white noise."""
    return 1e-3 * np.random.default_rng(7).standard_normal(time.size)
