"""What is chosen is what is solved: the plan's kinds against the touches, and against the solvers that were called."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.elastic_holds import StandIns
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.rim.solve_near_rim import FULL_DISC
from eitsim.scene.choices import Kind, Why
from eitsim.scene.edges.outline import Outline
from eitsim.scene.results import Plan, Touch
from eitsim.scene.scene import Accuracy, Body, Punch, Scene, scene_from
from eitsim.simulation import choose as choose_module
from eitsim.simulation import words
from eitsim.simulation.choose import choose, choose_ways
from eitsim.simulation.material import material_of
from eitsim.simulation.plan import plan_of
from eitsim.simulation.routes import all_edges, axisymmetric, general, known_routes, nearest_alone, pair
from eitsim.simulation.routes.known_routes import ROUTES
from eitsim.simulation.routes.route import NOT_MEANT, Case, Route, Values, Words
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from touchcal.choice import Choice

CARD = MaterialCard("foam", Hyperfoam([9530.0], [8.0], [0.0], "instantaneous"), Prony([0.3], [5.0]),
                    Conductivity(30.0, (2.0, -2.0, 1.0), (-0.4, 0.4)))
MECHANICS = ("axisymmetric", "nearest_edge", "all_edges", "whole_disc", "general")
BODIES = {"disc": {"radius_mm": 60}, "rectangle": {"outline": "rectangle", "width_mm": 130, "height_mm": 90}}


def drawn(seed: int) -> tuple[Scene, bool]:
    """A scene that is solved, and whether to be exact: one or two light touches anywhere on a disc or a rectangle."""
    rng = np.random.default_rng(seed)
    while True:
        punches = []
        for _ in range(int(rng.choice([1, 2], p=[0.7, 0.3]))):
            x_mm, y_mm = (rng.uniform(-1, 1, 2) * (60, 42)).round(1).tolist()
            punches.append({"x_mm": x_mm, "y_mm": y_mm, "force_N": round(float(rng.uniform(0.05, 0.2)), 3),
                            "diameter_mm": 8.0, "profile": str(rng.choice(["flat", "sphere"]))})
        raw: dict[str, Any] = {"body": BODIES[str(rng.choice([*BODIES]))], "punch": punches,
                               "accuracy": {"signal": float(rng.choice([0.05, 0.2]))}}
        if len(punches) == 1 and rng.random() < 0.2:
            raw["hold"] = {"time_s": [10.0], "control": str(rng.choice(["force", "depth"]))}
        scene, exact = scene_from(raw), bool(rng.random() < 0.2)
        if choose(scene, material_of(scene, CARD), exact=exact).why is None:
            return scene, exact


def planned(plan: Plan) -> tuple[list[str], int]:
    """Kinds of the touches' mechanics, and the number of pairs."""
    kinds = [one.kind for one in plan.decisions]
    return [kind for kind in kinds if kind in MECHANICS], kinds.count("pair")


def seen_in(touch: Touch, body: Body) -> str:
    """The kind of a touch by what it holds."""
    if touch.surface is not None:
        return "general"
    if touch.rim is None:
        return "axisymmetric"
    if touch.rim.neighbour:
        return "all_edges" if touch.rim.whole_turn else "axisymmetric"
    if touch.rim.whole_turn:
        return "all_edges"
    assert touch.volume is not None
    whole = not body.has_outline and touch.volume.amplitude_m.shape[-1] == FULL_DISC.harmonics
    return "whole_disc" if whole else "nearest_edge"


def check_solved(seed: int, *, exact: bool) -> None:
    """The plan of a drawn scene names what its solved touches hold."""
    scene, _ = drawn(seed)
    result = simulate(scene, CARD, exact=exact)
    assert result.outcome == "ok", result.message
    found = [seen_in(touch, scene.body) for touch in result.touches]
    neighbours = sum(touch.rim is not None and touch.rim.neighbour for touch in result.touches)
    named, pairs = planned(result.plan)
    assert pairs == neighbours // 2
    assert set(named) == set(found) if "general" in found else named == found


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [17])
def test_the_plan_names_what_solved_touches_hold(seed: int) -> None:
    check_solved(seed, exact=False)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_more_plans_name_what_solved_touches_hold(seed: int) -> None:
    check_solved(seed, exact=seed % 4 == 3)


@pytest.fixture(scope="module")
def touch() -> Touch:
    """Any touch."""
    return solve_touch(CARD.hyperfoam, Body(), Punch(force_N=0.1), element_m=0.004)


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch, touch: Touch) -> list[str]:
    """Kinds of the solvers that are called; none solves."""
    calls: list[str] = []

    def standing_in(kind_of: Callable[..., str], found: Any) -> Callable[..., Any]:
        def solver(*args: Any, **options: Any) -> Any:
            calls.append(kind_of(*args, **options))
            return found
        return solver

    def near(law: Hyperfoam, body: Body, punch: Punch, *, finer: bool = False, whole: bool = False,
             all_edges: bool = False) -> str:
        return "all_edges" if all_edges else "whole_disc" if whole and not body.has_outline else (
            "nearest_edge")

    fine = replace(touch, signal_errors=np.zeros(3))
    monkeypatch.setattr(axisymmetric, "solve_touch", standing_in(lambda *_, **__: "axisymmetric", fine))
    for module in (nearest_alone, all_edges):
        monkeypatch.setattr(module, "solve_near_rim", standing_in(near, fine))
    monkeypatch.setattr(axisymmetric, "solve_hold", standing_in(lambda *_, **__: "axisymmetric", [(0.0, fine)] * 2))
    monkeypatch.setattr(general, "solve_general", standing_in(
        lambda *_, **__: "general", SimpleNamespace(touches=(fine, fine))))
    monkeypatch.setattr(general, "solved_finer", lambda *_: None)
    monkeypatch.setattr(general, "read_by", lambda scene, punches, found: found.touches)
    monkeypatch.setattr(choose_module, "stand_ins", lambda *at: [
        StandIns(t, ((touch, touch),) * len(at[3])) for t in (0.0, 10.0)])
    monkeypatch.setattr(pair, "solved_together", standing_in(
        lambda *_, edges, **__: "all_edges" if edges else "pair", (fine, fine)))
    return calls


@pytest.mark.thorough
def test_solvers_obey_what_was_chosen(called: list[str]) -> None:
    """Of two hundred scenes; a pair near edges begins with its axisymmetric touches."""
    kinds: set[str] = set()
    for seed in range(200):
        scene, exact = drawn(seed)
        chosen = choose(scene, material_of(scene, CARD), exact=exact, bodies=seed % 2 == 0)
        named, pairs = planned(plan_of(chosen))
        called.clear()
        _ = chosen.held() if scene.hold.time_s else chosen.touches()
        kinds |= set(called)
        if chosen.elastic or "general" in named:
            assert set(called) == set(named), seed
        elif not pairs:
            assert called == named, seed
        else:
            assert called == ["axisymmetric"] * 2 + ["pair" if named[0] == "axisymmetric" else named[0]], seed
    assert kinds == {*MECHANICS, "pair"}


def test_the_cheapest_route_that_meets_the_error_is_taken() -> None:
    body = Body(Outline("rectangle", width_m=0.15, height_m=0.11))
    middle, edge, corner = ((0.0, 0.0), (0.066, 0.0), (0.066, 0.046))
    for place, kind in ((middle, "axisymmetric"), (edge, "nearest_edge"), (corner, "all_edges")):
        scene = Scene(body=body, punches=(Punch(*place, diameter_m=0.01),), accuracy=Accuracy(0.05))
        ((way,), _) = choose_ways(scene, bodies=False)
        assert way.route.kind == kind
        costs = {route: route.serves(way.case) for route in ROUTES if not route.for_exact}
        assert all(route.leaves_out(way.case) > way.case.allowed for route, cost in costs.items()
                   if isinstance(cost, float) and cost < way.cost_s)


def test_electrodes_are_bodies_where_leaving_that_out_costs_more_than_allowed() -> None:
    """In front of one, not between two far from each other, nor where they are soft or sweeps leave it out."""
    def kind(x_mm: float, y_mm: float, *, bodies: bool = True, **electrodes: object) -> str:
        scene = scene_from({"body": {"radius_mm": 120}, "electrodes": {"count": 8} | electrodes,
                            "punch": {"x_mm": x_mm, "y_mm": y_mm}, "accuracy": {"signal": 0.05}})
        return choose_ways(scene, bodies=bodies)[0][0].route.kind

    assert kind(104, 0) == "general"
    assert {kind(104, 0, bodies=False), kind(104, 0, soft=True)} == {"nearest_edge"}
    assert kind(102 * np.cos(np.pi / 8), 102 * np.sin(np.pi / 8)) == "nearest_edge"


def test_every_kind_has_its_words() -> None:
    assert {*words._LINES, *words._MADE} == {*Kind}
    problems = {kind for route in ROUTES for kind in route.problems}
    assert {*words._REFUSALS, *words._REFUSED, *problems} == {*Why} - {Why.NOT_MEANT}
    kinds = [route.kind for route in ROUTES]
    assert len({*kinds, *Kind}) == len(kinds) + len(Kind)


@pytest.mark.parametrize(("punches", "why"), [
    ([{"x_mm": 98}], Why.OFF_SKIN), ([{"x_mm": -7.1}, {"x_mm": 7.1}], Why.TOUCHING)])
def test_a_scene_that_no_route_serves_is_refused_for_what_physics_says(punches: list[dict[str, Any]], why: Why) -> None:
    scene = scene_from({"punch": punches})
    case = Case(scene, tuple(range(len(punches))))
    answers = [route.serves(case) for route in ROUTES if not route.for_exact]
    assert why in {one.kind for one in answers if isinstance(one, Choice) and one is not NOT_MEANT}
    chosen = choose(scene, material_of(scene, CARD))
    assert chosen.why is not None
    assert chosen.why.kind is why


class Coarse(Route):
    """A stand-in for a solver that serves everything: touches on a coarse mesh, whatever is near."""

    kind = "coarse"

    def serves(self, case: Case) -> float:
        return 40.0

    def solve(self, case: Case, law: Law, keep: bool) -> Touch:
        return solve_touch(law, case.scene.body, case.punch, element_m=2e-3)

    def solve_together(self, case: Case, law: Law, keep: bool, known: Sequence[Touch | None]) -> Sequence[Touch]:
        return [self.solve(one, law, keep) for one in case.each]

    def words(self, of: Values) -> Words:
        return f"{len(of.get('between', [0]))} on a coarse mesh", "it serves everything"


@pytest.mark.parametrize(("raw", "groups"), [
    ({"punch": {"x_mm": 98}}, ()), ({"punch": {"x_mm": 85}, "hold": {"time_s": 5.0, "control": "depth"}}, None),
    ({"punch": [{"x_mm": -7.1, "friction": "stick"}, {"x_mm": 7.1}]}, ((0, 1),)),
    ({"punch": [{"x_mm": x} for x in (-14.1, 0, 24)] + [{"y_mm": 60}]}, ((0, 1, 2),))])
def test_a_route_is_one_class_and_one_line(raw: dict[str, Any], groups: tuple[tuple[int, ...], ...] | None,
                                           monkeypatch: pytest.MonkeyPatch) -> None:
    """What no route serves is refused, and planned and solved by one that is added, for one touch or a cluster; what
    others serve they keep."""
    scene = scene_from(raw | {"accuracy": {"signal": 0.05}})
    without = choose(scene, material_of(scene, CARD))
    monkeypatch.setattr(known_routes, "ROUTES", (*ROUTES, Coarse()))
    chosen = choose(scene, material_of(scene, CARD))
    if groups is None:
        assert chosen.why is without.why is None
        assert plan_of(chosen) == plan_of(without)
        return
    assert without.why is not None
    assert chosen.why is None
    assert chosen.groups == groups
    by_it = {i for group in groups for i in group} or {0}
    lines = [one for one in plan_of(chosen).decisions if one.kind == "coarse"]
    assert [one.decision[0] for one in lines] == ["1"] * len(by_it) + [str(len(by_it))] * len(groups)
    touches = chosen.touches()
    for i in by_it:
        assert touches[i].depth_m == solve_touch(CARD.hyperfoam, scene.body, scene.punches[i], element_m=2e-3).depth_m


@pytest.mark.parametrize(("signal", "kind"), [(0.01, "nearest_edge"), (0.02, "general"), (0.3, "nearest_edge")])
def test_next_to_an_edge_a_route_that_meets_the_error_is_taken_where_it_pays(signal: float, kind: str) -> None:
    """The cheaper one is expected to state 5 %; the better one takes fifteen times as long for 1 %."""
    scene = scene_from({"body": BODIES["disc"], "punch": {"x_mm": 50, "force_N": 0.1, "diameter_mm": 8.0},
                        "electrodes": {"soft": True}, "accuracy": {"signal": signal}})
    ((way,), _) = choose_ways(scene)
    assert way.route.kind == kind
    ((swept,), _) = choose_ways(scene, bodies=False)
    assert swept.route.kind == "nearest_edge"
