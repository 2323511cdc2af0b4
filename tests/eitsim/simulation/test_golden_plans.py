"""Plans word by word as they are on record, for the examples and for scenes drawn over what a scene file can say.

`python tests/eitsim/simulation/test_golden_plans.py` writes the record anew.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.results import Plan
from eitsim.scene.scene import Scene, read_scene, scene_from
from eitsim.simulation.plan import make_plan
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony

RECORD = Path(__file__).with_name("golden_plans.json")
ROOT = Path(__file__).parents[3]
CARD = MaterialCard("golden", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.1, 0.1, 0.1],
                                        "instantaneous"),
                    Prony([0.15, 0.17, 0.06], [0.3, 5.8, 82.0]), Conductivity(30.0, (2.0, -2.0, 1.0), (-0.4, 0.4)))
SCENES = 60
# half sizes of the skin, mm, in which places are drawn
BODIES = {"disc": ({}, 60, 60), "small disc": ({"radius_mm": 40, "thickness_mm": 6}, 22, 22),
          "rectangle": ({"outline": "rectangle", "width_mm": 150, "height_mm": 110, "corner_radius_mm": 5}, 65, 45),
          "hole": ({"outline": "rectangle", "width_mm": 160, "height_mm": 120, "holes_mm": [[10, -20, 6]]}, 68, 48),
          "L": ({"outline": "polygon", "points_mm": [[-80, -60], [80, -60], [80, 0], [0, 0], [0, 60], [-80, 60]]},
                70, 50)}
TWO_CLOSE = {"punch": [{"x_mm": -11, "force_N": 0.5}, {"x_mm": 11, "force_N": 0.5}]}
FIXED = {
    "default": {}, "close pair": TWO_CLOSE, "pair at the rim": {"punch": [{"x_mm": 84, "y_mm": 11}, {"x_mm": 84,
                                                                                               "y_mm": -11}]},
    "hold kept": {"hold": {"time_s": [2, 60], "control": "depth"}}, "hold creeps": {"hold": {"time_s": 60.0}},
    "slow hold at a depth": {"hold": {"time_s": [2.0], "control": "depth", "loading_s": 1.0}},
    "held at the rim": {"punch": {"x_mm": 85}, "hold": {"time_s": [2.0]}},
    "stuck at the rim": {"punch": {"x_mm": 85, "friction": "stick"}}, "overhang": {"punch": {"x_mm": 98}},
    "patches": {"electrodes": {"kind": "patch"}, "punch": {"x_mm": 60, "conductor": True}},
    "on a patch": {"electrodes": {"kind": "patch"}, "punch": {"x_mm": 85}},
    "channels": {"channels": {"gains": [1.01] * 16, "conductance_S": [6e-4], "sheet_modes": [0.1],
                              "size_error": [0.03]}},
    "longterm": {"hold": {"moduli": "longterm"}}, "too deep": {"punch": {"depth_mm": 9.9}},
    "too light": {"punch": {"force_N": 1e-9}},
    "held pair": {"punch": [{"x_mm": 40}, {"x_mm": -40}], "hold": {"time_s": 5.0}},
    "surface": {"body": BODIES["rectangle"][0], "electrodes": {
        "kind": "surface", "x_mm": [-50, 0, 50, -50, 0, 50], "y_mm": [-30, -30, -30, 30, 30, 30], "count": 6,
        "contact_impedance_Ohm_m2": 1e-4, "width_mm": 4.0}, "drive": {"pattern": "adjacent"}}}


EXACT_TOO = ("default", "close pair", "stuck at the rim", "hold creeps", "patches", "surface")


def drawn(rng: np.random.Generator) -> dict[str, Any]:
    """The tables of a scene; what some may hold together is refused."""
    body, x_mm, y_mm = BODIES[str(rng.choice([*BODIES]))]
    count = int(rng.choice([1, 2, 3], p=[0.6, 0.3, 0.1]))
    first, punches = rng.uniform(-1, 1, 2) * (x_mm, y_mm), []
    for k in range(count):
        place = first if k == 0 else rng.uniform(-1, 1, 2) * (x_mm, y_mm) if rng.random() < 0.4 else (
            np.clip(first + rng.uniform(-30, 30, 2), -x_mm, x_mm))
        punch = {"x_mm": round(float(place[0]), 2), "y_mm": round(float(place[1]), 2),
                 "diameter_mm": round(float(rng.uniform(6, 18)), 1),
                 "profile": str(rng.choice(["flat", "sphere", "ellipse"], p=[0.7, 0.2, 0.1]))}
        punch |= {"force_N": round(float(rng.uniform(0.1, 1.5)), 2)} if rng.random() < 0.7 else {
            "depth_mm": round(float(rng.uniform(0.5, 3.0)), 2)}
        if rng.random() < 0.3:
            punch |= {"friction": "stick"} if rng.random() < 0.6 else {"friction": "coulomb",
                                                                       "friction_coefficient": 0.4}
        punches.append(punch | ({"conductor": True} if rng.random() < 0.25 else {}))
    scene: dict[str, Any] = {"body": body, "punch": punches,
                             "accuracy": {"signal": float(rng.choice([0.01, 0.02, 0.1]))},
                             "skin": {"strain": str(rng.choice(["principal", "normal", "areal"]))}}
    if rng.random() < 0.3:
        scene["electrodes"] = {"soft": True} if rng.random() < 0.5 else {"missing": [3, 7]}
    if rng.random() < 0.2:
        scene["hold"] = {"time_s": [2.0, 60.0], "control": str(rng.choice(["force", "depth"])),
                         "loading_s": float(rng.choice([0.0, 1.0]))}
    return scene


def scenes(count: int = SCENES, seed: int = 1) -> Iterator[tuple[str, Scene, bool]]:
    """Name, scene and whether it is to be exact; a drawn one that is no scene is drawn again."""
    for path in sorted((ROOT / "examples").glob("*.toml")):
        if path.stem in ("scene", "two_touches"):
            yield path.stem, read_scene(path), False
    for name, raw in FIXED.items():
        for exact in (False, True) if name in EXACT_TOO else (False,):
            yield name + ", exact" * exact, scene_from(raw), exact
    rng = np.random.default_rng(seed)
    made = 0
    while made < count:
        try:
            scene = scene_from(drawn(rng))
        except ValueError:
            continue
        yield f"drawn {made}", scene, made % 4 == 3
        made += 1


def lines(plan: Plan) -> list[tuple[str, str]]:
    """The text of a plan, each decision with its bound."""
    refused = [(f"refused: {plan.refusal}", "0")] if plan.refusal else []
    return [(" | ".join(filter(None, (one.decision, one.reason, "unknown" * one.unbounded, one.remedy))),
             f"{one.error_bound:.9g}") for one in plan.decisions] + refused


def record() -> dict[str, Any]:
    """Every line once, and of each scene the numbers of its lines and their bounds."""
    numbers: dict[str, int] = {}
    plans = {name: " ".join(f"{numbers.setdefault(line, len(numbers))}:{bound}" for line, bound in lines(
        make_plan(scene, CARD, exact=exact))) for name, scene, exact in scenes()}
    return {"lines": [*numbers], "plans": plans}


def spelled(found: dict[str, Any], name: str) -> list[tuple[str, str]]:
    """The lines of a scene in a record."""
    pairs = (part.split(":") for part in found["plans"][name].split())
    return [(found["lines"][int(number)], bound) for number, bound in pairs]


def test_plans_are_as_on_record() -> None:
    before, now = json.loads(RECORD.read_text(encoding="utf-8")), record()
    assert [*now["plans"]] == [*before["plans"]]
    for name in now["plans"]:
        assert spelled(now, name) == spelled(before, name), name


if __name__ == "__main__":
    RECORD.write_text(json.dumps(record(), indent=0, ensure_ascii=False) + "\n", encoding="utf-8")
