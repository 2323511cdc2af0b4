"""Tables of one truth as other people write them: two measures by name alone, ratios, angles, languages, steps."""

from pathlib import Path

import numpy as np
import pytest

from matcal.fitting.relaxation.relaxation_fit import fit_prony
from matcal.readers.column_options import parse_selection
from matcal.readers.detect import read
from matcal.reduction.experiment import Experiment
from matcal.reduction.reduce import read_and_reduce
from touchcal.errors import InputFileError

STRAIN = np.linspace(0, 0.5, 40)


def _write(folder: Path, name: str, columns: dict[str, np.ndarray], encoding: str = "utf-8") -> Path:
    rows = "\n".join(";".join(f"{x:.9g}" for x in row) for row in zip(*columns.values(), strict=True))
    (folder / name).write_text(f"{';'.join(columns)}\n{rows}\n", encoding=encoding)
    return folder / name


def _reduced(path: Path, kind: str | None = None, specimen: Path | None = None) -> Experiment:
    (found,) = read_and_reduce([(kind, (path,))], specimen).experiments
    return found


@pytest.mark.parametrize(("own", "frame"), [
    ("strain_extensometer", "strain_crosshead"), ("DIC eps_yy [-]", "Strain (Displacement) [-]"),
    ("Feindehnung (-)", "Dehnung (-)"), ("Axial strain (Video) (-)", "Compressive strain (Extension) (-)")])
def test_of_two_strains_that_of_the_specimen_counts_and_the_other_is_said(own: str, frame: str, tmp_path: Path) -> None:
    columns = {frame: -1.1 * STRAIN**1.02, own: -STRAIN, "stress (kPa)": -20 * STRAIN}
    got = _reduced(_write(tmp_path, "a_compression.csv", columns))
    assert got.strain == pytest.approx(-STRAIN)
    assert any("are strain" in said and "0.5 and 0.5" in said for said in got.cautions)
    with pytest.raises(InputFileError, match="Say which to use"):  # one of them in another unit
        read(_write(tmp_path, "b.csv", columns | {own: -100 * STRAIN}))
    with pytest.raises(InputFileError, match="Say which to use"):  # one of them across the load
        read(_write(tmp_path, "c.csv", columns | {own: 0.3 * STRAIN}))


def test_of_two_resistances_that_of_four_wires_counts_and_leads_are_said(tmp_path: Path) -> None:
    sizes = tmp_path / "s.toml"
    sizes.write_text("[conductivity]\nlength_mm = 20\narea_mm2 = 900\ndirection = \"tension\"\n", encoding="utf-8")
    whole = 1000 * (1 + STRAIN)
    columns = {"strain (%)": 100 * STRAIN, "R_2wire (Ohm)": whole + 30, "R_4wire (Ohm)": whole}
    got = _reduced(_write(tmp_path, "a.csv", columns), "conductivity", sizes)
    assert got.value == pytest.approx(0.02 / 0.9, rel=1e-6)
    assert any("leads" in said for said in got.cautions)


@pytest.mark.parametrize(("factor", "said"), [(1.0, False), (0.5, True)])
def test_a_change_of_resistance_is_held_against_the_resistance(factor: float, said: bool, tmp_path: Path) -> None:
    sizes = tmp_path / "s.toml"
    sizes.write_text("[conductivity]\nlength_mm = 20\narea_mm2 = 900\ndirection = \"tension\"\n", encoding="utf-8")
    columns = {"strain (%)": 100 * STRAIN, "R (Ohm)": 1000 + 1e3 * STRAIN, "ΔR/R (%)": 100 * factor * STRAIN}
    got = _reduced(_write(tmp_path, "a.csv", columns), "conductivity", sizes)
    assert any("one resistance at rest" in text for text in got.cautions) == said


@pytest.mark.parametrize("head", ["stress_kPa.1", "other (kPa)"])
def test_a_second_specimen_to_the_right_is_not_dropped_in_silence(head: str, tmp_path: Path) -> None:
    path = _write(tmp_path, "a_compression.csv", {"strain": -STRAIN, "stress_kPa": -20 * STRAIN, head: -25 * STRAIN})
    try:
        said = _reduced(path).cautions
    except InputFileError as error:
        said = (str(error),)
    assert any(head.split()[0] in text or "both stress" in text for text in said)


@pytest.mark.parametrize("unit", ["Grad", "grad", "grados", "°", "deg", "degrés"])
def test_degrees_of_other_languages_are_degrees(unit: str, tmp_path: Path) -> None:
    path = _write(tmp_path, "shear.csv", {f"angle ({unit})": np.degrees(np.arctan(STRAIN)), "tau (kPa)": 20 * STRAIN})
    assert _reduced(path).strain == pytest.approx(STRAIN, abs=1e-8)


def test_noise_at_rest_does_not_hide_compression_given_as_shear(tmp_path: Path) -> None:
    stress = -20 * STRAIN + 0.02 * np.random.default_rng(1).normal(size=STRAIN.size)
    stress[0] = 0.02
    got = _reduced(_write(tmp_path, "shear.csv", {"strain": -STRAIN, "stress (kPa)": stress}))
    assert any("as those of compression" in said for said in got.cautions)


@pytest.mark.parametrize(("head", "encoding"), [
    ("Czas [s];Przemieszczenie [mm];Siła [N]", "cp1250"), ("時間(s);変位(mm);荷重(N)", "shift_jis"),
    ("время, с;перемещение, мм;нагрузка, Н", "cp1251"), ("时间(s);位移(mm);负荷(N)", "gb18030"),
    ("시간(s);변위(mm);하중(N)", "euc_kr"), ("Temps (s);Déplacement (mm);Effort (N)", "latin-1"),
    ("Süre (s);Yer değiştirme (mm);Yük (N)", "cp1254"), ("Čas (s);Dráha (mm);Síla (N)", "cp1250")])
def test_the_code_page_is_that_in_which_the_names_are_known(head: str, encoding: str, tmp_path: Path) -> None:
    columns = dict(zip(head.split(";"), (STRAIN, 20 * STRAIN, 30 * STRAIN), strict=True))
    assert set(read(_write(tmp_path, "a.csv", columns, encoding)).columns) == {"time", "displacement", "force"}


@pytest.mark.parametrize("head", ["4711;4712;4713\ns;mm;N", "title\n1;2;3\ns;mm;N", "s;mm;N"])
def test_columns_without_a_name_are_asked_for_by_their_units(head: str, tmp_path: Path) -> None:
    rows = "\n".join(f"{e};{20 * e};{30 * e}" for e in STRAIN)
    (tmp_path / "a.csv").write_text(f"{head}\n{rows}\n", encoding="utf-8")
    with pytest.raises(InputFileError, match="time=1,displacement=2,force=3"):
        read(tmp_path / "a.csv")


@pytest.mark.parametrize("first", [0.1, 0.5])
@pytest.mark.parametrize("rest", [[0.0], [-3.0, -2.0, 0.0]])
def test_a_step_after_rows_at_rest_has_no_ramp_and_its_errors_hold_what_it_hides(first: float, rest: list[float],
                                                                               tmp_path: Path) -> None:
    since = np.geomspace(first, 500, 60)
    stress = 10 * (0.5 + 0.3 * np.exp(-since) + 0.2 * np.exp(-since / 50))
    none = np.zeros(len(rest))
    got = _reduced(_write(tmp_path, "a.csv", {"time (s)": np.r_[rest, since], "strain": np.r_[none, 0 * since - 0.3],
                                              "stress (kPa)": np.r_[none, -stress]}), "relaxation")
    assert got.facts["step_first_s"] == pytest.approx(first)
    found = fit_prony([got], None, 2)
    assert abs(found.prony.g[0] - 0.3) < 2 * found.g_sd[0]
    assert found.g_sd[0] > 0.02


@pytest.mark.parametrize("name", ["g_R(t)", "Relaxation modulus E(t) (kPa)", "G_r (t)",
                                  "Shear relaxation modulus (kPa)"])
def test_a_modulus_over_time_is_known_with_its_argument(name: str, tmp_path: Path) -> None:
    time = np.geomspace(0.1, 100, 40)
    path = _write(tmp_path, "a_relaxation.csv", {"Time (s)": time, name: 0.5 + 0.5 * np.exp(-time)})
    assert {"modulus", "normalised"} & set(read(path).columns)


def test_the_order_of_abaqus_test_data_is_offered_and_reads_them(tmp_path: Path) -> None:
    rows = "\n".join(f"{-0.02 * e:.8g},{-e:.8g},{0.1 * e:.8g}" for e in STRAIN)
    path = tmp_path / "a.inp"
    path.write_text(f"*HYPERFOAM, N=2, TEST DATA INPUT\n*UNIAXIAL TEST DATA\n{rows}\n", encoding="utf-8")
    with pytest.raises(InputFileError) as refused:
        read(path)
    option = str(refused.value).split('--columns "a.inp=')[1].split('"')[0]
    got = read(path, parse_selection(option))
    assert got.columns["stress"] == pytest.approx(-20e3 * STRAIN)
    assert got.columns["strain"] == pytest.approx(-STRAIN)
    assert got.columns["lateral"] == pytest.approx(0.1 * STRAIN)
