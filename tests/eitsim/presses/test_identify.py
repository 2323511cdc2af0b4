"""Presses of a layer: files, derivatives of paths, a hidden foam found again, what is said not to be determined."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import eitsim
import matcal
from eitsim.mechanics.axisymmetric.press_path import PressPath, press_path
from matcal.laws.law import vector, with_vector
from touchcal.errors import InputFileError

EXAMPLES = Path(__file__).parents[3] / "examples"
# What examples/press_*.csv hide: drawn and pressed by benchmarks/identify.py, layer 0.
HIDDEN = matcal.Hyperfoam([11068.74, 5444.14], [10.2345, -3.9808], [0.0, 0.0])
START = matcal.Hyperfoam([8e3, 2e3], [8.0, -2.0], [0.0, 0.0], "longterm")


def path_of(law: matcal.Hyperfoam, friction: float = 0.0, thickness_m: float = 0.01) -> PressPath:
    return press_path(law, eitsim.Scene(body=eitsim.Body(thickness_m=thickness_m)).body, eitsim.punch_of("flat 14"),
                      friction, 3e-3)


@pytest.mark.thorough
def test_derivatives_by_the_law_are_those_of_other_paths() -> None:
    at, step, path = np.log([5e-4, 1e-3, 2e-3]), 1e-2, path_of(START)
    values = vector(START)
    for k, size in enumerate((1e4, 1e4, 1.0, 1.0)):
        one = np.zeros(6)
        one[k] = step * size
        less, more = (path_of(with_vector(START, values + sign * one)).at(at) for sign in (-1, 1))
        found = np.interp(at, path.log_depth, path.by_law[:, k])
        np.testing.assert_allclose(found * step * size, (more - less) / 2, rtol=0.06, atol=3e-4)


def test_lengths_and_moduli_scale_the_force() -> None:
    """F = mu_0 H^2 f(d/H, R/H): a layer and punch twice as large press four times as hard at twice the depth."""
    one = path_of(START)
    punch = eitsim.Punch(diameter_m=0.028, fillet_m=0.001)
    twice = press_path(with_vector(START, vector(START) * [3, 3, 1, 1, 1, 1]), eitsim.Body(thickness_m=0.02), punch,
                       0.0, 6e-3)
    at = np.log([1e-3, 2e-3])
    np.testing.assert_allclose(twice.at(at + np.log(2)) - one.at(at), np.log(12), atol=2e-3)


def test_friction_stiffens_a_flat_press() -> None:
    at = np.log([1e-3])
    assert path_of(START, 0.4).at(at) > path_of(START).at(at)


def test_starts_are_of_a_foam_and_of_a_rubber() -> None:
    kept = {kind: matcal.read_card(EXAMPLES / f"{kind}_start.json").law.keeps_volume for kind in ("foam", "rubber")}
    assert kept == {"foam": False, "rubber": True}


def test_files_are_refused_by_line_and_column(tmp_path: Path) -> None:
    path = tmp_path / "press.csv"
    for text, words in (("depth_mm,force\n1,2\n", "must name depth_mm and F_N"),
                        ("depth_mm,F_N\n0.1,x\n", "line 2"),
                        ("depth_mm,F_N\n0.1,0.2\n", "8 and a positive force are needed")):
        path.write_text(text)
        with pytest.raises(InputFileError, match=words):
            eitsim.read_presses(path, eitsim.punch_of("flat 14"))
    with pytest.raises(ValueError, match="punch 'flat'"):
        eitsim.punch_of("flat")


def test_unloading_is_left_out_and_presses_are_told_apart(tmp_path: Path) -> None:
    rows = [f"{name},{d},{d * k}" for name, k in (("a", 1), ("b", 2)) for d in (*range(1, 11), 5, 2)]
    (tmp_path / "p.csv").write_text("press,depth_mm,F_N\n" + "\n".join(rows))
    first, second = eitsim.read_presses(tmp_path / "p.csv", eitsim.punch_of("sphere 10"))
    assert first.depth_m[-1] == pytest.approx(0.01)
    np.testing.assert_allclose(second.force_N, 2 * first.force_N)


@pytest.mark.slow
def test_a_hidden_foam_is_found_from_two_punches() -> None:
    """Pressed by another program."""
    presses = [one for name in ("flat", "sphere")
               for one in eitsim.read_presses(EXAMPLES / f"press_{name}.csv", eitsim.punch_of(f"{name} 14"))]
    found = eitsim.identify(presses, eitsim.PressSetup(0.01), matcal.read_card(EXAMPLES / "foam_start.json"))
    row = found.derived["mu_0_Pa"]
    assert row["lo"] < HIDDEN.mu_0_Pa < row["hi"]
    assert row["hi"] / row["lo"] < 1.3
    assert "friction" in found.not_determined
    assert found.cpu_s < 60
    ranked = eitsim.next_presses(found)
    assert ranked
    assert all(0 <= share < 1 for one in ranked for share in one.narrows.values())


@pytest.mark.slow
def test_the_command_fits_a_screen(command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    done = command("eitsim", "identify", EXAMPLES / "press_flat.csv", EXAMPLES / "press_sphere.csv", "--punch",
                   "flat 14", "--punch", "sphere 14", "--thickness-mm", "10", "--card", EXAMPLES / "foam_start.json",
                   "--out", "layer.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert len((done.stdout + done.stderr).splitlines()) <= 40
    assert "not determined" in done.stdout
    assert matcal.read_card(tmp_path / "layer.json").posterior["n"] == 1000
