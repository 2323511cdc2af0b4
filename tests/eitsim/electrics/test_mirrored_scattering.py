"""Touches that an edge changes, as circles that scatter: rings where they are rings, a mesh's readings where not,
the same wherever the edge lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.cem.mirrored_scattering import mirrored_scattering
from eitsim.electrics.cem.ring_scattering import scattering
from eitsim.electrics.forward.solve_forward import solve
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin
from matcal.laws.conductivity import Conductivity

LAW, SKIN, ORDERS = Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4)), Skin(strain="normal"), 12
BODY = Body(outline="rectangle", width_m=0.12, height_m=0.08, thickness_m=0.005)
LINES = Electrodes(count=12, width_m=0.006)
FAR_M = 1e3  # A straight edge is the rim of a disc so large.


def pressed() -> Touch:
    """A touch that squeezes the skin under a punch of 10 mm."""
    radius = np.linspace(0, 0.03, 121)
    normal, rest = 1 - 0.3 * np.exp(-(radius / 0.006) ** 4), np.ones_like(radius)
    return Touch(radius, 0 * rest, 0 * rest, rest, rest, normal, 1e4 * (radius < 0.005), 0.005, *[0.0] * 9, 0, (), 0.0)


def near_an_edge(gap_m: float, towards: tuple[float, float]) -> Touch:
    """The same, more squeezed and stretched on the side towards an edge that lies so far from its axis."""
    radius, share = np.linspace(0, gap_m, 25), np.linspace(0, 1, 25)
    there = np.exp(-(radius[:, None] / 0.008) ** 2) * (radius[:, None] / 0.008) * np.cos(np.pi * share)
    metric = np.stack([1 + 0.2 * there, 0.1 * there * np.sin(np.pi * share), 1 - 0.1 * there], axis=-1)
    rim = RimField(radius, share, np.zeros((25, 25, 3)), metric, 1 - 0.1 * there, FAR_M, FAR_M - gap_m,
                   np.array(towards))
    return replace(pressed(), rim=rim)


@pytest.mark.parametrize("conductor", [False, True])
def test_an_axisymmetric_touch_scatters_as_its_rings(conductor):
    punch, touch = Punch(0.03, 0.02, conductor=conductor), pressed()
    tau = scattering(punch, touch, SKIN, LAW, 0.012, ORDERS, 16)
    found = mirrored_scattering(punch, touch, SKIN, LAW, 0.012, ORDERS)
    off = np.abs(found - np.diag(np.tile(tau, 2))).max() / np.abs(tau).max()
    print(f"{off:.1e}")
    assert off < 2e-5


def test_scattering_is_reciprocal_and_mixes_harmonics():
    """m T_mn = n T_nm: what goes out of one harmonic by another is as much the other way round."""
    found = mirrored_scattering(Punch(0.03, 0.02), near_an_edge(0.015, (0.6, 0.8)), SKIN, LAW, 0.012, ORDERS)
    weighted = np.tile(np.arange(1, ORDERS + 1), 2)[:, None] * found
    np.testing.assert_allclose(weighted, weighted.T, atol=1e-10)
    mixed = weighted - np.diag(np.diag(weighted))
    assert np.abs(mixed).max() > 0.1 * np.abs(weighted).max()


@pytest.mark.parametrize("conductor", [False, True])
def test_rings_and_a_mesh_agree_within_their_estimates_near_an_edge(conductor):
    """In a fraction of the time."""
    punch, touch = Punch(0.01, 0.025, 0.01, conductor=conductor), near_an_edge(0.015, (0.0, 1.0))
    rings, mesh = (solve(BODY, SKIN, LINES, Drive(), ((punch, touch),), LAW, method=method, signal=2e-3)
                   for method in ("auto", "mesh"))
    off = np.linalg.norm(rings.signal_V - mesh.signal_V) / np.linalg.norm(mesh.signal_V)
    print(f"{off:.1e} {rings.signal_error:.1e} {mesh.signal_error:.1e} {rings.cpu_s:.3f} {mesh.cpu_s:.3f} s")
    assert rings.method == "multipole"
    assert off < rings.signal_error + mesh.signal_error
    axisymmetric = solve(BODY, SKIN, LINES, Drive(), ((punch, pressed()),), LAW).signal_V
    assert np.linalg.norm(axisymmetric - mesh.signal_V) > 0.01 * np.linalg.norm(mesh.signal_V)


def test_a_turned_skin_has_the_same_signal_near_an_edge():
    signals = []
    for body, punch, towards, first in (
            (BODY, Punch(0.01, 0.025, 0.01), (0.0, 1.0), 0.0),
            (replace(BODY, width_m=0.08, height_m=0.12), Punch(-0.025, 0.01, 0.01), (-1.0, 0.0), np.pi / 2)):
        lines = replace(LINES, first_angle_rad=first)
        signals.append(solve(body, SKIN, lines, Drive(), ((punch, near_an_edge(0.015, towards)),), LAW).signal_V)
    assert np.linalg.norm(signals[1] - signals[0]) < 5e-4 * np.linalg.norm(signals[0])


def test_a_contact_that_reaches_the_edge_takes_a_mesh():
    touch = replace(near_an_edge(0.0052, (0.0, 1.0)), contact_radius_m=0.0055)
    punch = Punch(0.01, 0.0348, 0.01)
    assert solve(BODY, SKIN, LINES, Drive(), ((punch, touch),), LAW, signal=0.02).method == "mesh"
    with pytest.raises(ValueError, match="'multipole' needs a contact that ends before the edge"):
        solve(BODY, SKIN, LINES, Drive(), ((punch, touch),), LAW, method="multipole")
