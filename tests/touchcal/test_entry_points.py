"""Parts that a package adds by entry points serve as built-in ones do; those that cannot be imported are named."""

import importlib
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from touchcal.entry_points import KINDS, added

ROOT = Path(__file__).parents[2]
PAGE, PACKAGE = ROOT / "docs" / "how-to" / "write-your-own.md", ROOT / "examples" / "my_parts"


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A folder that holds what installing the example package leaves there, and an entry point of nothing."""
    shutil.copytree(PACKAGE / "my_parts", tmp_path / "my_parts")
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    folder = tmp_path / "my_parts-1.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 1\n", encoding="utf-8")
    points = project["entry-points"]
    points["touchcal.laws"] |= {"broken": "my_parts:Nothing"}
    (folder / "entry_points.txt").write_text("".join(
        f"[{group}]\n" + "".join(f"{name} = {where}\n" for name, where in rows.items())
        for group, rows in points.items()), encoding="utf-8")
    return tmp_path


def test_the_page_shows_the_package() -> None:
    blocks = re.findall(r"```(?:python|toml)\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    files = [file.read_text(encoding="utf-8") for file in PACKAGE.rglob("*") if file.suffix in (".py", ".toml")]
    assert set(blocks) == {text for text in files if not text.startswith('"""')}


@pytest.mark.thorough
def test_the_parts_of_the_package_serve(installed: Path) -> None:
    used = """
import sys; sys.path.insert(0, sys.argv[1])
import numpy as np, matcal, eitsim
from pathlib import Path
folder = Path(sys.argv[1])
strain = np.linspace(0, 0.3, 40)
rows = "".join(f"{-e:.4f}|{-9 * e:.5f}\\n" for e in strain)
(folder / "uniaxial.txt").write_text("BENCH 7\\nstrain_1|stress_kPa\\n" + rows)
print(matcal.inspect(folder / "uniaxial.txt")["layout"])
print(matcal.export(matcal.MaterialCard("foam", matcal.Hyperfoam([12e3], [2.0], [0.0])), "marks").text.splitlines()[-1])
(folder / "scene.toml").write_text("[punch]\\nprofile = 'dome'\\n")
values = np.arange(416.0)
(folder / "press.f16").write_bytes(b"HEADER00" + values.tobytes())
print(eitsim.open_recording(folder / "press.f16").readings[1, 3])
scene = eitsim.read_scene(folder / "scene.toml")
print(scene.punches[0].profile)
import warnings; warnings.simplefilter("ignore")
from matcal.laws.known_laws import law_type
law = law_type("hencky")(2e3, 5e3)
made = {mode: (e, matcal.nominal_stress(law, mode, e)) for mode, e in (("uniaxial", -strain), ("shear", strain))}
found = matcal.fit([{mode: rows} for mode, rows in made.items()], law="hencky").card.law
print(found.name, round(found.mu_Pa, 3), round(found.kappa_Pa, 3))
skin = matcal.Conductivity(2.0, [-3.0, 0.5], (0, 0.3), "tunnelling")
from matcal.laws.conductivity import conductivity
found = matcal.fit([{"conductivity": (strain, conductivity(skin, strain))}], conduction="tunnelling").card
matcal.write_card(found, folder / "skin.json")
read = matcal.read_card(folder / "skin.json").conductivity
from eitsim.sheet.sheet_conductance import principal_conductances
stretched = principal_conductances(read, scene.skin, 1.2, 1.0, 1.0)[1] / scene.skin.thickness_m
print(read.kind, read.a.round(6), stretched.round(9))
"""
    done = subprocess.run([sys.executable, "-W", "error", "-c", used, str(installed)], capture_output=True, text=True,
                          check=False)
    assert done.stdout.split("\n")[:6] == [
        "bench", "12000 2", "211.0", "dome", "hencky 2000.0 5000.0",
        f"tunnelling [-3.   0.5] {(2 * np.exp(0.2 * (-3 + 0.5 * 0.2)) * 1.2).round(9)}"], done.stderr


def test_a_part_that_cannot_be_imported_is_named(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(installed))
    importlib.invalidate_caches()
    added.cache_clear()
    with pytest.warns(UserWarning, match=r"'broken' of touchcal\.laws is left out: my_parts:Nothing"):
        assert list(added("laws")) == ["hencky"]
    added.cache_clear()


def test_nothing_is_added_where_no_package_adds(monkeypatch: pytest.MonkeyPatch) -> None:
    added.cache_clear()
    assert {(kind, name) for kind in KINDS for name in added(kind)} <= {("quantities", "touch")}  # this project's own
