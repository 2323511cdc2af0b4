"""Presses on layers that conduct in their volume: touches between those of a path, what is left out, and the fit."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import matcal
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.edges.disc import Disc
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.fitted_layer import ACROSS, PIEZO, THICKNESS
from eitsim.scene.scene import Accuracy, Body, Punch, Scene, Skin
from eitsim.sensors.calibration.skin_law import MODULUS, changed, fitted_skin, skin_presses
from eitsim.sensors.labels import Labels
from eitsim.simulation.layer_paths import layer_paths
from eitsim.simulation.material import material_of
from eitsim.simulation.simulate import readings_of

FOAM = matcal.Hyperfoam(np.array([2e4]), np.array([4.0]), np.array([0.2]))
BASE = matcal.Hyperfoam(np.array([1e4]), np.array([6.0]), np.array([0.1]))
CARD = matcal.MaterialCard("layer", FOAM,
                           conductivity=matcal.Conductivity(5.0, np.array([-1.2, 0.7, -0.15]), (-0.4, 0.8)))
NAMES = ("x_mm", "y_mm", "d_mm", "F_N")


def scene_on(folder: Path, *, soft: bool) -> Scene:
    matcal.write_card(matcal.MaterialCard("base", BASE), folder / "base.json")
    skin = Skin(0.003, "principal", "layer")
    if soft:
        skin = replace(skin, base_m=0.004, base_card=str(folder / "base.json"))
    return Scene(Body(Disc(0.05)), skin=skin,
                 electrodes=Electrodes(count=8, soft=True), accuracy=Accuracy(0.05))


@pytest.mark.thorough
@pytest.mark.parametrize("soft", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_touches_between_those_of_a_path_are_those_solved_from_rest(tmp_path: Path, soft: bool) -> None:
    """With other moduli too; on the mesh of half the element size."""
    scene = scene_on(tmp_path, soft=soft)
    ends = [Punch(diameter_m=0.01, force_N=force) for force in (0.4, 2.0)]
    paths = layer_paths(scene, material_of(scene, CARD), ends)
    for force, ln_factor in ((0.55, 0.0), (1.9, -0.2)):
        card = changed(CARD, {MODULUS: ln_factor})
        pressed = replace(scene, punches=(Punch(0.008, 0.0, 0.01, force),))
        material = material_of(scene, card)
        touch = paths.touch(pressed, material)
        assert touch is not None
        fresh = solve_touch(material.solid, scene.body, pressed.punches[0])
        assert touch.depth_m == pytest.approx(fresh.depth_m, rel=2e-3)
        assert touch.sigma_ave_Pa == pytest.approx(fresh.sigma_ave_Pa, rel=0.02)
        own, other = (readings_of(pressed, (one,), material.skin, exact=True).signal_V for one in (touch, fresh))
        assert np.linalg.norm(own - other) < 5e-3 * np.linalg.norm(other)


@pytest.mark.thorough
def test_presses_to_a_depth_and_those_that_no_path_reaches(tmp_path: Path) -> None:
    scene = scene_on(tmp_path, soft=False)
    at = np.array([[0.0, 0.0], [20.0, 0.0], [0.0, -12.0], [46.0, 0.0]])
    labels = Labels(np.array([*"abcd"]), (*NAMES[:3], "depth_mm"),
                    np.column_stack([at, np.full(4, 10.0), [0.3, 1.0, 2.7, 0.5]]))
    presses = skin_presses(scene, CARD, labels, 1e-3 * at)
    assert presses.rows.tolist() == [0, 1]
    assert presses.too_deep.tolist() == [2]
    assert "modulus" not in presses.groups
    found = [touch for _, touch in presses.touches({})]
    assert [touch.depth_m for touch in found] == pytest.approx([3e-4, 1e-3])
    stiffer = [touch for _, touch in presses.touches({MODULUS: 0.1})]
    assert [touch.force_N for touch in stiffer] == pytest.approx([np.exp(0.1) * touch.force_N for touch in found])
    assert [touch.u_z_m.min() for touch in stiffer] == pytest.approx([touch.u_z_m.min() for touch in found])


@pytest.mark.thorough
def test_signals_between_thicknesses_are_those_of_a_layer_so_thick(tmp_path: Path) -> None:
    """And those of a piezoresistive layer are those of one with its fitted coefficients."""
    scene, at = scene_on(tmp_path, soft=False), np.array([[5.0, 12.0], [-15.0, 0.0]])
    labels = Labels(np.array([*"ab"]), NAMES, np.column_stack([at, np.full(2, 10.0), [0.5, 1.5]]))
    presses = skin_presses(scene, CARD, labels, 1e-3 * at)
    assert presses.groups["thickness"] == {THICKNESS: pytest.approx(0.05)}
    thick = replace(scene, skin=fitted_skin(scene.skin, {THICKNESS: 0.06}))
    found, known = presses.signals({THICKNESS: 0.06}), skin_presses(thick, CARD, labels, 1e-3 * at).signals({})
    assert np.linalg.norm(found - known) < 1e-3 * np.linalg.norm(known)
    assert np.linalg.norm(presses.signals({}) - known) > 0.03 * np.linalg.norm(known)
    piezo = replace(presses, scene=replace(scene, skin=Skin(0.003, "piezoresistive", "layer", along=3.0, across=1.0)))
    assert {*piezo.groups["amplitude"], *piezo.groups["shape"]} == {PIEZO, ACROSS}
    values = {PIEZO: 0.2, ACROSS: -0.1}
    other = replace(presses, scene=replace(scene, skin=fitted_skin(piezo.scene.skin, values)))
    np.testing.assert_allclose(piezo.signals(values), other.signals({}), rtol=1e-12)


@pytest.mark.slow
def test_hidden_layers_are_fitted_within_their_intervals(benchmark_module: Callable[[str], ModuleType]) -> None:
    """A sensor that the stored table does not have: a foam on a rigid plate."""
    row = benchmark_module("layer_fit").row_of(101)
    assert {"amplitude", "modulus"} <= {*row["kept"].split()}
    for name in ("ln_law_amplitude", "ln_modulus_factor"):
        assert abs(row[f"{name}_off"]) < 3 * row[f"{name}_sd"] < 0.3
    assert row["after"] < row["before"]
