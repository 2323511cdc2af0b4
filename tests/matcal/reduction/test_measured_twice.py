"""Strain next to crosshead and stress next to load: the better measure gives the modulus, and the choice is said."""

from pathlib import Path

import numpy as np
import pytest

from matcal.reduction.experiment import Experiment
from matcal.reduction.reduce import read_and_reduce
from touchcal.errors import InputFileError

CASE = Path(__file__).parents[4] / "shared" / "cases" / "material" / "24_extensometer_and_crosshead"
YOUNG_Pa, AREA_m2, HEIGHT_mm, REST = 40e3, 1e-3, 25.0, 40
SIZES = "[uniaxial]\narea_mm2 = 1000\nheight_mm = 25\ndirection = \"compression\"\n"


def _record(folder: Path, columns: dict[str, np.ndarray], sizes: str | None = SIZES) -> Experiment:
    rows = "\n".join(",".join(f"{x:.8g}" for x in row) for row in zip(*columns.values(), strict=True))
    (folder / "t.csv").write_text(f"{','.join(columns)}\n{rows}\n", encoding="utf-8")
    given = None
    if sizes is not None:
        given = folder / "s.toml"
        given.write_text(sizes, encoding="utf-8")
    (experiment,) = read_and_reduce([("uniaxial", (folder / "t.csv",))], given).experiments
    return experiment


def _strain(cycles: int = 1, side: int = -1) -> np.ndarray:
    turns = np.r_[[0.0, 0.0], np.tile([0.4, 0.0], cycles)][:2 * cycles + 1]
    return side * np.interp(np.arange(REST + 200 * (2 * cycles - 1)),
                            np.r_[0, REST + 200 * np.arange(2 * cycles)], turns)


def _columns(strain: np.ndarray, rng: np.random.Generator, compliance_mm_per_N: float, noise: float) -> dict:
    """A frame that gives, which stiffens as it is loaded, under a specimen of one modulus, and noise of the video."""
    force = YOUNG_Pa * AREA_m2 * strain
    frame = compliance_mm_per_N * force * (1 - 0.3 * np.abs(strain) / 0.4)
    return {"Time (s)": 0.1 * np.arange(strain.size), "Crosshead (mm)": HEIGHT_mm * strain + frame,
            "Load (N)": force + 2e-3 * rng.normal(size=strain.size),
            "Strain (%)": 100 * (strain + noise * rng.normal(size=strain.size))}


def test_a_strain_by_a_name_that_is_not_known_is_not_dropped_without_a_word(tmp_path: Path) -> None:
    columns = _columns(_strain(), np.random.default_rng(0), 0.15, 2e-4)
    columns["Strain ROI-7 upper (%)"] = columns.pop("Strain (%)")
    got = _record(tmp_path, columns)
    assert any("not 'Strain ROI-7 upper'" in caution and "--columns" in caution for caution in got.cautions)


@pytest.mark.parametrize(("head", "of"), [("Poisson ratio", lambda e: 0.3 + 0 * e),
                                          ("Diameter (mm)", lambda e: 50 * (1 - 0.3 * e))])
def test_what_moves_across_the_load_is_not_dropped_without_a_word(head: str, of, tmp_path: Path) -> None:
    strain = -np.linspace(0, 0.4, 40)
    got = _record(tmp_path, {"Strain": strain, "Stress (kPa)": 40 * strain, head: of(strain)}, None)
    assert any("is not used" in caution and "lateral strain" in caution for caution in got.cautions)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("cycles", [1, 2])
@pytest.mark.parametrize("stress", [False, True])
def test_the_strain_of_the_specimen_counts_and_what_the_frame_would_say_is_said(
        seed: int, cycles: int, stress: bool, tmp_path: Path) -> None:
    columns = _columns(_strain(cycles), np.random.default_rng(seed), 0.15, 2e-4)
    if stress:
        columns["Stress (kPa)"] = columns["Load (N)"] / AREA_m2 / 1e3
    got = _record(tmp_path, columns)
    assert np.polyfit(got.strain, got.value, 1)[0] == pytest.approx(YOUNG_Pa, rel=5e-3)
    (said,) = got.cautions
    assert "'Strain' is used" in said
    assert "'Crosshead'" in said
    assert " % lower" in said


@pytest.mark.parametrize("side", [-1, 1])
def test_strain_and_stress_need_no_sizes(side: int, tmp_path: Path) -> None:
    columns = _columns(_strain(side=side), np.random.default_rng(5), 0.15, 2e-4)
    columns["Stress (kPa)"] = columns["Load (N)"] / AREA_m2 / 1e3
    got = _record(tmp_path, columns, None if side < 0 else "[uniaxial]\ndirection = \"tension\"\n")
    assert np.polyfit(got.strain, got.value, 1)[0] == pytest.approx(YOUNG_Pa, rel=5e-3)
    assert np.sign(got.strain[-1]) == side
    assert got.facts["area_mm2"] == pytest.approx(1000, rel=1e-3)


def test_a_strain_made_of_the_displacement_is_one_measurement_and_needs_no_caution(tmp_path: Path) -> None:
    columns = _columns(_strain(), np.random.default_rng(5), 0.0, 0.0)
    columns["Strain (%)"] = columns["Crosshead (mm)"] / 0.25
    got = _record(tmp_path, columns)
    assert np.polyfit(got.strain, got.value, 1)[0] == pytest.approx(YOUNG_Pa, rel=5e-3)
    assert not got.cautions
    with pytest.raises(InputFileError, match=r"'Crosshead' over 25 mm, and the sizes of the specimen say 20 mm"):
        _record(tmp_path, columns, SIZES.replace("25", "20"))


def test_columns_that_contradict_the_sizes_are_asked_about(tmp_path: Path) -> None:
    columns = _columns(_strain(), np.random.default_rng(5), 0.15, 2e-4)
    columns["Stress (kPa)"] = columns["Load (N)"] / AREA_m2 / 1e3
    with pytest.raises(InputFileError, match=r"'Stress' is 'Load' over 1000 mm2, .* say 1200 mm2"):
        _record(tmp_path, columns, SIZES.replace("1000", "1200"))
    columns = {**columns, "strain": -0.05 * columns["Strain (%)"]}
    columns.pop("Strain (%)")
    with pytest.raises(InputFileError, match=r"spans 1.99.* spans 0.465.*strain=COLUMN:%"):
        _record(tmp_path, columns)


@pytest.mark.skipif(not CASE.exists(), reason="the shared cases are not here")
@pytest.mark.parametrize("sizes", [CASE / "specimen.toml", None])
def test_a_video_strain_next_to_a_crosshead(sizes: Path | None, tmp_path: Path) -> None:
    """6,370.8 Pa at 40 % by the specimen's own law, 5,760 Pa by the crosshead."""
    (tmp_path / "v.csv").write_bytes((CASE / "video_compression.csv").read_bytes())
    (got,) = read_and_reduce([("uniaxial", (tmp_path / "v.csv",))], sizes).experiments
    assert np.interp(0.4, -got.strain, -got.value) == pytest.approx(6370.8, rel=2e-3)
    assert any("Crosshead" in caution for caution in got.cautions)
