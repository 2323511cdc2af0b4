"""From files to experiments: each reduction gives back the truth of the synthetic files, each doubt is refused."""

import json
import shutil
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from matcal.reduction.experiment import Experiment
from matcal.reduction.reduce import reduce_tests
from touchcal.errors import InputFileError

DATA = Path(__file__).parents[3] / "data_raw"
REAL = Path(__file__).parents[4] / "shared" / "rawsamples"
TRUTH = json.loads((DATA / "truth.json").read_text())
STRIP = (DATA / "mts_stretch.txt", DATA / "nova_stretch.txt")
CURVE = "strain,stress\n-,kPa\n0,0\n-0.1,-1.6\n-0.2,-2.7\n"


def _reduced(*files: Path, kind: str | None = None, specimen: Path | None = None) -> Experiment:
    if specimen is None and all(file.parent == DATA for file in files):
        return _given(files, kind)
    (experiment,) = reduce_tests([(kind, files)], specimen)
    return experiment


@cache
def _given(files: tuple[Path, ...], kind: str | None) -> Experiment:
    """Of files that no test writes: reduced once."""
    (experiment,) = reduce_tests([(kind, files)], None)
    return experiment


def _written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


@pytest.mark.parametrize(("name", "length_mm"), [("uniaxial", 20.0), ("shear", 10.0)])
def test_quasistatic_curve_and_every_correction(name: str, length_mm: float) -> None:
    got, truth = _reduced(DATA / f"mts_{name}.txt"), TRUTH["tests_at_5_mm_per_min_and_relaxation"][name]
    setup, errors = TRUTH["setup"][name], TRUTH["errors"]
    late_mm = got.facts["contact_mm"] - (setup["gap_mm"] + errors["backlash_mm"])
    assert abs(late_mm) < 3 * got.facts["contact_sd_mm"]
    assert got.facts["contact_sd_mm"] < 0.02
    assert abs(got.facts["zero_load_N"] - setup["zero_N"]) < 0.05
    assert got.facts["load_noise_N"] == pytest.approx(errors["load_noise_N"], rel=0.05)
    sign = np.sign(got.strain[-1])
    strain = got.strain + sign * late_mm / length_mm
    inside = (np.abs(strain) > np.abs(truth["strain"][0])) & (np.abs(strain) < np.abs(truth["strain"][-1]))
    exact = np.interp(sign * strain[inside], sign * np.array(truth["strain"]), truth["stress_kPa"]) * 1e3
    error = np.sqrt(np.mean((got.value[inside] - exact) ** 2)) / np.sqrt(np.mean(exact**2))
    print(f"{name}: relative RMS {error:.3%} once the contact is put right, which is off by {late_mm:.3f} mm")
    assert error < 0.006
    assert got.time_s is not None
    assert got.time_s[-1] == pytest.approx(np.abs(got.strain[-1]) * length_mm / (5 / 60), rel=0.01)
    assert (got.strain[0], got.value[0], got.time_s[0]) == (0.0, 0.0, 0.0)


def test_drift_is_measured_where_the_frame_comes_back() -> None:
    facts = _reduced(DATA / "mts_uniaxial.txt").facts
    true = TRUTH["setup"]["uniaxial"]["drift_N_per_s"]
    assert abs(facts["drift_N_per_s"] - true) < 3 * facts["drift_sd_N_per_s"] < true
    assert "drift_sd_N_per_s" not in _reduced(DATA / "mts_shear.txt").facts


def test_noise_of_a_point_is_that_of_its_mean() -> None:
    got = _reduced(DATA / "mts_uniaxial.txt")
    rough = np.diff(got.value[20:120], 2) / np.sqrt(6)
    assert got.noise == pytest.approx(float(np.std(rough)), rel=0.3)


def test_relaxation_keeps_the_ramp_and_follows_the_hold() -> None:
    got, truth = _reduced(DATA / "mts_relaxation.txt"), TRUTH["tests_at_5_mm_per_min_and_relaxation"]["relaxation"]
    assert got.time_s is not None
    assert got.samples is not None
    ramp, hold = got.facts["ramp_s"], got.time_s > got.facts["ramp_s"] + 0.1
    assert ramp == pytest.approx(1.0, abs=0.06)
    assert np.count_nonzero(got.time_s < ramp) > 90
    assert got.facts["hold_strain"] == pytest.approx(-0.8, abs=3 * got.facts["strain_zero_sd"])
    assert got.samples.sum() > 18000 - 210
    start = 2.01 + (TRUTH["setup"]["relaxation"]["gap_mm"] + TRUTH["errors"]["backlash_mm"]) / 16.3
    exact = np.interp(got.time_s[hold] + start, truth["time_s"], np.array(truth["stress_kPa"])) * 1e3
    assert np.sqrt(np.mean((got.value[hold] / exact - 1) ** 2)) < 0.005


def test_conductivity_within_its_noise() -> None:
    got, true = _reduced(*STRIP), TRUTH["conductivity"]
    exact = true["c0_S_per_m"] * (1 + np.polynomial.polynomial.polyval(got.strain, [0, *true["a"]]))
    assert got.noise is not None
    chi_square = float(np.sum((got.value - exact) ** 2) / got.noise**2)
    print(f"chi-square {chi_square:.0f} for {got.value.size} points")
    assert chi_square < chi2.ppf(0.99, got.value.size)
    late = got.facts["clock_shift_s"] - TRUTH["clock_potentiostat_minus_frame_s"]["stretch"]
    assert abs(late) < 3 * got.facts["clock_shift_sd_s"] < 0.3
    assert got.facts["ring_area_m2"] == pytest.approx(true["ring_area_m2"])
    assert got.strain.max() == pytest.approx(true["break_strain"], abs=0.005)
    assert _reduced(*reversed(STRIP), kind="conductivity").value.tolist() == got.value.tolist()


def test_cyclic_stage_reports_how_the_resistance_settles() -> None:
    got = _reduced(DATA / "mts_cyclic.txt", DATA / "nova_cyclic.txt")
    rest = 0.075 / (30.0 * TRUTH["conductivity"]["ring_area_m2"])
    assert got.facts["cycles"] == 10
    assert got.facts["resistance_first_Ohm"] == pytest.approx(1.3 * rest, rel=0.005)
    assert got.facts["resistance_settled_Ohm"] == pytest.approx((1 + 0.3 * np.exp(-5)) * rest, rel=0.005)
    assert abs(got.facts["clock_shift_s"] - TRUTH["clock_potentiostat_minus_frame_s"]["cyclic"]) < 0.5
    assert any("last cycle" in sentence for sentence in got.decisions)


def test_kind_is_taken_from_flag_then_file_then_sidecar_then_name(tmp_path: Path) -> None:
    plain = _written(tmp_path, "my_shear.csv", CURVE)
    assert _reduced(plain).decisions[0].endswith("from its name.")
    _written(tmp_path, "my_shear.toml", 'kind = "uniaxial"\n')
    assert (_reduced(plain).kind, _reduced(plain, kind="shear").kind) == ("uniaxial", "shear")
    machine = tmp_path / "shear.txt"
    shutil.copy(DATA / "mts_uniaxial.txt", machine)
    got = _reduced(machine, specimen=DATA / "specimen.toml")
    assert got.kind == "uniaxial"
    assert "from its own line 'Test:" in got.decisions[0]
    with pytest.raises(ValueError, match="'tortion' is unknown; known: uniaxial"):
        _reduced(plain, kind="tortion")
    with pytest.raises(ValueError, match=r"'compression' is unknown; .* Write uniaxial for it\."):
        _reduced(plain, kind="compression")
    with pytest.raises(InputFileError, match=r"Write KIND=foam.csv"):
        _reduced(_written(tmp_path, "foam.csv", CURVE))
    assert _reduced(plain, kind="planar").kind == "planar"


def test_a_split_test_named_part_by_part_is_read_once(tmp_path: Path) -> None:
    head, rows = (DATA / "mts_shear.txt").read_text(encoding="utf-8-sig").split("sec\n")
    lines = rows.splitlines(keepends=True)
    cuts = {"1": lines[:5000], "": lines[5000:9000], "2": lines[9000:]}
    parts = [_written(tmp_path, f"lap - (Timed){k}.txt", "\ufeff" + head + "sec\n" + "".join(v))
             for k, v in cuts.items()]
    whole = _reduced(DATA / "mts_shear.txt")
    for inputs in ([(None, (part,)) for part in parts], [("shear", tuple(parts))], [("shear", (tmp_path,))]):
        (got,) = reduce_tests(inputs, DATA / "specimen.toml")
        np.testing.assert_array_equal(got.value, whole.value)


@pytest.mark.thorough
@pytest.mark.parametrize("kinds", [("uniaxial", "relaxation"), ("relaxation", "uniaxial")])
def test_the_parts_of_a_split_hold_serve_every_kind_that_they_are_given_as(kinds: tuple[str, ...],
                                                                           tmp_path: Path) -> None:
    head, rows = (DATA / "mts_relaxation.txt").read_text(encoding="utf-8-sig").split("sec\n")
    lines = rows.splitlines(keepends=True)
    parts = [_written(tmp_path, f"hold - (Timed){k}.txt", "\ufeff" + head + "sec\n" + "".join(v))
             for k, v in {"": lines[:3000], "1": lines[3000:]}.items()]
    given = [(kind, (part,)) for kind in kinds for part in parts]
    assert [e.kind for e in reduce_tests(given, DATA / "specimen.toml")] == list(kinds)


def test_replicates_stay_apart_but_one_test_counts_once(tmp_path: Path) -> None:
    file = DATA / "uniaxial.csv"
    other = _written(tmp_path, "uniaxial_2.csv", file.read_text() + "\n")
    assert len(reduce_tests([(None, (file,)), (None, (other,))])) == 2
    copied = _written(tmp_path, "uniaxial_3.csv", file.read_text())
    with pytest.raises(ValueError, match=r"uniaxial\.csv and uniaxial_3\.csv: the same contents are given twice"):
        reduce_tests([(None, (file,)), (None, (copied,))])
    with pytest.raises(ValueError, match=r"uniaxial\.csv: the same contents are given twice"):
        reduce_tests([(None, (file,)), (None, (file,))])
    assert [e.kind for e in reduce_tests([("uniaxial", (file,)), ("biaxial", (file,))])] == ["uniaxial", "biaxial"]
    with pytest.raises(ValueError, match="a uniaxial test takes one"):
        reduce_tests([("uniaxial", (file, DATA / "shear.csv"))])


def test_plain_tables_stand_as_they_are(tmp_path: Path) -> None:
    got = _reduced(DATA / "uniaxial.csv")
    assert (got.kind, got.strain[-1], got.time_s, got.noise) == ("uniaxial", -0.8, None, None)
    turned = _reduced(_written(tmp_path, "compression.csv", CURVE.replace("-0.", "0.").replace(",-", ",")
                               .replace("stress\n,kPa", "stress\n-,kPa")))
    assert turned.strain.tolist() == [0.0, -0.1, -0.2]
    assert any("the sign is turned" in sentence for sentence in turned.decisions)
    with pytest.raises(InputFileError, match="opposite signs"):
        _reduced(_written(tmp_path, "uniaxial.csv", CURVE.replace("-1.6", "1.6").replace("-2.7", "2.7")))
    with pytest.raises(InputFileError, match="needs a stress column"):
        _reduced(_written(tmp_path, "uniaxial.csv", "strain,time\n-,s\n0,0\n0.1,1\n"))
    with pytest.raises(InputFileError, match="given by gamma"):
        _reduced(_written(tmp_path, "shear.csv", "stretch,stress (kPa)\n1,0\n1.1,1\n"))


def test_a_table_that_unloads_or_begins_before_contact_is_said(tmp_path: Path) -> None:
    loading = np.linspace(0, -0.6, 61)
    stress = 20 * loading - 30 * loading**2 * loading**2

    def said(strain: np.ndarray, stress: np.ndarray) -> str:
        rows = "\n".join(f"{e:.6g},{p:.6g}" for e, p in zip(strain, stress, strict=True))
        return " ".join(_reduced(_written(tmp_path, "uniaxial.csv", f"strain,stress (kPa)\n{rows}\n")).cautions)

    both = np.r_[loading, loading[-2::-1]]
    assert "The strain turns back" in said(both, np.r_[stress, 0.7 * stress[-2::-1]])
    late = np.r_[np.linspace(0, -0.05, 6), loading[1:] - 0.05]
    assert "No load is carried in uniaxial.csv up to a strain of -0.050" in said(late, np.r_[np.zeros(6), stress[1:]])
    for strain, value in ((loading, stress), (loading[::-1], stress[::-1]), (-loading, -20 * loading * (1 - loading)),
                          (np.r_[loading[::-1], -loading], np.r_[stress[::-1], -stress])):
        assert not any(word in said(strain, value) for word in ("turns back", "No load is carried"))


def _frame(folder: Path, name: str, columns: dict[str, np.ndarray]) -> Path:
    names = {"displacement": "displacement (mm)", "force": "force (N)", "time": "time (s)"}
    rows = np.column_stack(list(columns.values()))
    text = ",".join(names[c] for c in columns) + "\n" + "\n".join(",".join(f"{x:.9g}" for x in row) for row in rows)
    return _written(folder, name, text + "\n")


def test_plain_frame_record_without_clock_or_rest(tmp_path: Path) -> None:
    travel = np.linspace(0, 10, 400)
    file = _frame(tmp_path, "tension.csv", {"displacement": travel, "force": 0.3 * travel})
    _written(tmp_path, "specimen.toml", "[uniaxial]\nwidth_mm = 10\ndepth_mm = 10\nheight_mm = 50\n")
    got = _reduced(file)
    assert got.time_s is None
    np.testing.assert_allclose(got.value, 0.3 * 50 * got.strain / 1e-4, rtol=1e-6, atol=1e-3)
    assert any("the first reading is taken as zero load" in sentence for sentence in got.decisions)


def test_a_gap_of_few_samples_before_contact_is_found(tmp_path: Path) -> None:
    """2.5 mm of air that a fast ramp crosses in ten samples, before a specimen of 50 mm."""
    time = np.concatenate([np.arange(0, 2.2, 0.02), 2.2 + np.arange(0.1, 60, 0.1)])
    travel = 12.5 * np.minimum(time, 2.2)
    noise = 0.05 * np.random.default_rng(2).standard_normal(time.size)
    file = _frame(tmp_path, "relaxation.csv", {"displacement": travel, "time": time,
                                               "force": 2.0 * np.maximum(travel - 2.5, 0) + noise - 0.2})
    _written(tmp_path, "specimen.toml", "[relaxation]\nwidth_mm = 50\ndepth_mm = 50\nheight_mm = 50\n"
                                        "direction = \"compression\"\n")
    got = _reduced(file)
    print(got.decisions)
    assert got.strain[-1] == pytest.approx(-0.5, abs=0.002)
    assert abs(got.facts["contact_mm"] - 2.5) < 3 * got.facts["contact_sd_mm"]


def test_direction_and_preload_of_the_specimen(tmp_path: Path) -> None:
    travel = np.concatenate([np.zeros(100), np.linspace(0, 10, 2000)])
    force = np.maximum(travel - 1.0, 0.0)
    file = _frame(tmp_path, "uniaxial.csv", {"displacement": travel, "force": force, "time": np.arange(2100) / 100})
    size = "[uniaxial]\ndiameter_mm = 20\nheight_mm = 30\n"
    with pytest.raises(InputFileError, match=r"direction = .compression. or .tension."):
        _reduced(file, specimen=_written(tmp_path, "s.toml", size))
    found = _reduced(file, specimen=_written(tmp_path, "s.toml", size + 'direction = "compression"\n'))
    assert found.strain.min() < -0.25
    assert found.facts["contact_mm"] == pytest.approx(1.0, abs=0.02)
    loaded = _reduced(file, specimen=_written(tmp_path, "s.toml", size + 'direction = "tension"\npreload_N = 0.5\n'))
    assert loaded.facts["contact_mm"] == pytest.approx(1.5, abs=1e-3)


@pytest.mark.parametrize(("table", "says"), [
    ("[uniaxial]\ndiameter = 50\n", "unknown key 'diameter'; known: area_mm2, compliance_mm_per_N"),
    ("[uniaxal]\ndiameter_mm = 50\n", "unknown table or key 'uniaxal'"),
    ("[uniaxial]\ndiameter_mm = 50\n", "needs the key height_mm"),
    ("[uniaxial]\nheight_mm = 20\n", "needs the key diameter_mm"),
    ("[uniaxial]\ndiameter_mm = -50\nheight_mm = 20\n", "must be a positive number"),
    ("[uniaxial]\ndiameter_mm = 1e-300\nheight_mm = 20\n", "check its unit"),
    ("[uniaxial]\ndiameter_mm = 50\nheight_mm = 1e300\n", "check its unit"),
    ("[uniaxial]\ndiameter_mm = \"50\"\nheight_mm = 20\n", "must be a positive number"),
    ("[uniaxial]\ndiameter_mm = 50\nheight_mm = 20\ndirection = \"down\"\n", "direction 'down' is unknown"),
    ("uniaxial = 3\n", "must be a table"),
    ("[uniaxial\n", "not TOML"),
    ("[shear]\nfaces = 4\nlength_mm = 25\nwidth_mm = 20\nthickness_mm = 10\n", r"no table \[uniaxial\]"),
    ("[uniaxial]\ndiameter_mm = 50\nheight_mm = 2\n", "Check height_mm, in mm"),
])
def test_a_specimen_that_does_not_serve_is_refused(table: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=says):
        _reduced(DATA / "mts_uniaxial.txt", specimen=_written(tmp_path, "specimen.toml", table))


def test_machine_files_without_what_they_need_are_refused(tmp_path: Path) -> None:
    alone = tmp_path / "mts_uniaxial.txt"
    shutil.copy(DATA / "mts_uniaxial.txt", alone)
    with pytest.raises(InputFileError, match="Give `specimen`"):
        _reduced(alone)
    with pytest.raises(InputFileError, match="no such file"):
        _reduced(alone, specimen=tmp_path / "absent.toml")
    with pytest.raises(InputFileError, match="conductivity=FRAME_FILE,POTENTIOSTAT_FILE"):
        _reduced(STRIP[0])
    with pytest.raises(InputFileError, match="no hold to fit"):
        _reduced(DATA / "mts_uniaxial.txt", kind="relaxation")
    sizes = (DATA / "specimen.toml").read_text().replace("voltage_V = 0.5", "voltage_V = 5")
    other = _written(tmp_path, "s.toml", sizes)
    with pytest.raises(InputFileError, match="voltage_V = 5"):
        _reduced(*STRIP, specimen=other)


@pytest.mark.skipif(not REAL.exists(), reason="real files are not next to the checkout")
def test_real_files_reduce_and_say_how(tmp_path: Path) -> None:
    gel = _written(tmp_path, "gel.toml", "[uniaxial]\ndiameter_mm = 8\nheight_mm = 2\n")
    (got,) = reduce_tests([(None, (p,)) for p in sorted((REAL / "mts_testsuite").iterdir())], gel)
    assert got.kind == "uniaxial"
    assert got.strain.min() == pytest.approx(-0.374, abs=0.01)
    assert np.all(got.value[5:] < 0)
    assert any("5 parts joined" in sentence for sentence in got.decisions)
    foam = _reduced(REAL / "foam_leap" / "foam_leap_UC.csv")
    assert (foam.kind, foam.strain.min()) == ("uniaxial", pytest.approx(-0.6))
    assert any("strain = stretch - 1" in sentence for sentence in foam.decisions)
