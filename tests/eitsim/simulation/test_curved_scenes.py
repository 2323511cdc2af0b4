"""Scenes on curved bodies, end to end: what symmetry says of their readings, and what a flat layer says of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import eitsim
from eitsim.scene.curved.curved_scene import CurvedScene, curved_scene
from eitsim.scene.results import Result
from eitsim.scene.scene import Punch
from eitsim.simulation.result_json import result_document
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony

FOAM = Hyperfoam(np.array([9530.0]), np.array([8.0]), np.array([0.0]), "longterm")
CARD = MaterialCard("foam", FOAM, conductivity=Conductivity(30.0, np.array([-2.0, 2, -1]), (0, 0.4)),
                    prony=Prony(np.array([0.4]), np.array([5.0])))
RADIUS_MM = 40.0


def ball(**punch: object) -> CurvedScene:
    """A ball with four electrodes around the equator's upper side and four around the lower one."""
    angle = np.pi / 2 * np.arange(4)
    rings = [[RADIUS_MM * np.cos(rise) * np.cos(a), RADIUS_MM * np.cos(rise) * np.sin(a), RADIUS_MM * np.sin(rise)]
             for rise in (0.3, -0.3) for a in angle]
    return curved_scene({"body": {"surface": "sphere", "radius_mm": RADIUS_MM, "thickness_mm": 8},
                         "punch": {"at_mm": [0, 0, RADIUS_MM], "diameter_mm": 14, "force_N": 0.5, **punch},
                         "electrodes": {"at_mm": rings, "width_mm": 8}, "accuracy": {"signal": 0.02}}, Path())


def read(impedance_Ohm: np.ndarray) -> np.ndarray:
    """What is read with four electrodes: current through one pair of neighbours, voltage of another, Ohm."""
    pairs = np.eye(8) - np.eye(8)[[1, 2, 3, 0, 5, 6, 7, 4]]
    return np.where(np.abs(pairs) @ np.abs(pairs).T > 0, 0.0, pairs @ impedance_Ohm @ pairs.T)


@pytest.fixture(scope="module")
def pressed() -> Result:
    return eitsim.simulate(ball(), CARD)


def test_a_touch_on_the_pole_of_a_ball_reads_the_same_all_around(pressed: Result) -> None:
    assert pressed.outcome == "ok", pressed.message
    assert pressed.readings is not None
    z = pressed.readings.impedance_Ohm
    turn = np.array([1, 2, 3, 0, 5, 6, 7, 4])
    over, under = read(z)[:4, :4], read(z)[4:, 4:]  # of the ring near the touch, and of the other one
    differs = np.abs(read(z[np.ix_(turn, turn)]) - read(z)).max()
    assert np.abs(z[np.ix_(turn, turn)] - z).max() < 5e-6 * np.abs(z).max()  # driven electrodes' own, which none reads
    assert differs < pressed.error_estimate["signal"] * np.abs(over - under).max()
    assert pressed.error_estimate["signal"] < 0.05


def test_a_convex_body_gives_way_more_than_a_flat_layer_and_says_so(pressed: Result) -> None:
    (touch,), (flat,) = pressed.touches, pressed.as_if_flat
    assert touch.force_N == pytest.approx(flat.force_N, rel=1e-6)
    assert 1.02 < touch.depth_m / flat.depth_m < 1.5
    document = result_document(pressed, ball(), CARD)
    assert document["as_if_flat"]["delta_max_mm"] == pytest.approx(1e3 * flat.depth_m)
    assert document["plan"][0]["kind"] == "on_surface"
    assert document["scene"]["body"]["surface"] == "sphere"


@pytest.mark.thorough
def test_a_kept_depth_relaxes_and_a_plan_says_of_the_body_what_physics_refuses() -> None:
    held = replace(ball(), hold=eitsim.Hold(time_s=(5.0,), control="depth"))
    found = eitsim.simulate(held, CARD)
    first, last = found.moments
    assert last.touches[0].force_N / first.touches[0].force_N == pytest.approx(0.6 + 0.4 * np.exp(-1))
    assert last.readings.signal_V == pytest.approx(first.readings.signal_V)
    thick = replace(ball(), body=replace(ball().body, thickness_m=0.039))
    assert "too thick" in eitsim.plan(thick, CARD).refusal
    punch, place = ball().punches[0], ball().places_m[0]
    both = replace(ball(), punches=(punch, punch), places_m=place + np.array([[0.0, 0, 0], [0.01, 0, 0]]))
    assert "from another punch" in eitsim.plan(both, CARD).refusal
    deep = replace(ball(), punches=(Punch(depth_m=0.0079),))
    assert "97% of the layer's thickness" in eitsim.plan(deep, CARD).refusal
