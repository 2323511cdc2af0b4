"""When half the element size is tried, when it is out of reach, and what is said where the wanted error is missed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.continuation import BottomedOut
from eitsim.mechanics.axisymmetric.solve_axisymmetric import Unresolved, solve_touch
from eitsim.mechanics.general.meshing.levels import COARSE, FINE
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Body, Punch, scene_from
from eitsim.simulation.routes import axisymmetric, general
from eitsim.simulation.routes.route import Case
from eitsim.simulation.simulate import simulate, solve_scene
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.known_laws import law_of
from matcal.laws.prony import Prony
from touchcal.errors import NotConverged

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def touch():
    return solve_touch(FOAM, Body(), Punch(), element_m=4 * default_element_m(Body(), Punch()))


@pytest.mark.parametrize(("friction", "error", "nodes", "tries"), [
    ("none", 0.001, 1.0, 1), ("none", 0.01, 1.0, 2), ("none", 0.5, 1.0, 2), ("none", 0.01, 20.0, 1),
    ("stick", 0.01, 1.0, 1)])
def test_half_the_element_size_is_tried_where_it_is_in_reach(touch, monkeypatch, friction, error, nodes, tries):
    """Of the mechanics 0.8 % is wanted; a large mesh, or a path with friction, stays and tells its error."""
    grown = replace(touch.section, **{name: getattr(touch.section, name).repeat(int(nodes), axis=0)
                                      for name in ("nodes_m", "displacement_m")})
    scene, sizes = scene_from({"punch": {"friction": friction}}), []
    of_the_skin = np.array(STRAINS) == scene.skin.strain

    def solved(law, body, punch, *, element_m=None, **_):
        sizes.append(element_m)
        return replace(touch, signal_errors=np.where(of_the_skin, error, 1.0), section=grown)

    monkeypatch.setattr(axisymmetric, "solve_touch", solved)
    refined = axisymmetric.AXISYMMETRIC.solve(Case(scene), FOAM, keep=False)
    assert len(sizes) == tries
    assert refined.signal_errors[of_the_skin] == error


@pytest.mark.thorough
def test_finer_elements_are_tried_where_readings_miss_the_accuracy():
    """Skin and conductor nearly cancel: the mechanics' share is met, the readings' error is not. Sweeps do not try."""
    card = MaterialCard("foam", Hyperfoam([9530.0], [8.0], [0.0]), None, Conductivity(30.0, [-2, 2, -1], (0.0, 0.4)))
    tables = {"punch": {"x_mm": 20, "force_N": 1.0, "conductor": True, "contact_impedance_Ohm_m2": 1e-3}}
    first = simulate(scene_from({**tables, "accuracy": {"signal": 0.5}}), card)
    error, numerical = first.error_estimate["signal"], first.numerical_error["signal"]
    scene = scene_from({**tables, "accuracy": {"signal": error - 0.2 * numerical}})
    met, swept = simulate(scene, card), solve_scene(scene, card, bodies=False)
    assert met.error_estimate["signal"] <= scene.accuracy.signal < swept.error_estimate["signal"]
    assert met.touches[0].radius_m.size > 1.5 * swept.touches[0].radius_m.size
    change = np.linalg.norm(met.readings.signal_V - swept.readings.signal_V) / np.linalg.norm(met.readings.signal_V)
    assert change < swept.error_estimate["signal"]


@pytest.mark.parametrize(("error", "tries"), [(0.02, 2), (0.05, 1), (0.01, 1)])
def test_a_hold_with_friction_is_solved_on_finer_elements_where_these_are_expected_to_do(
        touch, monkeypatch, error, tries):
    sizes = []

    def held(law, series, body, punch, hold, *, element_m=None):
        sizes.append(element_m)
        errors = np.full(len(STRAINS), error if element_m is None else error / 2)
        return [(t, replace(touch, signal_errors=errors)) for t in (0.0, 5.0)]

    monkeypatch.setattr(axisymmetric, "solve_hold", held)
    card = MaterialCard("foam", FOAM, Prony(np.array([0.4]), np.array([5.0])),
                        Conductivity(30.0, [-2, 2, -1], (0.0, 0.4)))
    scene = scene_from({"punch": {"friction": "stick"}, "hold": {"time_s": [5.0], "control": "force"},
                        "accuracy": {"signal": 0.018}})
    found = simulate(scene, card)
    assert found.outcome == "ok", found.message
    assert sizes == [None, default_element_m(Body(), Punch()) / 2][:tries]
    assert found.moments[-1].touches[0].signal_errors == pytest.approx(np.full(len(STRAINS), error / tries))


@pytest.mark.parametrize(("ends", "served"), [(NotConverged, True), (BottomedOut, False), (None, True)])
def test_a_hold_without_end_on_finer_elements_keeps_the_default_ones(
        touch: Touch, monkeypatch: pytest.MonkeyPatch, ends: type[NotConverged] | None, served: bool) -> None:
    """Where the finer elements show it bottomed out, it is; where they alone find it, theirs serves."""
    default, sizes = [(t, replace(touch, signal_errors=np.full(3, 0.1))) for t in (0.0, 5.0)], []

    def held(*_: object, element_m: float | None = None) -> list[tuple[float, Touch]]:
        sizes.append(element_m)
        if (element_m is None) == (ends is None):
            raise (ends or Unresolved)("no need to solve it")
        return default

    monkeypatch.setattr(axisymmetric, "solve_hold", held)
    case = Case(scene_from({"hold": {"time_s": [5.0], "control": "force"}}))
    how = case, FOAM, Prony(np.array([0.4]), np.array([5.0]))
    if served:
        assert axisymmetric.AXISYMMETRIC.solve_held(*how) is default
    else:
        with pytest.raises(BottomedOut):
            axisymmetric.AXISYMMETRIC.solve_held(*how)
    assert len(sizes) == 2


@pytest.mark.parametrize(("x_mm", "levels"), [(90, [COARSE, FINE]), (0, [])])
def test_what_only_a_coarse_mesh_strains_too_far_is_solved_on_a_finer_one(touch, monkeypatch, x_mm, levels):
    """A layer solved in three dimensions is refused for its strain on the finer mesh alone; an axisymmetric touch at
    once, whose surface shows its own strain."""
    tried, strained = [], np.full_like(touch.stretch_meridian, 3.0)

    def solved(law, body, punches, *, level, **given):
        tried.append(replace(level, reach=0.0))
        return SimpleNamespace(touches=[replace(touch, stretch_meridian=strained)])

    monkeypatch.setattr(general, "solve_general", solved)
    monkeypatch.setattr(general, "solved_finer", lambda *_: None)
    monkeypatch.setattr(general, "read_by", lambda scene, punches, found: found.touches)
    monkeypatch.setattr(axisymmetric, "solve_touch", lambda *given, **how: replace(touch, stretch_meridian=strained))
    skin = Conductivity(30.0, [-2, 2, -1], (0.0, 0.4))
    card = MaterialCard("rubber", law_of("neo_hooke", ((1e5,), (0.4995,))), None, skin)
    result = simulate(scene_from({"punch": {"x_mm": x_mm}, "skin": {"strain": "principal"}}), card)
    assert result.outcome == "refused"
    assert "strains the skin further than its law goes" in result.message
    assert tried == [replace(level, reach=0.0) for level in levels]


@pytest.mark.parametrize("serves", [True, False])
def test_what_the_sensor_reads_of_both_meshes_decides_on_the_finest_one(
        touch: Touch, monkeypatch: pytest.MonkeyPatch, serves: bool) -> None:
    read, decided = {"coarse": 0.07, "fine": 0.03}, []

    def finer(found: str, errors: np.ndarray, requested: np.ndarray) -> str | None:
        decided.append((found, errors[0], np.isfinite(requested).tolist()))
        return "fine" if serves else None

    monkeypatch.setattr(general, "solve_general", lambda *_, **__: "coarse")
    monkeypatch.setattr(general, "solved_finer", finer)
    monkeypatch.setattr(general, "read_by", lambda scene, punches, found: (
        replace(touch, signal_errors=np.full(len(STRAINS), read[found])),))
    route, case = general.General(), Case(scene_from({"punch": {"x_mm": 62.0}, "accuracy": {"signal": 0.05}}), (0,))
    (solved,) = route.solve_together(case, FOAM, False, ())
    assert decided == [("coarse", 0.07, [strain == case.scene.skin.strain for strain in STRAINS])]
    assert solved.signal_errors[0] == read["fine" if serves else "coarse"] + route.outside(case)


@pytest.mark.thorough
def test_a_missed_accuracy_is_said_with_its_cause():
    card = MaterialCard("foam", FOAM, None, Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4)))
    met, missed = (simulate(scene_from({"accuracy": {"signal": wanted}}), card) for wanted in (0.01, 1e-4))
    assert met.outcome == missed.outcome == "ok"
    assert met.message == ""
    assert "asked for (signal in [accuracy])" in missed.message
    assert met.numerical_error.keys() == met.error_estimate.keys()
    for key, told in met.error_estimate.items():
        assert 0 < met.numerical_error[key] <= told
