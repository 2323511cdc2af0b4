"""Packages that only a part needs: named with the extra that brings them, and loops that run without a compiler."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from touchcal.lazy import PACKAGES, missing, needed

ROOT = Path(__file__).parents[2]
WITHOUT = """
import sys
class Without:
    def find_spec(self, name, *_):
        if name.partition(".")[0] in ("numba", "pyarrow", "matplotlib", "typst", "arviz", "h5py", "torch"):
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)
sys.meta_path.insert(0, Without())
import numpy as np
from eitsim.numerics.multifrontal import compiled
import matcal
found = matcal.fit({"uniaxial": sys.argv[1]})
found.save("card.json")
print(compiled(np.sum) is np.sum, found.card.hyperfoam.strain_range)
try:
    import eitsim
    eitsim.open_dataset
except ValueError as error:
    print(error)
"""


def test_packages_stand_in_the_extras_that_are_named() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for package, (name, extra) in PACKAGES.items():
        assert any(each.lower().startswith((package, name.lower())) for each in extras[extra]), name


def test_a_fit_and_loops_need_no_extra(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT, ROOT / "data_raw/uniaxial.csv"], cwd=tmp_path,
                          capture_output=True, text=True, check=True)
    assert done.stdout.startswith("True")
    assert "this needs pyarrow, which is not installed; run pip install '.[data]'" in done.stdout
    assert "run pip install '.[fast]'" in done.stderr
    assert not list((tmp_path / "card.d").glob("*.parquet"))


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(ValueError, match=r"reports need typst, .* run pip install '\.\[reports\]'"):
        needed("typst", "reports")
    error = ModuleNotFoundError(name="unknown_package")
    assert missing(error) is error
