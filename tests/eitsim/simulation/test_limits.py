"""What is beyond numbers is refused in the plan, with its key and the mend; what only mechanics tells says so."""

from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.scene import Body, Punch, scene_from
from eitsim.sheet.sheet_conductance import FoldedSkin
from eitsim.simulation import simulate
from eitsim.simulation.choose import Chosen
from eitsim.simulation.plan import make_plan
from eitsim.simulation.simulate import solve_scene
from eitsim.simulation.validity import check_positive, positive_from
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity, NotPositive, conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.terminal import check_out

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
SKIN = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
CARD = MaterialCard("foam", FOAM, None, SKIN)


@pytest.mark.parametrize(("punch", "named"), [({"force_N": 1e-15}, "force_N = 1e-15 in [punch]"),
                                              ({"depth_mm": 1e-12}, "depth_mm = 1e-12 in [punch]")])
def test_touches_lost_in_rounding_are_refused_before_they_are_solved(punch: dict[str, float], named: str) -> None:
    assert named in make_plan(scene_from({"punch": punch}), CARD).refusal


@pytest.mark.parametrize("punch", [{"force_N": 1e-6}, {"depth_mm": 1e-6}])
def test_light_touches_are_let_through(punch: dict[str, float]) -> None:
    assert make_plan(scene_from({"punch": punch}), CARD).refusal == ""


@pytest.mark.parametrize("c0", [1e-300, 1e-12, 1e30])
def test_conductivities_of_another_unit_are_refused(c0: float) -> None:
    told = make_plan(scene_from({}), replace(CARD, conductivity=replace(SKIN, c0_S_per_m=c0))).refusal
    assert f"c0_S_per_m = {c0:g} in the conductivity of card 'foam'" in told


@pytest.mark.parametrize("current_mA", [1e300, 1e-20])
def test_currents_of_another_unit_are_refused(current_mA: float) -> None:
    with pytest.raises(ValueError, match=r"current_mA in \[drive\] must be from 1e-09 to 1e\+06 mA"):
        scene_from({"drive": {"current_mA": current_mA}})


def test_the_plan_tells_the_strain_at_which_the_skins_cubic_ends() -> None:
    torn = replace(SKIN, a=np.array([-2.0, 2.0, 20.0]))
    end = positive_from(torn)
    assert end is not None
    assert conductivity(torn, end + 1e-6) > 0
    with pytest.raises(ValueError, match="not positive"):
        conductivity(torn, end - 1e-6)
    assert positive_from(SKIN) is None
    told = [[d.decision for d in make_plan(scene_from({}), replace(CARD, conductivity=law)).decisions]
            for law in (torn, SKIN)]
    assert ["the skin's law is positive over part of what touches reach" in names for names in told] == [True, False]


def test_a_touch_that_strains_the_skin_beyond_its_cubic_is_said_to_be_known_from_its_mechanics() -> None:
    touch = solve_touch(FOAM, Body(), Punch(), element_m=4 * default_element_m(Body(), Punch()))
    check_positive(SKIN, "normal", [touch])
    with pytest.raises(NotPositive, match="is not positive"):
        check_positive(replace(SKIN, a=np.array([-2.0, 2.0, 20.0])), "normal", [touch])


class Torn:
    """A field of the whole skin that is flattened next to the touch, where the touch's own samples do not show it."""

    def metric(self, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        there = np.abs(points_m[..., 0] - 0.01) < 0.003
        return np.where(there[..., None, None], 4.0, 1.0) * np.eye(2), np.where(there, 0.3, 1.0)

    def displacement(self, points_m: np.ndarray) -> np.ndarray:
        return np.zeros((*points_m.shape[:-1], 3))


def test_a_field_that_strains_the_skin_beyond_its_cubic_ends_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not in a traceback, wherever on the skin that is."""
    touch = solve_touch(FOAM, Body(), Punch(), element_m=4 * default_element_m(Body(), Punch()))
    monkeypatch.setattr(Chosen, "touches", lambda _: (replace(touch, surface=Torn()),))
    card = replace(CARD, conductivity=replace(SKIN, a=np.array([0.0, 0.0, 4.0])))  # positive down to a strain of -0.63
    result = solve_scene(scene_from({"skin": {"strain": "normal"}}), card)
    assert result.outcome == "refused"
    assert "which its solved mechanics alone tells" in result.message


def test_places_that_cannot_be_written_are_noticed_before_any_work(tmp_path: Path) -> None:
    """A folder of the kernel's own has permissions for everybody's reading, and takes no file from anyone."""
    folder = Path("/proc/self")
    if not folder.is_dir():
        pytest.skip("no such folder here")
    with pytest.raises(ValueError, match="cannot be written"):
        check_out(folder / "result.json")
    check_out(tmp_path / "result.json")
    assert not list(tmp_path.iterdir())


def test_a_skin_that_folds_is_a_refusal_and_no_crash() -> None:
    with patch.object(simulate, "solve", side_effect=FoldedSkin("the skin folds")):
        result = simulate.solve_scene(scene_from({"punch": {"force_N": 0.1}}), CARD)
    assert (result.outcome, result.message) == ("refused", "the skin folds")
