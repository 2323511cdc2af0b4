"""Touches that no load path serves are kept: another skin takes them as they are."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from eitsim.scene.results import Touch
from eitsim.scene.scene import Accuracy, Punch, Scene, Skin
from eitsim.simulation.routes import axisymmetric
from eitsim.simulation.routes.route import Case
from matcal.laws.hyperfoam import Hyperfoam

LAW = Hyperfoam(np.array([9530.0]), np.array([8.0]), np.array([0.0]), "longterm")
SCENE = Scene(punches=(Punch(force_N=0.3),), accuracy=Accuracy(0.05))


def solved(scene: Scene, *, keep: bool) -> Touch:
    return axisymmetric.AXISYMMETRIC.solve(Case(scene), LAW, keep)


@pytest.mark.thorough
def test_another_skin_and_another_contact_take_the_kept_touch(monkeypatch, tmp_path) -> None:
    """One solution serves another strain and contact impedance, bit for bit what was solved; another force none, and no
    punch that conducts, whose mesh is another."""
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path))
    with patch.object(axisymmetric, "solve_touch", wraps=axisymmetric.solve_touch) as solve:
        direct = solved(SCENE, keep=False)
        first = solved(SCENE, keep=True)
        once = solve.call_count
        (punch,) = SCENE.punches
        touched = replace(SCENE, punches=(replace(punch, contact_impedance_Ohm_m2=1e-3),), skin=Skin(strain="areal"))
        second = solved(touched, keep=True)
        assert solve.call_count == once
        solved(replace(SCENE, punches=(replace(punch, conductor=True),)), keep=True)
        assert solve.call_count > once
        once = solve.call_count
        heavier = replace(SCENE, punches=(replace(SCENE.punches[0], force_N=0.31),))
        other = solved(heavier, keep=True)
        assert solve.call_count > once
    for name in ("radius_m", "u_z_m", "stretch_normal", "pressure_Pa", "depth_m", "signal_errors", "residuals"):
        assert np.array_equal(getattr(first, name), getattr(direct, name)), name
        assert np.array_equal(getattr(second, name), getattr(direct, name)), name
    assert second.cpu_s < first.cpu_s
    assert second.section is None
    assert other.depth_m > first.depth_m
