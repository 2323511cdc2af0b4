"""Holds of touches alone, stepped in time, and of others as elastic touches: as deep as those alone, forces kept,
stresses relaxed."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.elastic_holds import StandIns
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.choices import Kind
from eitsim.scene.results import Result, Touch
from eitsim.scene.scene import STRAINS, Body, Punch, scene_from
from eitsim.simulation import choose as choose_module
from eitsim.simulation.choose import choose
from eitsim.simulation.material import material_of
from eitsim.simulation.result_json import as_json
from eitsim.simulation.routes.general import General
from eitsim.simulation.routes.route import Case
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law
from matcal.laws.prony import Prony, relaxation

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0], "longterm")
SERIES = Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672])
CARD = MaterialCard("Table 1", FOAM, SERIES, Conductivity(30.0, [-2, 2, -1], (0.0, 0.4)))
FAR = {"x_mm": -50.0, "force_N": 0.5}
HOLD = {"time_s": [2.0, 60.0], "control": "force", "loading_s": 1.0}


def solved(punches: list[dict[str, Any]], hold: dict[str, Any]) -> Result:
    result = simulate(scene_from({"punch": punches, "hold": hold, "accuracy": {"signal": 0.05}}), CARD)
    assert result.outcome == "ok", result.message
    return result


def kinds(result: Result) -> set[Kind]:
    return {decision.kind for decision in result.plan.decisions}


@pytest.mark.slow
@pytest.mark.parametrize("control", ["force", "depth"])
def test_two_touches_far_from_each_other_creep_as_each_alone(control: str) -> None:
    hold = HOLD | {"control": control}
    alone, both = solved([FAR], hold), solved([FAR, FAR | {"x_mm": 50.0}], hold)
    assert Kind.HOLD_STEPPED in kinds(alone) & kinds(both)
    for one, two in zip(alone.moments, both.moments, strict=True):
        for touch in two.touches:
            assert touch.depth_m == pytest.approx(one.touches[0].depth_m, rel=1e-12)
            assert touch.force_N == pytest.approx(one.touches[0].force_N, rel=1e-12)


def test_each_time_of_a_hold_starts_from_the_one_before(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, cases = scene_from({"punch": [FAR | {"x_mm": x} for x in (-50, -34, -18)], "hold": HOLD}), []
    forces = np.array([punch.force_N for punch in scene.punches])

    def found(self: General, case: Case, law: Law, keep: bool, known: Sequence[Touch | None]) -> Sequence[Any]:
        cases.append(case)
        return [SimpleNamespace(force_N=punch.force_N) for punch in case.punches]

    monkeypatch.setattr(General, "solve_together", found)
    monkeypatch.setattr(choose_module, "stand_ins", lambda *_: [
        SimpleNamespace(time_s=t, force_N=share * forces, held=tuple) for t, share in ((0, 1), (2, 1.1), (60, 1.2))])
    chosen = choose(scene, material_of(scene, CARD))
    chosen.held()
    given = [[punch.force_N for punch in case.punches] for case in cases]
    assert given == [pytest.approx(share * forces) for share in (1, 1.1, 1.2)]
    assert [[touch.force_N for touch in case.start] for case in cases] == [[], *given[:-1]]
    assert not any(case.finer for case in cases)

    finer = chosen.finer_layers()
    assert finer is not None
    finer.held()
    assert all(case.finer for case in cases[3:])
    assert len(cases) == 6


@pytest.mark.slow
def test_a_touch_near_the_rim_creeps_under_its_force() -> None:
    near = solved([FAR | {"x_mm": 85.0}], HOLD)
    forces, depths = zip(*((m.touches[0].force_N, m.touches[0].depth_m) for m in near.moments), strict=True)
    assert forces == pytest.approx([0.5] * 3, rel=1e-9)
    assert np.all(np.diff(depths) > 0)
    assert Kind.HOLD_ELASTIC in kinds(near)


def test_touches_at_a_depth_kept_from_loading_at_once_relax_by_the_series() -> None:
    hold = {"time_s": [2.0, 60.0], "control": "depth", "loading_s": 0.0}
    both = solved([FAR, {"x_mm": 50.0, "depth_mm": 2.0}], hold)
    assert Kind.HOLD_KEPT in kinds(both)
    share = relaxation(SERIES, np.array([0.0, 2.0, 60.0]))
    for k in range(2):
        forces = np.array([moment.touches[k].force_N for moment in both.moments])
        np.testing.assert_allclose(forces / forces[0], share, rtol=1e-9)
    document = as_json(both, scene_from({"punch": [FAR, {"x_mm": 50.0, "depth_mm": 2.0}], "hold": hold}), CARD)
    assert [len(block["force_N"]) for block in document["times"]] == [2, 2, 2]


@pytest.mark.slow
def test_a_touch_with_friction_creeps() -> None:
    rubbed, smooth = (solved([FAR | {"friction": kind}], HOLD) for kind in ("stick", "none"))
    assert Kind.HOLD_STEPPED in kinds(rubbed)
    for one, other in zip(rubbed.moments, smooth.moments, strict=True):
        assert one.touches[0].force_N == pytest.approx(0.5, rel=1e-9)
        assert one.touches[0].depth_m == pytest.approx(other.touches[0].depth_m, rel=0.06)


def test_what_lone_touches_differ_by_adds_to_the_errors() -> None:
    body, punch = Body(thickness_m=0.01), Punch(diameter_m=0.014, force_N=0.5)
    law = replace(FOAM, moduli="instantaneous")
    one, other = (solve_touch(law, body, replace(punch, force_N=force)) for force in (0.5, 0.51))
    (held,) = StandIns(2.0, ((one, other),)).held((other,))
    radius = np.linspace(0, one.radius_m[-1], 20001)[1:]
    hoop, wider = (np.interp(radius, touch.radius_m, touch.stretch_normal) - 1 for touch in (one, other))
    missed = np.abs(hoop - wider) @ radius / abs(wider @ radius)
    assert held.signal_errors[STRAINS.index("normal")] - other.signal_errors[STRAINS.index("normal")] == pytest.approx(
        missed, rel=0.02)
    assert held.force_N == pytest.approx(0.5, rel=1e-12)
    assert held.depth_error == pytest.approx(other.depth_error + 1 - one.depth_m / other.depth_m, rel=1e-9)
