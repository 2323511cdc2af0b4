"""Tables of scenes: row i is scene i, empty cells keep to the scene file, mistakes name line and column."""

import hashlib
from pathlib import Path

import pytest

from eitsim.scene.scene import Scene, scene_from
from eitsim.sweeps.design.design import same_or_grown, scene_at
from eitsim.sweeps.run.scene_table import read_scene_table
from touchcal.errors import InputFileError


def written(folder: Path, *lines: str) -> Path:
    (folder / "scenes.csv").write_text("\n".join(lines) + "\n")
    return folder / "scenes.csv"


def scenes(folder: Path, *lines: str, base: str | None = None) -> list[Scene]:
    if base is not None:
        (folder / "base.toml").write_text(base)
    design = read_scene_table(written(folder, *lines), folder / "base.toml" if base is not None else None)
    return [scene_at(design, i) for i in range(design.scenes)]


def test_a_row_is_a_scene(tmp_path: Path) -> None:
    found = scenes(tmp_path, "x_mm,y_mm,d_mm,F_N,profile,skin.thickness_um", "10,-20,12,0.5,sphere,18", "",
                   "0.1,0,14,1e-1,,")
    first = {"x_mm": 10, "y_mm": -20, "diameter_mm": 12, "force_N": 0.5, "profile": "sphere"}
    assert found == [scene_from({"punch": first, "skin": {"thickness_um": 18}}),
                     scene_from({"punch": {"x_mm": 0.1, "force_N": 0.1}})]


def test_columns_may_be_named_as_in_data_sets(tmp_path: Path) -> None:
    short = scenes(tmp_path, "d_mm,profile,skin.thickness_um,x_2_mm,F_2_N", "12,cone,18,40,0.3")
    assert short == scenes(tmp_path, "punch_diameter_mm,punch_profile,skin_thickness_um,punch_2_x_mm,punch_2_force_N",
                           "12,cone,18,40,0.3")
    assert len(short[0].punches) == 2


def test_the_scene_file_holds_what_cells_leave_out(tmp_path: Path) -> None:
    base = "card = \"card.json\"\n[punch]\nx_mm = 25\nforce_N = 0.7\ndiameter_mm = 16\n[body]\nthickness_mm = 8\n"
    found = scenes(tmp_path, "F_N,depth_mm,x_mm", ",2,", "0.2,,", ",,5", base=base)
    punches = [scene.punches[0] for scene in found]
    assert [p.x_m for p in punches] == [0.025, 0.025, 0.005]
    assert [(p.force_N, p.depth_m) for p in punches] == [(None, 0.002), (0.2, None), (0.7, None)]
    assert {p.diameter_m for p in punches} == {0.016}
    assert {scene.body.thickness_m for scene in found} == {0.008}
    (only,) = scenes(tmp_path, "depth_mm", "3", base=base)
    assert (only.punches[0].force_N, only.punches[0].depth_m) == (None, 0.003)


def test_the_scene_file_may_hold_what_designs_hold_beside(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text("seed = 5\n[punch]\nforce_N = 0.7\n[material]\ndraws = 20\n")
    design = read_scene_table(written(tmp_path, "x_mm", "10", "20"), tmp_path / "base.toml")
    assert design.seed == 5
    assert design.material is not None
    assert design.material.draws == 20
    assert [scene_at(design, i).punches[0].force_N for i in range(2)] == [0.7, 0.7]
    for text, named in (("[punch]\nforce_N = [1, 2]\n", "force_N in .punch. must be"), ("scenes = 3\n", "'scenes'"),
                        ("[material]\nnumber = 3\n", "number"), ("[hold]\ntime_s = [2, 60]\n", "several times"),
                        ("[fields]\nonly = 1\n", "only")):
        (tmp_path / "base.toml").write_text(text)
        with pytest.raises(InputFileError, match=named):
            read_scene_table(tmp_path / "scenes.csv", tmp_path / "base.toml")


def test_rows_may_have_fewer_touches(tmp_path: Path) -> None:
    found = scenes(tmp_path, "x_mm,F_N,x_2_mm,F_2_N,punch_2_conductor", "-30,0.5,30,0.2,true", "-30,0.5,,,",
                   "-30,0.5,35,,")
    assert [len(scene.punches) for scene in found] == [2, 1, 2]
    assert found[0].punches[1].conductor
    assert found[2].punches[1].force_N == 1.0


def test_hash_and_content_are_kept_and_rows_may_be_added(tmp_path: Path) -> None:
    lines = ["x_mm,F_N", "1,0.5", "2,"]
    path = written(tmp_path, *lines)
    old = read_scene_table(path)
    assert old.source == {"file": "scenes.csv", "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    assert old.tables["punch"][0] == {"x_mm": {"rows": [1.0, 2.0]}, "y_mm": 0.0, "force_N": {"rows": [0.5, None]}}
    longer = read_scene_table(written(tmp_path, *lines, "3,0.1"))
    assert [scene_at(longer, i) for i in range(2)] == [scene_at(old, i) for i in range(2)]
    assert same_or_grown(old.tables, longer.tables)
    assert not same_or_grown(longer.tables, old.tables)
    other = read_scene_table(written(tmp_path, "x_mm,F_N", "1,0.5", "2.5,", "3,0.1"))
    assert not same_or_grown(old.tables, other.tables)
    assert read_scene_table(written(tmp_path, *lines), scenes=1).scenes == 1
    with pytest.raises(InputFileError, match="it holds 2 scenes; 3 are asked for"):
        read_scene_table(tmp_path / "scenes.csv", scenes=3)


@pytest.mark.parametrize(("lines", "line", "named"), [
    (["x_mm,F_N", "1,5,0,5"], 2, "4 cells, expected 2 as in the header. A decimal comma .* use points"),
    (["x_mm,wide", "1,2"], 1, "column 'wide' is unknown; known: x_mm, y_mm, d_mm, F_N"),
    (["d_mm,diameter_mm", "1,2"], 1, "'diameter_mm' says again"), (["x_mm,y_mm", "1,2", "1"], 3, "1 cells, expected 2"),
    (["x_mm", "0", "", "far"], 4, r"column x_mm: x_mm in \[punch\] must be a finite number, got 'far'"),
    (["x_mm", "nan"], 2, "column x_mm"), (["x_mm,profile", "0,flat", "0,ball"], 3, "column profile: .*'ball'.*sphere"),
    (["d_mm,F_N", "12,1", "-3,1"], 3, r"diameter_mm in \[punch\] must be positive"),
    (["F_N,depth_mm", "1,2"], 2, "both force_N and depth_mm"), (["x_mm,x_3_mm", "0,40"], 2, "touch 2 is not"),
    (["x_mm"], None, "no scenes"), (["electrodes.count", "16"], 1, "decides which readings")])
def test_mistakes_name_line_and_column(tmp_path: Path, lines: list[str], line: int | None, named: str) -> None:
    with pytest.raises(InputFileError, match=named) as caught:
        read_scene_table(written(tmp_path, *lines))
    assert caught.value.line == line


def test_files_that_are_no_tables_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="no such file"):
        read_scene_table(tmp_path / "absent.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputFileError, match="not a text file"):
        read_scene_table(tmp_path / "binary.csv")
