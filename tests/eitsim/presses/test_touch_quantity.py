"""The depth of a touch as what a further test is to narrow: against the paths of other laws, and against a fit to the
test that is named."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import matcal
from eitsim.mechanics.axisymmetric.press_path import press_path
from eitsim.presses.touch_quantity import touch_depth
from eitsim.scene.scene import read_scene
from matcal.posterior.draws import foam_draws, write_draws
from matcal.record.next_test import quantities
from matcal.reduction.experiment import Experiment
from touchcal.errors import InputFileError

ROOT = Path(__file__).parents[3]
MU, ALPHA = np.array([1.2e4, 4e3]), np.array([8.0, -2.0])
LAW = matcal.Hyperfoam(MU, ALPHA, np.zeros(2))


def measured(kind: str, end: float, rng: np.random.Generator) -> Experiment:
    strain = np.linspace(1.0 if kind == "volumetric" else 0.0, end, 60)[1:]
    stress = matcal.nominal_stress(LAW, kind, strain)
    return Experiment(kind, strain, stress * (1 + 0.01 * rng.normal(size=strain.size)))


def first() -> list[Experiment]:
    return [measured("uniaxial", end, np.random.default_rng(seed)) for seed, end in enumerate((-0.5, 0.2))]


@pytest.fixture(scope="module")
def card() -> matcal.MaterialCard:
    return matcal.fit(first(), order=2).card


def scene_file(folder: Path, punch: str) -> str:
    (folder / "scene.toml").write_text(f"[punch]\n{punch}\n", encoding="utf-8")
    return str(folder / "scene.toml")


@pytest.mark.thorough
@pytest.mark.parametrize(("punch", "sampled"), [
    ("diameter_mm = 14\nforce_N = 1", False), ("diameter_mm = 10\nforce_N = 0.3\nprofile = 'sphere'", True)])
def test_depths_of_other_laws_are_those_of_their_own_paths(punch: str, sampled: bool, tmp_path: Path) -> None:
    laws = [matcal.Hyperfoam(stiffer * MU, ALPHA + np.array([more, 0.0]), np.zeros(2))
            for stiffer, more in ((1.0, 0.0), (0.97, 0.0), (1.0, 0.3), (1.03, -0.2))]
    draws = foam_draws(np.array([law.mu_Pa for law in laws]), np.array([law.alpha for law in laws]), 0.0)
    card = matcal.MaterialCard("foam", laws[0])
    if sampled:
        (tmp_path / "card.d").mkdir()
        write_draws(draws, tmp_path / "card.d" / "posterior.nc", {})
        card = replace(card, posterior={"file": "card.d/posterior.nc"}, file=tmp_path / "card.json")
    file = scene_file(tmp_path, punch)
    scene, (name, of_draws) = read_scene(file), touch_depth(file, card)
    assert name == "depth of scene.toml, mm"
    truth = []
    for law in laws:
        path = press_path(law, scene.body, scene.punches[0], 0.0, 0.5 * scene.body.thickness_m)
        aim = float(np.log(scene.punches[0].force_N or 0.0))
        root = brentq(lambda x, p=path, a=aim: float(p.at(np.array(x))) - a, -15, path.log_depth[-1])
        truth.append(1e3 * np.exp(root))
    found = of_draws(draws)[:, 0]
    np.testing.assert_allclose(found / found[0] - 1, np.array(truth) / truth[0] - 1, rtol=0.1, atol=1e-3)
    assert found[0] == pytest.approx(truth[0], rel=0.005)


@pytest.mark.thorough
def test_the_test_that_is_named_narrows_the_depth_as_promised(card: matcal.MaterialCard, tmp_path: Path,
                                                               monkeypatch: pytest.MonkeyPatch) -> None:
    points = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    assert points["touchcal.quantities"] == {"touch": f"{touch_depth.__module__}:{touch_depth.__name__}"}
    monkeypatch.setattr(quantities, "added", lambda kind: {"touch": touch_depth})
    file = scene_file(tmp_path, "diameter_mm = 14\nforce_N = 1")
    found = matcal.next_tests(card, f"touch:{file}")
    best, after = found.tests[0], []
    assert best.narrows_by > 0.3
    for seed in range(3):
        more = measured(best.test.kind, best.test.strain_to, np.random.default_rng([3, seed]))
        after.append(matcal.next_tests(matcal.fit([*first(), more], order=2).card, f"touch:{file}").sd)
    assert 1 - np.median(after) / found.sd == pytest.approx(best.narrows_by, rel=0.25)


@pytest.mark.thorough
def test_touches_that_have_no_such_depth_are_refused(card: matcal.MaterialCard, tmp_path: Path) -> None:
    for punch, words in (("depth_mm = 2", "a given depth"), ("force_N = 500", "does not carry 500 N")):
        with pytest.raises(InputFileError, match=words):
            touch_depth(scene_file(tmp_path, f"diameter_mm = 14\n{punch}"), card)
    two = "diameter_mm = 8\nforce_N = 0.2\nx_mm = -20\n[[punch]]\ndiameter_mm = 8\nforce_N = 0.2\nx_mm = 20"
    (tmp_path / "two.toml").write_text(f"[[punch]]\n{two}\n", encoding="utf-8")
    with pytest.raises(InputFileError, match="several touches"):
        touch_depth(str(tmp_path / "two.toml"), card)


@pytest.mark.parametrize(("scene", "key"), [
    ("[hold]\ntime_s = [1.0]", "time_s in .hold."), ("tilt_deg = 5", "tilt_deg"), ('friction = "stick"', "friction"),
    ('[skin]\nkind = "layer"\nthickness_mm = 3\nbase_thickness_mm = 6\nbase_card = "base.json"\n'
     "[electrodes]\nsoft = true", "base_card in .skin.")])
def test_what_the_touch_of_one_material_does_not_hold_is_refused(card, scene, key, tmp_path):
    matcal.write_card(card, tmp_path / "base.json")
    with pytest.raises(InputFileError, match=f"{key}.*Leave the key out"):
        touch_depth(scene_file(tmp_path, f"diameter_mm = 8\nforce_N = 0.2\n{scene}"), card)
