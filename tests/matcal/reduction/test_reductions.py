"""Every kind of machine file and table: the truth comes back, each choice is said, each impossibility refused."""

from pathlib import Path

import numpy as np
import pytest

import matcal
from matcal.reduction.experiment import Experiment
from matcal.reduction.hold_segments import find_holds
from matcal.reduction.reduce import read_and_reduce
from touchcal.errors import InputFileError

REAL = Path(__file__).parents[4] / "shared" / "rawsamples"
NAMES = {"displacement": "displacement (mm)", "force": "force (N)", "time": "time (s)"}


def _written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def _frame(folder: Path, name: str, **columns: np.ndarray) -> Path:
    rows = np.column_stack(list(columns.values()))
    text = ",".join(NAMES[c] for c in columns) + "\n" + "\n".join(",".join(f"{x:.9g}" for x in row) for row in rows)
    return _written(folder, name, text + "\n")


def _reduced(file: Path, kind: str, specimen: Path | None = None, branch: str = "last") -> Experiment:
    (experiment,) = read_and_reduce([(kind, (file,))], specimen, branch=branch).experiments
    return experiment


def _record(points: list[tuple[float, float]], stiffness: float, rng: np.random.Generator, gap: float = 0.5,
            noise: float = 0.01) -> dict[str, np.ndarray]:
    """Travel, mm, through (s, mm) points at 50 Hz, and the load of a spring, N/mm, that is met after `gap`."""
    time = np.arange(0, points[-1][0], 0.02)
    travel = np.interp(time, *np.array(points).T)
    load = stiffness * np.maximum(travel - gap, 0.0)
    return {"displacement": travel, "force": load + noise * rng.standard_normal(time.size), "time": time}


@pytest.mark.parametrize(("kind", "table", "stiffness", "word"), [
    ("biaxial", "length_mm = 40\nwidth_mm = 40\nthickness_mm = 5\n", 20.0 * 200 / 40, "one of two equal axes"),
    ("planar", "length_mm = 20\nwidth_mm = 100\nthickness_mm = 5\n", 20.0 * 500 / 20, "kept by the grips"),
    ("planar", "length_mm = 20\nwidth_mm = 40\nthickness_mm = 5\n", 20.0 * 200 / 20, "below 4 its edges draw in"),
])
def test_sheets_are_reduced_on_one_axis(kind: str, table: str, stiffness: float, word: str, tmp_path: Path) -> None:
    """A material of 20 MPa per unit strain (N/mm^2) gives its modulus back."""
    record = _record([(0, 0), (5, 0), (65, 8)], stiffness, np.random.default_rng(1))
    got = _reduced(_frame(tmp_path, "sheet.csv", **record), kind, _written(tmp_path, "s.toml", f"[{kind}]\n{table}"))
    modulus = float(got.value @ got.strain / (got.strain @ got.strain))
    assert modulus == pytest.approx(20e6, rel=0.01)
    assert any(word in s for s in got.decisions)
    assert any("tension is assumed" in s for s in got.decisions)


def test_volumetric_by_fluid_and_in_a_sleeve(tmp_path: Path) -> None:
    record = _record([(0, 0), (5, 0), (65, 4)], 100.0, np.random.default_rng(2))
    file = _frame(tmp_path, "cell.csv", **record)
    area, volume = np.pi * 10**2 / 4, 2000.0
    sizes = f"[volumetric]\nmethod = \"hydrostatic\"\npiston_diameter_mm = 10\nvolume_mm3 = {volume}\n"
    fluid = _reduced(file, "volumetric", _written(tmp_path, "a.toml", sizes))
    bulk = 100.0 / area * volume / area * 1e6
    slope = np.polyfit(fluid.strain[1:] - 1, fluid.value[1:], 1)[0]
    assert (fluid.strain[0], fluid.value[0]) == (1.0, 0.0)
    assert slope == pytest.approx(bulk, rel=0.01)
    assert fluid.strain.min() == pytest.approx(1 - area * 3.5 / volume, abs=1e-3)
    sleeve = "[volumetric]\nmethod = \"confined\"\ndiameter_mm = 10\nheight_mm = 20\n"
    with pytest.raises(InputFileError, match="add lateral_ratio"):
        _reduced(file, "volumetric", _written(tmp_path, "b.toml", sleeve))
    confined = _reduced(file, "volumetric", _written(tmp_path, "b.toml", sleeve + "lateral_ratio = 0.4\n"))
    axial = 100.0 / area * 20 * 1e6
    assert np.polyfit(confined.strain[1:] - 1, confined.value[1:], 1)[0] == pytest.approx(0.6 * axial, rel=0.01)
    with pytest.raises(InputFileError, match="does not tell what the force is"):
        _reduced(file, "volumetric", _written(tmp_path, "c.toml", "[volumetric]\ndiameter_mm = 10\nheight_mm = 20\n"))


def _cycles(count: int, set_mm: float, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Compression cycles to 5 mm in which later loadings meet a specimen shorter by `set_mm` and softer by a third."""
    points = [(0.0, 0.0), (5.0, 0.0)] + [(5.0 + 40 * k, 5.0 * (k % 2)) for k in range(1, 2 * count + 1)]
    time = np.arange(0, points[-1][0], 0.02)
    travel = np.interp(time, *np.array(points).T)
    half = np.clip((time - 5) // 40, 0, 2 * count - 1)
    first, falling = half < 1, half % 2 == 1
    shift = np.where(first, 0.5, 0.5 + set_mm)
    stiffness = np.where(first, 30.0, 20.0) * np.where(falling & (travel < 5), 0.8, 1.0)
    load = stiffness * np.maximum(travel - shift, 0.0)
    return {"displacement": travel, "force": load + 0.02 * rng.standard_normal(time.size), "time": time}


def test_the_last_loading_is_used_unless_the_first_is_asked_for(tmp_path: Path) -> None:
    file = _frame(tmp_path, "compression.csv", **_cycles(4, 0.3, np.random.default_rng(3)))
    sizes = _written(tmp_path, "s.toml", "[uniaxial]\nwidth_mm = 20\ndepth_mm = 20\nheight_mm = 20\n")
    last, first = (_reduced(file, "uniaxial", sizes, branch) for branch in ("last", "first"))
    for got, stiffness in ((last, 20.0), (first, 30.0)):
        modulus = float(got.value @ got.strain / (got.strain @ got.strain))
        assert modulus == pytest.approx(stiffness * 20 / 400 * 1e6, rel=0.01)
        assert (got.strain[0], got.value[0]) == (0.0, 0.0)
        assert got.time_s is not None
        assert got.time_s[0] == 0.0
    assert last.facts["residual_strain"] == pytest.approx(-0.3 / 20, abs=5e-4)
    assert any("The last of 4 loadings" in s and "set that is left" in s for s in last.decisions)
    assert any("The first of 4 loadings" in s for s in first.decisions)
    assert last.cycles is not None
    assert last.cycles["cycle"].tolist() == [1, 2, 3, 4]
    work = 0.5 * 20e3 * 4.2e-3**2 / 8e-6
    np.testing.assert_allclose(last.cycles["work_Pa"][1:], work, rtol=0.02)
    np.testing.assert_allclose(last.cycles["loss_Pa"][1:], 0.2 * work, rtol=0.05)
    with pytest.raises(ValueError, match="branch 'middle' is unknown; known: last, first"):
        _reduced(file, "uniaxial", sizes, "middle")


def test_a_loading_that_starts_loaded_has_no_clock(tmp_path: Path) -> None:
    record = _record([(0, 0), (5, 0), (45, 5), (60, 2), (90, 5)], 30.0, np.random.default_rng(4))
    sizes = _written(tmp_path, "s.toml", "[uniaxial]\nwidth_mm = 20\ndepth_mm = 20\nheight_mm = 20\n")
    got = _reduced(_frame(tmp_path, "compression.csv", **record), "uniaxial", sizes)
    assert got.time_s is None
    assert got.strain[0] == pytest.approx(-1.5 / 20, abs=0.002)
    assert any("does not return to zero" in s for s in got.decisions)


def test_every_hold_of_a_relaxation_is_kept(tmp_path: Path) -> None:
    points = [(0, 0), (5, 0), (7, 2.5), (67, 2.5), (69, 4.5), (169, 4.5), (172, 6.5), (292, 6.5)]
    record = _record(points, 30.0, np.random.default_rng(5))
    sizes = _written(tmp_path, "s.toml", "[relaxation]\nwidth_mm = 20\ndepth_mm = 20\nheight_mm = 20\n"
                                         "direction = \"compression\"\n")
    got = _reduced(_frame(tmp_path, "relaxation.csv", **record), "relaxation", sizes)
    assert got.held is not None
    assert got.samples is not None
    assert got.facts["holds"] == 3
    strains = [got.facts[f"hold_strain_{k}"] for k in (1, 2, 3)]
    np.testing.assert_allclose(strains, [-0.1, -0.2, -0.3], atol=4 * got.facts["strain_zero_sd"])
    np.testing.assert_allclose([got.facts[f"hold_s_{k}"] for k in (1, 2, 3)], [60, 100, 120], atol=0.5)
    groups = np.flatnonzero(np.diff(got.held) == 1).size
    assert groups == 3
    assert np.ptp(got.strain[got.held == 1][:40]) < 1e-3
    assert got.samples[1:].sum() > 0.9 * record["time"].size - 5 * 50 - 40
    assert got.value.size < 1100


def test_holds_are_told_from_slow_ramps() -> None:
    time = np.arange(0, 400, 0.1)
    ramp = np.interp(time, [0, 10, 400], [0, 0, 16.0])
    assert find_holds(time, ramp) == []
    (first, last), = find_holds(time, np.interp(time, [0, 10, 200, 400], [0, 0, 16.0, 16.0]))
    assert time[first] == pytest.approx(200, abs=1)
    assert last == time.size


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("over_mm", "noise_mm"), [(0.004, 1e-4), (0.006, 5e-4), (0.0, 1e-4), (0.01, 1e-4)])
def test_holds_that_a_crosshead_overshoots_are_all_found(over_mm: float, noise_mm: float, seed: int) -> None:
    """Six steps of 0.3 mm in 1.8 s, each held 10 s from an overshoot on that creeps back within a second or two."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, 6 * 11.8, 0.1)
    step, since = np.divmod(time, 11.8)
    back = over_mm * rng.choice([0.0, 1.0], 6)[step.astype(int)] * np.exp(-np.maximum(since - 1.8, 0) / 0.7)
    travel = 0.3 * (step + np.minimum(since / 1.8, 1)) + np.where(since >= 1.8, back, 0.0)
    found = find_holds(time, travel + noise_mm * rng.normal(size=time.size))
    assert [int(time[first] // 11.8) for first, _ in found] == list(range(6))
    assert all(time[last - 1] - time[first] > 7.5 for first, last in found)


def test_a_short_first_hold_leaves_the_others(tmp_path: Path) -> None:
    record = _record([(0, 0), (5, 0), (15, 1.0), (17, 1.0), (25, 2.0), (65, 2.0), (75, 3.0), (135, 3.0)], 4.0,
                     np.random.default_rng(1), gap=0.1)
    sizes = _written(tmp_path, "s.toml",
                     "[relaxation]\ndiameter_mm = 40\nheight_mm = 10\ndirection = \"compression\"\n")
    got = _reduced(_frame(tmp_path, "steps.csv", **record), "relaxation", sizes)
    assert got.facts["holds"] == 2
    assert [got.facts[f"hold_s_{k}"] for k in (1, 2)] == pytest.approx([40, 60], abs=0.5)


def test_every_hold_of_a_published_staircase_is_used() -> None:
    folder = REAL.parent / "cases" / "material" / "01_instron_pu_foam"
    if not folder.is_dir():
        pytest.skip("the case's files are not here")
    for name in ("PU_U1comp_1.csv", "PU_U2comp_1.csv"):
        got = _reduced(folder / name, "relaxation", folder / "specimen.toml")
        assert got.facts["holds"] == 7
        assert min(got.facts[f"hold_s_{k}"] for k in range(1, 8)) > 8


def test_sizes_come_from_the_flag_the_file_or_beside_it_and_are_told(tmp_path: Path) -> None:
    record = _record([(0, 0), (5, 0), (65, 8)], 30.0, np.random.default_rng(6))
    file = _frame(tmp_path, "compression.csv", **record)
    sizes = "[uniaxial]\nwidth_mm = 20\ndepth_mm = 20\nheight_mm = 20\n"
    beside = _written(tmp_path, "specimen.toml", sizes)
    got = read_and_reduce([("uniaxial", (file,))])
    assert got.also_read == (beside,)
    assert any("of specimen.toml" in s for s in got.experiments[0].decisions)
    own = _written(tmp_path, "compression.toml", sizes.replace("height_mm = 20", "height_mm = 25") + "")
    assert read_and_reduce([("uniaxial", (file,))]).also_read == (own,)


@pytest.mark.parametrize(("spoil", "says"), [
    ({"force": np.full(3000, 4.0)}, "never changes, so there is no load"),
    ({"force": 0.5 * np.random.default_rng(7).standard_normal(3000)}, "was not touched"),
    ({"displacement": np.full(3000, 1.0)}, "never leaves its rest position"),
    ({"time": np.arange(3000)[::-1] / 50}, "time runs backwards"),
])
def test_records_without_a_test_are_refused(spoil: dict[str, np.ndarray], says: str, tmp_path: Path) -> None:
    time = np.arange(3000) / 50
    travel = np.interp(time, [0, 5, 60], [0, 0, 6])
    columns = {"displacement": travel, "force": 30 * np.maximum(travel - 0.5, 0), "time": time} | spoil
    sizes = _written(tmp_path, "s.toml", "[uniaxial]\nwidth_mm = 20\ndepth_mm = 20\nheight_mm = 20\n")
    with pytest.raises(InputFileError, match=says):
        _reduced(_frame(tmp_path, "compression.csv", **columns), "uniaxial", sizes)


@pytest.mark.parametrize(("kind", "text", "says"), [
    ("uniaxial", "strain,stress (kPa)\n-0.1,-1\n-0.1,-1\n-0.1,-1\n", "in every row"),
    ("uniaxial", "strain,stress (kPa)\n0,2\n-0.1,2\n-0.2,2\n", "in every row"),
    ("uniaxial", "strain,stress (kPa)\n0,0\n-0.9,-2\n-1.2,-3\n", "falls to -1.2"),
    ("uniaxial", "strain,stress (kPa)\n0,0\n-0.9,-2\n", "2 rows are no curve"),
    ("shear", "gamma,stress (kPa)\n0,0\n0.1,-2\n0.2,-3\n", "opposite signs"),
    ("shear", "lambda,stress (kPa)\n0.01,0.1\n0.1,2\n0.2,3\n", "may be a stretch"),
    ("volumetric", "strain,stress (kPa)\n0,0\n-0.1,-2\n-0.2,-3\n", r"needs a volume ratio \(J\) column"),
    ("volumetric", "J,stress (kPa)\n1,0\n0.5,-2\n-0.2,-3\n", "J = -0.2 is not possible"),
    ("relaxation", "time (s),strain,stress (kPa)\n0,0,0\n1,-0.5,-2\n1,-0.5,-3\n", "does not grow"),
])
def test_tables_that_cannot_be_are_refused(kind: str, text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=says):
        _reduced(_written(tmp_path, "table.csv", text), kind)


def test_tension_that_its_specimen_calls_compression_is_refused_with_the_key(tmp_path: Path) -> None:
    sizes = _written(tmp_path, "s.toml", "[uniaxial]\nwidth_mm = 20\ndepth_mm = 20\nheight_mm = 20\n"
                                         "direction = \"compression\"\n")
    table = _written(tmp_path, "table.csv", "strain (-),stress (kPa)\n0,0\n1,20\n2,30\n4,50\n")
    with pytest.raises(InputFileError, match=r'-4 is not possible in compression.*direction = "tension" below \[uniax'):
        _reduced(table, "uniaxial", sizes)


def test_a_pressure_is_turned_into_a_mean_stress(tmp_path: Path) -> None:
    for sign in (1, -1):
        text = "J,pressure (kPa)\n" + "".join(f"{1 - 0.1 * k},{sign * 5 * k}\n" for k in range(5))
        got = _reduced(_written(tmp_path, "table.csv", text), "volumetric")
        np.testing.assert_allclose(got.strain, 1 - 0.1 * np.arange(5))
        np.testing.assert_allclose(got.value, -5e3 * np.arange(5))
        assert any("sign is turned" in s for s in got.decisions) == (sign < 0)


@pytest.mark.skipif(not REAL.exists(), reason="real files are not next to the checkout")
def test_gamma_that_is_called_lambda_and_a_gel_that_is_compressed_twice(tmp_path: Path) -> None:
    shear = _reduced(REAL / "foam_leap" / "foam_leap_SS.csv", "shear")
    assert (shear.strain.min(), shear.strain.max()) == (-0.15, 0.15)
    assert any("in this shear test it is gamma" in s for s in shear.decisions)
    gel = _written(tmp_path, "gel.toml", "[uniaxial]\ndiameter_mm = 8\nheight_mm = 2\n")
    part = next((REAL / "mts_testsuite").glob("*5.txt"))
    assert _reduced(part, "uniaxial", gel).facts["loadings"] == 2
    assert _reduced(part, "uniaxial", gel, "first").strain.min() == pytest.approx(-0.374, abs=0.01)


def test_a_record_of_few_samples_is_refused_with_what_would_do(tmp_path: Path) -> None:
    (tmp_path / "foam_uniaxial.csv").write_text("displacement_mm,force_N\n" + "\n".join(
        f"{k},{force}" for k, force in enumerate((0, 2, 4, 6.5, 10, 16, 27, 45))))
    sizes = '[uniaxial]\ndiameter_mm = 40\nheight_mm = 20\ndirection = "compression"\n'
    for preload, said in (("0", "give preload_N, above 0"), ("0.5", "only 7 samples .* 10 are needed")):
        (tmp_path / "specimen.toml").write_text(f"{sizes}preload_N = {preload}\n")
        with pytest.raises(InputFileError, match=f"{said}.* A table of strain and stress may have few rows"):
            matcal.fit(tmp_path / "foam_uniaxial.csv")
