"""What a design will not give is said before its rows are solved; what differs between designs is named by its key."""

import json
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

from eitsim.cli.sweep_commands import _range
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run.folder import _differing
from eitsim.sweeps.run.omissions import cautions
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3), "longterm")
CARD = MaterialCard("Table 1", FOAM, None, Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0, 0.4)))
RAW = {"scenes": 10, "punch": {"x_mm": {"list": [0, 150]}, "y_mm": 0}}


def test_rows_that_will_be_refused_are_counted_beforehand() -> None:
    (told,) = cautions(design_from(RAW), CARD)
    assert told.startswith("5 of the first 10 scenes will be refused")
    assert "rim" in told
    assert not list(cautions(design_from({**RAW, "punch": {"x_mm": [-40, 40], "y_mm": 0}}), CARD))


@pytest.mark.parametrize(("scenes", "told"), [(3, ["Ask for 4, or 2."]), (8, []), (1, [])])
def test_sobol_points_want_powers_of_two(scenes: int, told: list[str]) -> None:
    design = design_from({"scenes": scenes, "sampler": "sobol", "punch": {"x_mm": [-40, 40], "y_mm": 0}})
    assert [sentence.rpartition("alone. ")[2] for sentence in cautions(design, CARD)] == told


@pytest.mark.parametrize(("other", "words"), [
    ({"punch": {"x_mm": {"list": [0, 9]}, "y_mm": 0}}, 'x_mm in [punch] is {"list": [0, 150]}, here {"list": [0, 9]}'),
    ({"punch": {"x_mm": {"list": [0, 150]}}}, "y_mm in [punch] is 0, here not given"),
    ({"skin": {"thickness_um": 5}}, 'skin is not given, here {"thickness_um": 5}'),
    ({"punch": [{"y_mm": 0}, {"y_mm": 1}]}, 'punch is {"x_mm"')])
def test_the_key_that_differs_is_named(other: dict[str, Any], words: str) -> None:
    old, new = (json.loads(json.dumps(asdict(design_from(raw))))["tables"] for raw in (RAW, {**RAW, **other}))
    assert words in _differing("tables", old, new)


def test_of_several_touches_the_one_that_differs_is_named() -> None:
    old, new = ({"punch": [{"force_N": 1}, {"force_N": force}]} for force in (1, 2))
    assert _differing("tables", old, new) == "force_N in [punch 2] is 1, here 2"


@pytest.mark.parametrize("text", ["F_N", "F_N=", "=1,2", "F_N=2,1", "F_N=1"])
def test_a_range_of_touches_says_its_form(text: str) -> None:
    with pytest.raises(ValueError, match=r"give KEY=LOW,HIGH.*F_N=0\.9,1\.1"):
        _range(text)
    assert _range("F_N=0.9,1.1") == ("F_N", (0.9, 1.1))
