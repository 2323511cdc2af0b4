"""Whose sizes count: given, the file's own, or next to it; what contradicts is said or refused."""

from pathlib import Path

import numpy as np
import pytest

from matcal.readers.recording import Recording
from matcal.reduction.reduce import reduce_tests
from matcal.reduction.specimen import Block
from matcal.reduction.specimen_sizes import specimen_of
from touchcal.errors import InputFileError

DISC = "[uniaxial]\ndiameter_mm = 50\nheight_mm = 20\ncompliance_mm_per_N = 0.001\n"


def _recording(folder: Path, **sizes: float) -> Recording:
    return Recording((folder / "press.csv",), "instron", {"force": np.zeros(3)}, {"force": "Load"}, {"force": "N"}, 1,
                     properties=sizes)


def _toml(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def test_the_files_own_sizes_serve_alone(tmp_path: Path) -> None:
    block, said, used = specimen_of("uniaxial", _recording(tmp_path, diameter=0.05, height=0.02), None)
    assert isinstance(block, Block)
    assert (block.area_m2, block.length_m) == (pytest.approx(np.pi * 0.05**2 / 4), 0.02)
    assert "the file's own sizes: diameter 50 mm, height 20 mm" in said[0]
    assert used == ()
    sheet, _, _ = specimen_of("planar", _recording(tmp_path, length=0.02, width=0.1, thickness=0.005), None)
    assert isinstance(sheet, Block)
    with pytest.raises(InputFileError):
        specimen_of("shear", _recording(tmp_path, length=0.02), None)
    with pytest.raises(InputFileError, match=r"press.csv does not state it.*Give `specimen`"):
        specimen_of("uniaxial", _recording(tmp_path), None)


def test_what_agrees_is_used_with_its_compliance_and_what_differs_is_refused_or_said(tmp_path: Path) -> None:
    beside = _toml(tmp_path, "specimen.toml", DISC)
    block, said, used = specimen_of("uniaxial", _recording(tmp_path, diameter=0.05, height=0.02), None)
    assert isinstance(block, Block)
    assert block.compliance_m_per_N == pytest.approx(1e-6)
    assert "agrees with what the file itself states" in said[0]
    assert used == (beside,)
    other = _recording(tmp_path, diameter=0.05, height=0.03)
    with pytest.raises(
        InputFileError, match=r"a length of 30 mm instead of .* 20 mm, as \[uniaxial\] of specimen.toml .*in press.toml"
    ):
        specimen_of("uniaxial", other, None)
    block, said, used = specimen_of("uniaxial", other, beside)
    assert isinstance(block, Block)
    assert block.length_m == 0.02
    assert "itself states diameter 50 mm, height 30 mm" in said[1]
    assert "its own [uniaxial] in press.toml" in said[1]
    own = _toml(tmp_path, "press.toml", DISC.replace("20", "30"))
    assert specimen_of("uniaxial", other, None)[2] == (own,)


@pytest.mark.parametrize(("table", "own", "area_mm2", "length_mm", "says"), [
    ('direction = "compression"\n', {"diameter": 0.05, "height": 0.02}, 1963.5, 20, "diameter_mm = 50, height_mm = 20"),
    ("height_mm = 20\n", {"diameter": 0.05}, 1963.5, 20, "itself states: diameter_mm = 50"),
    ("width_mm = 10\ndepth_mm = 20\n", {"height": 0.03}, 200, 30, "height_mm = 30"),
    ("height_mm = 20\n", {"width": 0.01, "thickness": 0.005}, 50, 20, "width_mm = 10, depth_mm = 5"),
    ("area_mm2 = 400\nheight_mm = 20\n", {}, 400, 20, "Specimen from")])
def test_table_and_file_complete_each_other(table: str, own: dict[str, float], area_mm2: float, length_mm: float,
                                            says: str, tmp_path: Path) -> None:
    given = _toml(tmp_path, "s.toml", f"[uniaxial]\n{table}")
    block, said, _ = specimen_of("uniaxial", _recording(tmp_path, **own), given)
    assert isinstance(block, Block)
    assert (block.area_m2 * 1e6, block.length_m * 1e3) == (pytest.approx(area_mm2, rel=1e-5), pytest.approx(length_mm))
    assert says in said[0]


def test_the_file_serves_where_the_given_table_is_of_other_tests(tmp_path: Path) -> None:
    given = _toml(tmp_path, "s.toml", "[shear]\nthickness_mm = 10\nfaces = 1\nlength_mm = 20\nwidth_mm = 20\n")
    _, said, used = specimen_of("uniaxial", _recording(tmp_path, diameter=0.05, height=0.02), given)
    assert "s.toml has no table [uniaxial]" in said[0]
    assert used == ()


@pytest.mark.parametrize(("table", "own", "says"), [
    ("diameter_mm = 50\nwidth_mm = 3\ndepth_mm = 3\nheight_mm = 20\n", {}, r"two cross-sections: diameter_mm = 50 "),
    ("area_mm2 = 400\ndiameter_mm = 50\nheight_mm = 20\n", {}, r"area_mm2 = 400 .* but diameter_mm = 50"),
    ("diameter_mm = 50\nwidth_mm = 3\nheight_mm = 20\n", {}, "width_mm has no effect without depth_mm"),
    ("height_mm = 20\n", {"area": 4e-4, "diameter": 0.05}, "two cross-sections"),
    ("diameter_mm = 50\n", {"width": 0.01}, r"needs the key height_mm. press.csv itself states width 10 mm")])
def test_sizes_that_contradict_or_do_not_suffice_are_refused(table: str, own: dict[str, float], says: str,
                                                             tmp_path: Path) -> None:
    given = _toml(tmp_path, "s.toml", f"[uniaxial]\n{table}")
    with pytest.raises(InputFileError, match=says):
        specimen_of("uniaxial", _recording(tmp_path, **own), given)


def test_a_file_that_contradicts_itself_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"press.csv: .*two cross-sections"):
        specimen_of("uniaxial", _recording(tmp_path, area=4e-4, diameter=0.05, height=0.02), None)
    needs = r"needs the key height_mm. .* \[uniaxial\] in `specimen` "
    with pytest.raises(InputFileError, match=needs + "specimen.toml, or in press.toml next to press.csv, completes it"):
        specimen_of("uniaxial", _recording(tmp_path, diameter=0.05), None)
    with pytest.raises(InputFileError, match=needs + "s.toml, or without it in press.toml next to press.csv"):
        specimen_of("uniaxial", _recording(tmp_path, diameter=0.05), _toml(tmp_path, "s.toml", "[shear]\nfaces = 1\n"))


def test_sizes_that_the_given_table_overrules_are_minded(tmp_path: Path) -> None:
    path = tmp_path / "tension.csv"
    rows = "".join(f"{0.1 * k:.1f},{0.2 * k:.1f}\n" for k in range(30))
    path.write_text(f"Width,10,mm\nThickness,10,mm\nGauge length,40,mm\n\nExtension (mm),Load (N)\n{rows}")
    (found,) = reduce_tests([("uniaxial", (path,))], _toml(tmp_path, "all.toml", DISC))
    assert any("itself states width 10 mm" in caution and "tension.toml" in caution for caution in found.cautions)
    assert not any("itself states width" in decision for decision in found.decisions)
