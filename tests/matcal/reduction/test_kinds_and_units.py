"""Words as words, angles as angles, per cent without a unit, and tables of another kind than the one given."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import matcal
from matcal.readers.column_options import parse_selection, selections_of
from matcal.reduction.experiment import Experiment
from matcal.reduction.loading_direction import named_direction
from matcal.reduction.reduce import read_and_reduce
from touchcal.errors import InputFileError

MODULUS_Pa = 10e3


def _table(folder: Path, name: str, head: str, strain: np.ndarray, stress: np.ndarray) -> Path:
    rows = "\n".join(f"{e:.8g},{p:.8g}" for e, p in zip(strain, stress, strict=True))
    (folder / name).write_text(f"{head}\n{rows}\n", encoding="utf-8")
    return folder / name


def _experiment(path: Path, kind: str | None, columns: str = "") -> Experiment:
    inputs = [(kind, (path,))]
    (found,) = read_and_reduce(inputs, None, selections_of(inputs, [parse_selection(columns)] if columns else [])
                               ).experiments
    return found


@pytest.mark.parametrize(("text", "direction"), [
    ("Compressive strain (Extension) 1", "compression"), ("extension", None), ("Tensile test", "tension"),
    ("PU_U1comp_1", "compression"), ("decompression", None), ("tension_3", "tension"), ("Drucksensor", None),
    ("Druckversuch", "compression"), ("extensometer", None), ("hypertension", None), ("stretcher", None),
    ("stretch-to-failure", "tension"), ("компрессия", None), ("Kompression", "compression"),
    ("압축시험", "compression"), ("rozciąganie", "tension")])
def test_a_direction_is_a_word_and_no_part_of_one(text: str, direction: str | None) -> None:
    assert named_direction([text]) == direction


def test_compression_next_to_extension_in_a_name_is_compression(tmp_path: Path) -> None:
    e = np.linspace(0, 0.5, 20)
    path = _table(tmp_path, "mech.csv", "Compressive strain (Extension) 1,Stress 1", e, 20 * e)
    got = _experiment(path, "uniaxial", "strain=1:-,stress=2:kPa")
    assert got.strain.min() == pytest.approx(-0.5)
    assert not got.cautions


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("per_cent", [False, True])
@pytest.mark.parametrize("left", [False, True])
def test_a_compression_ratio_is_what_is_given_or_what_is_left(left: bool, per_cent: bool, side: int,
                                                              tmp_path: Path) -> None:
    strain = np.linspace(0, 0.4, 9)
    head = f"Compression ratio{' (%)' if per_cent else ''},stress (Pa)"
    column = (100 if per_cent else 1) * (1 - strain if left else strain)
    found = _experiment(_table(tmp_path, "uniaxial.csv", head, column, side * MODULUS_Pa * strain), None)
    np.testing.assert_allclose([found.strain, found.value], [-strain, -MODULUS_Pa * strain], atol=1e-9)
    with pytest.raises(InputFileError, match=r"begins at 0\.3 and"):
        _experiment(_table(tmp_path, "uniaxial.csv", "Compression ratio,stress (Pa)", 0.3 + strain, strain), None)


@pytest.mark.parametrize(("head", "unit"), [("gamma (deg)", 180 / np.pi), ("shear angle (°)", 180 / np.pi),
                                            ("angle (degrees)", 180 / np.pi), ("gamma (rad)", 1.0)])
@pytest.mark.parametrize("most", [20.0, 60.0])
def test_an_angle_of_shear_is_no_gamma(head: str, unit: float, most: float, tmp_path: Path) -> None:
    angle = np.radians(np.linspace(0, most, 31))
    path = _table(tmp_path, "shear.csv", f"{head},tau (kPa)", unit * angle, 1e-3 * MODULUS_Pa * np.tan(angle))
    got = _experiment(path, None)
    assert got.value == pytest.approx(MODULUS_Pa * got.strain, rel=1e-6)
    assert bool(got.cautions) == ("rad" in head)
    with pytest.raises(InputFileError, match="is an angle"):
        _experiment(path, "uniaxial")


@pytest.mark.parametrize("degrees", [False, True])
def test_an_angle_without_a_unit_is_asked_for(degrees: bool, tmp_path: Path) -> None:
    angle = np.linspace(0, 0.7, 31)
    path = _table(tmp_path, "shear.csv", "shear angle,tau (kPa)", np.degrees(angle) if degrees else angle,
                  1e-3 * MODULUS_Pa * np.tan(angle))
    with pytest.raises(InputFileError, match=r"has no unit.*strain=1:deg"):
        _experiment(path, None)
    unit = "deg" if degrees else "rad"
    assert _experiment(path, None, f"strain=1:{unit},stress=2").strain == pytest.approx(np.tan(angle), rel=1e-6)


@pytest.mark.parametrize("head", ["eps_xy", "tensorial shear strain", "Exy"])
def test_gamma_is_twice_the_component_of_the_tensor(head: str, tmp_path: Path) -> None:
    gamma = np.linspace(0, 0.8, 31)
    got = _experiment(_table(tmp_path, "shear.csv", f"{head} (-),sigma_xy (kPa)", gamma / 2, 10 * gamma), None)
    assert got.strain == pytest.approx(gamma)
    assert any("twice" in caution for caution in got.cautions)


def test_an_angle_that_no_shear_has_is_refused(tmp_path: Path) -> None:
    gamma = np.linspace(0, 2.0, 31)
    path = _table(tmp_path, "shear.csv", "gamma (rad),tau (kPa)", gamma, 10 * gamma)
    with pytest.raises(InputFileError, match="If it is gamma itself, give it with `columns` strain=gamma:-"):
        _experiment(path, None)
    assert _experiment(path, None, "strain=gamma:-,stress=tau").value == pytest.approx(MODULUS_Pa * gamma)


@pytest.mark.parametrize("name", ["compression.csv", "uniaxial_compression.csv"])
@pytest.mark.parametrize("most", [1.2, 2.5, 60.0])
@pytest.mark.parametrize("side", [-1, 1])
def test_per_cent_without_a_unit_is_asked_for_in_compression(name: str, most: float, side: int, tmp_path: Path) -> None:
    e = side * np.linspace(0, most, 40)
    path = _table(tmp_path, name, "strain,stress (kPa)", e, 0.2 * e)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputFileError, match=r"--columns .*strain=.*:%"):
            _experiment(path, None)
    got = _experiment(path, None, "strain=strain:%,stress=stress")
    assert got.strain.min() == pytest.approx(-most / 100)


@pytest.mark.parametrize(("kind", "most", "said"), [("uniaxial", 2.5, True), ("shear", 1.5, True),
                                                    ("uniaxial", 0.9, False)])
def test_per_cent_without_a_unit_is_minded_in_tension(kind: str, most: float, said: bool, tmp_path: Path) -> None:
    e = np.linspace(0, most, 40)
    path = _table(tmp_path, f"{kind}_tension.csv" if kind == "uniaxial" else "shear.csv", "strain,stress (kPa)", e,
                  0.2 * e)
    got = _experiment(path, None)
    assert ["strain=strain:%" in caution for caution in got.cautions] == [True] * said
    unit = "-" if said else ""
    assert not said or not _experiment(path, None, f"strain=strain:{unit},stress=stress").cautions


@pytest.mark.parametrize(("name", "head", "said"), [
    ("uniaxial.csv", "strain,stress (kPa)", "its name says uniaxial"),
    ("a.csv", "compressive strain,stress (kPa)", "named after compression"),
    ("a.csv", "strain,stress (kPa)", "negative throughout")])
def test_a_table_of_compression_that_is_given_as_shear_is_minded(name: str, head: str, said: str,
                                                                 tmp_path: Path) -> None:
    e = np.linspace(0, -0.5, 30)
    got = _experiment(_table(tmp_path, name, head, e, 20 * e), "shear")
    assert any(said in caution for caution in got.cautions)
    assert not _experiment(_table(tmp_path, "b.csv", "gamma,tau (kPa)", -e, -20 * e), "shear").cautions
    assert not _experiment(_table(tmp_path, "tension.csv", "strain,stress (kPa)", -e, -20 * e), "planar").cautions


def test_arrays_are_in_si_and_need_no_unit() -> None:
    e = np.linspace(0, 2.0, 30)
    assert not matcal.read_test({"shear": (e, 20e3 * e)}).cautions


@pytest.mark.parametrize("head", ["time (s),relaxation modulus (kPa)", "t [s],G(t) [Pa]", "t (s),normalised modulus"])
def test_a_modulus_over_time_is_a_relaxation_by_its_columns(tmp_path: Path, head: str) -> None:
    t = np.geomspace(1, 1000, 12)
    got = _experiment(_table(tmp_path, "batch_7.csv", head, t, 0.7 + 0.3 * np.exp(-t / 30)), None)
    assert got.kind == "relaxation"
