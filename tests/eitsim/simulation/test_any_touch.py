"""The last route: what is refused where any touch may be asked for, and its touches against those of faster routes."""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitsim.cli.output_files import OutputFiles, check_output_files
from eitsim.scene.choices import Why
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.outline import Outline
from eitsim.scene.scene import Accuracy, Body, Punch, Scene, scene_from, scene_tables
from eitsim.simulation.choose import choose
from eitsim.simulation.derivatives.readings import check_differentiable, scene_sensitivity
from eitsim.simulation.material import material_of
from eitsim.simulation.reuse import scene_shape
from eitsim.simulation.routes import known_routes
from eitsim.simulation.routes.general import General
from eitsim.simulation.routes.route import Case
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.known_laws import law_of
from matcal.laws.prony import Prony

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0], "longterm")
SERIES = Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672])
CARD = MaterialCard("Table 1", FOAM, SERIES, Conductivity(30.0, [-2, 2, -1], (0.0, 0.4)))
DRAWS = Path(__file__).parents[4] / "shared" / "checks" / "any_scene.py"


@pytest.mark.skipif(not DRAWS.exists(), reason="the scenes drawn over all keys are not at hand")
def test_few_scenes_are_refused_and_none_as_a_combination_that_was_not_built() -> None:
    """Of 150 scenes drawn over everything that a scene file can say; electrodes that the draw puts off the skin are
    its own slips."""
    names: dict[str, Any] = {}
    exec(DRAWS.read_text(encoding="utf-8").rpartition("main()")[0], names)  # without the call that runs it
    rng, reasons = np.random.default_rng(4711), []
    for _ in range(150):
        tables = tomllib.loads(names["draw"](rng))
        try:
            scene = scene_from(tables)
        except ValueError:
            continue
        why = choose(scene, material_of(scene, CARD)).why
        reasons += [] if why is None else [why.kind]
    assert set(reasons) <= {Why.OFF_SKIN, Why.TOO_DEEP}
    assert len(reasons) <= 3


def test_a_rubber_is_axisymmetric_away_from_edges_and_solved_by_the_last_route_near_them() -> None:
    card = MaterialCard("rubber", law_of("neo_hooke", ((1e5,), (0.4995,))), None, CARD.conductivity)
    scene = scene_from({"punch": [{"x_mm": -30}, {"x_mm": 90}]})
    assert [way.route.kind for way in choose(scene, material_of(scene, card)).ways] == ["axisymmetric", "general"]
    near = scene_from({"punch": {"x_mm": 90}})
    kinds = [choose(near, material_of(near, made), bodies=False).ways[0].route.kind for made in (CARD, card)]
    assert kinds == ["nearest_edge", "general"]
    with pytest.raises(ValueError, match="nearly keeps its volume"):
        scene_sensitivity(near, card)


def test_a_punch_that_leans_is_solved_in_three_dimensions() -> None:
    upright, leaning = (scene_from({"punch": {"tilt_deg": tilt, "tilt_direction_deg": 90}}) for tilt in (0, 5))
    assert leaning.punches[0].tilt_rad == pytest.approx(np.radians(5))
    assert scene_from(scene_tables(leaning)) == leaning
    assert "tilt_deg" not in scene_tables(upright)["punch"][0]
    kinds = [choose(scene, material_of(scene, CARD)).ways[0].route.kind for scene in (upright, leaning)]
    assert kinds == ["axisymmetric", "general"]
    with pytest.raises(ValueError, match="upright punches"):
        scene_from({"punch": {"tilt_deg": 5, "friction": "stick"}})
    with pytest.raises(ValueError, match="upright punches"):
        scene_from({"punch": {"tilt_deg": 5, "conductor": True}})


def test_a_punch_that_leans_is_not_taken_as_upright_by_load_paths_and_derivatives() -> None:
    leaning = scene_from({"punch": {"tilt_deg": 5}})
    with pytest.raises(ValueError, match="tilt_deg"):
        scene_shape(leaning, CARD)
    with pytest.raises(ValueError, match="tilt_deg"):
        check_differentiable(leaning)
    check_differentiable(scene_from({"punch": {"tilt_deg": 0, "tilt_direction_deg": 90}}))
    with pytest.raises(ValueError, match="upright punches"):
        check_output_files(leaning, OutputFiles(fields=Path("press.pvd")))


def test_a_mesh_in_three_dimensions_goes_farther_where_less_error_is_asked_for() -> None:
    """Until the slowest mode of the layer, exp(-pi r / 2 H), is a fifth of it, or as far as 5 thicknesses."""
    def reach(signal: float) -> float:
        return General()._reach(Case(replace(Scene(body=Body(Disc(0.2), 0.01)), accuracy=Accuracy(signal))))

    assert [reach(signal) for signal in (0.2, 0.05, 0.02, 0.005, 1e-4)] == [2.5, 3.0, 4.0, 4.5, 5.0]


def test_what_no_other_route_serves_is_solved_in_three_dimensions() -> None:
    body = Body(Outline("rectangle", width_m=0.16, height_m=0.1))
    three = [Punch(0.07, 0.0, 0.008), Punch(0.055, 0.0, 0.01, friction="stick"), Punch(0.055, 0.02, 0.01)]
    scene = Scene(body=body, punches=three)
    chosen = choose(scene, material_of(scene, CARD))
    assert chosen.why is None
    assert [way.route.kind for way in chosen.clusters] == ["general"]
    assert chosen.groups == ((0, 1, 2),)


@pytest.mark.slow
@pytest.mark.parametrize("punch", [{"x_mm": 85.0, "force_N": 0.5}, {"x_mm": 88.0, "depth_mm": 2.0, "diameter_mm": 10}],
                         ids=["a force", "a depth"])
def test_a_touch_near_the_rim_is_that_of_the_faster_route(punch, monkeypatch) -> None:
    scene = scene_from({"punch": punch, "accuracy": {"signal": 0.02}})
    fast = simulate(scene, CARD)
    monkeypatch.setattr(known_routes, "ROUTES", (known_routes.ROUTES[0], General()))
    found = simulate(scene, CARD)
    assert {d.kind for d in found.plan.decisions} >= {"general"}
    assert found.touches[0].depth_m == pytest.approx(fast.touches[0].depth_m, rel=2e-3)
    assert found.touches[0].force_N == pytest.approx(fast.touches[0].force_N, rel=5e-3)
    known = fast.readings.signal_V
    assert np.linalg.norm(found.readings.signal_V - known) < 0.03 * np.linalg.norm(known)
