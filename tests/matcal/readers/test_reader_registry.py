"""A new vendor is one module with a `Reader` and one line in `vendors`."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from matcal.cli.main import main
from matcal.readers import vendors
from matcal.readers.reader import Reader, Source
from matcal.readers.recording import Recording

TOY = Reader("toy", "Toy press log", lambda source: source.text.startswith("TOY"), lambda source, chosen: press(source))


def press(source: Source) -> Recording:
    rows = np.array([[float(cell) for cell in line.split("~")] for line in source.text.splitlines()[1:]])
    return Recording((source.path,), "toy", {"strain": rows[:, 0], "stress": rows[:, 1]},
                     {"strain": "squeeze", "stress": "push"}, {"strain": "", "stress": "Pa"}, 2)


@pytest.mark.parametrize("place", [0, len(vendors._READERS)])
def test_a_vendor_of_one_line_is_detected_and_inspected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                        capsys: pytest.CaptureFixture[str], place: int) -> None:
    path = tmp_path / "compression.log"
    path.write_text("TOY\n-0.01~-100\n-0.02~-190\n-0.03~-270\n")
    monkeypatch.setattr(vendors, "_READERS", (*vendors._READERS[:place], TOY, *vendors._READERS[place:]))
    monkeypatch.setattr(sys, "argv", ["matcal", "inspect", str(path), "--json"])
    with pytest.raises(SystemExit, match=r"^0$"):
        main()
    found = json.loads(capsys.readouterr().out)[str(path)]
    assert (found["layout"], found["kind"], found["rows"]) == ("toy", "uniaxial", 3)
    monkeypatch.setattr(sys, "argv", ["matcal", "inspect", str(path)])
    with pytest.raises(SystemExit, match=r"^0$"):
        main()
    assert "Toy press log, 3 rows" in capsys.readouterr().out


def test_readers_have_names_of_their_own_and_the_last_takes_what_is_left() -> None:
    names = [reader.name for reader in vendors.readers()]
    assert len(set(names)) == len(names)
    assert vendors.readers()[-1].recognises(Source(Path("x"), "anything"))
