"""Exported cards in CalculiX itself: one C3D8 brick, driven, against the closed forms of
`matcal.laws.deformation_modes`.

CalculiX prints seven digits of a force and differentiates this law numerically: its residual does not fall below some
1e-5 of the mean force, hence the *CONTROLS below and the tolerances where faces are free.
"""

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from matcal.card import MaterialCard, read_card
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.prony import Prony
from matcal.record.exporters.base import UNITS
from matcal.record.exporters.deck import export

CCX = shutil.which("ccx")
pytestmark = pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: Debian package calculix-ccx")

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0], "instantaneous")
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
LOWER, UPPER = 0, 1


PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "calibrate-a-foam.md"


def test_the_brick_of_the_page_gives_the_stress_of_its_card(tmp_path: Path) -> None:
    card = MaterialCard("foam", Hyperfoam([10800.0, 1200.0], [8.0, -1.8], [0.1, 0.1]))
    (tmp_path / "foam.inp").write_text(export(card, "calculix", units="mm-t-s").text)
    (deck,) = re.findall(r"```\n(\*NODE.*?)```", PAGE.read_text(), flags=re.DOTALL)
    (tmp_path / "brick.inp").write_text(deck)
    subprocess.run([str(CCX), "brick"], cwd=tmp_path, check=True, capture_output=True, timeout=60)
    force = float((tmp_path / "brick.dat").read_text().split()[-1])
    assert card.hyperfoam is not None
    assert force == pytest.approx(float(nominal_stress(card.hyperfoam, "uniaxial", -0.5)) * 1e-6, rel=1e-5)


def face(axis: int, side: int) -> list[int]:
    return [n for n, corner in enumerate(CORNERS, 1) if corner[axis] == side]


def supports(mode: str) -> list[str]:
    """What does not move: three lower faces in their normal; simple shear holds bottom and top but for thickness."""
    if mode == "shear":
        held = [(n, (1, 2)) for n in face(1, LOWER)] + [(n, (2,)) for n in face(1, UPPER)] + [
            (n, (3,)) for n in face(2, LOWER)]
    else:
        held = [(n, (axis + 1,)) for axis in range(3) for n in face(axis, LOWER)]
        held += [(n, (2,)) for n in face(1, UPPER) if mode == "planar"]
    return [f"{n}, {d}, {d}" for n, dofs in held for d in dofs]


def driven(mode: str, e: float) -> list[str]:
    if mode == "shear":
        return [f"{n}, 1, 1, {e!r}" for n in face(1, UPPER)]
    return [f"{n}, {axis + 1}, {axis + 1}, {e!r}" for axis in ((0, 1) if mode == "biaxial" else (0,))
            for n in face(axis, UPPER)]


def brick(material: str, mode: str, path: list[float]) -> str:
    """An input file with a unit cube and a step for every strain of the path."""
    nodes = [f"{n}, {x}., {y}., {z}." for n, (x, y, z) in enumerate(CORNERS, 1)]
    name = re.search(r"NAME=(\S+)", material)
    assert name
    lines = ["*NODE, NSET=ALL", *nodes, "*ELEMENT, TYPE=C3D8, ELSET=BRICK", "1, 1, 2, 3, 4, 5, 6, 7, 8",
             "*NSET, NSET=TOP", ", ".join(map(str, face(1 if mode == "shear" else 0, UPPER))),
             material.rstrip(), f"*SOLID SECTION, ELSET=BRICK, MATERIAL={name[1]}",
             "*BOUNDARY", *supports(mode)]
    for e in path:
        lines += ["*STEP, NLGEOM, INC=1000", "*CONTROLS, PARAMETERS=FIELD", "1e-4, 1e-4",
                  "*STATIC", "0.1, 1., 1e-6, 0.2", "*BOUNDARY", *driven(mode, e),
                  "*NODE PRINT, NSET=TOP, TOTALS=ONLY, FREQUENCY=1000", "RF", "*END STEP"]
    return "\n".join(lines) + "\n"


def forces(folder: Path, text: str) -> np.ndarray:
    """(steps done, 3) total force on the moving face at the end of each step."""
    assert CCX is not None
    (folder / "brick.inp").write_text(text)
    done = subprocess.run([CCX, "brick"], cwd=folder, capture_output=True, text=True, timeout=120,
                          env={"OMP_NUM_THREADS": "1", "PATH": "/usr/bin:/bin"})
    assert "parameter not recognized" not in done.stdout, done.stdout[-2000:]
    printed = (folder / "brick.dat").read_text() if (folder / "brick.dat").exists() else ""
    found = re.findall(r"total force.*\n\s*\n\s*(\S+)\s+(\S+)\s+(\S+)", printed)
    assert found, done.stdout[-2000:]
    return np.array(found, dtype=float)


def compare(folder: Path, card: MaterialCard, mode: str, path: list[float], units: str = "SI",
            moduli: str | None = None) -> float:
    """Largest error of the nominal stress, over the largest stress of the path; every step must have been done."""
    deck = export(card, "calculix", moduli, units)
    found = forces(folder, brick(deck.text, mode, path))[:, 0] / UNITS[units].stress
    assert found.size == len(path), f"CalculiX stopped at {path[found.size - 1]}"
    assert card.law is not None
    expected = nominal_stress(card.law, mode, np.array(path))
    error = float(np.abs(found - expected).max() / np.abs(expected).max())
    print(f"{card.name}, {mode} to {path[-1]}: {error:.1e}")
    return error


COMPRESSION, SHEAR = [-0.1, -0.3, -0.5, -0.65, -0.8], [0.25, 0.5, 1.0]


def test_table_1_at_half_its_height(tmp_path: Path) -> None:
    found = forces(tmp_path, brick(export(MaterialCard("Table 1", TABLE_1), "calculix").text, "uniaxial", [-0.5]))
    assert found[0, 0] == pytest.approx(-4221.98, abs=0.01)


@pytest.mark.parametrize(("mode", "path"), [("uniaxial", COMPRESSION), ("shear", SHEAR)])
@pytest.mark.parametrize("units", UNITS)
def test_table_1(tmp_path: Path, mode: str, path: list[float], units: str) -> None:
    assert compare(tmp_path, MaterialCard("Table 1", TABLE_1), mode, path, units) < 1e-6


@pytest.mark.parametrize(("mode", "path"), [("uniaxial", [*COMPRESSION, 0.2]), ("shear", SHEAR), ("biaxial", [-0.2]),
                                            ("planar", [-0.1, -0.2])])
@pytest.mark.parametrize("nu", [(0.2, 0.2, 0.2), (0.05, 0.3, 0.1)])
def test_lateral_expansion(tmp_path: Path, nu: tuple[float, ...], mode: str, path: list[float]) -> None:
    law = Hyperfoam([9000.0, 2500.0, 100.25], [3.1, -1.9, 8.0], nu)
    assert compare(tmp_path, MaterialCard(f"nu {nu}", law), mode, path, "mm-t-s") < 1e-5


@pytest.mark.parametrize("mode", ["uniaxial", "shear"])
@pytest.mark.parametrize("terms", [1, 2])
def test_fewer_terms(tmp_path: Path, terms: int, mode: str) -> None:
    law = Hyperfoam([4231.7, 1999.123][:terms], [2.7, -1.3][:terms], [0.0, 0.15][:terms])
    assert compare(tmp_path, MaterialCard("few", law), mode, [-0.2, -0.6] if mode == "uniaxial" else SHEAR) < 1e-5


@pytest.mark.parametrize(("mode", "path"), [("uniaxial", [*COMPRESSION, 0.2]), ("shear", SHEAR)])
def test_neo_hooke_without_lateral_strain_is_a_foam(tmp_path: Path, mode: str, path: list[float]) -> None:
    assert compare(tmp_path, MaterialCard("rubber", NeoHooke(8123.4, 0.0)), mode, path, "mm-t-s") < 1e-5


def test_neo_hooke_of_calculix_is_another_law(tmp_path: Path) -> None:
    """Its C10 and D1 from the card's moduli at rest: the same slope there, some per cent of stress in compression."""
    law = NeoHooke(8e3, 0.3)
    with pytest.raises(ValueError, match="is another law than neo_hooke"):
        export(MaterialCard("rubber", law), "calculix")
    material = f"*MATERIAL, NAME=R\n*HYPERELASTIC, NEO HOOKE\n{law.mu_Pa / 2!r}, {2 / law.kappa_0_Pa!r}"
    path = [-1e-3, -0.5]
    ratio = forces(tmp_path, brick(material, "uniaxial", path))[:, 0] / nominal_stress(law, "uniaxial", np.array(path))
    assert ratio[0] == pytest.approx(1, abs=2e-3)
    assert abs(ratio[1] - 1) > 0.02


def test_twenty_characters_a_value_are_enough(tmp_path: Path) -> None:
    law = Hyperfoam([123456.789012345, -115000.123456789, 321.987654321], [2.0123456789, 2.2, 8.1], [1 / 7] * 3)
    assert compare(tmp_path, MaterialCard("merged", law), "shear", SHEAR, "mm-kg-ms") < 1e-6


def test_long_term_moduli(tmp_path: Path) -> None:
    card = MaterialCard("relaxed", TABLE_1, Prony([0.15, 0.25], [1.0, 50.0]))
    found = forces(tmp_path, brick(export(card, "calculix", "longterm").text, "uniaxial", [-0.5]))
    assert found[0, 0] == pytest.approx(0.6 * nominal_stress(TABLE_1, "uniaxial", np.array(-0.5)), rel=1e-6)


def test_a_fitted_card(tmp_path: Path, command: Callable[..., Any]) -> None:
    """From test files to CalculiX by the commands of the README."""
    data = Path(__file__).parents[3] / "data_raw"
    for arguments in (["fit", data / "uniaxial.csv", data / "shear.csv", "--order", "3", "--out", "card.json"],
                      ["export", "card.json", "--to", "calculix", "--out", "foam.inp"]):
        assert not command("matcal", *arguments, cwd=tmp_path).returncode
    card = read_card(tmp_path / "card.json")
    assert card.hyperfoam is not None
    for mode, path in (("uniaxial", COMPRESSION), ("shear", SHEAR)):
        folder = tmp_path / mode
        folder.mkdir()
        found = forces(folder, brick((tmp_path / "foam.inp").read_text(), mode, path))[:, 0]
        expected = nominal_stress(card.hyperfoam, mode, np.array(path))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())
