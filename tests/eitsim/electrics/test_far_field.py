"""What rings leave out: sampled as finely as the foam is thick, however large the skin."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

from eitsim.electrics.cem.assembly import gradients, quadrature_points
from eitsim.electrics.forward import far_field
from eitsim.electrics.outline.triangles import refined, skin_mesh, triangulated
from eitsim.scene.edges.outline import Outline
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch, Scene, Skin
from matcal.laws.conductivity import Conductivity

LAW, SKIN = Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4)), Skin(strain="normal")
RADIUS = np.linspace(0, 0.05, 401)
SHEET = Scene(Body(Outline("rectangle", width_m=0.6, height_m=0.4), 0.002),
              electrodes=Electrodes(count=8, width_m=0.02))


def test_a_quadrature_in_parts_is_exact_and_converges():
    body = Body(Outline("rectangle", width_m=2.0, height_m=1.0))
    lines = Scene(body, electrodes=Electrodes(count=8, width_m=0.1)).electrodes
    mesh = skin_mesh(refined(triangulated(body.outline, lines), lambda places_m: np.full(len(places_m), 0.1)), lines)
    known = 4 * np.sinh(5.0) * np.sin(2.5) / 25
    found = []
    for parts in (1, 2, 4):
        points, area = quadrature_points(mesh, parts), gradients(mesh, np.zeros((len(mesh.nodes_m), 1)), parts)[1]
        assert area.sum() == pytest.approx(2.0, rel=1e-12)
        found.append(np.sum(area * np.exp(5 * points[..., 0]) * np.cos(5 * points[..., 1])))
    off = np.abs(np.array(found) / known - 1)
    print(off)
    assert off[1] < off[0] / 20
    assert off[2] < off[1] / 20


def touch() -> Touch:
    """A punch of 10 mm that squeezes the skin by 0.3 under it, and by e less each 2 mm further."""
    rest, normal = np.ones_like(RADIUS), 1 - 0.3 * np.exp(-np.maximum(RADIUS - 0.005, 0) / 0.002)
    parts: list[Any] = [RADIUS, 0 * rest, 0 * rest, rest, rest, normal, 0 * rest, 0.005, *[0.0] * 9, 0, (), 0.0]
    return Touch(*parts)


@pytest.mark.parametrize("part", [1e-5, 1e-3])
def test_cells_left_out_change_no_more_than_is_said(part: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(far_field, "_LEFT_OUT", part)

    def outside(change_Ohm: float) -> np.ndarray:
        return far_field.born_correction(SHEET.body, SHEET.electrodes, 6e-4, Punch(0.05, 0.17, 0.01), touch(), SKIN,
                                         LAW, 0.01, change_Ohm=change_Ohm)[0]

    whole = outside(0.0)
    some = outside(float(np.linalg.norm(whole)))
    off = float(np.linalg.norm(some - whole) / np.linalg.norm(whole))
    print(off)
    assert 0 < off < part
    assert not outside(1e9).any()


def test_what_rings_leave_out_on_a_large_thin_sheet_is_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if the foam were thinner still, within one in a hundred of a small part; triangles of 11 mm alone miss more
    than ten times as much."""
    def left_out(thickness_m: float) -> np.ndarray:
        return far_field.born_correction(replace(SHEET.body, thickness_m=thickness_m), SHEET.electrodes, 6e-4,
                                         Punch(0.05, 0.19, 0.01), touch(), SKIN, LAW, 0.01)[0]

    coarse, found = left_out(0.02), left_out(0.002)
    monkeypatch.setattr(far_field, "_FADES", ((0.016 / 0.0005, 1.0),))
    fine = left_out(0.0005)
    off = [float(np.linalg.norm(one - fine) / np.linalg.norm(fine)) for one in (coarse, found)]
    print(off)
    assert off[1] < 0.01
    assert off[1] < off[0] / 10


def test_the_second_order_is_by_half_of_the_squared_change_over_the_conductance(monkeypatch: pytest.MonkeyPatch
                                                                                ) -> None:
    first_order, taken = far_field.first_order, []
    monkeypatch.setattr(far_field, "first_order", lambda *parts: (taken.append(parts), first_order(*parts))[1])
    found, second = far_field.born_correction(SHEET.body, SHEET.electrodes, 6e-4, Punch(0.05, 0.17, 0.01), touch(),
                                              SKIN, LAW, 0.01)
    (area, field, squared), (*_, change) = taken
    off, _ = KDTree((-change @ change / (2 * 6e-4)).reshape(-1, 4)).query(squared.reshape(-1, 4))
    assert off.max() < 1e-9 * np.abs(squared).max()
    assert second == pytest.approx(-np.einsum("n,nik,nij,njl->kl", area, field, squared, field), rel=1e-9)
    assert 0 < np.linalg.norm(second) < 0.3 * np.linalg.norm(found)
