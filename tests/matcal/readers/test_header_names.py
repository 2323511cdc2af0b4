"""Names of columns: what machines of several vendors and languages write is known; what is something else is not."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from matcal.readers.detect import read
from matcal.readers.unit_table import readings
from matcal.readers.units import measures, quantity_in, si_factor, split_name, unused_in
from matcal.readers.vocabulary import quantities_of, relative_of
from matcal.reduction.reduce import reduce_tests
from touchcal.errors import InputFileError

LISTED = Path(__file__).parents[4] / "shared" / "cases" / "material" / "31_headers_of_machines" / "out.txt"

# (cells of one machine or language, quantity and unit of each)
MACHINES = {
    "WaveMatrix": ("Total Time (s)|Position(Linear:Position) (mm)|Load(8800 (0,1):Load) (kN)",
                   "time displacement force"),
    "DIC, Keithley, divider": ("Clock (s)|DIC strain Eyy (%)|P11 (kPa)|Measure I (A)|Vout (V)|Rs (Ohm)|X-head (mm)",
                               "time strain stress current potential resistance displacement"),
    "Nexygen": ("Load (N)|Machine Extension (mm)|Time (sec)|Extension from Preload (mm)",
                "force displacement time displacement"),
    "Exponent": ("Force (g)|Distance (mm)|Time (sec)", "force displacement time"),
    "CellScale": ("Time_S|Displacement_mm|Force_N", "time displacement force"),
    "testXpert": ("Prüfzeit in s|Standardweg in mm|Prüfkraft in N|Nominelle Dehnung in %|Traverse absolut in mm",
                  "time displacement force strain displacement"),
    "Walter+Bai": ("Zeit [s]|Kolbenweg [mm]|Kraft [kN]|Längenänderung [mm]", "time displacement force displacement"),
    "Trapezium": ("時間(sec)|試験力(N)|ストローク(mm)|引張応力(N/mm2)|ストローク歪(%)",
                  "time force displacement stress strain"),
    "EC-Lab": ("time/s|Ewe/V|<I>/mA|I/mA", "time potential current current"),
    "Gamry": ("T (s)|Vf (V vs. Ref.)|Im (A)", "time potential current"),
    "Keithley": ("Relative Time (s)|Voltage (Volts)|Current (Amps)|Resistance (Ohms)|Smua.1 R (MOhm)",
                 "time potential current resistance resistance"),
    "capitals": ("TIME (SEC)|EXTENSION (MM)|LOAD (KN)|STRESS (PSI)|STRESS (MPA)",
                 "time displacement force stress stress"),
    "Italian": ("Tempo (s)|Corsa (mm)|Carico (N)|Deformazione (%)|Tensione (MPa)|Tensione (V)",
                "time displacement force strain stress potential"),
    "Portuguese": ("Tempo (s)|Extensão (mm)|Força (N)|Deformação (%)|Tensão (MPa)",
                   "time displacement force strain stress"),
    "French": ("Temps (s)|Déplacement traverse (mm)|Force (N)|Déformation (%)|Déformation (mm)|Tension (V)",
               "time displacement force strain displacement potential"),
    "Polish": ("Czas [s]|Wydłużenie [mm]|Obciążenie [N]|Odkształcenie [%]|Naprężenie [MPa]",
               "time displacement force strain stress"),
    "Czech": ("Čas [s]|Dráha [mm]|Síla [N]|Deformace [%]|Napětí [MPa]|Napětí [V]",
              "time displacement force strain stress potential"),
    "Turkish": ("Zaman (sn)|Uzama (mm)|Kuvvet (N)|Gerilme (MPa)|Birim uzama (%)", " displacement force stress strain"),
    "Norwegian, Danish": ("Tid (s)|Forskyvning (mm)|Kraft (N)|Tøyning (%)|Spenning (MPa)|Strøm (A)",
                          "time displacement force strain stress current"),
    "Finnish": ("Aika (s)|Siirtymä (mm)|Voima (N)|Venymä (%)|Jännitys (MPa)", "time displacement force strain stress"),
    "Russian": ("Время, с|Перемещение, мм|Нагрузка, кН|Деформация, %|Напряжение, МПа|Напряжение, В",
                "time displacement force strain stress potential"),
    "Hungarian, Romanian": ("Idő (s)|Elmozdulás (mm)|Erő (N)|Timp (s)|Forță (N)|Deplasare (mm)",
                            "time displacement force time force displacement"),
    "Korean": ("시간(s)|변위(mm)|시험하중(N)|압축응력(MPa)|변형률(%)", "time displacement force stress strain"),
    "Chinese": ("试验时间(s)|压缩位移(mm)|試驗力(N)|压缩变形(mm)|工程应变(%)|电阻(Ω)|压强(kPa)",
                "time displacement force displacement strain resistance pressure"),
}
# known words that are no measurement of a test, or of another one
UNKNOWN = ("Strain rate (1/s)", "Force setpoint (N)", "Peak load (N)", "Young's modulus (MPa)", "Energy (J)",
           "Position command", "Bruchdehnung (%)", "Höchstkraft (N)", "Ch 1 Kraft Sollwert",
           "Load cell temperature (°C)", "Time step", "f (Hz)", "T (°C)", "T/K", "C (pF)", "P (W)", "E (MPa)",
           "Attention", "Pretension", "SetName", "Index", "Scan", "Rate (mm/min)")


@pytest.mark.parametrize(("cells", "quantities"), MACHINES.values(), ids=MACHINES.keys())
def test_names_of_machines_and_languages(cells: str, quantities: str) -> None:
    got = [quantity_in(*split_name(cell)) for cell in cells.split("|")]
    expected = quantities.split()
    assert got[len(got) - len(expected):] == expected
    for cell, quantity in zip(cells.split("|")[len(got) - len(expected):], expected, strict=True):
        unit = split_name(cell)[1]
        assert unit is not None
        assert si_factor(unit, quantity) is not None, cell


@pytest.mark.parametrize("cell", UNKNOWN)
def test_what_is_no_column_of_a_test_stays_unknown(cell: str) -> None:
    assert quantity_in(*split_name(cell)) is None


@pytest.mark.skipif(not LISTED.exists(), reason="the cases are not next to the checkout")
def test_headers_collected_from_public_readers() -> None:
    cells = [found[1] for line in LISTED.read_text(encoding="utf-8").splitlines()
             if (found := re.fullmatch(r"   (.*) -> .*", line))]
    split = [split_name(cell) for cell in cells]
    known = [cell for cell, (name, unit) in zip(cells, split, strict=True)
             if quantity_in(name, unit) or relative_of(name) or unused_in(name, unit)]
    assert (len(cells), len(known) >= 180) == (191, True)


@pytest.mark.parametrize(("unit", "quantity", "factor"), [
    ("Ohm", "resistance", 1.0), ("kOhm", "resistance", 1e3), ("MOhm", "resistance", 1e6), ("MOHM", "resistance", 1e6),
    ("mohm", "resistance", 1e-3), ("kΩ", "resistance", 1e3), ("Volts", "potential", 1.0), ("Amps", "current", 1.0),
    ("PSI", "stress", 6894.757), ("psi", "stress", 6894.757), ("MM", "displacement", 1e-3), ("S", "time", 1.0),
    ("mPa", "stress", 1e-3), ("Mpa", "stress", 1e6), ("kgf/cm²", "stress", 98066.5), ("g", "force", 9.80665e-3),
    ("lbf", "force", 4.448222), ("mm/m", "strain", 1e-3), ("µε", "strain", 1e-6), ("N mm-2", "stress", 1e6),
    ("1/(s)", "time", None), ("mS/cm", "conductivity", 0.1), ("V vs. Ref.", "potential", 1.0), ("кН", "force", 1e3),
    ("dB", "strain", None), ("turn", "strain", None), ("count", "strain", None), ("count", "cycle", 1.0),
    ("deg", "strain", np.pi / 180), ("rad", "strain", 1.0), ("deg", "lateral", None),
    ("°C", "time", None), ("Hz", "force", None)])
def test_units_of_machines(unit: str, quantity: str, factor: float | None) -> None:
    assert si_factor(unit, quantity) == (None if factor is None else pytest.approx(factor, rel=1e-6))


@pytest.mark.thorough
@given(st.text(max_size=30)
       | st.from_regex(r"[A-Za-zΔ]{1,3}[_/ ][A-Za-z]{1,3}[0o]?( ?[(\[][a-zA-Z0-9/%^-]{0,8}[)\]])?"))
@example("R/R0")
@example("e/e0")
@example("t/t0 (molar_gas_constant)")
@settings(max_examples=500)
def test_any_text_is_a_header(cell: str) -> None:
    name, unit = split_name(cell)
    quantity_in(name, unit)
    quantities_of(cell)
    for text in (cell, unit or ""):
        readings(text)
        measures(text)


def _table(folder: Path, names: str, columns: list[list[float]], name: str = "uniaxial.csv") -> Path:
    path = folder / name
    path.write_text(names + "\n" + "".join(",".join(map(str, row)) + "\n" for row in zip(*columns, strict=True)),
                    encoding="utf-8")
    return path


RISING = [0.0, 0.1, 0.2, 0.3]


@pytest.mark.parametrize("ratio", ["V/V0", "F/F0", "P/P0", "T/T0", "t/t0", "C/C0", "U/U0", "c/c0", "e/e0",
                                   "sigma/sigma0", "σ/σ_0", "foo/foo0", "N/N0", "x/x0", "h/h0"])
def test_a_ratio_to_an_initial_value_that_no_test_uses_is_left_out(ratio: str, tmp_path: Path) -> None:
    path = _table(tmp_path, f"strain,stress (kPa),{ratio}", [RISING, RISING, [1.0, 1.1, 1.2, 1.3]])
    got = read(path)
    assert set(got.columns) == {"strain", "stress"}
    assert any(f"'{ratio}' left out" in note and "relative to its initial value" in note for note in got.notes)


@pytest.mark.parametrize(("name", "values"), [("R/R0", [1.0, 1.2]), ("R_R0", [1.0, 1.2]), ("ΔR/R0 (%)", [0.0, 20.0]),
                                              ("(R-R0)/R0", [0.0, 0.2]),
                                              ("relative resistance change (%)", [0.0, 20.0]),
                                              ("Relative resistance (-)", [1.0, 1.2])])
def test_relative_resistance_is_the_ratio(name: str, values: list[float], tmp_path: Path) -> None:
    got = read(_table(tmp_path, f"strain,{name}", [[0.0, 0.1], values]))
    np.testing.assert_allclose(got.columns["relative_resistance"], [1.0, 1.2])


def test_a_volume_ratio_stands_next_to_a_pressure(tmp_path: Path) -> None:
    got = read(_table(tmp_path, "V/V0,pressure (kPa)", [[1.0, 0.9, 0.8], [0.0, 2.0, 4.0]]))
    assert got.columns["volume_ratio"].tolist() == [1.0, 0.9, 0.8]


def test_a_letter_is_what_its_unit_says(tmp_path: Path) -> None:
    got = read(_table(tmp_path, "u (mm),P (N),V (V),T (°C)", [RISING] * 4))
    assert (got.names["displacement"], got.names["force"], got.names["potential"]) == ("u", "P", "V")
    assert any("'T' left out: a temperature" in note for note in got.notes)


def test_a_conductance_g_next_to_a_clock_is_no_modulus_that_relaxes(tmp_path: Path) -> None:
    found = read(_table(tmp_path, "time (s),displacement (mm),G (uS)", [RISING, RISING, [100.0, 80.0, 50.0, 40.0]]))
    assert found.columns["resistance"] == pytest.approx([1e4, 1.25e4, 2e4, 2.5e4])
    assert "modulus" not in found.columns


def test_a_deformation_without_a_unit_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="'Deformation' has no unit"):
        read(_table(tmp_path, "Deformation,stress (kPa)", [RISING] * 2))
    for name in ("Deformation", "Deflection", "Indentation"):
        assert read(_table(tmp_path, f"{name} (%),stress (kPa)", [RISING] * 2)).columns["strain"][-1] == 0.003
    assert read(_table(tmp_path, "Deflection (mm),Load (N)", [RISING] * 2)).columns["displacement"][-1] == 3e-4


@pytest.mark.parametrize("names", ["Temperature (°C),Speichermodul (MPa),tan delta,Kraft (N),Weg (mm)",
                                   "E' (MPa),E\" (MPa)"])
def test_a_dynamic_test_without_frequencies_says_what_it_needs(names: str, tmp_path: Path) -> None:
    path = _table(tmp_path, names, [RISING] * len(names.split(",")))
    with pytest.raises(InputFileError, match="needs a frequency column"):
        reduce_tests([("dma", (path,))])


@pytest.mark.parametrize(("unit", "says"), [("dB", "not known"), ("turn", "not known")])
def test_units_of_something_else_are_refused_for_a_strain(unit: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=says):
        read(_table(tmp_path, f"gamma ({unit}),stress (kPa)", [RISING] * 2))
