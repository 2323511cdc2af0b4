"""Scenes are solved on one thread of linear algebra: with two a touch takes some four times as long."""

from pathlib import Path

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import eitsim
import matcal

EXAMPLES = Path(__file__).parents[3] / "examples"
CARD = matcal.MaterialCard("foam", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))


@pytest.mark.parametrize(("scene", "asked"), [
    ("scene.toml", "eitsim.simulation.simulate.choose"),
    ("forearm.toml", "eitsim.simulation.curved.solve_curved_scene.material_of")])
def test_scenes_are_solved_on_one_thread(scene, asked, monkeypatch) -> None:
    class Stopped(Exception):
        pass

    def stop(*_, **__):
        raise Stopped({pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"})

    monkeypatch.setattr(asked, stop)
    with threadpool_limits(2), pytest.raises(Stopped) as stopped:
        eitsim.simulate(EXAMPLES / scene, CARD)
    assert stopped.value.args == ({1},)
