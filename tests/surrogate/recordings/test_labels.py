"""Labels of presses: what is read, and what is refused with the line."""

from pathlib import Path

import numpy as np
import pytest

from eitsim.sensors.labels import read_labels
from touchcal.errors import InputFileError


def test_columns_in_any_order(tmp_path: Path) -> None:
    path = tmp_path / "touches.csv"
    path.write_text("F_N,touch,y_mm,x_mm\n0.5,a,2,1\n\n1.5,b,4,3\n")
    found = read_labels(path)
    assert found.touch.tolist() == ["a", "b"]
    assert found.names == ("x_mm", "y_mm", "F_N")
    np.testing.assert_array_equal(found.values, [[1, 2, 0.5], [3, 4, 1.5]])


def test_labels_of_a_spreadsheet_with_decimal_commas(tmp_path: Path) -> None:
    (tmp_path / "touches.csv").write_text("touch;x_mm;F_N\na;1,5;0,25\n;;\nb;-2;1\n")
    found = read_labels(tmp_path / "touches.csv")
    np.testing.assert_array_equal(found.values, [[1.5, 0.25], [-2, 1]])


@pytest.mark.parametrize(("text", "said"), [
    ("", "the file is empty"), ("touch,x_mm\n", "without touches"), ("touch,x_nm\na,1\n", "Did you mean 'x_mm'"),
    ("touch,x_mm,hour\na,1,2\n", "unknown column 'hour'"),
    ("x_mm,y_mm\n1,2\n", "expected touch and any of"), ("touch\na\n", "expected touch and any of"),
    ("touch,x_mm,x_mm\na,1,2\n", "one of them twice"),
    ("touch,x_mm\na,1\n\na,2\n", "line 4: touch 'a' stands in line 2"),
    ("touch,x_mm\n,1\n", "line 2: touch is empty"), ("touch,x_mm\na,\n", "line 2: x_mm is ''"),
    ("touch,x_mm\na,1,5\n", "Write numbers with a point, not a comma"),
    ("touch,x_mm\n7,1\n7.0,2\n", "line 3: touch '7' stands in line 2"),
    ("touch,x_mm\na,inf\n", "line 2: x_mm is 'inf'"), ("touch,x_mm\na,1,2\n", "line 2: 3 columns, expected 2")])
def test_what_is_no_label_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "touches.csv"
    path.write_text(text)
    with pytest.raises(InputFileError, match=r"touches\.csv") as error:
        read_labels(path)
    assert said in str(error.value)
