"""Labels of several touches at once."""

from pathlib import Path

import pytest

from eitsim.sensors.touch_sets import TouchSets, holds_several, read_touch_sets
from touchcal.errors import InputFileError


def written(folder: Path, text: str) -> Path:
    path = folder / "touches.csv"
    path.write_text(text)
    return path


def test_all_forms_say_the_same(tmp_path: Path) -> None:
    columns = read_touch_sets(written(tmp_path, "touch,A,B,points\n1,1,0,1\n2,1,1,2\n"))
    rows = read_touch_sets(written(tmp_path, "touch,place,F_N\n1,A,1\n2,A,2\n2.0,B,3\n"))
    places = read_touch_sets(written(tmp_path, "touch,x_mm,y_mm\n1,5,0\n2,5,0\n2,-5,1\n"))
    assert columns.down.tolist() == rows.down.tolist() == places.down.tolist() == [[True, False], [True, True]]
    assert columns.touch.tolist() == rows.touch.tolist() == places.touch.tolist() == ["1", "2"]
    assert rows.force_N is not None
    assert rows.force_N.tolist() == [[1, 0], [2, 3]]
    assert places.at_mm is not None
    assert places.at_mm.tolist() == [[5, 0], [-5, 1]]


@pytest.mark.parametrize(("text", "several"), [
    ("touch,A,B\n1,1,0\n", True), ("touch,place\n1,A\n", True), ("touch,x_mm,y_mm\n1,5,0\n1,-5,1\n", True),
    ("touch,x_mm,y_mm\n1,5,0\n2,-5,1\n", False), ("touch,F_N\n1,5\n", False), ("touch,x_mm,Y\n1,5,0\n", False),
    ("touch,x_cm,F_gf\n1,0.5,30\n", False),
    ("touch,x_cm,force_gf\n1,0.5,30\n", False), ("touch,X,Y\n1,5,0\n2,3,2\n", False)])
def test_labels_of_single_touches_stay_what_they_are(tmp_path: Path, text: str, several: bool) -> None:
    assert holds_several(written(tmp_path, text)) is several


@pytest.mark.parametrize(("text", "line"), [
    ("touch,A,B\n1,1,2\n", 2), ("touch,A,B\n1,1,0\n1,0,1\n", 3), ("touch,A,B\n1,0,0\n", 2),
    ("touch,A,B,points\n1,1,0,2\n", 2), ("touch,place\n1,A\n1,A\n", 3), ("touch,place,F_N\n1,A,0\n", 2),
    ("touch,place\n1,\n", 2), ("touch,A\n,1\n", 2), ("touch,place,x_mm,y_mm\n1,A,0,0\n2,A,1,0\n", 3)])
def test_what_is_no_label_is_refused_with_its_line(tmp_path: Path, text: str, line: int) -> None:
    with pytest.raises(InputFileError, match=f"line {line}"):
        read_touch_sets(written(tmp_path, text))


def test_touches_are_counted_once_a_frame(tmp_path: Path) -> None:
    sets = read_touch_sets(written(tmp_path, "touch,place\n7,A\n7,B\n7.0,C\n"))
    assert isinstance(sets, TouchSets)
    assert sets.down.sum() == 3
    assert len(sets.touch) == 1
