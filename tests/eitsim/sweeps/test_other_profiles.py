"""The first touches of a design again, by punches of other profiles."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitsim.scene.profiles.registry import profiles
from eitsim.sweeps.dataset.parquet import OTHER_PROFILES, open_dataset
from eitsim.sweeps.design.design import Design, design_from, scene_at
from eitsim.sweeps.run import other_profiles
from eitsim.sweeps.run.sweep import sweep
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

PUNCH = {"place": {"within_mm": 45}, "diameter_mm": [10, 18], "force_N": [0.1, 2.0]}
CARD = MaterialCard("foam", Hyperfoam(np.array([9530.0]), np.array([8.0]), np.zeros(1), "longterm"),
                    conductivity=Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0, 0.4)))


def design(scenes: int = other_profiles.ENOUGH, **changes: Any) -> Design:
    return design_from({"scenes": scenes, "seed": 3, "punch": PUNCH, "accuracy": {"signal": 0.05}} | changes)


@pytest.mark.parametrize("own", ["flat", "sphere"])
def test_each_other_profile_makes_as_many_of_the_same_touches(own: str) -> None:
    given = design(punch=PUNCH | {"profile": own})
    found = other_profiles.other_profiles(given)
    assert found is not None
    punches = [scene_at(found, k).punches[0] for k in range(found.scenes)]
    names = [punch.profile for punch in punches]
    assert {name: names.count(name) for name in names} == dict.fromkeys(set(profiles()) - {own}, other_profiles.TOUCHES)
    for k, punch in enumerate(punches[:5]):
        same = scene_at(given, k).punches[0]
        assert (punch.x_m, punch.y_m, punch.diameter_m, punch.force_N) == (
            same.x_m, same.y_m, same.diameter_m, same.force_N)


@pytest.mark.parametrize("changes", [
    {"scenes": other_profiles.ENOUGH - 1}, {"touches": 2}, {"sampler": "sobol"},
    {"punch": PUNCH | {"profile": {"choice": ["flat", "cone"]}}}, {"punch": [PUNCH, PUNCH]}])
def test_few_or_several_touches_or_profiles_are_left_as_they_are(changes: dict[str, Any]) -> None:
    assert other_profiles.other_profiles(design(**changes)) is None


@pytest.mark.thorough
@pytest.mark.usefixtures("solved_once")
def test_a_sweep_puts_them_next_to_its_own_rows_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(other_profiles, "ENOUGH", 2)
    monkeypatch.setattr(other_profiles, "TOUCHES", 1)
    data = sweep(design(2), CARD, tmp_path / "set", reuse=False)
    others = open_dataset(tmp_path / "set" / OTHER_PROFILES)
    again = sweep(design(2), CARD, tmp_path / "set", reuse=False)
    assert len(data.ok) == len(again.ok) == 2
    assert sorted(others.ok["punch_profile"]) == sorted(set(profiles()) - {"flat"})
    assert not (tmp_path / "set" / OTHER_PROFILES / OTHER_PROFILES).exists()
