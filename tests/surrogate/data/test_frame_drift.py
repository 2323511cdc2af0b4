"""Derivatives of readings by what drifts between the frames."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.forward.untouched import untouched_impedance, untouched_readings
from eitsim.scene.drive import Drive
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Scene
from surrogate.data.frame_drift import by_gain, frame_drift
from surrogate.data.sensor_ring import ring_of

SHEET_S = 6e-4


@pytest.mark.parametrize("scene", [Scene(), Scene(drive=Drive(pattern="opposite", reading="differential")),
                                   Scene(electrodes=Electrodes(count=8, width_m=0.03))])
def test_gains_scale_the_potentials_of_the_complete_electrode_model(scene: Scene) -> None:
    """Of electrodes that carry no current; against the mean of all."""
    ring, rest = ring_of(scene), untouched_readings(scene, SHEET_S)
    impedance, rows = untouched_impedance(scene.body, scene.electrodes, SHEET_S), np.arange(len(ring.read))
    potential = scene.drive.current_A * (impedance[:, ring.source] - impedance[:, ring.sink])
    potential -= potential.mean(axis=0)
    exact = np.zeros((len(rows), scene.electrodes.count))
    exact[rows, ring.read] = potential[ring.read, rows]
    exact[rows, ring.ground] = -potential[ring.ground, rows]
    found = by_gain(ring, rest)
    assert np.linalg.norm(found - exact) < 0.01 * np.linalg.norm(exact)
    assert np.linalg.norm(found.sum(axis=1) - rest) < 0.01 * np.linalg.norm(rest)


def test_contacts_change_readings_as_new_solutions_do() -> None:
    scene = Scene()
    rest = untouched_readings(scene, SHEET_S)
    root = frame_drift(ring_of(scene), rest, contact_sd=0.02, scene=scene).root
    z = np.ones(16)
    z[3] = 1.02
    other = replace(scene, electrodes=replace(scene.electrodes, contact_impedance_Ohm_m=tuple(z.tolist())))
    change = untouched_readings(other, SHEET_S) - rest
    assert np.linalg.norm(root[:, 3] - change) < 0.05 * np.linalg.norm(change)


def test_both_drifts_stand_next_to_each_other() -> None:
    scene = Scene()
    rest, ring = untouched_readings(scene, SHEET_S), ring_of(scene)
    both = frame_drift(ring, rest, 1e-3, 1e-2, scene).root
    assert both.shape == (208, 32)
    assert np.array_equal(both[:, :16], 1e-3 * by_gain(ring, rest))
    assert frame_drift(ring, rest).root.shape == (208, 0)


@pytest.mark.parametrize(("given", "named"), [
    ({"gain_sd": -0.1}, "from 0 to 1"), ({"contact_sd": np.nan}, "from 0 to 1"), ({"contact_sd": 0.01}, "`scene`")])
def test_what_is_not_known_of_a_drift_is_refused(given: dict[str, float], named: str) -> None:
    scene = Scene()
    with pytest.raises(ValueError, match=named):
        frame_drift(ring_of(scene), untouched_readings(scene, SHEET_S), **given)


def test_potentials_are_not_foreseen_of_another_frame() -> None:
    with pytest.raises(ValueError, match="cannot be foreseen"):
        by_gain(ring_of(Scene()), untouched_readings(Scene(), SHEET_S)[::-1])
