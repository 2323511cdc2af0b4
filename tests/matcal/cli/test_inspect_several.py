"""`matcal inspect` of several files: what can be read is shown, what cannot is said, and the status is 2."""

import json
from pathlib import Path

from typer.testing import CliRunner

from matcal.cli.main import app
from touchcal.errors import InputFileError

TABLE = "strain,stress (kPa)\n0,0\n-0.1,-1\n-0.2,-2\n"


def test_one_unreadable_file_hides_no_other(tmp_path: Path) -> None:
    good, bad, last = (tmp_path / name for name in ("uniaxial.csv", "prose.csv", "shear.csv"))
    for path in (good, last):
        path.write_text(TABLE, encoding="utf-8")
    bad.write_text("no numbers at all\n", encoding="utf-8")
    result = CliRunner().invoke(app, ["inspect", str(good), str(bad), str(last)])
    assert isinstance(result.exception, InputFileError)
    assert "prose.csv" in str(result.exception)
    assert "uniaxial.csv" in result.stdout
    assert "shear.csv" in result.stdout
    result = CliRunner().invoke(app, ["inspect", "--json", str(bad), str(last), str(good)])
    assert [Path(name).name for name in json.loads(result.stdout)] == ["shear.csv", "uniaxial.csv"]
    assert isinstance(result.exception, InputFileError)
