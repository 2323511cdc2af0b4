"""--columns: what it can say, which file it belongs to, that each refusal suggests one that works; swapped columns."""

import re
from pathlib import Path

import numpy as np
import pytest

import matcal
from matcal.readers.column_options import Selection, parse_selection, selections_of
from matcal.readers.detect import read
from matcal.reduction.reduce import reduce_tests
from touchcal.errors import InputFileError

SHARED = Path(__file__).parents[4] / "shared" / "rawsamples"
E = np.linspace(0, -0.6, 25)
P = -20e3 * (1 - np.exp(3 * E)) + 5e4 * E**3


def _write(folder: Path, text: str, name: str = "uniaxial.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def _rows(*columns: np.ndarray) -> str:
    return "".join(",".join(f"{v:.9g}" for v in row) + "\n" for row in zip(*columns, strict=True))


def test_what_the_option_says() -> None:
    got = parse_selection("foam.csv=stress=1:MPa,stretch=lambda 1,sheet=Data")
    assert got == Selection("foam.csv", {"stress": ("1", "MPa"), "stretch": ("lambda 1", None)}, "Data", got.text)
    assert parse_selection("conductivity=strain=1,conductivity=2:S/m").where == "conductivity"
    assert parse_selection("conductivity=3:S/cm").columns == {"conductivity": ("3", "S/cm")}
    for wrong, says in (("strain", "not QUANTITY=COLUMN"), ("strian=1", "'strian' is unknown"),
                        ("strain=1,strain=2", "given twice"), ("a=b=strain=1", "not QUANTITY"), ("", "not QUANTITY")):
        with pytest.raises(ValueError, match=says):
            parse_selection(wrong)


def test_which_input_it_belongs_to() -> None:
    foam, other = Path("foam.xlsx"), Path("other.csv")
    by_kind, by_file, rest = (parse_selection(f"{where}stress=1:Pa") for where in ("shear=", "other.csv=", ""))
    got = selections_of([("uniaxial", [foam]), ("shear", [foam]), ("shear", [other])], [by_kind, by_file, rest])
    assert got == [{foam: rest}, {foam: by_kind}, {other: by_file}]
    turns = [parse_selection(f"uniaxial=stress={n}:Pa") for n in (2, 8)]
    assert selections_of([("uniaxial", [foam]), ("uniaxial", [foam])], turns) == [{foam: turns[0]}, {foam: turns[1]}]
    with pytest.raises(ValueError, match="fits no file"):
        selections_of([("uniaxial", [foam])], [by_kind])


@pytest.mark.parametrize(("option", "says"), [
    ("strain=1,stress=1:kPa", "column 1 'a' is given as strain and as stress"),
    ("strain=1,stress=2:frob", "unit 'frob' by `columns`, which is not known. Units of stress: Pa, kPa"),
    ("strain=1,stress=2:furlong", "which measures displacement, not stress. Units of stress")])
def test_options_that_cannot_be_right_are_refused(option: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=says):
        read(_write(tmp_path, "a,b\n" + _rows(E, P)), parse_selection(option))


def test_headerless_columns_by_number(tmp_path: Path) -> None:
    path = _write(tmp_path, _rows(P / 1e6, 1 + E))
    got = read(path, parse_selection("stress=1:MPa,stretch=2"))
    np.testing.assert_allclose(got.columns["stress"], P, atol=1e-2)
    for wrong, says in (("stress=7:MPa,stretch=2", "'7' is no column"), ("stress=1,stretch=2", "has no unit"),
                        ("stress=1:mm,stretch=2", "measures displacement, not stress"),
                        ("stress=x:Pa,stretch=2", "'x' is no column")):
        with pytest.raises(InputFileError, match=says):
            read(path, parse_selection(wrong))


@pytest.mark.parametrize("text", [
    _rows(P / 1e6, 1 + E), _rows(E, P), "foam-stretch,foam-stress [kPa],foam-std\n" + _rows(1 + E, P / 1e3, E * 0 + 1),
    "a,b\nmm,N\n" + _rows(E, P), "x,y\n" + _rows(1 + E, P / 1e6), "strain,stress\n" + _rows(E, P),
    "strain,stress (kPa),strain,stress (kPa)\n" + _rows(E, P / 1e3, 0.5 * E, P / 2e3)])
def test_every_refusal_suggests_an_option_that_reads_the_file(text: str, tmp_path: Path) -> None:
    path = _write(tmp_path, text)
    with pytest.raises(InputFileError) as caught:
        read(path)
    found = re.search(r'--columns "([^"]+)"', str(caught.value))
    assert found is not None
    option = parse_selection(found[1])
    assert option.where == path.name
    assert read(path, option).rows == E.size


@pytest.mark.parametrize("text", [
    "stress (kPa),strain\n" + _rows(E, P / 1e3), "strain,stress\n-,kPa\n" + _rows(P, E),
    "lambda,P_MPa\n" + _rows(P / 1e6, 1 + E), "strain (%),stress (Pa)\n" + _rows(P, 100 * E),
    "displacement,force\nN,mm\n" + _rows(E, P), "strain,stress\nkPa,-\n" + _rows(E, P),
    "time (mm),displacement (s),force (N)\n" + _rows(-E, E, P), "displacement (m),force (N)\n" + _rows(P, E)])
def test_swapped_columns_are_refused_with_the_option_that_helps(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r'exchanged.*--columns "uniaxial\.csv='):
        read(_write(tmp_path, text))


def test_what_the_user_says_is_not_doubted_where_a_unit_mends_it(tmp_path: Path) -> None:
    stretched = np.sqrt(np.linspace(0, 0.4, 25))
    path = _write(tmp_path, "strain,stress (kPa)\n" + _rows(stretched, np.linspace(0, 50, 25)))
    with pytest.raises(InputFileError, match="advances in equal steps"):
        read(path)
    assert read(path, parse_selection("strain=1,stress=2")).rows == 25


def test_scatter_and_lateral_strain_reach_the_experiment(tmp_path: Path) -> None:
    text = "stretch,stress (kPa),stress std (kPa),lateral stretch\n" + _rows(1 + E, P / 1e3, 0 * E + 0.5, 1 - E / 10)
    experiment, = reduce_tests([(None, (_write(tmp_path, text),))])
    assert experiment.deviation is not None
    assert experiment.lateral is not None
    np.testing.assert_allclose(experiment.deviation, 500.0)
    np.testing.assert_allclose(experiment.lateral, -E / 10, atol=1e-8)
    with pytest.raises(InputFileError, match="falls below 0"):
        reduce_tests([(None, (_write(tmp_path, text.replace(",0.5,", ",-0.5,")),))])


def test_the_real_headerless_table() -> None:
    path = SHARED / "Treloar1944_UT.txt"
    if not path.exists():
        pytest.skip("real files are not next to the checkout")
    with pytest.raises(InputFileError, match=r"stress=1:MPa,stretch=2"):
        read(path)
    got = read(path, parse_selection("stress=1:MPa,stretch=2"))
    assert (got.rows, got.columns["stretch"][-1], got.columns["stress"][0]) == (24, 7.6, pytest.approx(25500))


@pytest.mark.parametrize(("header", "option"), [
    ("True Strain (-),True Stress (kPa)", None), ("eps_log (-),sigma_true (kPa)", None),
    ("True Strain (-),True Stress (kPa)", "strain=1,stress=2"), ("ln strain,Cauchy stress", "strain=1:-,stress=2:kPa"),
    ("Hencky strain (-),stress (kPa)", "strain=1,stress=2"), ("strain (-),sigma_true (kPa)", "strain=1,stress=2")])
def test_true_strain_and_stress_are_refused_with_the_formula_of_the_nominal(header: str, option: str | None,
                                                                            tmp_path: Path) -> None:
    path = _write(tmp_path, f"{header}\n" + _rows(E, P / 1e3))
    with pytest.raises(InputFileError, match=r"named as a true .* here is nominal\. .*nominal = "):
        read(path, parse_selection(option) if option else None)


def test_nominal_columns_next_to_true_ones_are_taken(tmp_path: Path) -> None:
    path = _write(tmp_path, "True Strain,Engineering Strain,True Stress (kPa),Engineering Stress (kPa)\n"
                  + _rows(np.log1p(E), E, P / 2e3, P / 1e3))
    np.testing.assert_allclose(read(path).columns["stress"], P, atol=1e-2)


def test_hints_leave_out_columns_of_another_name_and_say_per_cent(tmp_path: Path) -> None:
    path = _write(tmp_path, "Time,CalculatedValue,AdjustedForce\n" + _rows(-E, E, P))
    with pytest.raises(InputFileError, match=r"--columns \"uniaxial.csv=strain=NUMBER,stress=NUMBER:kPa\""):
        read(path)
    path = _write(tmp_path, "a,b,c\n" + _rows(0 * E, P, -1000 * E))
    with pytest.raises(InputFileError, match=r"--columns \"uniaxial.csv=strain=3:%,stress=2:kPa\"") as caught:
        read(path, parse_selection("strain=3,stress=2:kPa"))
    assert "exchanged" not in str(caught.value)
    read(path, parse_selection("strain=3:%,stress=2:kPa"))
    path = _write(tmp_path, "strain,stress (kPa)\n" + _rows(-10 * E, -P))
    with pytest.raises(InputFileError, match=r"in per cent, give --columns \"uniaxial.csv=strain=1:%,stress=2\""):
        read(path)
    path = _write(tmp_path, "strain,stress (kPa)\n" + _rows(-1000 * E, -P))
    with pytest.raises(InputFileError, match=r"in per cent, give .* If columns are exchanged, give"):
        read(path)
    path = _write(tmp_path, "strain,stress (kPa)\n" + _rows(-1e-3 * P, -E))
    with pytest.raises(InputFileError, match="If columns are exchanged, give") as caught:
        read(path)
    exchanged = re.findall(r'=(strain\S+)"', str(caught.value))[-1]
    np.testing.assert_allclose(read(path, parse_selection(exchanged)).columns["strain"], -E, rtol=1e-5)


def test_values_too_small_for_any_test_are_refused(tmp_path: Path) -> None:
    path = _write(tmp_path, "strain,stress (Pa)\n" + _rows(-E, -1e-300 * P))
    with pytest.raises(InputFileError, match=r"column 'stress' nowhere exceeds \S+ Pa, too little for any stress"):
        read(path)


def test_underscores_before_names_and_rows_with_a_number_too_many(tmp_path: Path) -> None:
    path = _write(tmp_path, "_Extension (mm),_Load (N),_Time (s)\n" + _rows(-E, -P, -E))
    assert set(read(path).columns) == {"displacement", "force", "time"}
    path = _write(tmp_path, "strain,stress (Pa)\n" + _rows(E, P) + "1,2,3\n")
    with pytest.raises(InputFileError, match="line 27: 3 cells in a table of 2 columns"):
        read(path)


@pytest.mark.parametrize(("begin", "says"), [(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
                                              r"old Office file, .* Save it as .xlsx"),
                                             (b"\x89HDF\r\n\x1a\n", "HDF5")])
def test_other_formats_are_known_by_their_first_bytes(begin: bytes, says: str, tmp_path: Path) -> None:
    path = tmp_path / "test.dat"
    path.write_bytes(begin + bytes(600))
    with pytest.raises(InputFileError, match=says):
        read(path)


def test_the_gap_of_a_rheometer_is_its_displacement(tmp_path: Path) -> None:
    strain = np.linspace(0, 0.5, 400)
    rows = zip(np.arange(400) * 0.1, 2 * strain, 10000 * (1 - strain), strict=True)
    path = tmp_path / "disc_uniaxial.txt"
    path.write_text("Time (s)\tNormal force (N)\tGap (um)\n" + "".join(f"{t}\t{f}\t{g}\n" for t, f, g in rows))
    toml = tmp_path / "specimen.toml"
    toml.write_text("[uniaxial]\ndiameter_mm = 8\nheight_mm = 10\ndirection = \"compression\"\n")
    test = matcal.read_test({"uniaxial": path}, specimen=toml)
    assert test.strain.min() == pytest.approx(-0.5, abs=0.005)
    assert test.value.min() == pytest.approx(-1 / (np.pi * 0.004**2), rel=0.01)
