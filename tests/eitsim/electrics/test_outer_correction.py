"""Strain outside the circle of a touch near an edge: the same signal wherever the circle ends, and symmetric."""

import numpy as np
import pytest

from eitsim.electrics.cem import coupled_scattering, ring_scattering
from eitsim.electrics.forward import outer_correction, solve_forward
from eitsim.electrics.forward.far_field import born_correction
from eitsim.electrics.outline import edge_response
from eitsim.electrics.outline.adapted_mesh import solve_untouched
from eitsim.scene.edges.outline import Outline
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Scene, Skin
from matcal.laws.conductivity import Conductivity

LAW, SKIN = Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4)), Skin(strain="normal")
SCENE = Scene(Body(Outline("rectangle", width_m=0.12, height_m=0.08), 0.005),
              electrodes=Electrodes(count=12, width_m=0.006))
GAP_M, FAR_M = 0.01, 1e3  # From the axis to the edge, which is the rim of a disc so large.
PUNCH = Punch(0.012, 0.04 - GAP_M, 0.01)


def squeezed() -> Touch:
    """A touch that squeezes the skin far outside the largest circle that fits on it, more so towards the edge."""
    radius, share = np.linspace(0, 0.04, 161), np.linspace(0, 1, 25)
    rest, normal = np.ones_like(radius), 1 - 0.3 * np.exp(-(radius / 0.008) ** 2)
    more = 0.1 * np.exp(-(radius[:, None] / 0.008) ** 2) * (radius[:, None] / 0.008) * np.cos(np.pi * share)
    metric = np.broadcast_to([1.0, 0.0, 1.0], (*more.shape, 3)).copy()
    rim = RimField(radius, share, np.zeros((*more.shape, 3)), metric, 1 - more, FAR_M, FAR_M - GAP_M,
                   np.array([0.0, 1.0]))
    return Touch(radius, 0 * rest, 0 * rest, rest, rest, normal, 1e4 * (radius < 0.005), 0.005, *[0.0] * 9, 0, (), 0.0,
                 rim=rim)


def test_the_untouched_skin_is_solved_once() -> None:
    """Readings, edges and fields take the same meshes."""
    solve_untouched.cache_clear()
    law = Conductivity(31.0, [-2, 2, -1], (-0.5, 0.4))
    solve_forward.solve(SCENE.body, SKIN, SCENE.electrodes, Drive(), ((PUNCH, squeezed()),), law, method="multipole")
    assert solve_untouched.cache_info().misses == 1


def signal() -> np.ndarray:
    return solve_forward.solve(SCENE.body, SKIN, SCENE.electrodes, Drive(), ((PUNCH, squeezed()),), LAW,
                               method="multipole").signal_V


def test_it_matters_little_where_the_circle_begins_to_fade(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten times less than where strain outside counts as it does far from edges."""
    found = []
    for by in (outer_correction.outer_correction, born_correction):
        monkeypatch.setattr(solve_forward, "outer_correction", by)
        signals = []
        for full in (0.8, 0.9):
            monkeypatch.setattr(ring_scattering, "FULL", full)
            monkeypatch.setattr(outer_correction, "FULL", full)
            monkeypatch.setattr("eitsim.electrics.forward.far_field.FULL", full)
            signals.append(signal())
        found.append(float(np.linalg.norm(signals[1] - signals[0]) / np.linalg.norm(signals[0])))
    print(found)
    assert found[0] < 1e-3
    assert found[0] < found[1] / 10


def test_what_the_circle_leaves_out_is_symmetric() -> None:
    """As an impedance matrix is, and its rows sum to zero."""
    body, lines, touch = SCENE.body, SCENE.electrodes, squeezed()
    circle = ring_scattering.position(PUNCH), GAP_M
    coupling, _ = edge_response.couplings(body.outline, lines, 6e-4, [circle], 16)
    own = coupled_scattering.coupled_scattering(PUNCH, touch, SKIN, LAW, GAP_M, 16)
    change, unsure = outer_correction.outer_correction(
        body, lines, 6e-4, PUNCH, touch, SKIN, LAW, GAP_M, ring_scattering.scattered(coupling, 6e-4, own))
    size = np.abs(change).max()
    np.testing.assert_allclose(change, change.T, atol=1e-8 * size)
    np.testing.assert_allclose(change.sum(axis=0), 0, atol=1e-3 * size)
    assert np.abs(unsure).max() < 0.05 * size
