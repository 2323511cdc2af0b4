"""Conductors from what people record: resistance, compression, one file or two, relative resistance; c = L/(R A)."""

from pathlib import Path

import numpy as np
import pytest

import matcal
from matcal.reduction.experiment import Experiment
from matcal.reduction.reduce import read_and_reduce
from touchcal.errors import InputFileError

CASES = Path(__file__).parents[4] / "shared" / "cases" / "material"
LENGTH_mm, AREA_mm2, REST_S_per_m = 8.0, 400.0, 0.02
BLOCK = "[conductivity]\nlength_mm = 8\narea_mm2 = 400\n"


def _conductivity(strain: np.ndarray) -> np.ndarray:
    return REST_S_per_m * (1 - 1.5 * strain + strain**2)


def _resistance(strain: np.ndarray) -> np.ndarray:
    return 1e-3 * LENGTH_mm * (1 + strain) / (_conductivity(strain) * 1e-6 * AREA_mm2)


def _experiment(folder: Path, sizes: str, **tables: dict[str, np.ndarray]) -> Experiment:
    (folder / "s.toml").write_text(sizes, encoding="utf-8")
    files = []
    for name, columns in tables.items():
        rows = "\n".join(",".join(f"{x:.9g}" for x in row) for row in zip(*columns.values(), strict=True))
        (folder / f"{name}.csv").write_text(f"{','.join(columns)}\n{rows}\n", encoding="utf-8")
        files.append(folder / f"{name}.csv")
    (found,) = read_and_reduce([("conductivity", tuple(files))], folder / "s.toml").experiments
    return found


def _record(side: int) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(0, 60, 0.1)
    return time, side * 0.5 * np.clip(time - 5, 0, None) / 55


@pytest.mark.parametrize(("head", "of"), [
    ("Conductance (uS)", lambda e: 1e6 / _resistance(e)), ("Leitwert [mS]", lambda e: 1e3 / _resistance(e)),
    ("rho (Ohm cm)", lambda e: 100 / _conductivity(e)), ("Resistivity (Ohm m)", lambda e: 1 / _conductivity(e))])
def test_a_conductance_or_a_resistivity_is_read_by_its_unit(head: str, of, tmp_path: Path) -> None:
    strain = -np.linspace(0, 0.5, 13)
    got = _experiment(tmp_path, BLOCK, foam={"Kompression (%)": -100 * strain, head: of(strain)})
    assert got.strain == pytest.approx(strain)
    assert got.value == pytest.approx(_conductivity(strain), rel=1e-6)


@pytest.mark.parametrize("phase", [0.0, -3.0, 40.0])
@pytest.mark.parametrize("heads", [("|Z| (kOhm)", "Phase (deg)"), ("Z' (Ohm)", "Z'' (Ohm)"),
                                   ("Impedance magnitude (Ohm)", "phase angle (rad)")])
def test_an_impedance_gives_the_resistance_with_its_phase(heads: tuple[str, str], phase: float, tmp_path: Path) -> None:
    strain, turn = -np.linspace(0, 0.5, 13), np.radians(phase)
    first = _resistance(strain) / (np.cos(turn) if "Z'" not in heads[0] else 1) / (1e3 if "kOhm" in heads[0] else 1)
    second = {"deg": phase, "rad": turn}.get(heads[1][-4:-1], 0.0) + 0 * strain
    got = _experiment(tmp_path, BLOCK, foam={"compression (%)": -100 * strain, heads[0]: first, heads[1]: second})
    assert got.value == pytest.approx(_conductivity(strain), rel=1e-6)
    assert any("in parallel" in said for said in got.cautions) == (phase == 40.0 and "Z'" not in heads[0])


def test_the_magnitude_of_an_impedance_alone_is_no_resistance(tmp_path: Path) -> None:
    strain = -np.linspace(0, 0.5, 13)
    with pytest.raises(InputFileError, match=r"without its phase.*strain=1,resistance=2"):
        _experiment(tmp_path, BLOCK, foam={"strain (%)": 100 * strain, "|Z| (Ohm)": _resistance(strain)})


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_table_of_strain_and_resistance(relative: bool, side: int, tmp_path: Path) -> None:
    """Strain counted positive in both directions; direction says which it is."""
    strain = side * np.linspace(0, 0.6, 13)
    resistance = _resistance(strain)
    sizes = BLOCK + f"direction = \"{'compression' if side < 0 else 'tension'}\"\n"
    if relative:
        table = {"conductivity": {"strain": np.abs(strain), "relative_resistance": resistance / resistance[0]}}
        with pytest.raises(InputFileError, match=r"width_mm, and rest_resistance_Ohm below"):
            matcal.read_test(table)
        (tmp_path / "s.toml").write_text(sizes, encoding="utf-8")
        with pytest.raises(InputFileError, match=r"relative to the resistance at rest. Write rest_resistance_Ohm"):
            matcal.read_test(table, tmp_path / "s.toml")
        (tmp_path / "s.toml").write_text(f"{sizes}rest_resistance_Ohm = {resistance[0]:.9g}\n", encoding="utf-8")
        got = matcal.read_test(table, tmp_path / "s.toml")
    else:
        got = _experiment(tmp_path, sizes, foam={"strain": np.abs(strain), "resistance (ohm)": resistance})
    assert got.strain == pytest.approx(strain)
    assert got.value == pytest.approx(_conductivity(strain), rel=1e-6)
    assert not got.cautions


@pytest.mark.parametrize("files", [1, 2])
@pytest.mark.parametrize("electric", ["resistance", "current"])
@pytest.mark.parametrize("by", ["key", "name", "column", "sign"])
def test_a_record_of_compression(files: int, electric: str, by: str, tmp_path: Path) -> None:
    """The direction by the specimen's key, the file's name, a column's name, or displacement and force that fall."""
    time, strain = _record(-1)
    noise = 1 + 1e-4 * np.random.default_rng(3).normal(size=time.size)
    travel, force = LENGTH_mm * np.abs(strain), 3 * np.abs(strain)
    if by == "sign":
        travel, force = -travel, -force
    frame = {"time (s)": time, ("compressive " if by == "column" else "") + "displacement (mm)": travel,
             "force (N)": force}
    meter = {"resistance (ohm)": _resistance(strain) * noise} if electric == "resistance" else {
        "potential (V)": np.full(time.size, 2.0), "current (A)": 2.0 / _resistance(strain) * noise}
    sizes = BLOCK + "direction = \"compression\"\n" * (by == "key")
    first = "frame_compression" if by == "name" else "frame"
    tables = {first: frame | meter} if files == 1 else {first: frame, "meter": {"time (s)": time + 7.0} | meter}
    got = _experiment(tmp_path, sizes, **tables)
    assert got.strain.min() == pytest.approx(-0.5, rel=0.02)
    assert got.value == pytest.approx(_conductivity(got.strain), rel=2e-3 if files == 1 else 0.02)
    if files == 1:
        assert got.facts["clock_shift_s"] == 0
        assert "backlash_mm" not in got.facts


def test_nothing_that_tells_the_direction_is_asked_for_or_said(tmp_path: Path) -> None:
    time, strain = _record(1)
    table = {"time (s)": time, "displacement (mm)": LENGTH_mm * strain, "resistance (ohm)": _resistance(strain)}
    with pytest.raises(InputFileError, match=r"compression or tension. Write direction"):
        _experiment(tmp_path, BLOCK, t=table)
    coated = "[conductivity]\nlength_mm = 8\nwidth_mm = 5\nthickness_mm = 5\ncoating_um = 20000\n"
    got = _experiment(tmp_path, coated, t=table)
    assert got.value == pytest.approx(_conductivity(got.strain), rel=2e-3)
    assert "read as tension" in got.cautions[0]


@pytest.mark.parametrize("off", [1.0, 1.3])
def test_resistance_next_to_voltage_and_current_counts_and_a_difference_is_said(off: float, tmp_path: Path) -> None:
    time, strain = _record(1)
    resistance = _resistance(strain)
    got = _experiment(tmp_path, BLOCK + "direction = \"tension\"\n", t={
        "time (s)": time, "displacement (mm)": LENGTH_mm * strain, "R (ohm)": resistance,
        "current (A)": 1 / resistance, "voltage (V)": np.full(time.size, off)})
    assert got.value == pytest.approx(_conductivity(got.strain), rel=2e-3)
    assert [f"{off - 1:.0%}".rstrip("%") in caution for caution in got.cautions] == [True] * (off > 1)


@pytest.mark.parametrize("files", [1, 2])
def test_the_specimens_voltage_in_a_divider_gives_its_resistance(files: int, tmp_path: Path) -> None:
    time, strain = _record(-1)
    frame = {"time (s)": time, "displacement (mm)": -LENGTH_mm * strain}
    logger = {"time (s)": time, "voltage (V)": 5 / (1 + 1e3 / _resistance(strain))}
    tables = {"compression": frame | logger} if files == 1 else {"compression": frame, "logger": logger}
    with pytest.raises(InputFileError, match=r"voltage alone gives no resistance.*write series_resistance_Ohm and"):
        _experiment(tmp_path, BLOCK, **tables)
    with pytest.raises(InputFileError, match=r"is of a divider: write voltage_V"):
        _experiment(tmp_path, BLOCK + "series_resistance_Ohm = 1000\n", **tables)
    with pytest.raises(InputFileError, match=r"is between 0 and voltage_V = 0.1"):
        _experiment(tmp_path, BLOCK + "series_resistance_Ohm = 1000\nvoltage_V = 0.1\n", **tables)
    got = _experiment(tmp_path, BLOCK + "series_resistance_Ohm = 1000\nvoltage_V = 5\n", **tables)
    assert got.strain.min() < -0.4
    assert got.value == pytest.approx(_conductivity(got.strain), rel=2e-3)


def test_a_table_of_conductivity_that_is_named_compression(tmp_path: Path) -> None:
    (tmp_path / "foam_compression.csv").write_text("strain,conductivity\n-,S/m\n" + "".join(
        f"{e:.3g},{_conductivity(-e):.9g}\n" for e in np.linspace(0, 0.7, 15)), encoding="utf-8")
    (got,) = read_and_reduce([("conductivity", (tmp_path / "foam_compression.csv",))]).experiments
    assert got.strain.min() == pytest.approx(-0.7)
    assert got.value == pytest.approx(_conductivity(got.strain))


@pytest.mark.skipif(not CASES.exists(), reason="the shared cases are not here")
def test_a_foam_pressed_between_electrodes() -> None:
    """3.60e-6 and 7.52e-6 S/m at 40 and 60 % of compression, by the table itself; c = L0 (1 - e)/(R A) by the frame's
    file and the source's."""
    folder = CASES / "04_divider_logger"
    (table,) = read_and_reduce([("conductivity", (folder / "foam_compression_conductivity.csv",))]).experiments
    assert np.interp([0.4, 0.6], -table.strain, table.value) == pytest.approx([3.60e-6, 7.52e-6], rel=5e-3)
    files = (folder / "PU_U1_compression.csv", folder / "smu.csv")
    (record,) = read_and_reduce([("conductivity", files)], folder / "specimen.toml").experiments
    frame = np.genfromtxt((line.replace('"', "") for line in files[0].open()), delimiter=",", skip_header=2)
    meter = np.genfromtxt(files[1], delimiter=",", skip_header=1)
    strain, when = frame[:, 2] / 3.0, frame[:, 1]
    resistance = np.interp(when + record.facts["clock_shift_s"], meter[:, 0], meter[:, 1] / (1e-3 * meter[:, 2]))
    held = (np.abs(strain - 0.6) < 0.004) & (when < when[np.argmax(strain)])
    expected = (3e-3 * (1 - strain) / (resistance * 1.64e-6))[held]
    at = int(np.argmin(np.abs(record.strain + 0.6)))
    assert expected.min() < record.value[at] < expected.max()


@pytest.mark.skipif(not CASES.exists(), reason="the shared cases are not here")
def test_resistance_by_number_of_a_file_of_three_clocks() -> None:
    from matcal.readers.column_options import parse_selection, selections_of

    folder = CASES / "05_headerless_3clocks"
    inputs = [("conductivity", (folder / "rig.csv",))]
    chosen = selections_of(inputs, [parse_selection("rig.csv=time=5:s,displacement=4:mm,resistance=1:ohm")])
    (got,) = read_and_reduce(inputs, folder / "specimen.toml", chosen).experiments
    assert (got.facts["clock_shift_s"], "backlash_mm" in got.facts) == (0, False)
    rows = np.genfromtxt(folder / "rig.csv", delimiter=",")
    expected = 0.04 * (1 + got.strain) / 2.8e-6
    assert np.median(got.value / (expected / np.median(rows[-200:, 0]))) == pytest.approx(1, rel=0.1)


@pytest.mark.parametrize(("change", "noise", "said"), [(0.06, 0.01, True), (-0.1, 0.005, True), (0.0, 0.02, False),
                                                       (0.0, 0.1, False)])
def test_what_unloading_conducts_otherwise_is_said_with_its_size(change: float, noise: float, said: bool,
                                                                 tmp_path: Path) -> None:
    """Unless there is none; of 400 tables with 10 % of noise and none, 3 said one."""
    strain = np.r_[np.linspace(0, 0.4, 40), np.linspace(0.4, 0, 40)]
    value = 30 * (1 - 2 * strain + 2 * strain**2) * (1 + change * (np.arange(80) >= 40))
    value *= 1 + noise * np.random.default_rng(7).standard_normal(80)
    file = tmp_path / "tension.csv"
    file.write_text("strain,conductivity\n-,S/m\n" + "".join(f"{e:.6g},{c:.6g}\n" for e, c in zip(
        strain, value, strict=True)), encoding="utf-8")
    test = read_and_reduce([("conductivity", (file,))]).experiments[0]
    if said:
        assert test.facts["conduction_hysteresis"] == pytest.approx(change, abs=0.01)
    assert ("conduction_hysteresis" in test.facts) == said
    assert any("(hysteresis)" in sentence for sentence in test.cautions) == said


def test_the_magnitude_of_an_impedance_next_to_a_load_leaves_a_mechanical_test_as_it_is(tmp_path: Path) -> None:
    strain, file = np.linspace(0, 0.5, 30), tmp_path / "uniaxial_3.csv"
    file.write_text("strain,stress (kPa),|Z| (Ohm)\n" + "".join(f"{e:.6g},{20 * e:.6g},{1e3 * (1 + e):.6g}\n"
                                                                for e in strain), encoding="utf-8")
    test = read_and_reduce([(None, (file,))]).experiments[0]
    assert test.kind == "uniaxial"
    np.testing.assert_allclose(np.abs(test.value), 20e3 * np.abs(test.strain), rtol=1e-4)
    assert any("'|Z|' left out" in sentence for sentence in test.decisions)


@pytest.mark.parametrize(("sizes", "said"), [("", "area_mm2 of a block"),
                                               ("width_mm = 5\n", "needs the key coating_um")])
def test_sizes_that_leave_open_what_conducts_name_both_ways(sizes: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=said) as refused:
        _experiment(tmp_path, f"[conductivity]\nlength_mm = 8\n{sizes}", tension={
            "strain": np.linspace(0, 0.5, 9), "resistance_Ohm": np.linspace(10, 20, 9)})
    assert "area_mm2" in str(refused.value)
